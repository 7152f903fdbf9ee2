/* The tip sensor's poses are older than their times say. Past poses wait in a ring; the one of `delay` ago is
 * read from it on a cubic through its neighbours (Catmull and Rom 1974, for uneven times), so that it is
 * smooth in the delay. */
#include <math.h>
#include <string.h>

#include "sim/effect.h"

enum { DELAY };
enum { COUNT, NEWEST, RING };
enum { TIME, POSE, POSE_DOUBLES = 7, ENTRY_DOUBLES = POSE + POSE_DOUBLES };

#define ENTRIES 39
#define DELAY_MOST_S 0.15
/* Least time between settled entries: the ring then reaches back DELAY_MOST_S at any rate. */
#define SPACING_S 0.0041

_Static_assert(RING + ENTRIES * ENTRY_DOUBLES <= EFFECT_STATE_DOUBLES, "the ring fits the state");
_Static_assert(sizeof(struct tip_pose) == POSE_DOUBLES * sizeof(double), "a pose is its numbers");

/* The entry `back` samples before the newest. */
static double *entry(double *state, size_t back) {
    const size_t at = ((size_t)state[NEWEST] + ENTRIES - back) % ENTRIES;
    return &state[RING + at * ENTRY_DOUBLES];
}

/* Of the two quaternions of an orientation, the one near the last. */
static void match_sign(const double *last, double *newest) {
    double dot = 0.0;
    for (size_t i = 3; i < POSE_DOUBLES; i++) {
        dot += last[POSE + i] * newest[POSE + i];
    }
    for (size_t i = 3; i < POSE_DOUBLES && dot < 0.0; i++) {
        newest[POSE + i] = -newest[POSE + i];
    }
}

/* The newest entry gives way to the next pose while it is too near the one before. */
static void remember(double *state, double time_s, const struct tip_pose *pose) {
    const bool crowded = state[COUNT] >= 2.0 && entry(state, 0)[TIME] - entry(state, 1)[TIME] < SPACING_S;
    if (!crowded) {
        state[NEWEST] = fmod(state[NEWEST] + 1.0, ENTRIES);
        state[COUNT] = fmin(state[COUNT] + 1.0, ENTRIES);
    }
    double *newest = entry(state, 0);
    newest[TIME] = time_s;
    memcpy(&newest[POSE], pose, sizeof *pose);
    if (state[COUNT] >= 2.0) {
        match_sign(entry(state, 1), newest);
    }
}

/* Slope at `middle` of the parabola through three entries. */
static double slope(const double *before, const double *middle, const double *after, size_t i) {
    const double left_s = middle[TIME] - before[TIME], right_s = after[TIME] - middle[TIME];
    const double left = (middle[POSE + i] - before[POSE + i]) / left_s;
    const double right = (after[POSE + i] - middle[POSE + i]) / right_s;
    return (left * right_s + right * left_s) / (left_s + right_s);
}

/* Between the entries `back` + 1 and `back`; a parabola at an end of the ring, a line between the only two.
 */
static void read_between(double *state, size_t back, double time_s, struct tip_pose *pose) {
    const bool has_before = back + 2 < (size_t)state[COUNT], has_after = back > 0;
    const double *p1 = entry(state, back + 1), *p2 = entry(state, back);
    const double length_s = p2[TIME] - p1[TIME], at = (time_s - p1[TIME]) / length_s;
    double value[POSE_DOUBLES], square = 0.0;
    for (size_t i = 0; i < POSE_DOUBLES; i++) {
        const double rise = p2[POSE + i] - p1[POSE + i];
        double start = has_before ? length_s * slope(entry(state, back + 2), p1, p2, i) : rise;
        double end = has_after ? length_s * slope(p1, p2, entry(state, back - 1), i) : rise;
        start = !has_before && has_after ? 2.0 * rise - end : start;
        end = has_before && !has_after ? 2.0 * rise - start : end;
        value[i] = p1[POSE + i] +
                   at * (start + at * ((3.0 * rise - 2.0 * start - end) + at * (start + end - 2.0 * rise)));
        square += i >= 3 ? value[i] * value[i] : 0.0;
    }
    for (size_t i = 3; i < POSE_DOUBLES; i++) {
        value[i] /= sqrt(square);
    }
    memcpy(pose, value, sizeof *pose);
}

static void delay(double *state, const double *parameter, struct effect_signals *signals) {
    const double wanted_s = signals->time_s - parameter[DELAY];
    if (signals->aged) {
        return;
    }
    remember(state, signals->time_s, signals->pose);
    if (wanted_s >= signals->time_s) {
        return;
    }
    const size_t count = (size_t)state[COUNT];
    size_t back = 0;
    while (back + 1 < count && entry(state, back + 1)[TIME] > wanted_s) {
        back++;
    }
    if (back + 1 < count) {
        read_between(state, back, wanted_s, signals->pose);
    } else {
        /* from before it began: as it then was */
        memcpy(signals->pose, &entry(state, back)[POSE], sizeof *signals->pose);
    }
}

static double age_s(const double *parameter) {
    return parameter[DELAY];
}

static const struct effect_kind tip_latency = {
    .name = "tip_latency",
    .what = "the tip sensor's poses are older than their times say",
    .signature = "the difference follows the tip's velocity, in position and orientation alike, and "
                 "vanishes in every hold; pressures are right. Of the body's effects creep is nearest, "
                 "which has a tail",
    .stage = EFFECT_STAGE_TIP_SENSOR,
    .scope = EFFECT_GLOBAL,
    .delays = true,
    .parameter_count = 1,
    .parameter = {[DELAY] = {"delay", "s", 0.0, DELAY_MOST_S, 0.03, 0.0}},
    .age_s = age_s,
    .pose = delay};

EFFECT_REGISTER(tip_latency);
