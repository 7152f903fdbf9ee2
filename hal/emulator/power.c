#include "emulator/power.h"

#include <string.h>

#define PVD_IRQ 1u
#define PVD_LINE (1u << 16)
#define CR2_PVDE 1u
#define SR2_PVDO (1u << 11)
#define CR5_R1MODE (1u << 8)
#define CFGR2_CLL 1u
#define CFGR2_PVDL 4u
#define NOMINAL_V 3.3
#define HYSTERESIS_V 0.1

static const double detector_v[8] = {2.0, 2.2, 2.4, 2.5, 2.6, 2.8, 2.9, 0.0};

static void set_line(struct power *power) {
    core_line(power->core, NVIC_FIRST_IRQ + PVD_IRQ,
              (power->lines_pending & power->lines_enabled & PVD_LINE) != 0);
}

static void look(struct power *power) {
    const double level = detector_v[power->control[1] >> 1 & 7u];
    const bool on = (power->control[1] & CR2_PVDE) != 0;
    const bool was_low = power->low;
    power->low = on && power->supply_v < level + (was_low ? HYSTERESIS_V : 0.0);
    if (power->low != was_low) {
        const uint32_t edges = power->low ? power->lines_rising : power->lines_falling;
        power->lines_pending |= edges & PVD_LINE;
        set_line(power);
    }
    if (power->low && !was_low && (power->configuration & CFGR2_PVDL) != 0 && power->broke != NULL) {
        power->broke(power->context);
    }
}

void power_init(struct power *power, struct core *core) {
    memset(power, 0, sizeof *power);
    power->core = core;
    power->supply_v = NOMINAL_V;
    power->brown_out_v = 2.8;
}

void power_reset(struct power *power) {
    power->control[0] = 0x200u;
    power->control[1] = 0u;
    power->control_5 = CR5_R1MODE;
    power->configuration = 0u;
    power->lines_enabled = power->lines_events = power->lines_rising = power->lines_falling =
        power->lines_pending = 0u;
    power->low = false;
    set_line(power);
}

void power_supply(struct power *power, double volts) {
    power->supply_v = volts;
    look(power);
}

bool power_is_out(const struct power *power) {
    return power->supply_v < power->brown_out_v;
}

bool power_is_boosted(const struct power *power) {
    return (power->control_5 & CR5_R1MODE) == 0;
}

void power_lock_up(struct power *power) {
    if ((power->configuration & CFGR2_CLL) != 0 && power->broke != NULL) {
        power->broke(power->context);
    }
}

bool power_read(void *context, uint32_t offset, uint32_t *value) {
    const struct power *power = context;
    *value = offset < 8u ? power->control[offset / 4u] : offset == 0x80u ? power->control_5 : 0u;
    if (offset == 0x14u) {
        *value = power->low ? SR2_PVDO : 0u;
    }
    return offset < 8u || offset == 0x14u || offset == 0x80u;
}

bool power_write(void *context, uint32_t offset, uint32_t value) {
    struct power *power = context;
    if (offset < 8u) {
        power->control[offset / 4u] = value;
        look(power);
    } else if (offset == 0x80u) {
        power->control_5 = value;
        if (power->range_changed != NULL) {
            power->range_changed(power->context);
        }
    } else {
        return false;
    }
    return true;
}

bool power_syscfg_read(void *context, uint32_t offset, uint32_t *value) {
    *value = ((const struct power *)context)->configuration;
    return offset == 0x1cu;
}

/* Its lock bits are set once, until reset. */
bool power_syscfg_write(void *context, uint32_t offset, uint32_t value) {
    struct power *power = context;
    if (offset == 0x1cu) {
        power->configuration |= value & 15u;
        return true;
    }
    return false;
}

static uint32_t *line_word(struct power *power, uint32_t offset) {
    uint32_t *word[6] = {
        &power->lines_enabled, &power->lines_events, &power->lines_rising, &power->lines_falling, NULL,
        &power->lines_pending};
    return offset < 0x18u ? word[offset / 4u] : NULL;
}

bool power_exti_read(void *context, uint32_t offset, uint32_t *value) {
    const uint32_t *word = line_word(context, offset);
    *value = word != NULL ? *word : 0u;
    return word != NULL;
}

bool power_exti_write(void *context, uint32_t offset, uint32_t value) {
    struct power *power = context;
    uint32_t *word = line_word(power, offset);
    if (word == NULL) {
        return false;
    }
    *word = word == &power->lines_pending ? power->lines_pending & ~value : value;
    set_line(power);
    return true;
}
