#include "stm32g4/clock.h"

#include "stm32g4/core.h"
#include "stm32g4/registers.h"

#define CLOCK_HSI_HZ 16000000u
#define CLOCK_PLL_HZ 170000000u
#define PLL_N 85u
#define PLL_M_HSE 6u /* 24 MHz / 6 x 85 / 2 */
#define PLL_M_HSI 4u /* 16 MHz / 4 x 85 / 2 */
/* Polls, each of at least 5 cycles: 30 ms at 16 MHz for the crystal, which takes up to 10 ms; 1.5 ms for the
 * rest. */
#define POLLS_CRYSTAL 100000u
#define POLLS_SWITCH 5000u
#define SETTLE_TURNS 200u /* over 1 us at 85 MHz, for the regulator */

static volatile bool crystal_failed;

static bool start_pll(uint32_t source, uint32_t m) {
    RCC->cr &= ~RCC_CR_PLLON;
    if (!core_await(&RCC->cr, RCC_CR_PLLRDY, 0u, POLLS_SWITCH)) {
        return false;
    }
    RCC->pllcfgr =
        source | ((m - 1u) << RCC_PLLCFGR_M_SHIFT) | (PLL_N << RCC_PLLCFGR_N_SHIFT) | RCC_PLLCFGR_REN;
    RCC->cr |= RCC_CR_PLLON;
    return core_await(&RCC->cr, RCC_CR_PLLRDY, RCC_CR_PLLRDY, POLLS_SWITCH);
}

/* At half speed for a microsecond: the regulator must not see the whole step at once (RM0440, 6.1.5). */
static bool switch_to_pll(void) {
    RCC->cfgr = (RCC->cfgr & ~RCC_CFGR_HPRE_MASK) | RCC_CFGR_HPRE_HALF;
    RCC->cfgr = (RCC->cfgr & ~RCC_CFGR_SW_MASK) | RCC_CFGR_SW_PLL;
    const bool done = core_await(&RCC->cfgr, RCC_CFGR_SW_MASK << RCC_CFGR_SWS_SHIFT,
                                 RCC_CFGR_SW_PLL << RCC_CFGR_SWS_SHIFT, POLLS_SWITCH);
    for (volatile uint32_t i = 0; i < SETTLE_TURNS; i++) {
    }
    RCC->cfgr &= ~RCC_CFGR_HPRE_MASK;
    return done;
}

static void run_from_hsi(void) {
    RCC->cfgr = (RCC->cfgr & ~(RCC_CFGR_SW_MASK | RCC_CFGR_HPRE_MASK)) | RCC_CFGR_SW_HSI;
}

/* Boost range and wait states for 170 MHz; harmless at less. */
static bool prepare_speed(void) {
    RCC->apb1enr1 |= RCC_APB1ENR1_PWR;
    (void)RCC->apb1enr1; /* the bus needs two cycles before the first access */
    PWR->cr5 &= ~PWR_CR5_R1MODE;
    FLASH->acr = FLASH_ACR_LATENCY_170MHZ | FLASH_ACR_PRFTEN | FLASH_ACR_ICEN | FLASH_ACR_DCEN;
    return core_await(&PWR->sr2, PWR_SR2_VOSF, 0u, POLLS_SWITCH) &&
           core_await(&FLASH->acr, FLASH_ACR_LATENCY_MASK, FLASH_ACR_LATENCY_170MHZ, POLLS_SWITCH);
}

static bool start_from_crystal(void) {
    RCC->cr |= RCC_CR_HSEON;
    if (!core_await(&RCC->cr, RCC_CR_HSERDY, RCC_CR_HSERDY, POLLS_CRYSTAL) ||
        !start_pll(RCC_PLLCFGR_SRC_HSE, PLL_M_HSE) || !switch_to_pll()) {
        return false;
    }
    RCC->cr |= RCC_CR_CSSON;
    return true;
}

static bool start_from_hsi(void) {
    run_from_hsi();
    RCC->cr &= ~RCC_CR_HSEON;
    return start_pll(RCC_PLLCFGR_SRC_HSI, PLL_M_HSI) && switch_to_pll();
}

uint32_t clock_start(void) {
    const bool prepared = prepare_speed();
    if (prepared && start_from_crystal()) {
        return CLOCK_PLL_HZ;
    }
    crystal_failed = true;
    if (prepared && start_from_hsi()) {
        return CLOCK_PLL_HZ;
    }
    run_from_hsi();
    return CLOCK_HSI_HZ;
}

bool clock_crystal_failed(void) {
    return crystal_failed;
}

/* The chip itself has switched to HSI, and the PLL and the crystal off. */
bool clock_take_failure(bool *lost) {
    if ((RCC->cifr & RCC_CIFR_CSSF) == 0u) {
        return false;
    }
    RCC->cicr = RCC_CICR_CSSC;
    crystal_failed = true;
    *lost = !start_from_hsi();
    return true;
}
