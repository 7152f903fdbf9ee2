#include "sim/valve.h"

#include <math.h>
#include <string.h>

void valve_init(struct valve *valve) {
    memset(valve, 0, sizeof *valve);
}

static void forget_past(struct valve *valve, int64_t time_us) {
    uint32_t past = 0;
    while (past < valve->count && valve->pulse[past].close_at_us <= time_us) {
        past++;
    }
    valve->count -= past;
    memmove(valve->pulse, valve->pulse + past, valve->count * sizeof valve->pulse[0]);
}

void valve_start_period(struct valve *valve, const struct valve_parameters *parameters, int64_t start_us, int64_t late_us,
                        double duty) {
    const int64_t on_us = llround(fmin(fmax(duty, 0.0), 1.0) * (double)parameters->period_us);
    const int64_t seen_us = start_us + late_us;
    const int64_t off_us = seen_us + on_us + parameters->close_delay_us;
    forget_past(valve, start_us);
    struct valve_pulse *last = valve->count > 0 ? &valve->pulse[valve->count - 1] : NULL;
    if (last != NULL && seen_us >= last->open_at_us && seen_us < last->close_at_us && on_us > 0) {
        last->close_at_us = off_us; /* energised again before it had closed */
    } else if (on_us > parameters->open_delay_us && valve->count < VALVE_PULSES_MAX) {
        valve->pulse[valve->count++] = (struct valve_pulse){seen_us + parameters->open_delay_us, off_us};
    }
}

void valve_cut(struct valve *valve, const struct valve_parameters *parameters, int64_t time_us) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < valve->count; i++) {
        struct valve_pulse pulse = valve->pulse[i];
        if (pulse.open_at_us > time_us) {
            continue; /* de-energised before it had opened */
        }
        if (pulse.close_at_us > time_us + parameters->close_delay_us) {
            pulse.close_at_us = time_us + parameters->close_delay_us;
        }
        valve->pulse[kept++] = pulse;
    }
    valve->count = kept;
}

bool valve_fills(const struct valve *valve, int64_t time_us) {
    if (valve->stuck != VALVE_FREE) {
        return valve->stuck == VALVE_STUCK_FILLING;
    }
    for (uint32_t i = 0; i < valve->count; i++) {
        if (time_us >= valve->pulse[i].open_at_us && time_us < valve->pulse[i].close_at_us) {
            return true;
        }
    }
    return false;
}

int64_t valve_next_switch_us(const struct valve *valve, int64_t time_us) {
    if (valve->stuck != VALVE_FREE) {
        return INT64_MAX;
    }
    for (uint32_t i = 0; i < valve->count; i++) {
        if (time_us < valve->pulse[i].open_at_us) {
            return valve->pulse[i].open_at_us;
        }
        if (time_us < valve->pulse[i].close_at_us) {
            return valve->pulse[i].close_at_us;
        }
    }
    return INT64_MAX;
}
