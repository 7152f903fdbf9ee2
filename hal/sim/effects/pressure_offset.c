/* The zero of a pressure sensor is off by a constant. */
#include "sim/effect.h"

enum { OFFSET };

static void read(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->reading_pa[c] += parameter[OFFSET];
    }
}

static const struct effect_kind pressure_offset = {
    .name = "pressure_offset",
    .what = "a pressure sensor reads a constant too much",
    .signature = "readings and simulated pressures differ by the same amount vented and filled, while the "
                 "tip, simulated from the duties, is right; a sensor that clips at zero hides a negative "
                 "one while vented",
    .stage = EFFECT_STAGE_PRESSURE_SENSOR,
    .scope = EFFECT_EVERY_CHAMBER,
    .parameter_count = 1,
    .parameter = {[OFFSET] = {"offset", "Pa", -8000.0, 8000.0, 800.0, 0.0}},
    .reading = read};

EFFECT_REGISTER(pressure_offset);
