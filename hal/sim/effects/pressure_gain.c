/* The span of a pressure sensor is off by a factor. */
#include "sim/effect.h"

enum { GAIN };

static void read(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->reading_pa[c] *= parameter[GAIN];
    }
}

static const struct effect_kind pressure_gain = {
    .name = "pressure_gain",
    .what = "a pressure sensor reads a constant share too much",
    .signature = "readings and simulated pressures differ in proportion to the pressure, at any rate; "
                 "without the duties it is the same as another stiffness of the module (all chambers) or "
                 "another gain of a chamber (one)",
    .stage = EFFECT_STAGE_PRESSURE_SENSOR,
    .scope = EFFECT_EVERY_CHAMBER,
    .parameter_count = 1,
    .parameter = {[GAIN] = {"gain", "1", 0.7, 1.3, 1.05, 1.0}},
    .reading = read};

EFFECT_REGISTER(pressure_gain);
