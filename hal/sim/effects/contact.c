/* Something stands in the way: beyond a bend in one direction, going on that way is harder by a factor. */
#include <math.h>

#include "sim/effect.h"

enum { DIRECTION, BEND, STIFFNESS };

#define CORNER_RAD 0.01 /* half the width over which it takes hold: nothing touches all at once */

/* Smooth max(0, value). */
static double beyond(double value) {
    if (value <= -CORNER_RAD) {
        return 0.0;
    }
    return value >= CORNER_RAD ? value : (value + CORNER_RAD) * (value + CORNER_RAD) / (4.0 * CORNER_RAD);
}

static void touch(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    struct body_shape *shape = signals->shape;
    const double x = cos(parameter[DIRECTION]), y = sin(parameter[DIRECTION]);
    const double towards_rad = shape->bend_x_rad * x + shape->bend_y_rad * y;
    const double held = parameter[STIFFNESS] / (1.0 + parameter[STIFFNESS]);
    const double back_rad = held * beyond(towards_rad - parameter[BEND]);
    shape->bend_x_rad -= back_rad * x;
    shape->bend_y_rad -= back_rad * y;
}

static const struct effect_kind contact = {
    .name = "contact",
    .what = "beyond a bend in one direction the module meets something and goes on less",
    .signature = "right up to a bend in one direction, then too little bend, in loading and unloading "
                 "alike; other directions are right. A recording that never gets there cannot show it",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 3,
    .parameter = {[DIRECTION] = {"direction", "rad", -M_PI, M_PI, 0.0, NAN},
                  [BEND] = {"bend", "rad", 0.05, 2.5, 0.6, NAN},
                  [STIFFNESS] = {"stiffness", "1", 0.0, 20.0, 2.0, 0.0}},
    .doubt = {[BEND] = 0.1, [STIFFNESS] = 0.4}, /* a wall that yields as round bodies do (Hertz 1882) */
    .shape = touch};

EFFECT_REGISTER(contact);
