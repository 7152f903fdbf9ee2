#include "stm32g4/valves.h"

#include "control/real_math.h"
#include "stm32g4/conversions.h"
#include "stm32g4/pins.h"
#include "stm32g4/registers.h"

#define VALVE_FUNCTION 6u /* TIM1 on PA8, PA9, PA10 */
#define VALVE_PIN_FIRST 8u
#define SUPPLY_PIN 5u

/* Idle outputs are driven low; a break of the chip itself (lock-up, supply) clears MOE, which only software
 * sets again. */
#define BDTR_OFF (TIM_BDTR_OSSI | TIM_BDTR_OSSR | TIM_BDTR_BKE | TIM_BDTR_BKP)

static uint32_t period_counts;

bool valves_start(uint32_t clock_hz) {
    struct pwm_scale scale;
    if (!conversions_pwm_scale(clock_hz, VALVES_PERIOD_US, &scale)) {
        return false;
    }
    pins_output_low(GPIOB, SUPPLY_PIN);
    RCC->apb2enr |= RCC_APB2ENR_TIM1 | RCC_APB2ENR_SYSCFG;
    (void)RCC->apb2enr;
    SYSCFG->cfgr2 = SYSCFG_CFGR2_CLL | SYSCFG_CFGR2_PVDL;
    TIM1->af1 = 0u; /* no break pin */
    TIM1->bdtr = BDTR_OFF;
    TIM1->psc = scale.prescaler - 1u;
    TIM1->arr = scale.counts - 1u;
    TIM1->ccmr1 = TIM_CCMR_LOW_PWM1 | TIM_CCMR_HIGH_PWM1;
    TIM1->ccmr2 = TIM_CCMR_LOW_PWM1;
    TIM1->ccer = TIM_CCER_CC1E | TIM_CCER_CC2E | TIM_CCER_CC3E;
    TIM1->cr1 = TIM_CR1_ARPE | TIM_CR1_URS;
    TIM1->egr = TIM_EGR_UG;
    period_counts = scale.counts;
    for (uint32_t c = 0; c < 3u; c++) {
        pins_alternate(GPIOA, VALVE_PIN_FIRST + c, VALVE_FUNCTION, GPIO_PULL_DOWN);
    }
    return true;
}

/* Off now, and nothing left of the running period's duty should they be enabled again within it: without
 * preload a compare value holds at once. */
static void stop_valves(void) {
    TIM1->bdtr = BDTR_OFF;
    TIM1->ccmr1 = (TIM_CCMR_LOW_PWM1 | TIM_CCMR_HIGH_PWM1) & ~TIM_CCMR_PRELOADS;
    TIM1->ccmr2 = TIM_CCMR_LOW_PWM1 & ~TIM_CCMR_PRELOADS;
    for (uint32_t c = 0; c < 3u; c++) {
        TIM1->ccr[c] = 0u;
    }
    TIM1->ccmr1 = TIM_CCMR_LOW_PWM1 | TIM_CCMR_HIGH_PWM1;
    TIM1->ccmr2 = TIM_CCMR_LOW_PWM1;
}

static bool run_valves(const float duty[3]) {
    for (uint32_t c = 0; c < 3u; c++) {
        TIM1->ccr[c] = conversions_compare(duty[c], period_counts);
    }
    TIM1->bdtr = BDTR_OFF | TIM_BDTR_MOE;
    return valves_enabled();
}

bool valves_write(const struct hal_outputs *outputs) {
    GPIOB->bsrr = outputs->supply_enabled ? 1u << SUPPLY_PIN : 1u << (SUPPLY_PIN + 16u);
    if (!outputs->valves_enabled) {
        stop_valves();
        return true;
    }
    const bool sound = real_is_finite(outputs->duty[0]) && real_is_finite(outputs->duty[1]) &&
                       real_is_finite(outputs->duty[2]);
    if (!sound || !run_valves(outputs->duty)) {
        valves_shut();
        return false;
    }
    return true;
}

void valves_shut(void) {
    TIM1->bdtr = BDTR_OFF;
    GPIOB->bsrr = 1u << (SUPPLY_PIN + 16u);
}

bool valves_enabled(void) {
    return (TIM1->bdtr & TIM_BDTR_MOE) != 0u;
}
