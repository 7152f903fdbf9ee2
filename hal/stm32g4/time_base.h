/* Time: the microsecond counter (TIM2), the tick of the control step (TIM3), and the watch over the steps
 * that follow it. */
#ifndef TRIBEND_STM32G4_TIME_BASE_H
#define TRIBEND_STM32G4_TIME_BASE_H

#include <stdbool.h>
#include <stdint.h>

#define TIME_BASE_STEP_US 1000u

/* Sets TIM2 and TIM3; none counts yet. False: the clock is no whole number of MHz. */
bool time_base_start(uint32_t clock_hz);
/* Time 0: TIM2, TIM3 and the valves' TIM1 start together. */
void time_base_run(void);
/* Microseconds since time 0, modulo 2^32. */
uint32_t time_base_now_us(void);
/* Sleep until a tick that is not the one of `seen`; returns the number of ticks since time 0, modulo 2^32. */
uint32_t time_base_wait(uint32_t seen);
/* The step of tick number `tick` is complete. */
void time_base_completed(uint32_t tick);
/* How often the tick found no step completed for TIME_BASE_HUNG_STEPS and shut the valves. */
uint32_t time_base_hung_count(void);

#define TIME_BASE_HUNG_STEPS 5u

#endif
