/* A share of a neighbour's pressure stands in a chamber on top of its own. Form 0: a thin wall, at once and in proportion;
 * `side` says which neighbour: 1 the next chamber (1 -> 2 -> 3 -> 1), 0 the previous one, between them both in that
 * proportion. Form 1: a leak through the wall between a chamber and the next, laminar, so wide that a chamber that its
 * valve vents stands at that share of a neighbour's REFERENCE_PA. */
#include <math.h>

#include "sim/effect.h"

enum { FRACTION, SIDE };
enum { WALL, LEAK };

#define REFERENCE_PA 6000.0
#define AMBIENT_PA_ABS 101325.0
#define VENT_CONDUCTANCE 2e-10 /* of a valve and its tube, m3/(s Pa) */
#define REFERENCE_DENSITY 1.185
#define CRITICAL_RATIO 0.3

/* kg/(s Pa): what leaves through the vent at that share comes through the wall (ISO 6358-1:2013). */
static double bridge_of(double fraction) {
    const double up_pa = AMBIENT_PA_ABS + fraction * REFERENCE_PA;
    const double beyond = (AMBIENT_PA_ABS / up_pa - CRITICAL_RATIO) / (1.0 - CRITICAL_RATIO);
    const double vented = VENT_CONDUCTANCE * REFERENCE_DENSITY * up_pa * sqrt(fmax(1.0 - beyond * beyond, 0.0));
    return vented / (REFERENCE_PA * (1.0 - fraction));
}

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3 && signals->form == LEAK; c++) {
        signals->influence->bridge_kgpspa[c] += bridge_of(parameter[FRACTION]);
    }
    for (size_t c = 0; c < 3 && signals->form == WALL; c++) {
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
    .forms = 2,
    .form_what = {"a thin wall: at once and in proportion", "a leak to the next chamber: the pressures drift together"},
    .parameter_count = 2,
    .parameter =
        {[FRACTION] = {"fraction", "1", 0.0, 0.2, 0.05, 0.0}, [SIDE] = {"side", "1", 0.0, 1.0, 1.0, NAN}},
    .gas = step};

EFFECT_REGISTER(cross_coupling);
