/* Viscoelastic creep: under a held pressure the silicone goes on yielding, so the bend grows by a share of itself with
 * one time constant (the creep of a standard linear solid, Ferry 1980). Acts on the bend and on the lengthening alike. */
#include <math.h>

#include "sim/effect.h"

enum { AMPLITUDE, TIME_CONSTANT };
enum { CREPT_X, CREPT_Y, CREPT_STRETCH };

/* Crept amounts follow amplitude times the elastic ones; exact for an elastic shape that holds over the step. */
static void step(double *state, const double *parameter, struct effect_signals *signals) {
    struct body_shape *shape = signals->shape;
    const double kept = exp(-signals->step_s / parameter[TIME_CONSTANT]);
    const double elastic[3] = {shape->bend_x_rad, shape->bend_y_rad, shape->stretch - 1.0};
    for (int i = CREPT_X; i <= CREPT_STRETCH; i++) {
        state[i] = kept * state[i] + (1.0 - kept) * parameter[AMPLITUDE] * elastic[i];
    }
    shape->bend_x_rad += state[CREPT_X];
    shape->bend_y_rad += state[CREPT_Y];
    shape->stretch += state[CREPT_STRETCH];
}

static const struct effect_kind creep = {
    .name = "creep",
    .what = "the bend under a held pressure grows by a share of itself with one time constant",
    .signature = "the residual lags the bend, grows over a hold and goes on after venting; no dependence on the path beyond that",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 2,
    .parameter = {[AMPLITUDE] = {"amplitude", "1", 0.0, 0.5, 0.1, 0.0},
                  [TIME_CONSTANT] = {"time_constant", "s", 0.05, 600.0, 3.0, NAN}},
    .shape = step};

EFFECT_REGISTER(creep);
