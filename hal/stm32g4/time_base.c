#include "stm32g4/time_base.h"

#include "stm32g4/core.h"
#include "stm32g4/handlers.h"
#include "stm32g4/registers.h"
#include "stm32g4/valves.h"

#define HZ_PER_MHZ 1000000u
#define SAMPLE_AT_US 750u /* of each step: the converter is done 60 us before the next */
#define TICK_PRIORITY 1u

static volatile uint32_t ticks;
static volatile uint32_t completed;
static volatile uint32_t hung_count;
static uint32_t tick_us; /* when tick number `ticks` was due */

bool time_base_start(uint32_t clock_hz) {
    const uint32_t prescaler = clock_hz / HZ_PER_MHZ;
    if (prescaler * HZ_PER_MHZ != clock_hz || prescaler == 0u) {
        return false;
    }
    RCC->apb1enr1 |= RCC_APB1ENR1_TIM2 | RCC_APB1ENR1_TIM3;
    (void)RCC->apb1enr1;
    TIM2->cr1 = TIM_CR1_URS;
    TIM2->psc = prescaler - 1u;
    TIM2->arr = 0xffffffffu;
    TIM2->egr = TIM_EGR_UG;
    TIM3->cr1 = TIM_CR1_URS;
    TIM3->psc = prescaler - 1u;
    TIM3->arr = TIME_BASE_STEP_US - 1u;
    TIM3->ccmr2 = TIM_CCMR_HIGH_PWM2;
    TIM3->ccr[3] = SAMPLE_AT_US;
    TIM3->cr2 = TIM_CR2_MMS_OC4REF;
    TIM3->egr = TIM_EGR_UG;
    TIM3->dier = TIM_DIER_UIE;
    core_enable_interrupt(IRQ_TIM3, TICK_PRIORITY);
    return true;
}

void time_base_run(void) {
    const uint32_t mask = core_mask();
    TIM2->cr1 = TIM_CR1_URS | TIM_CR1_CEN;
    TIM3->cr1 = TIM_CR1_URS | TIM_CR1_CEN;
    TIM1->cr1 = TIM_CR1_URS | TIM_CR1_ARPE | TIM_CR1_CEN;
    core_unmask(mask);
}

uint32_t time_base_now_us(void) {
    return TIM2->cnt;
}

/* A step that hangs with its valves open must not fill a chamber until the watchdog bites. */
static void watch_steps(void) {
    if (ticks - completed > TIME_BASE_HUNG_STEPS && valves_enabled()) {
        valves_shut();
        hung_count = hung_count + 1u;
    }
}

/* More than one tick has passed where the core stood still while its own flash bank was erased. */
void handler_tim3(void) {
    TIM3->sr = ~TIM_SR_UIF;
    const uint32_t steps = (TIM2->cnt - tick_us) / TIME_BASE_STEP_US;
    const uint32_t passed = steps > 0u ? steps : 1u;
    tick_us += passed * TIME_BASE_STEP_US;
    ticks = ticks + passed;
    watch_steps();
}

uint32_t time_base_wait(uint32_t seen) {
    uint32_t mask = core_mask();
    while (ticks == seen) {
        core_wait();
        core_unmask(mask); /* lets what woke the core run */
        mask = core_mask();
    }
    const uint32_t tick = ticks;
    core_unmask(mask);
    return tick;
}

void time_base_completed(uint32_t tick) {
    completed = tick;
}

uint32_t time_base_hung_count(void) {
    return hung_count;
}
