/* Long or narrow tubes between valves and module. Flow elements in series are one of less conductance under
 * the same law (ISO 6358-3:2014), so the valve's conductance is scaled; over 1, the tubes are wider than
 * those it was measured with. */
#include "sim/effect.h"

enum { CONDUCTANCE_SCALE };

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->influence->conductance_scale[c] *= parameter[CONDUCTANCE_SCALE];
    }
}

static const struct effect_kind line_resistance = {
    .name = "line_resistance",
    .what = "the tubes let through a constant share of the air that they should",
    .signature = "chambers fill and vent slower by the same factor and end where they should; on a single "
                 "chamber it is the same as valve_sluggish. Unlike line_volume it slows large and small "
                 "chamber volumes alike",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_EVERY_CHAMBER,
    .parameter_count = 1,
    .parameter = {[CONDUCTANCE_SCALE] = {"conductance_scale", "1", 0.1, 1.2, 0.6, 1.0}},
    .gas = step};

EFFECT_REGISTER(line_resistance);
