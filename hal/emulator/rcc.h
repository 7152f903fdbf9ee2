/* Reset and clock control: oscillators that take time to start, the PLL, the switch between them, the clock
 * security system, the bus clocks' gates and the reset causes. RM0440, chapter 7. What a clock then drives is
 * told of every change. */
#ifndef TRIBEND_EMULATOR_RCC_H
#define TRIBEND_EMULATOR_RCC_H

#include "emulator/core.h"

#define RCC_BASE 0x40021000u
#define RCC_HSI_HZ 16000000u
#define RCC_HSE_HZ 24000000u /* the NUCLEO's crystal */
#define RCC_LSI_HZ 32000u

#define RCC_RESET_PIN (1u << 26)
#define RCC_RESET_BROWN_OUT (1u << 27)
#define RCC_RESET_SOFTWARE (1u << 28)
#define RCC_RESET_WATCHDOG (1u << 29)

struct rcc {
    struct core *core;
    /* Before and after every change of a clock. */
    void (*changing)(void *context);
    void (*changed)(void *context);
    void (*crystal_stopped)(void *context); /* the clock security system's signal to TIM1 */
    void *context;
    uint32_t control, configuration, pll, interrupt_flags, gates[5], selection, status, cause;
    int64_t ready_ticks[3]; /* HSI, HSE, PLL */
    bool crystal_works;
    bool pll_locks;
    bool boost; /* set by PWR: needed over 150 MHz */
    uint32_t flash_wait_states;
    uint32_t core_hz, apb1_hz, apb2_hz;
    uint32_t violations; /* clocks that the flash or the regulator could not follow */
    size_t slot;
};

void rcc_init(struct rcc *rcc, struct core *core);
/* `cause`: RCC_RESET bits that CSR then shows, until software removes them. */
void rcc_reset(struct rcc *rcc, uint32_t cause);
bool rcc_read(void *context, uint32_t offset, uint32_t *value);
bool rcc_write(void *context, uint32_t offset, uint32_t value);
/* The crystal stops, or works again. */
void rcc_crystal(struct rcc *rcc, bool works);
uint32_t rcc_fdcan_hz(const struct rcc *rcc);
/* Timers on a divided bus run at twice its clock. */
uint32_t rcc_timer_hz(const struct rcc *rcc, bool apb2);

#endif
