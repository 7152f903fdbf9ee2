/* A share of a neighbour's pressure stands in a chamber on top of its own: a leaking or thin wall between the
 * two. `side` says which neighbour: 1 the next chamber (1 -> 2 -> 3 -> 1), 0 the previous one, between them
 * both in that proportion. */
#include "sim/effect.h"

enum { FRACTION, SIDE };

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        double *share = signals->influence->coupling[c];
        share[(c + 1) % 3] += parameter[FRACTION] * parameter[SIDE];
        share[(c + 2) % 3] += parameter[FRACTION] * (1.0 - parameter[SIDE]);
    }
}

static const struct effect_kind cross_coupling = {
    .name = "cross_coupling",
    .what = "a share of a neighbour's pressure stands in a chamber on top of its own",
    .signature = "a chamber's pressure follows its neighbour's, at once and in proportion, even while its "
                 "own valve rests; only seen where chambers are not driven alike. Driven alike it is the "
                 "same as pressure_gain",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_EVERY_CHAMBER,
    .parameter_count = 2,
    .parameter =
        {[FRACTION] = {"fraction", "1", 0.0, 0.2, 0.05, 0.0}, [SIDE] = {"side", "1", 0.0, 1.0, 1.0, NAN}},
    .gas = step};

EFFECT_REGISTER(cross_coupling);
