#include "emulator/exceptions.h"

#define CONTROL_NPRIV 1u
#define CONTROL_SPSEL 2u
#define CONTROL_FPCA 4u
#define CONTROL_SFPA                                                                                         \
    8u /* libunicorn's core is an M33 in its secure state, where FPCA alone is not enough                    \
        */
#define CCR_STKALIGN 0x200u
#define XPSR_THUMB (1u << 24)
#define XPSR_ALIGNED (1u << 9)
#define BASIC_WORDS 8u
#define EXTENDED_WORDS 26u
#define RETURN_TO_HANDLER 0xfffffff1u
#define RETURN_TO_THREAD_MSP 0xfffffff9u
#define RETURN_TO_THREAD_PSP 0xfffffffdu
#define RETURN_BASIC_FRAME 0x10u

static const int low_register[5] = {UC_ARM_REG_R0, UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3,
                                    UC_ARM_REG_R12};

struct nvic_masks exceptions_masks(const struct core *core) {
    return (struct nvic_masks){.primask = (core_register(core, UC_ARM_REG_PRIMASK) & 1u) != 0,
                               .faultmask = (core_register(core, UC_ARM_REG_FAULTMASK) & 1u) != 0,
                               .basepri = (uint8_t)core_register(core, UC_ARM_REG_BASEPRI)};
}

static void lock_up(struct core *core) {
    core->locked_up = true;
    if (core->peripherals.locked_up != NULL) {
        core->peripherals.locked_up(core->peripherals.context);
    }
}

/* Push the frame; false: there is no memory for it. `words` of the frame, aligned where the CCR says so. */
static bool push(struct core *core, uint32_t return_address, bool process_stack, bool extended) {
    const int stack = process_stack ? UC_ARM_REG_PSP : UC_ARM_REG_MSP;
    const uint32_t words = extended ? EXTENDED_WORDS : BASIC_WORDS;
    const uint32_t sp = core_register(core, stack);
    const bool align = (sp & 4u) != 0 && (extended || (core->nvic.configuration & CCR_STKALIGN) != 0);
    const uint32_t frame_address = sp - 4u * words - (align ? 4u : 0u);
    uint32_t frame[EXTENDED_WORDS] = {0};
    for (size_t i = 0; i < 5; i++) {
        frame[i] = core_register(core, low_register[i]);
    }
    frame[5] = core_register(core, UC_ARM_REG_LR);
    frame[6] = return_address & ~1u;
    frame[7] =
        (core_register(core, UC_ARM_REG_XPSR) & ~XPSR_ALIGNED) | XPSR_THUMB | (align ? XPSR_ALIGNED : 0u);
    for (int i = 0; extended && i < 16; i++) {
        frame[8 + i] = core_register(core, UC_ARM_REG_S0 + i);
    }
    frame[24] = extended ? core_register(core, UC_ARM_REG_FPSCR) : 0u;
    core_set_register(core, stack, frame_address);
    return core_write(core, frame_address, frame, 4u * words);
}

static void enter(struct core *core, uint32_t exception, uint32_t return_address) {
    const uint32_t control = core_register(core, UC_ARM_REG_CONTROL);
    const bool from_handler = core->running != 0;
    const bool process_stack = !from_handler && (control & CONTROL_SPSEL) != 0;
    const bool extended = (control & CONTROL_FPCA) != 0;
    const uint32_t kind = from_handler    ? RETURN_TO_HANDLER
                          : process_stack ? RETURN_TO_THREAD_PSP
                                          : RETURN_TO_THREAD_MSP;
    uint32_t vector = 0;
    if (!push(core, return_address, process_stack, extended)) {
        core->nvic.fault_status |= CFSR_STKERR;
        if (exception == EXCEPTION_HARD_FAULT) {
            lock_up(core);
            return;
        }
        core->nvic.hard_fault_status |= HFSR_FORCED;
        exception = EXCEPTION_HARD_FAULT;
    }
    nvic_enter(&core->nvic, exception);
    core->running = exception;
    core->count[exception].entries++;
    core->run_instructions[exception] = 0;
    core_set_register(core, UC_ARM_REG_XPSR_NZCVQG,
                      (core_register(core, UC_ARM_REG_XPSR) & 0xf80f0000u) | XPSR_THUMB | exception);
    core_set_register(core, UC_ARM_REG_CONTROL, control & CONTROL_NPRIV);
    core_set_register(core, UC_ARM_REG_LR, extended ? kind & ~RETURN_BASIC_FRAME : kind);
    if (!core_read(core, core->nvic.vector_table + 4u * exception, &vector, sizeof vector)) {
        core->nvic.hard_fault_status |= HFSR_VECTTBL;
        lock_up(core);
    }
    core_set_register(core, UC_ARM_REG_PC, vector | 1u);
}

void exceptions_take(struct core *core) {
    const struct nvic_masks masks = exceptions_masks(core);
    const uint32_t next = nvic_next(&core->nvic, &masks);
    if (next != NVIC_NONE && !core->locked_up) {
        core->sleeping = false;
        enter(core, next, core_register(core, UC_ARM_REG_PC));
    }
}

bool exceptions_wake(const struct core *core) {
    struct nvic_masks masks = exceptions_masks(core);
    masks.primask = false;
    return nvic_next(&core->nvic, &masks) != NVIC_NONE;
}

static void end_run(struct core *core) {
    struct core_count *count = &core->count[core->running];
    count->last = core->run_instructions[core->running];
    count->most = count->last > count->most ? count->last : count->most;
}

static bool meaningful(const struct core *core, uint32_t value) {
    const uint32_t kind = value | RETURN_BASIC_FRAME;
    return core->running != 0 && core->nvic.active[core->running] &&
           (kind == RETURN_TO_HANDLER || kind == RETURN_TO_THREAD_MSP || kind == RETURN_TO_THREAD_PSP);
}

/* Registers from the frame; the stack pointer and the return address last. */
static void restore(struct core *core, const uint32_t *frame, uint32_t frame_address, int stack,
                    bool extended, bool to_thread) {
    const uint32_t words = extended ? EXTENDED_WORDS : BASIC_WORDS;
    const uint32_t xpsr = frame[7];
    const uint32_t control = core_register(core, UC_ARM_REG_CONTROL) & CONTROL_NPRIV;
    for (size_t i = 0; i < 5; i++) {
        core_set_register(core, low_register[i], frame[i]);
    }
    core_set_register(core, UC_ARM_REG_LR, frame[5]);
    for (int i = 0; extended && i < 16; i++) {
        core_set_register(core, UC_ARM_REG_S0 + i, frame[8 + i]);
    }
    if (extended) {
        core_set_register(core, UC_ARM_REG_FPSCR, frame[24]);
    }
    core_set_register(core, UC_ARM_REG_XPSR_NZCVQG, xpsr & ~XPSR_ALIGNED);
    core_set_register(core, UC_ARM_REG_CONTROL,
                      control | (extended ? CONTROL_FPCA | CONTROL_SFPA : 0u) |
                          (to_thread && stack == UC_ARM_REG_PSP ? CONTROL_SPSEL : 0u));
    core_set_register(core, stack, frame_address + 4u * words + ((xpsr & XPSR_ALIGNED) != 0 ? 4u : 0u));
    core->running = xpsr & 0x1ffu;
    core_set_register(core, UC_ARM_REG_PC, frame[6] | 1u);
}

void exceptions_return(struct core *core, uint32_t value) {
    uint32_t frame[EXTENDED_WORDS];
    const bool extended = (value & RETURN_BASIC_FRAME) == 0;
    const uint32_t kind = value | RETURN_BASIC_FRAME;
    const int stack = kind == RETURN_TO_THREAD_PSP ? UC_ARM_REG_PSP : UC_ARM_REG_MSP;
    const uint32_t frame_address = core_register(core, stack);
    if (!meaningful(core, value)) {
        core->oddities.spurious_returns++;
        exceptions_fault(core, EXCEPTION_USAGE_FAULT, CFSR_INVPC, value);
        return;
    }
    if (!core_read(core, frame_address, frame, 4u * (extended ? EXTENDED_WORDS : BASIC_WORDS))) {
        exceptions_fault(core, EXCEPTION_BUS_FAULT, CFSR_UNSTKERR, value);
        return;
    }
    end_run(core);
    if (core->running != EXCEPTION_NMI) {
        core_set_register(core, UC_ARM_REG_FAULTMASK, 0u);
    }
    nvic_leave(&core->nvic, core->running);
    restore(core, frame, frame_address, stack, extended, kind != RETURN_TO_HANDLER);
    if (core->running == 0 && (core->nvic.system_control & 2u) != 0) {
        core->sleeping = true; /* SLEEPONEXIT */
    }
}

void exceptions_fault(struct core *core, uint32_t exception, uint32_t status, uint32_t pc) {
    const struct nvic_masks masks = exceptions_masks(core);
    const uint32_t taken = nvic_fault(&core->nvic, exception, status, &masks);
    if (nvic_running_priority(&core->nvic, &masks) <= nvic_group_priority(&core->nvic, taken)) {
        lock_up(core);
        return;
    }
    enter(core, taken, pc);
}

void exceptions_supervisor_call(struct core *core) {
    const struct nvic_masks masks = exceptions_masks(core);
    const uint32_t pc = core_register(core, UC_ARM_REG_PC);
    if (nvic_group_priority(&core->nvic, EXCEPTION_SVCALL) >= nvic_running_priority(&core->nvic, &masks)) {
        exceptions_fault(core, EXCEPTION_HARD_FAULT, 0u, pc);
        return;
    }
    enter(core, EXCEPTION_SVCALL, pc);
}
