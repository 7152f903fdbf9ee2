#include "sim/valve.h"

#include <math.h>

void valve_init(struct valve *valve) {
    *valve = (struct valve){0, 0};
}

void valve_start_period(struct valve *valve, const struct valve_parameters *parameters, int64_t start_us, double duty) {
    const int64_t on_us = llround(fmin(fmax(duty, 0.0), 1.0) * (double)parameters->period_us);
    const int64_t off_us = start_us + on_us + parameters->close_delay_us;
    if (valve_fills(valve, start_us) && on_us > 0) {
        valve->close_at_us = off_us; /* energised again before it had closed */
    } else if (on_us > parameters->open_delay_us) {
        valve->open_at_us = start_us + parameters->open_delay_us;
        valve->close_at_us = off_us;
    }
}

void valve_cut(struct valve *valve, const struct valve_parameters *parameters, int64_t time_us) {
    if (valve->open_at_us > time_us) {
        valve->close_at_us = valve->open_at_us; /* de-energised before it had opened */
    } else if (valve->close_at_us > time_us + parameters->close_delay_us) {
        valve->close_at_us = time_us + parameters->close_delay_us;
    }
}

bool valve_fills(const struct valve *valve, int64_t time_us) {
    return time_us >= valve->open_at_us && time_us < valve->close_at_us;
}

int64_t valve_next_switch_us(const struct valve *valve, int64_t time_us) {
    if (time_us < valve->open_at_us && valve->open_at_us < valve->close_at_us) {
        return valve->open_at_us;
    }
    return time_us < valve->close_at_us ? valve->close_at_us : INT64_MAX;
}
