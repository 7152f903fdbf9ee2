/* Two frames that do not meet: form 0, the sensor sits at an angle on the tip (a rotation vector in the tip's frame); form 1,
 * the transmitter stands at an angle to the module's base, so that positions turn as well (in the base frame). */
#include <math.h>

#include "sim/effect.h"

enum { X, Y, Z };
enum { SENSOR, TRANSMITTER };

#define SMALL_RAD 1e-6 /* below it sin(a / 2) / a is a half to double precision */

/* The pose seen from a frame that is turned: rotation times position and orientation. */
static void turn_all(const double r[4], struct tip_pose *pose) {
    const double *q = pose->quaternion, *p = pose->position_m;
    const double turned[4] = {r[0] * q[0] - r[1] * q[1] - r[2] * q[2] - r[3] * q[3],
                              r[0] * q[1] + r[1] * q[0] + r[2] * q[3] - r[3] * q[2],
                              r[0] * q[2] - r[1] * q[3] + r[2] * q[0] + r[3] * q[1],
                              r[0] * q[3] + r[1] * q[2] - r[2] * q[1] + r[3] * q[0]};
    const double cross[3] = {r[2] * p[2] - r[3] * p[1], r[3] * p[0] - r[1] * p[2], r[1] * p[1] - r[2] * p[0]};
    const double again[3] = {r[2] * cross[2] - r[3] * cross[1], r[3] * cross[0] - r[1] * cross[2],
                             r[1] * cross[1] - r[2] * cross[0]};
    for (int i = 0; i < 3; i++) {
        pose->position_m[i] += 2.0 * (r[0] * cross[i] + again[i]);
    }
    for (int i = 0; i < 4; i++) {
        pose->quaternion[i] = turned[i];
    }
}

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
    if (signals->form == TRANSMITTER) {
        const double left[4] = {w, x, y, z};
        turn_all(left, signals->pose);
        return;
    }
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
    .forms = 2,
    .form_what = {"the sensor sits at an angle on the tip", "the transmitter stands at an angle to the base"},
    .parameter_count = 3,
    .parameter = {[X] = {"x", "rad", -0.5, 0.5, 0.05, 0.0},
                  [Y] = {"y", "rad", -0.5, 0.5, 0.05, 0.0},
                  [Z] = {"z", "rad", -0.5, 0.5, 0.05, 0.0}},
    .pose = turn};

EFFECT_REGISTER(tip_misalignment);
