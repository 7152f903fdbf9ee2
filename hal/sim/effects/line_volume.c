/* More air to fill than the plant's chambers and tubes have: longer tubes, fittings, a sensor's port. */
#include "sim/effect.h"

enum { VOLUME };

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->influence->extra_volume_m3[c] += parameter[VOLUME];
    }
}

static const struct effect_kind line_volume = {
    .name = "line_volume",
    .what = "there is more dead volume between valve and chamber",
    .signature = "pressure rises and falls slower and ripples less with the PWM, most so at low pressure, "
                 "where the chamber itself is small; where it ends is unchanged. Much like "
                 "line_resistance, which also holds back a full chamber",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_EVERY_CHAMBER,
    .parameter_count = 1,
    .parameter = {[VOLUME] = {"volume", "m3", 0.0, 8e-6, 1.5e-6, 0.0}},
    .gas = step};

EFFECT_REGISTER(line_volume);
