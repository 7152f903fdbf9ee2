/* The tip sensor's base is not where the module's base frame is: positions are off by a constant. */
#include "sim/effect.h"

enum { X, Y, Z };

static void move(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (int i = X; i <= Z; i++) {
        signals->pose->position_m[i] += parameter[i];
    }
}

static const struct effect_kind tip_offset = {
    .name = "tip_offset",
    .what = "positions of the tip are off by a constant in the base frame",
    .signature = "the same difference of position at rest and in every pose, at any pressure and time; "
                 "orientations are right. An offset along the axis is also that of a longer module",
    .stage = EFFECT_STAGE_TIP_SENSOR,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 3,
    .parameter = {[X] = {"x", "m", -0.02, 0.02, 1e-3, 0.0},
                  [Y] = {"y", "m", -0.02, 0.02, 1e-3, 0.0},
                  [Z] = {"z", "m", -0.02, 0.02, 1e-3, 0.0}},
    .pose = move};

EFFECT_REGISTER(tip_offset);
