/* One valve passes less air than the others, both ways: a worn seat, dirt, another specimen. */
#include "sim/effect.h"

enum { FLOW_SCALE };

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->influence->conductance_scale[c] *= parameter[FLOW_SCALE];
    }
}

static const struct effect_kind valve_sluggish = {
    .name = "valve_sluggish",
    .what = "one valve passes a constant share of the air that it should",
    .signature = "one chamber fills and vents slower by the same factor; where it ends is unchanged, for "
                 "one duty fills and vents through the same valve. The other chambers are right; if they "
                 "are not, it is line_resistance",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_ONE_CHAMBER,
    .parameter_count = 1,
    .parameter = {[FLOW_SCALE] = {"flow_scale", "1", 0.2, 1.2, 0.6, 1.0}},
    .gas = step};

EFFECT_REGISTER(valve_sluggish);
