/* Metal near the field generator bends the field: positions are off by an amount that depends on where the tip is. The
 * lowest terms of a polynomial field (Kindratenko 2000 calibrates with polynomials): form 0, by the square of the distance
 * from the module's axis; form 1 and 2, in proportion to the distance along x or y, as a field with a slope has it. A real
 * field has all of them: they add up when one adds the effect in several forms. */
#include "sim/effect.h"

enum { X, Y, Z };
enum { ROUND, ALONG_X, ALONG_Y };

#define REACH_M 0.040 /* distance from the axis at which the parameters are the error */

static void move(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    double *position_m = signals->pose->position_m;
    const double x = position_m[0] / REACH_M, y = position_m[1] / REACH_M;
    const double share = signals->form == ROUND ? x * x + y * y : signals->form == ALONG_X ? x : y;
    for (int i = X; i <= Z; i++) {
        position_m[i] += parameter[i] * share;
    }
}

static const struct effect_kind tip_distortion = {
    .name = "tip_distortion",
    .what = "positions of the tip are off by an amount that grows with its distance from the module's axis",
    .signature = "positions are right at rest and off in a fixed direction of the base frame when the tip "
                 "is far out, whatever pressure, rate or history took it there; orientations are right",
    .stage = EFFECT_STAGE_TIP_SENSOR,
    .scope = EFFECT_GLOBAL,
    .forms = 3,
    .forms_add = true,
    .form_what = {"by the square of the distance from the axis", "in proportion to x", "in proportion to y"},
    .parameter_count = 3,
    .parameter = {[X] = {"x", "m", -0.02, 0.02, 1e-3, 0.0},
                  [Y] = {"y", "m", -0.02, 0.02, 1e-3, 0.0},
                  [Z] = {"z", "m", -0.02, 0.02, 1e-3, 0.0}},
    .pose = move};

EFFECT_REGISTER(tip_distortion);
