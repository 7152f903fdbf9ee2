/* A 3/2 solenoid valve under PWM: energised it fills after its open delay (if it still is energised), de-energised it
 * vents after its close delay. Times in us. */
#ifndef TRIBEND_SIM_VALVE_H
#define TRIBEND_SIM_VALVE_H

#include <stdbool.h>
#include <stdint.h>

#define VALVE_PULSES_MAX 16 /* under way or still to come: a late valve has some of these */

struct valve_parameters {
    int64_t period_us;
    int64_t open_delay_us;
    int64_t close_delay_us;
};

/* Fills within [open_at, close_at). */
struct valve_pulse {
    int64_t open_at_us;
    int64_t close_at_us;
};

/* A spool that no longer follows its coil. */
enum valve_stuck { VALVE_FREE = 0, VALVE_STUCK_FILLING, VALVE_STUCK_VENTING };

struct valve {
    struct valve_pulse pulse[VALVE_PULSES_MAX]; /* in the order of time */
    uint32_t count;
    enum valve_stuck stuck;
};

void valve_init(struct valve *valve);
/* The PWM period that starts at `start_us` energises the coil for duty * period from its start; `late_us` more passes
 * before the valve sees any of it. */
void valve_start_period(struct valve *valve, const struct valve_parameters *parameters, int64_t start_us, int64_t late_us,
                        double duty);
/* The coil is de-energised at `time_us`, inside a period. */
void valve_cut(struct valve *valve, const struct valve_parameters *parameters, int64_t time_us);
bool valve_fills(const struct valve *valve, int64_t time_us);
/* When it next changes over after `time_us`; INT64_MAX: not by what it knows. */
int64_t valve_next_switch_us(const struct valve *valve, int64_t time_us);

#endif
