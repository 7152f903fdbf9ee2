/* From the command to the coil, or from the coil to the air, a time passes that the plant's valve does not
 * have: a bus, a driver, a pilot stage. Pulses keep their length. */
#include "sim/effect.h"

enum { DELAY };

static void command(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->late_s[c] += parameter[DELAY];
    }
}

static const struct effect_kind valve_dead_time = {
    .name = "valve_dead_time",
    .what = "a valve sees its pulses late",
    .signature = "pressures are the simulated ones, shifted in time: filling and venting alike, whatever "
                 "the size of the step; on slow ramps the same as pressure_lag",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_EVERY_CHAMBER,
    .delays = true,
    .parameter_count = 1,
    .parameter = {[DELAY] = {"delay", "s", 0.0, 0.06, 0.01, 0.0}},
    .doubt = {[DELAY] = 0.02},
    .command = command};

EFFECT_REGISTER(valve_dead_time);
