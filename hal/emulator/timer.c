#include "emulator/timer.h"

#include <string.h>

#define CR1_CEN 1u
#define CR1_URS 4u
#define CR1_ARPE 0x80u
#define CR2_MMS_SHIFT 4u
#define MMS_OC4REF 7u
#define SR_UIF 1u
#define SR_BIF 0x80u
#define DIER_UIE 1u
#define EGR_UG 1u
#define BDTR_BKE (1u << 12)
#define BDTR_MOE (1u << 15)
#define MODE_PWM1 6u
#define MODE_PWM2 7u

static bool runs(const struct timer *timer) {
    return (timer->control[0] & CR1_CEN) != 0 && timer->clock_hz != 0u;
}

static int64_t ticks_a_count(const struct timer *timer) {
    return TICKS_PER_SECOND / timer->clock_hz * (int64_t)(timer->active_prescaler + 1u);
}

uint32_t timer_count(const struct timer *timer) {
    if (!runs(timer) || timer->core->now_ticks < timer->base_ticks) {
        return timer->count;
    }
    const uint64_t passed = (uint64_t)((timer->core->now_ticks - timer->base_ticks) / ticks_a_count(timer));
    return (uint32_t)((timer->count + passed) % ((uint64_t)timer->active_reload + 1u));
}

/* Moves the base to the present, keeping what is left of a count. */
static void rebase(struct timer *timer) {
    if (runs(timer) && timer->core->now_ticks > timer->base_ticks) {
        const int64_t each = ticks_a_count(timer);
        const int64_t whole = (timer->core->now_ticks - timer->base_ticks) / each;
        timer->count = timer_count(timer);
        timer->base_ticks += whole * each;
    } else if (!runs(timer)) {
        timer->base_ticks = timer->core->now_ticks;
    }
}

static int64_t when(const struct timer *timer, uint32_t count) {
    const int64_t period = (int64_t)timer->active_reload + 1;
    const int64_t ahead = ((int64_t)count - (int64_t)timer->count % period + period) % period;
    return timer->base_ticks + (ahead == 0 ? period : ahead) * ticks_a_count(timer);
}

static uint32_t mode_of(const struct timer *timer, uint32_t channel) {
    return timer->modes[(channel - 1u) / 2u] >> (channel % 2u == 1u ? 4u : 12u) & 7u;
}

static bool preloads(const struct timer *timer, uint32_t channel) {
    return (timer->modes[(channel - 1u) / 2u] >> (channel % 2u == 1u ? 3u : 11u) & 1u) != 0;
}

static bool triggers(const struct timer *timer) {
    return timer->triggered != NULL && (timer->control[1] >> CR2_MMS_SHIFT & 7u) == MMS_OC4REF &&
           mode_of(timer, 4u) == MODE_PWM2 && timer->active_compare[3] <= timer->active_reload;
}

static void plan(struct timer *timer) {
    schedule_set(&timer->core->schedule, timer->update_slot, runs(timer) ? when(timer, 0u) : SCHEDULE_NEVER);
    schedule_set(&timer->core->schedule, timer->trigger_slot,
                 runs(timer) && triggers(timer) ? when(timer, timer->active_compare[3]) : SCHEDULE_NEVER);
}

static void set_line(struct timer *timer) {
    if (timer->irq != 0u) {
        core_line(timer->core, NVIC_FIRST_IRQ + timer->irq,
                  (timer->status & SR_UIF) != 0 && (timer->enables & DIER_UIE) != 0);
    }
}

static void load(struct timer *timer) {
    timer->active_prescaler = timer->prescaler;
    timer->active_reload = timer->reload;
    memcpy(timer->active_compare, timer->compare, sizeof timer->compare);
}

static void on_update(void *context, int64_t at_ticks) {
    struct timer *timer = context;
    timer->count = 0u;
    timer->base_ticks = at_ticks;
    load(timer);
    timer->status |= SR_UIF;
    set_line(timer);
    plan(timer);
    if (timer->updated != NULL) {
        timer->updated(timer->context, at_ticks);
    }
}

static void on_trigger(void *context, int64_t at_ticks) {
    struct timer *timer = context;
    schedule_set(&timer->core->schedule, timer->trigger_slot,
                 at_ticks + ((int64_t)timer->active_reload + 1) * ticks_a_count(timer));
    timer->triggered(timer->context, at_ticks);
}

void timer_init(struct timer *timer, struct core *core, uint32_t irq, uint32_t most, bool advanced) {
    memset(timer, 0, sizeof *timer);
    timer->core = core;
    timer->irq = irq;
    timer->most = most;
    timer->advanced = advanced;
    timer->update_slot = schedule_add(&core->schedule, on_update, timer);
    timer->trigger_slot = schedule_add(&core->schedule, on_trigger, timer);
}

static void tell(struct timer *timer) {
    if (timer->outputs_changed != NULL) {
        timer->outputs_changed(timer->context);
    }
}

void timer_reset(struct timer *timer, uint32_t clock_hz) {
    timer->control[0] = timer->control[1] = timer->enables = timer->status = timer->outputs = 0u;
    timer->modes[0] = timer->modes[1] = timer->prescaler = timer->dead_time = timer->alternate = 0u;
    memset(timer->compare, 0, sizeof timer->compare);
    timer->reload = timer->most;
    timer->count = 0u;
    timer->clock_hz = clock_hz;
    timer->base_ticks = timer->core->now_ticks;
    load(timer);
    set_line(timer);
    plan(timer);
    tell(timer);
}

void timer_before_clock(struct timer *timer) {
    rebase(timer);
}

void timer_after_clock(struct timer *timer, uint32_t clock_hz) {
    timer->clock_hz = clock_hz;
    plan(timer);
}

static bool driven(const struct timer *timer, uint32_t channel) {
    return runs(timer) && (timer->outputs >> (4u * (channel - 1u)) & 1u) != 0 &&
           (!timer->advanced || (timer->dead_time & BDTR_MOE) != 0);
}

double timer_duty(const struct timer *timer, uint32_t channel) {
    const double period = (double)timer->active_reload + 1.0;
    const double on = (double)timer->active_compare[channel - 1u];
    return !driven(timer, channel) || mode_of(timer, channel) != MODE_PWM1 ? 0.0
           : on >= period                                                  ? 1.0
                                                                           : on / period;
}

double timer_duty_left(const struct timer *timer, uint32_t channel) {
    const double passed = (double)timer_count(timer) / ((double)timer->active_reload + 1.0);
    const double duty = timer_duty(timer, channel);
    return duty > passed ? duty - passed : 0.0;
}

void timer_break(struct timer *timer) {
    if ((timer->dead_time & BDTR_BKE) != 0) {
        timer->status |= SR_BIF;
        timer->breaks++;
        timer->dead_time &= ~BDTR_MOE;
        tell(timer);
    }
}

static uint32_t *plain(struct timer *timer, uint32_t offset) {
    switch (offset) {
    case 0x00u:
        return &timer->control[0];
    case 0x04u:
        return &timer->control[1];
    case 0x0cu:
        return &timer->enables;
    case 0x10u:
        return &timer->status;
    case 0x18u:
        return &timer->modes[0];
    case 0x1cu:
        return &timer->modes[1];
    case 0x20u:
        return &timer->outputs;
    case 0x28u:
        return &timer->prescaler;
    case 0x2cu:
        return &timer->reload;
    case 0x44u:
        return &timer->dead_time;
    case 0x60u:
        return &timer->alternate;
    default:
        return offset >= 0x34u && offset <= 0x40u ? &timer->compare[(offset - 0x34u) / 4u] : NULL;
    }
}

bool timer_read(void *context, uint32_t offset, uint32_t *value) {
    struct timer *timer = context;
    const uint32_t *word = plain(timer, offset);
    *value = word != NULL ? *word : offset == 0x24u ? timer_count(timer) : 0u;
    return word != NULL || offset == 0x24u || offset == 0x14u;
}

static void generate(struct timer *timer, uint32_t value) {
    if ((value & EGR_UG) == 0u) {
        return;
    }
    timer->count = 0u;
    timer->base_ticks = timer->core->now_ticks;
    load(timer);
    if ((timer->control[0] & CR1_URS) == 0u) {
        timer->status |= SR_UIF;
    }
}

/* Values without preload hold at once. */
static void load_at_once(struct timer *timer) {
    for (uint32_t c = 1; c <= TIMER_CHANNELS; c++) {
        if (!preloads(timer, c)) {
            timer->active_compare[c - 1u] = timer->compare[c - 1u];
        }
    }
    if ((timer->control[0] & CR1_ARPE) == 0u) {
        timer->active_reload = timer->reload;
    }
}

bool timer_write(void *context, uint32_t offset, uint32_t value) {
    struct timer *timer = context;
    uint32_t *word = plain(timer, offset);
    rebase(timer);
    if (offset == 0x10u) {
        timer->status &= value; /* written with 0 to clear */
    } else if (offset == 0x14u) {
        generate(timer, value);
    } else if (offset == 0x24u) {
        timer->count = value & timer->most;
        timer->base_ticks = timer->core->now_ticks;
    } else if (word != NULL) {
        *word = offset == 0x2cu || offset >= 0x34u
                    ? value & (offset == 0x44u || offset == 0x60u ? ~0u : timer->most)
                    : value;
        load_at_once(timer);
    } else {
        return false;
    }
    set_line(timer);
    plan(timer);
    tell(timer);
    return true;
}
