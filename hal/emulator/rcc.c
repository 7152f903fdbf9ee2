#include "emulator/rcc.h"

#include <string.h>

#define CR_HSION (1u << 8)
#define CR_HSIRDY (1u << 10)
#define CR_HSEON (1u << 16)
#define CR_HSERDY (1u << 17)
#define CR_CSSON (1u << 19)
#define CR_PLLON (1u << 24)
#define CR_PLLRDY (1u << 25)
#define CR_WRITABLE (CR_HSION | CR_HSEON | CR_CSSON | CR_PLLON)
#define CIFR_CSSF (1u << 8)
#define CSR_RMVF (1u << 23)
#define CSR_CAUSES 0xfe000000u
#define PLL_SOURCE_HSI 2u
#define PLL_SOURCE_HSE 3u
#define PLL_R_ENABLED (1u << 24)
#define SWITCH_HSI 1u
#define SWITCH_HSE 2u
#define SWITCH_PLL 3u
#define HSI_START_US 2
#define HSE_START_US 2000
#define PLL_LOCK_US 40
#define BOOST_ABOVE_HZ 150000000u
#define HZ_A_WAIT_STATE 34000000u /* in boost range; 30 MHz without */
#define HZ_A_WAIT_STATE_NORMAL 30000000u

enum oscillator { HSI, HSE, PLL };

static const uint32_t on_bit[3] = {CR_HSION, CR_HSEON, CR_PLLON};
static const uint32_t ready_bit[3] = {CR_HSIRDY, CR_HSERDY, CR_PLLRDY};
static const int64_t start_us[3] = {HSI_START_US, HSE_START_US, PLL_LOCK_US};

static bool ready(const struct rcc *rcc, enum oscillator which) {
    return (rcc->control & on_bit[which]) != 0 && rcc->core->now_ticks >= rcc->ready_ticks[which];
}

static bool pll_source_ready(const struct rcc *rcc) {
    const uint32_t source = rcc->pll & 3u;
    return (source == PLL_SOURCE_HSI && ready(rcc, HSI)) || (source == PLL_SOURCE_HSE && ready(rcc, HSE));
}

static uint32_t pll_hz(const struct rcc *rcc) {
    const uint32_t m = (rcc->pll >> 4 & 15u) + 1u, n = rcc->pll >> 8 & 127u,
                   r = 2u * ((rcc->pll >> 25 & 3u) + 1u);
    const uint32_t input = (rcc->pll & 3u) == PLL_SOURCE_HSE ? RCC_HSE_HZ : RCC_HSI_HZ;
    return (rcc->pll & PLL_R_ENABLED) != 0 ? (uint32_t)((uint64_t)input * n / m / r) : 0u;
}

static uint32_t system_hz(const struct rcc *rcc) {
    switch (rcc->configuration & 3u) {
    case SWITCH_HSE:
        return RCC_HSE_HZ;
    case SWITCH_PLL:
        return pll_hz(rcc);
    default:
        return RCC_HSI_HZ;
    }
}

static uint32_t divided(uint32_t hz, uint32_t field, uint32_t first_shift) {
    static const uint8_t shift_of_eight[8] = {1, 2, 3, 4, 6, 7, 8, 9};
    if (first_shift == 8u) { /* AHB: 1xxx divides by 2, 4, 8, 16, 64 .. 512 */
        return (field & 8u) != 0 ? hz >> shift_of_eight[field & 7u] : hz;
    }
    return (field & 4u) != 0 ? hz >> ((field & 3u) + 1u) : hz;
}

static void judge(struct rcc *rcc) {
    const uint32_t each = rcc->boost ? HZ_A_WAIT_STATE : HZ_A_WAIT_STATE_NORMAL;
    const bool too_fast = rcc->core_hz > each * (rcc->flash_wait_states + 1u);
    rcc->violations += too_fast || (rcc->core_hz > BOOST_ABOVE_HZ && !rcc->boost) ? 1u : 0u;
}

static void apply(struct rcc *rcc) {
    const uint32_t core_hz = divided(system_hz(rcc), rcc->configuration >> 4 & 15u, 8u);
    const uint32_t apb1_hz = divided(core_hz, rcc->configuration >> 8 & 7u, 4u);
    const uint32_t apb2_hz = divided(core_hz, rcc->configuration >> 11 & 7u, 4u);
    if (core_hz == 0u || (core_hz == rcc->core_hz && apb1_hz == rcc->apb1_hz && apb2_hz == rcc->apb2_hz)) {
        return;
    }
    if (rcc->changing != NULL) {
        rcc->changing(rcc->context);
    }
    rcc->core_hz = core_hz;
    rcc->apb1_hz = apb1_hz;
    rcc->apb2_hz = apb2_hz;
    core_set_clock(rcc->core, core_hz);
    judge(rcc);
    if (rcc->changed != NULL) {
        rcc->changed(rcc->context);
    }
}

/* The crystal is gone while something runs from it: back to HSI, NMI. */
static void secure(struct rcc *rcc) {
    const bool from_pll = (rcc->configuration & 3u) == SWITCH_PLL && (rcc->pll & 3u) == PLL_SOURCE_HSE;
    rcc->control = (rcc->control & ~(CR_HSEON | CR_CSSON)) | CR_HSION;
    rcc->control &= (rcc->pll & 3u) == PLL_SOURCE_HSE ? ~CR_PLLON : ~0u;
    if (from_pll || (rcc->configuration & 3u) == SWITCH_HSE) {
        rcc->configuration = (rcc->configuration & ~3u) | SWITCH_HSI;
    }
    rcc->interrupt_flags |= CIFR_CSSF;
    core_line(rcc->core, EXCEPTION_NMI, true);
    if (rcc->crystal_stopped != NULL) {
        rcc->crystal_stopped(rcc->context);
    }
    apply(rcc);
}

void rcc_crystal(struct rcc *rcc, bool works) {
    const bool was_ready = ready(rcc, HSE);
    rcc->crystal_works = works;
    if (works) {
        rcc->ready_ticks[HSE] = rcc->core->now_ticks + HSE_START_US * TICKS_PER_US;
        return;
    }
    rcc->ready_ticks[HSE] = SCHEDULE_NEVER;
    if (was_ready && (rcc->control & CR_CSSON) != 0) {
        secure(rcc);
    }
}

void rcc_init(struct rcc *rcc, struct core *core) {
    memset(rcc, 0, sizeof *rcc);
    rcc->core = core;
    rcc->crystal_works = rcc->pll_locks = true;
}

void rcc_reset(struct rcc *rcc, uint32_t cause) {
    rcc->control = CR_HSION;
    rcc->configuration = SWITCH_HSI;
    rcc->pll = 0x1000u;
    rcc->interrupt_flags = rcc->selection = 0u;
    memset(rcc->gates, 0, sizeof rcc->gates);
    rcc->cause |= cause | RCC_RESET_PIN;
    rcc->ready_ticks[HSI] = rcc->core->now_ticks;
    rcc->ready_ticks[HSE] = rcc->ready_ticks[PLL] = SCHEDULE_NEVER;
    core_line(rcc->core, EXCEPTION_NMI, false);
    apply(rcc);
}

static void write_control(struct rcc *rcc, uint32_t value) {
    const uint32_t risen = value & ~rcc->control;
    uint32_t kept = value & CR_WRITABLE;
    if ((rcc->configuration & 3u) == SWITCH_PLL) {
        kept |= CR_PLLON; /* cannot be switched off while in use */
    }
    rcc->control = kept | (rcc->control & CR_CSSON); /* once on, only a reset or a failure switches it off */
    for (int i = 0; i < 3; i++) {
        if ((risen & on_bit[i]) != 0) {
            rcc->ready_ticks[i] = rcc->core->now_ticks + start_us[i] * TICKS_PER_US;
        }
    }
    if ((risen & CR_HSEON) != 0 && !rcc->crystal_works) {
        rcc->ready_ticks[HSE] = SCHEDULE_NEVER;
    }
    if ((risen & CR_PLLON) != 0 && (!pll_source_ready(rcc) || !rcc->pll_locks)) {
        rcc->ready_ticks[PLL] = SCHEDULE_NEVER;
    }
}

/* A switch to a source that is not ready does not happen. */
static void write_configuration(struct rcc *rcc, uint32_t value) {
    static const enum oscillator needed[4] = {HSI, HSI, HSE, PLL};
    const uint32_t wanted = value & 3u;
    const uint32_t kept = wanted != 0u && ready(rcc, needed[wanted]) ? wanted : rcc->configuration & 3u;
    rcc->configuration = (value & ~15u) | kept;
    apply(rcc);
}

static uint32_t read_control(const struct rcc *rcc) {
    uint32_t value = rcc->control;
    for (int i = 0; i < 3; i++) {
        value |= ready(rcc, (enum oscillator)i) ? ready_bit[i] : 0u;
    }
    return value;
}

static uint32_t *gate(struct rcc *rcc, uint32_t offset) {
    switch (offset) {
    case 0x48u:
        return &rcc->gates[0];
    case 0x4cu:
        return &rcc->gates[1];
    case 0x58u:
        return &rcc->gates[2];
    case 0x5cu:
        return &rcc->gates[3];
    case 0x60u:
        return &rcc->gates[4];
    case 0x88u:
        return &rcc->selection;
    default:
        return NULL;
    }
}

bool rcc_read(void *context, uint32_t offset, uint32_t *value) {
    struct rcc *rcc = context;
    const uint32_t *word = gate(rcc, offset);
    if (word != NULL) {
        *value = *word;
        return true;
    }
    switch (offset) {
    case 0x00u:
        *value = read_control(rcc);
        return true;
    case 0x08u:
        *value = rcc->configuration | (rcc->configuration & 3u) << 2;
        return true;
    case 0x0cu:
        *value = rcc->pll;
        return true;
    case 0x1cu:
        *value = rcc->interrupt_flags;
        return true;
    case 0x94u:
        *value = rcc->status | rcc->cause;
        return true;
    default:
        return false;
    }
}

bool rcc_write(void *context, uint32_t offset, uint32_t value) {
    struct rcc *rcc = context;
    uint32_t *word = gate(rcc, offset);
    if (word != NULL) {
        *word = value;
        if (word == &rcc->selection && rcc->changed != NULL) {
            rcc->changed(rcc->context); /* a peripheral's own clock */
        }
        return true;
    }
    switch (offset) {
    case 0x00u:
        write_control(rcc, value);
        return true;
    case 0x08u:
        write_configuration(rcc, value);
        return true;
    case 0x0cu:
        rcc->pll = (rcc->control & CR_PLLON) == 0 ? value : rcc->pll;
        return true;
    case 0x20u:
        rcc->interrupt_flags &= ~value;
        core_line(rcc->core, EXCEPTION_NMI, (rcc->interrupt_flags & CIFR_CSSF) != 0);
        return true;
    case 0x94u:
        rcc->cause = (value & CSR_RMVF) != 0 ? 0u : rcc->cause;
        rcc->status = value & ~(CSR_CAUSES | CSR_RMVF);
        return true;
    default:
        return false;
    }
}

uint32_t rcc_fdcan_hz(const struct rcc *rcc) {
    return (rcc->selection >> 24 & 3u) == 2u ? rcc->apb1_hz : RCC_HSE_HZ;
}

uint32_t rcc_timer_hz(const struct rcc *rcc, bool apb2) {
    const uint32_t bus_hz = apb2 ? rcc->apb2_hz : rcc->apb1_hz;
    return bus_hz == rcc->core_hz ? bus_hz : 2u * bus_hz;
}
