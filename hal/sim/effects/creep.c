/* Viscoelastic creep: under a held pressure the silicone goes on yielding (Ferry 1980). Form 0: the bend grows by a share of
 * itself with one time constant (standard linear solid). Form 1: with a broad spectrum of them, six times shorter and
 * longer ones in equal parts. Form 2: the rubber's stiffness relaxes with one time constant, so that the module bends as
 * under a higher pressure: near 90 degrees that bends it several times as much. */
#include <math.h>

#include "sim/effect.h"

enum { AMPLITUDE, TIME_CONSTANT };
enum { ONE_TIME, SPECTRUM, STIFFNESS };
enum { TERMS = 3, SIGNALS = 3 };

#define SPREAD 6.0 /* of the spectrum's time constants */

/* Crept amounts follow amplitude times the elastic ones; exact for an elastic shape that holds over the step. */
static double creep_on(double *crept, double elastic, double step_s, double time_constant_s, double amplitude) {
    const double kept = exp(-step_s / time_constant_s);
    *crept = kept * *crept + (1.0 - kept) * amplitude * elastic;
    return *crept;
}

static void bend(double *state, const double *parameter, struct effect_signals *signals) {
    struct body_shape *shape = signals->shape;
    const double elastic[SIGNALS] = {shape->bend_x_rad, shape->bend_y_rad, shape->stretch - 1.0};
    const size_t terms = signals->form == SPECTRUM ? TERMS : 1;
    double grown[SIGNALS] = {0.0, 0.0, 0.0};
    for (size_t k = 0; k < terms && signals->form != STIFFNESS; k++) {
        const double time_s = parameter[TIME_CONSTANT] * (terms > 1 ? pow(SPREAD, (double)k - 1.0) : 1.0);
        for (size_t i = 0; i < SIGNALS; i++) {
            grown[i] += creep_on(&state[SIGNALS * k + i], elastic[i], signals->step_s, time_s,
                                 parameter[AMPLITUDE] / (double)terms);
        }
    }
    shape->bend_x_rad += grown[0];
    shape->bend_y_rad += grown[1];
    shape->stretch += grown[2];
}

static void load(double *state, const double *parameter, struct effect_signals *signals) {
    for (size_t c = 0; c < 3 && signals->form == STIFFNESS; c++) {
        signals->load_pa[c] += creep_on(&state[c], signals->load_pa[c], signals->step_s, parameter[TIME_CONSTANT],
                                        parameter[AMPLITUDE]);
    }
}

static const struct effect_kind creep = {
    .name = "creep",
    .what = "the module goes on yielding under a held pressure",
    .signature = "the residual lags the bend, grows over a hold and goes on after venting; no dependence on the path beyond that",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .forms = 3,
    .form_what = {"the bend, with one time constant", "the bend, with a broad spectrum of time constants",
                  "the stiffness, with one time constant"},
    .remembers = true,
    .parameter_count = 2,
    .parameter = {[AMPLITUDE] = {"amplitude", "1", 0.0, 0.5, 0.1, 0.0},
                  [TIME_CONSTANT] = {"time_constant", "s", 0.05, 600.0, 3.0, NAN}},
    .doubt = {[AMPLITUDE] = 0.3, [TIME_CONSTANT] = 0.7}, /* stretched exponentials, powers of time (Findley 1976) */
    .load = load,
    .shape = bend};

EFFECT_REGISTER(creep);
