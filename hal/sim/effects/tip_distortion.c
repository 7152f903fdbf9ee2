/* Metal near the field generator bends the field: poses are off by an amount that depends on where the tip is. The lowest
 * terms of a polynomial field (Kindratenko 2000 calibrates with polynomials): position and orientation each in proportion to
 * the distance along x and y, as a field with a slope has it, by the square of the distance from the module's axis, and by
 * the two squares that tell directions apart. A real field has all of them: they add up when one adds the effect in several
 * forms. */
#include <math.h>

#include "sim/effect.h"

enum { X, Y, Z };
enum { ROUND, ALONG_X, ALONG_Y, SADDLE, DIAGONAL, POSITION_FORMS, FORMS = 2 * POSITION_FORMS };

#define REACH_M 0.040 /* distance from the axis at which the parameters are the error */
#define TURN_PER_M 10.0 /* rad: what the parameter of an orientation's form means at that distance */
#define SMALL_RAD 1e-9

static double share_of(const double position_m[3], size_t form) {
    const double x = position_m[0] / REACH_M, y = position_m[1] / REACH_M;
    switch (form) {
    case ALONG_X:
        return x;
    case ALONG_Y:
        return y;
    case SADDLE:
        return x * x - y * y;
    case DIAGONAL:
        return 2.0 * x * y;
    case ROUND:
    default:
        return x * x + y * y;
    }
}

/* Rotation vector `r` in the base frame, times the quaternion `q`. */
static void turn(const double r[3], double q[4]) {
    const double angle = sqrt(r[X] * r[X] + r[Y] * r[Y] + r[Z] * r[Z]);
    const double along = angle < SMALL_RAD ? 0.5 : sin(0.5 * angle) / angle;
    const double w = cos(0.5 * angle), x = along * r[X], y = along * r[Y], z = along * r[Z];
    const double turned[4] = {w * q[0] - x * q[1] - y * q[2] - z * q[3], w * q[1] + x * q[0] + y * q[3] - z * q[2],
                              w * q[2] - x * q[3] + y * q[0] + z * q[1], w * q[3] + x * q[2] - y * q[1] + z * q[0]};
    for (int i = 0; i < 4; i++) {
        q[i] = turned[i];
    }
}

static void move(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    double *position_m = signals->pose->position_m;
    if (signals->form >= POSITION_FORMS) {
        const double share = TURN_PER_M * share_of(position_m, signals->form - POSITION_FORMS);
        const double rotation[3] = {share * parameter[X], share * parameter[Y], share * parameter[Z]};
        turn(rotation, signals->pose->quaternion);
        return;
    }
    const double share = share_of(position_m, signals->form);
    for (int i = X; i <= Z; i++) {
        position_m[i] += parameter[i] * share;
    }
}

static const struct effect_kind tip_distortion = {
    .name = "tip_distortion",
    .what = "poses of the tip are off by an amount that grows with its distance from the module's axis",
    .signature = "poses are right at rest and off in a fixed direction of the base frame when the tip is far out, whatever "
                 "pressure, rate or history took it there; position and orientation do not agree with any bend of the body",
    .stage = EFFECT_STAGE_TIP_SENSOR,
    .scope = EFFECT_GLOBAL,
    .forms = FORMS,
    .forms_add = true,
    .form_what = {"position, by the square of the distance from the axis", "position, in proportion to x",
                  "position, in proportion to y", "position, by x squared less y squared", "position, by 2 x y",
                  "orientation (10 mrad for 1 mm), by the square of the distance",
                  "orientation (10 mrad for 1 mm), in proportion to x", "orientation (10 mrad for 1 mm), in proportion to y",
                  "orientation (10 mrad for 1 mm), by x squared less y squared", "orientation (10 mrad for 1 mm), by 2 x y"},
    .parameter_count = 3,
    .parameter = {[X] = {"x", "m", -0.02, 0.02, 1e-3, 0.0},
                  [Y] = {"y", "m", -0.02, 0.02, 1e-3, 0.0},
                  [Z] = {"z", "m", -0.02, 0.02, 1e-3, 0.0}},
    .pose = move};

EFFECT_REGISTER(tip_distortion);
