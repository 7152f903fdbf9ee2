/* An effect of one's own: a joint between module and base that gives a little before it holds, so that the tip turns further
 * by up to `slack` in the direction in which it bends. See docs/gap.md on how to build it in. */
#include <math.h>

#include "sim/effect.h"

enum { SLACK };

static void turn_further(double *state, const double *parameter, struct effect_signals *signals) {
    struct body_shape *shape = signals->shape;
    const double bend_rad = hypot(shape->bend_x_rad, shape->bend_y_rad);
    (void)state;
    if (bend_rad > 0.0) {
        const double share = 1.0 + parameter[SLACK] * tanh(bend_rad / 0.1) / bend_rad; /* taken up within 0.1 rad */
        shape->bend_x_rad *= share;
        shape->bend_y_rad *= share;
    }
}

static const struct effect_kind joint_slack = {
    .name = "joint_slack",
    .what = "the joint at the base gives a little before it holds",
    .signature = "the same angle too much at every bend but the smallest",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 1,
    .parameter = {[SLACK] = {"slack", "rad", 0.0, 0.5, 0.05, 0.0}},
    .shape = turn_further};

EFFECT_REGISTER(joint_slack);
