/* A 3/2 solenoid valve under PWM: energised it fills after its open delay (if it still is energised), de-energised it
 * vents after its close delay. Times in us. */
#ifndef TRIBEND_SIM_VALVE_H
#define TRIBEND_SIM_VALVE_H

#include <stdbool.h>
#include <stdint.h>

struct valve_parameters {
    int64_t period_us;
    int64_t open_delay_us;
    int64_t close_delay_us;
};

struct valve {
    int64_t open_at_us;  /* fills within [open_at, close_at) */
    int64_t close_at_us;
};

void valve_init(struct valve *valve);
/* The PWM period that starts at `start_us` energises the coil for duty * period from its start. */
void valve_start_period(struct valve *valve, const struct valve_parameters *parameters, int64_t start_us, double duty);
/* The coil is cut off at once. */
void valve_cut(struct valve *valve, const struct valve_parameters *parameters, int64_t time_us);
bool valve_fills(const struct valve *valve, int64_t time_us);
/* The next time after `time_us` at which the valve switches; INT64_MAX: none in sight. */
int64_t valve_next_switch_us(const struct valve *valve, int64_t time_us);

#endif
