/* What C cannot say: interrupt masking, waiting and barriers of the Cortex-M4, and its interrupt controller.
 */
#ifndef TRIBEND_STM32G4_CORE_H
#define TRIBEND_STM32G4_CORE_H

#include <stdbool.h>
#include <stdint.h>

#include "stm32g4/registers.h"

/* Polls a register at most `polls` times (each takes at least five cycles) until its bits in `mask` are
 * `value`. */
static inline bool core_await(const reg32 *reg, uint32_t mask, uint32_t value, uint32_t polls) {
    for (uint32_t i = 0; i < polls; i++) {
        if ((*reg & mask) == value) {
            return true;
        }
    }
    return false;
}

/* Masks interrupts; returns what core_unmask() needs to restore the state before. */
static inline uint32_t core_mask(void) {
    uint32_t before;
    __asm volatile("mrs %0, primask\n\tcpsid i" : "=r"(before)::"memory");
    return before;
}

static inline void core_unmask(uint32_t before) {
    __asm volatile("msr primask, %0" ::"r"(before) : "memory");
}

/* Until an interrupt is pending, masked or not. */
static inline void core_wait(void) {
    __asm volatile("dsb\n\twfi" ::: "memory");
}

static inline void core_barrier(void) {
    __asm volatile("dsb\n\tisb" ::: "memory");
}

/* Priorities 0 (highest) to 15. */
static inline void core_enable_interrupt(uint32_t number, uint8_t priority) {
    NVIC_PRIORITY[number] = (uint8_t)(priority << NVIC_PRIORITY_SHIFT);
    NVIC->iser[number / 32u] = 1u << (number % 32u);
}

/* Does not come back. */
_Noreturn static inline void core_reset(void) {
    core_barrier();
    SCB->aircr = SCB_AIRCR_RESET;
    for (;;) {
        core_barrier();
    }
}

#endif
