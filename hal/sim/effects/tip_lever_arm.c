/* The tip sensor does not sit at the centre of the tip face: its position is that of a point fixed to the
 * tip, given in the tip's frame. */
#include "sim/effect.h"

enum { X, Y, Z };

/* v + 2 q x (q x v + w v), q the vector part. */
static void move(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    const double *v = parameter, *q = signals->pose->quaternion;
    const double t[3] = {q[2] * v[Z] - q[3] * v[Y] + q[0] * v[X], q[3] * v[X] - q[1] * v[Z] + q[0] * v[Y],
                         q[1] * v[Y] - q[2] * v[X] + q[0] * v[Z]};
    double *position_m = signals->pose->position_m;
    position_m[0] += v[X] + 2.0 * (q[2] * t[2] - q[3] * t[1]);
    position_m[1] += v[Y] + 2.0 * (q[3] * t[0] - q[1] * t[2]);
    position_m[2] += v[Z] + 2.0 * (q[1] * t[1] - q[2] * t[0]);
}

static const struct effect_kind tip_lever_arm = {
    .name = "tip_lever_arm",
    .what = "the tip sensor sits beside or before the centre of the tip face",
    .signature = "positions are off by an amount of constant size that turns with the tip; orientations "
                 "are right. While the tip hardly turns it is the same as tip_offset; an arm along the "
                 "axis is a longer cap",
    .stage = EFFECT_STAGE_TIP_SENSOR,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 3,
    .parameter = {[X] = {"x", "m", -0.04, 0.04, 5e-3, 0.0},
                  [Y] = {"y", "m", -0.04, 0.04, 5e-3, 0.0},
                  [Z] = {"z", "m", -0.04, 0.04, 5e-3, 0.0}},
    .pose = move};

EFFECT_REGISTER(tip_lever_arm);
