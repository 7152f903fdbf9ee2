/* The tip sensor's link drops samples, and the last pose is reported again in their place. */
#include <string.h>

#include "sim/effect.h"

enum { FRACTION };
enum { STARTED, LAST };

static void repeat(double *state, const double *parameter, struct effect_signals *signals) {
    if (state[STARTED] != 0.0 && signals->chance < parameter[FRACTION]) {
        memcpy(signals->pose, &state[LAST], sizeof *signals->pose);
        signals->repeats = true;
    }
    memcpy(&state[LAST], signals->pose, sizeof *signals->pose);
    state[STARTED] = 1.0;
}

static const struct effect_kind tip_freeze = {
    .name = "tip_freeze",
    .what = "now and then the tip sensor reports its last pose again",
    .signature = "samples that equal the one before to the last digit, while the tip moves; on average it "
                 "looks like a little latency",
    .stage = EFFECT_STAGE_TIP_SENSOR,
    .scope = EFFECT_GLOBAL,
    .by_chance = true,
    .parameter_count = 1,
    .parameter = {[FRACTION] = {"fraction", "1", 0.0, 0.9, 0.2, 0.0}},
    .pose = repeat};

EFFECT_REGISTER(tip_freeze);
