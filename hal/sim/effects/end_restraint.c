/* The rigid ends hold the rubber beside them: a part of the length does not bend (or, over 1, a cap that
 * gives bends as well). The rest has the same curvature. */
#include "sim/effect.h"

enum { FRACTION };

static void restrain(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    signals->shape->bend_x_rad *= parameter[FRACTION];
    signals->shape->bend_y_rad *= parameter[FRACTION];
    signals->shape->active_fraction *= parameter[FRACTION];
}

static const struct effect_kind end_restraint = {
    .name = "end_restraint",
    .what = "only a fraction of the length bends, the rest is straight, half of it at either end",
    .signature = "bend is too small by the same share in every pose, at any rate, and positions are those "
                 "of a shorter arc with longer caps. Without positions it is the same as an error of "
                 "stiffness while bend is proportional to pressure",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 1,
    .parameter = {[FRACTION] = {"fraction", "1", 0.7, 1.15, 0.93, 1.0}},
    .doubt = {[FRACTION] = 0.05}, /* how gradually the bend ends */
    .shape = restrain};

EFFECT_REGISTER(end_restraint);
