/* The tip sensor sits at an angle on the tip: a constant rotation, as a rotation vector in the tip's frame.
 */
#include <math.h>

#include "sim/effect.h"

enum { X, Y, Z };

#define SMALL_RAD 1e-6 /* below it sin(a / 2) / a is a half to double precision */

/* q times the quaternion of the rotation. */
static void turn(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    const double *r = parameter;
    double *q = signals->pose->quaternion;
    const double angle = sqrt(r[X] * r[X] + r[Y] * r[Y] + r[Z] * r[Z]);
    const double along = angle < SMALL_RAD ? 0.5 : sin(0.5 * angle) / angle;
    const double w = cos(0.5 * angle), x = along * r[X], y = along * r[Y], z = along * r[Z];
    const double turned[4] = {
        q[0] * w - q[1] * x - q[2] * y - q[3] * z, q[0] * x + q[1] * w + q[2] * z - q[3] * y,
        q[0] * y - q[1] * z + q[2] * w + q[3] * x, q[0] * z + q[1] * y - q[2] * x + q[3] * w};
    for (int i = 0; i < 4; i++) {
        q[i] = turned[i];
    }
}

static const struct effect_kind tip_misalignment = {
    .name = "tip_misalignment",
    .what = "the tip sensor sits at a constant angle on the tip",
    .signature = "orientations are off by the same rotation in the tip's frame at rest and in every pose; "
                 "positions are right. Without orientation in the recording it cannot be seen",
    .stage = EFFECT_STAGE_TIP_SENSOR,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 3,
    .parameter = {[X] = {"x", "rad", -0.5, 0.5, 0.05, 0.0},
                  [Y] = {"y", "rad", -0.5, 0.5, 0.05, 0.0},
                  [Z] = {"z", "rad", -0.5, 0.5, 0.05, 0.0}},
    .pose = turn};

EFFECT_REGISTER(tip_misalignment);
