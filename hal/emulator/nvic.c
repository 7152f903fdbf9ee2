#include "emulator/nvic.h"

#include <string.h>

#define PRIORITY_MASK ((0xffu << (8u - NVIC_PRIORITY_BITS)) & 0xffu)
#define CCR_STKALIGN 0x200u
#define AIRCR_KEY 0x05fau
#define AIRCR_SYSRESETREQ 0x4u
#define ICSR_OFFSET 0xd04u

void nvic_reset(struct nvic *nvic) {
    bool line[NVIC_EXCEPTIONS];
    memcpy(line, nvic->line, sizeof line);
    memset(nvic, 0, sizeof *nvic);
    memcpy(nvic->line, line, sizeof line);
    nvic->configuration = CCR_STKALIGN;
    nvic->priority[EXCEPTION_RESET] = -3;
    nvic->priority[EXCEPTION_NMI] = -2;
    nvic->priority[EXCEPTION_HARD_FAULT] = -1;
    for (uint32_t e = 0; e < NVIC_FIRST_IRQ; e++) {
        nvic->enabled[e] = true;
    }
}

static void count_pending(struct nvic *nvic) {
    nvic->pending_count = 0;
    for (uint32_t e = 1; e < NVIC_EXCEPTIONS; e++) {
        nvic->pending_count += nvic->enabled[e] && nvic->pending[e] ? 1u : 0u;
    }
}

void nvic_pend(struct nvic *nvic, uint32_t exception) {
    if (!nvic->pending[exception]) {
        nvic->pending[exception] = true;
        nvic->pending_count += nvic->enabled[exception] ? 1u : 0u;
    }
}

void nvic_unpend(struct nvic *nvic, uint32_t exception) {
    if (nvic->pending[exception]) {
        nvic->pending[exception] = false;
        nvic->pending_count -= nvic->enabled[exception] ? 1u : 0u;
    }
}

void nvic_line(struct nvic *nvic, uint32_t exception, bool level) {
    if (level && !nvic->line[exception]) {
        nvic_pend(nvic, exception);
    }
    nvic->line[exception] = level;
}

static int grouped(const struct nvic *nvic, int priority) {
    return priority < 0 ? priority : (int)((unsigned)priority & (0xffffffffu << (nvic->priority_group + 1u)));
}

int nvic_group_priority(const struct nvic *nvic, uint32_t exception) {
    return grouped(nvic, nvic->priority[exception]);
}

int nvic_running_priority(const struct nvic *nvic, const struct nvic_masks *masks) {
    int priority = NVIC_THREAD;
    for (uint32_t e = 1; e < NVIC_EXCEPTIONS; e++) {
        if (nvic->active[e] && nvic_group_priority(nvic, e) < priority) {
            priority = nvic_group_priority(nvic, e);
        }
    }
    if (masks->basepri != 0 && grouped(nvic, masks->basepri) < priority) {
        priority = grouped(nvic, masks->basepri);
    }
    if (masks->primask && priority > 0) {
        priority = 0;
    }
    return masks->faultmask && priority > -1 ? -1 : priority;
}

uint32_t nvic_next(const struct nvic *nvic, const struct nvic_masks *masks) {
    uint32_t best = NVIC_NONE;
    if (nvic->pending_count == 0) {
        return NVIC_NONE;
    }
    for (uint32_t e = 1; e < NVIC_EXCEPTIONS; e++) {
        if (nvic->pending[e] && nvic->enabled[e] &&
            (best == NVIC_NONE || nvic->priority[e] < nvic->priority[best])) {
            best = e;
        }
    }
    return best != NVIC_NONE && nvic_group_priority(nvic, best) < nvic_running_priority(nvic, masks)
               ? best
               : NVIC_NONE;
}

void nvic_enter(struct nvic *nvic, uint32_t exception) {
    nvic_unpend(nvic, exception);
    nvic->active[exception] = true;
}

void nvic_leave(struct nvic *nvic, uint32_t exception) {
    nvic->active[exception] = false;
    if (nvic->line[exception]) {
        nvic_pend(nvic, exception);
    }
}

bool nvic_any_active(const struct nvic *nvic) {
    for (uint32_t e = 1; e < NVIC_EXCEPTIONS; e++) {
        if (nvic->active[e]) {
            return true;
        }
    }
    return false;
}

uint32_t nvic_fault(struct nvic *nvic, uint32_t exception, uint32_t status, const struct nvic_masks *masks) {
    const uint32_t enable = 1u << (16u + exception - EXCEPTION_MEMORY_FAULT);
    const bool configurable = exception >= EXCEPTION_MEMORY_FAULT && exception <= EXCEPTION_USAGE_FAULT;
    const bool ready = nvic_group_priority(nvic, exception) < nvic_running_priority(nvic, masks);
    nvic->fault_status |= status;
    if (ready && (!configurable || (nvic->fault_enables & enable) != 0)) {
        return exception;
    }
    nvic->hard_fault_status |= HFSR_FORCED;
    return EXCEPTION_HARD_FAULT;
}

/* --- registers --- */

enum nvic_bank { BANK_ENABLE_SET, BANK_ENABLE_CLEAR, BANK_PEND_SET, BANK_PEND_CLEAR, BANK_ACTIVE };

static uint32_t bank_read(const struct nvic *nvic, uint32_t bank, uint32_t word) {
    const bool *flags = bank <= BANK_ENABLE_CLEAR ? nvic->enabled
                        : bank <= BANK_PEND_CLEAR ? nvic->pending
                                                  : nvic->active;
    uint32_t value = 0;
    for (uint32_t bit = 0; bit < 32u && 32u * word + bit < NVIC_PERIPHERALS; bit++) {
        value |= flags[NVIC_FIRST_IRQ + 32u * word + bit] ? 1u << bit : 0u;
    }
    return value;
}

static void bank_write(struct nvic *nvic, uint32_t bank, uint32_t word, uint32_t value) {
    for (uint32_t bit = 0; bit < 32u && 32u * word + bit < NVIC_PERIPHERALS; bit++) {
        const uint32_t exception = NVIC_FIRST_IRQ + 32u * word + bit;
        if ((value >> bit & 1u) == 0) {
            continue;
        }
        if (bank == BANK_ENABLE_SET || bank == BANK_ENABLE_CLEAR) {
            nvic->enabled[exception] = bank == BANK_ENABLE_SET;
        } else if (bank == BANK_PEND_SET || bank == BANK_PEND_CLEAR) {
            nvic->pending[exception] = bank == BANK_PEND_SET || nvic->line[exception];
        }
    }
    count_pending(nvic);
}

static bool in_banks(uint32_t offset, uint32_t *bank, uint32_t *word) {
    *bank = (offset - 0x100u) / 0x80u;
    *word = offset % 0x80u / 4u;
    return offset >= 0x100u && offset < 0x380u && *word < (NVIC_PERIPHERALS + 31u) / 32u;
}

static uint32_t interrupt_state(const struct nvic *nvic, uint32_t running) {
    const struct nvic_masks none = {false, false, 0};
    uint32_t highest = nvic_next(nvic, &none);
    return running | highest << 12 | (nvic->pending[EXCEPTION_SYSTICK] ? 1u << 26 : 0u) |
           (nvic->pending[EXCEPTION_PENDSV] ? 1u << 28 : 0u) | (nvic->pending[EXCEPTION_NMI] ? 1u << 31 : 0u);
}

static void write_interrupt_state(struct nvic *nvic, uint32_t value) {
    static const struct {
        uint32_t set, clear, exception;
    } bit[] = {{1u << 31, 0u, EXCEPTION_NMI},
               {1u << 28, 1u << 27, EXCEPTION_PENDSV},
               {1u << 26, 1u << 25, EXCEPTION_SYSTICK}};
    for (uint32_t i = 0; i < sizeof bit / sizeof bit[0]; i++) {
        if ((value & bit[i].set) != 0) {
            nvic_pend(nvic, bit[i].exception);
        } else if ((value & bit[i].clear) != 0) {
            nvic_unpend(nvic, bit[i].exception);
        }
    }
}

static uint32_t handler_state(const struct nvic *nvic) {
    return (nvic->active[EXCEPTION_MEMORY_FAULT] ? 1u : 0u) | (nvic->active[EXCEPTION_BUS_FAULT] ? 2u : 0u) |
           (nvic->active[EXCEPTION_USAGE_FAULT] ? 8u : 0u) | (nvic->active[EXCEPTION_SVCALL] ? 0x80u : 0u) |
           (nvic->active[EXCEPTION_PENDSV] ? 0x400u : 0u) | (nvic->active[EXCEPTION_SYSTICK] ? 0x800u : 0u) |
           nvic->fault_enables;
}

/* Registers that are a word and nothing more. */
static uint32_t *plain(struct nvic *nvic, uint32_t offset) {
    switch (offset) {
    case 0xd08u:
        return &nvic->vector_table;
    case 0xd10u:
        return &nvic->system_control;
    case 0xd14u:
        return &nvic->configuration;
    case 0xd30u:
        return &nvic->debug_fault_status;
    case 0xd34u:
        return &nvic->memory_fault_address;
    case 0xd38u:
        return &nvic->bus_fault_address;
    case 0xd88u:
        return &nvic->coprocessors;
    default:
        return NULL;
    }
}

static uint32_t first_of_priorities(uint32_t offset) {
    return offset >= 0x400u ? NVIC_FIRST_IRQ + offset - 0x400u : 4u + offset - 0xd18u;
}

static bool in_priorities(uint32_t offset) {
    return (offset >= 0x400u && offset < 0x400u + NVIC_PERIPHERALS) || (offset >= 0xd18u && offset < 0xd24u);
}

static uint32_t read_priorities(const struct nvic *nvic, uint32_t first) {
    uint32_t value = 0;
    for (uint32_t i = 0; i < 4u && first + i < NVIC_EXCEPTIONS; i++) {
        value |= (uint32_t)nvic->priority[first + i] << (8u * i);
    }
    return value;
}

static void write_priorities(struct nvic *nvic, uint32_t first, uint32_t value) {
    for (uint32_t i = 0; i < 4u && first + i < NVIC_EXCEPTIONS; i++) {
        nvic->priority[first + i] = (int16_t)(value >> (8u * i) & PRIORITY_MASK);
    }
}

bool nvic_read(struct nvic *nvic, uint32_t offset, uint32_t running, uint32_t *value) {
    uint32_t bank, word;
    const uint32_t *word_register = plain(nvic, offset);
    if (word_register != NULL) {
        *value = *word_register;
    } else if (in_banks(offset, &bank, &word)) {
        *value = bank_read(nvic, bank, word);
    } else if (in_priorities(offset) && (offset < 0x500u || offset >= 0xd18u)) {
        *value = read_priorities(nvic, first_of_priorities(offset));
    } else if (offset == 0xd00u) {
        *value = 0x410fc241u; /* CPUID of a Cortex-M4 r0p1 */
    } else if (offset == ICSR_OFFSET) {
        *value = interrupt_state(nvic, running);
    } else if (offset == 0xd0cu) {
        *value = 0xfa050000u | nvic->priority_group << 8;
    } else if (offset == 0xd24u) {
        *value = handler_state(nvic);
    } else if (offset == 0xd28u) {
        *value = nvic->fault_status;
    } else if (offset == 0xd2cu) {
        *value = nvic->hard_fault_status;
    } else {
        *value = 0;
        return offset == 0xf34u || offset == 0xf3cu || offset == 0xdf0u; /* FPCCR, FPDSCR, DHCSR: at rest */
    }
    return true;
}

bool nvic_write(struct nvic *nvic, uint32_t offset, uint32_t value) {
    uint32_t bank, word;
    uint32_t *word_register = plain(nvic, offset);
    if (word_register != NULL) {
        *word_register = value;
    } else if (in_banks(offset, &bank, &word)) {
        bank_write(nvic, bank, word, value);
    } else if (in_priorities(offset)) {
        write_priorities(nvic, first_of_priorities(offset), value);
    } else if (offset == ICSR_OFFSET) {
        write_interrupt_state(nvic, value);
    } else if (offset == 0xd0cu && value >> 16 == AIRCR_KEY) {
        nvic->priority_group = value >> 8 & 7u;
        nvic->reset_requested = nvic->reset_requested || (value & AIRCR_SYSRESETREQ) != 0;
    } else if (offset == 0xd24u) {
        nvic->fault_enables = value & 0x70000u;
    } else if (offset == 0xd28u) {
        nvic->fault_status &= ~value;
    } else if (offset == 0xd2cu) {
        nvic->hard_fault_status &= ~value;
    } else if (offset == 0xf00u && (value & 0x1ffu) < NVIC_PERIPHERALS) {
        nvic_pend(nvic, NVIC_FIRST_IRQ + (value & 0x1ffu));
    } else {
        return false;
    }
    return true;
}
