#include "stm32g4/faults.h"

#include "stm32g4/clock.h"
#include "stm32g4/core.h"
#include "stm32g4/flash.h"
#include "stm32g4/handlers.h"
#include "stm32g4/linker.h"
#include "stm32g4/registers.h"
#include "stm32g4/valves.h"

#define CFSR_STACKING                                                                                        \
    (0x10u | 0x20u | 0x1000u | 0x2000u) /* MSTKERR MLSPERR STKERR LSPERR: no frame was stored */
#define CFSR_MMARVALID 0x80u
#define CFSR_BFARVALID 0x8000u
#define FRAME_BYTES 32u

/* What the core pushed on entry. */
struct exception_frame {
    uint32_t r[4];
    uint32_t r12;
    uint32_t lr;
    uint32_t pc;
    uint32_t xpsr;
};

static struct crash_record kept_record __attribute__((section(".noinit")));
static struct running_mark kept_mark __attribute__((section(".noinit")));
static volatile uint32_t torn_words;

static const struct running_mark no_mark = {0u, 0u, 0u};

static void take_record(struct faults_start *start) {
    start->crashed = crash_record_is_sound(&kept_record);
    start->record = kept_record;
    start->last = running_mark_is_sound(&kept_mark) ? kept_mark : no_mark;
    kept_record.magic = 0u;
}

void faults_begin(struct faults_start *start) {
    const uint32_t reset = RCC->csr;
    const bool was_running = running_mark_is_sound(&kept_mark);
    take_record(start);
    start->watchdog = (reset & RCC_CSR_IWDGRSTF) != 0u;
    start->brown_out = ((reset & RCC_CSR_BORRSTF) != 0u && was_running) ||
                       (start->crashed && start->record.cause == (uint32_t)CRASH_SUPPLY_DIP);
    RCC->csr = reset | RCC_CSR_RMVF;
    running_mark_set(&kept_mark, 0u, 0u);
    SCB->shcsr |= SCB_SHCSR_FAULTS;
    SCB->ccr |= SCB_CCR_DIV_0_TRP;
}

void faults_mark_step(uint32_t step, uint32_t state) {
    running_mark_set(&kept_mark, step, state);
}

_Noreturn static void keep_and_reset(struct crash_record *record) {
    record->step = kept_mark.step;
    record->state = kept_mark.state;
    kept_record = *record;
    crash_record_seal(&kept_record);
    core_reset();
}

void faults_stop(enum crash_cause cause, uint32_t address) {
    valves_shut();
    struct crash_record record = {.cause = (uint32_t)cause, .address = address};
    keep_and_reset(&record);
}

static bool frame_is_readable(uint32_t stack_pointer, uint32_t cfsr) {
    return (cfsr & CFSR_STACKING) == 0u && stack_pointer % 4u == 0u &&
           stack_pointer >= (uint32_t)(uintptr_t)linker_stack_bottom &&
           stack_pointer + FRAME_BYTES <= (uint32_t)(uintptr_t)linker_stack_top;
}

static uint32_t fault_address(uint32_t cfsr) {
    if ((cfsr & CFSR_MMARVALID) != 0u) {
        return SCB->mmfar;
    }
    return (cfsr & CFSR_BFARVALID) != 0u ? SCB->bfar : 0u;
}

/* Reached from handler_fault on a stack of its own. */
_Noreturn void faults_enter(uint32_t stack_pointer, uint32_t exception);
_Noreturn void faults_enter(uint32_t stack_pointer, uint32_t exception) {
    valves_shut();
    const uint32_t cfsr = SCB->cfsr;
    struct crash_record record = {.cause = exception,
                                  .sp = stack_pointer,
                                  .cfsr = cfsr,
                                  .hfsr = SCB->hfsr,
                                  .address = fault_address(cfsr)};
    if (frame_is_readable(stack_pointer, cfsr)) {
        const struct exception_frame *frame = (const struct exception_frame *)(uintptr_t)stack_pointer;
        record.pc = frame->pc;
        record.lr = frame->lr;
        record.xpsr = frame->xpsr;
    }
    keep_and_reset(&record);
}

/* The stack may be what failed: go on with another one. */
__attribute__((naked)) void handler_fault(void) {
    __asm volatile("mov r0, sp\n\t"
                   "mrs r1, ipsr\n\t"
                   "ldr r2, =linker_fault_stack_top\n\t"
                   "mov sp, r2\n\t"
                   "b faults_enter\n\t");
}

void handler_unexpected(void) {
    uint32_t number;
    __asm volatile("mrs %0, ipsr" : "=r"(number));
    faults_stop(CRASH_UNEXPECTED, number);
}

static void take_flash_error(void) {
    const uint32_t state = FLASH->eccr;
    if ((state & (FLASH_ECCR_ECCD | FLASH_ECCR_ECCD2)) == 0u) {
        return;
    }
    FLASH->eccr = state; /* written ones clear the flags */
    const uint32_t offset = state & FLASH_ECCR_ADDRESS_MASK;
    if ((state & FLASH_ECCR_SYSF_ECC) != 0u || !flash_is_storage((state & FLASH_ECCR_BK_ECC) != 0u, offset)) {
        faults_stop(CRASH_FLASH_CORRUPT, offset);
    }
    torn_words = torn_words + 1u;
}

void handler_nmi(void) {
    bool lost = false;
    if (clock_take_failure(&lost) && lost) {
        faults_stop(CRASH_CLOCK_LOST, 0u);
    }
    take_flash_error();
}

uint32_t faults_torn_words(void) {
    return torn_words;
}
