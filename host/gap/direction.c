#include "gap/direction.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gap/noise_floor.h"

#define DEGREES (180.0 / M_PI)
#define BLOCK_S REPLAY_TIP_BLOCK_S
#define STEP_BLOCKS 10     /* a step is over within half a second .. */
#define STEP_SHARE 0.12    /* .. and changes the bend by this share of the greatest */
#define SETTLED_BLOCKS 4   /* after it the bend stays, for a start .. */
#define SETTLED_SHARE 0.05 /* .. within this share, */
#define HELD_SHARE 0.08    /* and for as long as the hold lasts within this */
#define LOADED_SHARE 0.12  /* holds of less bend are rests */
#define LEAST_BLOCKS 20    /* one second */
#define AFTER_BLOCKS 4     /* just after the step */
#define END_BLOCKS 6       /* at the end of the hold */
#define LEAST_BEND_RAD (2.0 / DEGREES)
#define TAU_FIRST_S 0.1
#define TAU_FACTOR 1.05
#define TAU_HOLDS 2.0      /* a time constant longer than two holds cannot be told from a drift */
#define CLEAR_SIGMAS 4.0   /* the change over a hold must exceed its own scatter by this, to count as one */
#define SMALL_RAD (0.05 / DEGREES)

/* Bends by tip block; NAN where nothing was measured. */
struct bends {
    size_t count;
    double *measured;
    double *nominal;
    double *best;
};

static void axis_after(const double rotation[3], const double axis[3], double turned[3]) {
    /* Rodrigues */
    const double angle = sqrt(rotation[0] * rotation[0] + rotation[1] * rotation[1] + rotation[2] * rotation[2]);
    const double s = angle > 1e-12 ? sin(angle) / angle : 1.0, c = cos(angle);
    const double along = angle > 1e-12 ? (1.0 - c) / (angle * angle) : 0.5;
    const double dot = rotation[0] * axis[0] + rotation[1] * axis[1] + rotation[2] * axis[2];
    for (size_t k = 0; k < 3; k++) {
        const size_t i = (k + 1) % 3, j = (k + 2) % 3;
        turned[k] = c * axis[k] + s * (rotation[i] * axis[j] - rotation[j] * axis[i]) + along * dot * rotation[k];
    }
}

static double lean_of(const double axis[3]) {
    return atan2(hypot(axis[0], axis[1]), axis[2]);
}

/* An arc of constant curvature that ends there, and is tangent to z where it starts. */
static double bend_to(const double position[3]) {
    return 2.0 * atan2(hypot(position[0], position[1]), position[2]);
}

/* Bend of a model: the measured pose with the residual taken off. */
static double simulated(const struct replay *replay, size_t at, const double *residual, bool orientation,
                        const double pose[3]) {
    double off[3], turned[3];
    for (size_t k = 0; k < 3; k++) {
        const size_t channel = at + (orientation ? 3 : 0) + k;
        off[k] = -residual[channel] / replay->weight[channel];
        turned[k] = pose[k] + off[k];
    }
    if (orientation) {
        axis_after(off, pose, turned);
        return lean_of(turned);
    }
    return bend_to(turned);
}

/* Mean axis or position of the samples of each block; [3 * tip_blocks], and how many. */
static void sum_poses(const struct replay_run *run, bool orientation, double *pose, double *samples) {
    const double start_s = 1e-6 * (double)run->start_us;
    for (size_t i = 0; i < run->run->tips; i++) {
        const struct gap_tip *tip = &run->run->tip[i];
        const double since_s = tip->time_s - start_s, *q = tip->quaternion;
        const size_t b = since_s > 0.0 ? (size_t)(since_s / BLOCK_S) : 0;
        const double axis[3] = {2.0 * (q[1] * q[3] + q[0] * q[2]), 2.0 * (q[2] * q[3] - q[0] * q[1]),
                                1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])};
        if (b >= run->tip_blocks || (orientation && isnan(q[0]))) {
            continue;
        }
        for (size_t k = 0; k < 3; k++) {
            pose[3 * b + k] += orientation ? axis[k] : tip->position_m[k];
        }
        samples[b] += 1.0;
    }
}

static bool fill_bends(const struct replay *replay, size_t index, const double *nominal, const double *best,
                       struct bends *bends) {
    const struct replay_run *run = &replay->run[index];
    const bool orientation = run->run->has_orientation;
    double *pose = calloc(4 * run->tip_blocks + 1, sizeof *pose);
    if (pose == NULL) {
        return false;
    }
    double *samples = pose + 3 * run->tip_blocks;
    sum_poses(run, orientation, pose, samples);
    for (size_t b = 0; b < run->tip_blocks; b++) {
        const size_t at = run->tip_at + REPLAY_TIP_CHANNELS * b;
        const bool seen = samples[b] > 0.0 && replay->weight[at + (orientation ? 3 : 0)] > 0.0;
        bends->measured[b] = bends->nominal[b] = bends->best[b] = NAN;
        for (size_t k = 0; k < 3 && seen; k++) {
            pose[3 * b + k] /= samples[b];
        }
        if (seen) {
            bends->measured[b] = orientation ? lean_of(pose + 3 * b) : bend_to(pose + 3 * b);
            bends->nominal[b] = simulated(replay, at, nominal, orientation, pose + 3 * b);
            bends->best[b] = simulated(replay, at, best, orientation, pose + 3 * b);
        }
    }
    bends->count = run->tip_blocks;
    free(pose);
    return true;
}

/* --- holds --- */

static bool steps_to(const double *bend, size_t b, double most) {
    bool steps = false;
    for (size_t k = 1; k <= STEP_BLOCKS && k <= b; k++) {
        steps = steps || fabs(bend[b] - bend[b - k]) > STEP_SHARE * most;
    }
    return steps;
}

/* Does it stay there from now on, within a share of the greatest? A block without samples changes nothing. */
static bool stays(const double *bend, size_t from, size_t until, double level, double within) {
    for (size_t b = from; b < until; b++) {
        if (fabs(bend[b] - level) > within) {
            return false;
        }
    }
    return true;
}

static double mean(const double *measured, const double *simulated, size_t from, size_t until) {
    double sum = 0.0, count = 0.0;
    for (size_t b = from; b < until; b++) {
        const double value = measured[b] - (simulated != NULL ? simulated[b] : 0.0);
        sum += isnan(value) ? 0.0 : value;
        count += !isnan(value);
    }
    return count > 0.0 ? sum / count : NAN;
}

/* Straight line through values against u: value = base + change u. Returns the sum of squares that it leaves. */
static double fit_line(const double *value, const double *u, size_t count, double *change, double *spread) {
    double su = 0.0, sv = 0.0, suu = 0.0, suv = 0.0, svv = 0.0, n = 0.0;
    for (size_t i = 0; i < count; i++) {
        if (!isnan(value[i])) {
            su += u[i];
            sv += value[i];
            suu += u[i] * u[i];
            suv += u[i] * value[i];
            svv += value[i] * value[i];
            n += 1.0;
        }
    }
    const double uu = suu - su * su / n, uv = suv - su * sv / n, vv = svv - sv * sv / n;
    *change = uu > 0.0 ? uv / uu : 0.0;
    const double left = fmax(vv - *change * uv, 0.0);
    *spread = uu > 0.0 && n > 3.0 ? sqrt(left / (n - 3.0) / uu) : INFINITY;
    return left;
}

/* Time constant of one exponential, by search over it; the rest is linear. NAN: none shows. */
static double time_constant(const double *value, size_t count) {
    double *u = calloc(count + 1, sizeof *u), least = INFINITY, found_s = NAN;
    const double longest_s = TAU_HOLDS * BLOCK_S * (double)count;
    for (double tau_s = TAU_FIRST_S; tau_s < longest_s && u != NULL; tau_s *= TAU_FACTOR) {
        double change, spread;
        for (size_t i = 0; i < count; i++) {
            u[i] = 1.0 - exp(-BLOCK_S * (double)i / tau_s);
        }
        const double left = fit_line(value, u, count, &change, &spread);
        if (left < least) {
            least = left;
            found_s = fabs(change) > CLEAR_SIGMAS * spread && fabs(change) > SMALL_RAD ? tau_s : NAN;
        }
    }
    free(u);
    /* at either end of the search the hold does not say */
    return found_s > TAU_FIRST_S && found_s * TAU_FACTOR < longest_s ? found_s : NAN;
}

static void take_hold(struct direction *direction, const struct replay *replay, size_t index, const struct bends *bends,
                      size_t from, size_t until) {
    const double start_s = 1e-6 * (double)replay->run[index].start_us + GAP_TIP_AGE_S;
    struct direction_hold *hold = &direction->hold[direction->holds];
    *hold = (struct direction_hold){.run = index,
                                    .from_s = start_s + BLOCK_S * (double)from,
                                    .until_s = start_s + BLOCK_S * (double)until,
                                    .bend_rad = mean(bends->measured, NULL, until - END_BLOCKS, until),
                                    .just_after_rad = mean(bends->measured, bends->nominal, from, from + AFTER_BLOCKS),
                                    .end_rad = mean(bends->measured, bends->nominal, until - END_BLOCKS, until),
                                    .time_constant_s = NAN};
    const double first_rad = mean(bends->measured, NULL, from, from + AFTER_BLOCKS);
    hold->growth = (hold->end_rad - hold->just_after_rad) / first_rad;
    double *rest = calloc(until - from, sizeof *rest);
    for (size_t b = from; b < until && rest != NULL; b++) {
        rest[b - from] = bends->measured[b] - bends->nominal[b];
    }
    if (rest != NULL) {
        hold->time_constant_s = time_constant(rest, until - from);
    }
    free(rest);
    direction->holds += isfinite(hold->growth) && isfinite(hold->end_rad);
}

struct held_out_mean {
    double sum;
    double count;
};

static void find_holds(struct direction *direction, const struct replay *replay, size_t index, const struct bends *bends,
                       struct held_out_mean *with_effects) {
    const struct gap_run *run = replay->run[index].run;
    const size_t arrival = run->has_reading || run->has_duty ? 0 : (size_t)(NOISE_FLOOR_ARRIVES_S / BLOCK_S + 0.5);
    double most = 0.0;
    for (size_t b = 0; b < bends->count; b++) {
        most = fmax(most, bends->nominal[b]); /* a NaN changes nothing */
    }
    size_t b = 1;
    while (most > LEAST_BEND_RAD && b + LEAST_BLOCKS <= bends->count && direction->holds < DIRECTION_HOLDS_MAX) {
        const double level = bends->nominal[b];
        const bool starts = level > LOADED_SHARE * most && steps_to(bends->nominal, b, most) &&
                            stays(bends->nominal, b, b + SETTLED_BLOCKS, level, SETTLED_SHARE * most);
        size_t until = b + 1;
        while (starts && until < bends->count && stays(bends->nominal, until, until + 1, level, HELD_SHARE * most)) {
            until++;
        }
        const size_t from = b + arrival;
        if (starts && until >= from + LEAST_BLOCKS) {
            take_hold(direction, replay, index, bends, from, until);
            for (size_t k = until - END_BLOCKS; k < until; k++) {
                const double left = bends->measured[k] - bends->best[k];
                const bool counts = !isnan(left) && replay->held_out[replay->run[index].tip_at + REPLAY_TIP_CHANNELS * k];
                with_effects->sum += counts ? left : 0.0;
                with_effects->count += counts;
            }
            b = until;
        } else {
            b++;
        }
    }
}

/* --- what they say together --- */

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void sum_up(struct direction *direction) {
    double tau_s[DIRECTION_HOLDS_MAX];
    size_t with = 0;
    direction->just_after_rad = direction->end_rad = 0.0;
    direction->growth_low = INFINITY;
    direction->growth_high = -INFINITY;
    for (size_t i = 0; i < direction->holds; i++) {
        const struct direction_hold *hold = &direction->hold[i];
        direction->just_after_rad += hold->just_after_rad / (double)direction->holds;
        direction->end_rad += hold->end_rad / (double)direction->holds;
        direction->growth_low = fmin(direction->growth_low, hold->growth);
        direction->growth_high = fmax(direction->growth_high, hold->growth);
        if (!isnan(hold->time_constant_s)) {
            tau_s[with++] = hold->time_constant_s;
        }
    }
    if (with > 0) {
        qsort(tau_s, with, sizeof tau_s[0], compare);
        direction->time_constant_s = tau_s[with / 2];
        direction->time_constant_low_s = tau_s[0];
        direction->time_constant_high_s = tau_s[with - 1];
    }
}

static const char *against(double difference_rad) {
    return difference_rad >= 0.0 ? "exceeds" : "falls short of";
}

static void put_in_words(struct direction *direction) {
    const double drift_rad = direction->end_rad - direction->just_after_rad;
    const double end_deg = direction->end_rad * DEGREES, after_deg = direction->just_after_rad * DEGREES;
    char how[160] = "";
    if (fabs(drift_rad) < SMALL_RAD) {
        (void)snprintf(direction->text, sizeof direction->text,
                       "measured bend %s the nominal model's by %.2g deg over %zu hold%s, and that does not change while a pressure "
                       "is held",
                       against(end_deg), fabs(end_deg), direction->holds, direction->holds == 1 ? "" : "s");
        return;
    }
    if (isnan(direction->time_constant_s)) {
        (void)snprintf(how, sizeof how, "the module %s after the model has stopped, with no one time constant",
                       drift_rad > 0.0 ? "goes on bending" : "straightens");
    } else {
        (void)snprintf(how, sizeof how, "the module %s after the model has stopped, and the model lags with a time constant of %.2g s (%.2g to %.2g s)",
                       drift_rad > 0.0 ? "goes on bending" : "straightens", direction->time_constant_s,
                       direction->time_constant_low_s, direction->time_constant_high_s);
    }
    (void)snprintf(direction->text, sizeof direction->text,
                   "measured bend %s the nominal model's by %.2g deg at the end of %zu hold%s, and %s it by %.2g deg just after "
                   "the step%s: %s; over a hold the bend changes by %+.1f to %+.1f %%",
                   against(end_deg), fabs(end_deg), direction->holds, direction->holds == 1 ? "" : "s", against(after_deg),
                   fabs(after_deg), direction->holds == 1 ? "" : "s", how, 100.0 * direction->growth_low, 100.0 * direction->growth_high);
}

bool direction_find(struct direction *direction, const struct replay *replay, const double *nominal, const double *best) {
    struct held_out_mean with_effects = {0.0, 0.0};
    size_t most = 1;
    memset(direction, 0, sizeof *direction);
    direction->just_after_rad = direction->end_rad = direction->end_with_effects_rad = NAN;
    direction->time_constant_s = direction->time_constant_low_s = direction->time_constant_high_s = NAN;
    for (size_t i = 0; i < replay->runs; i++) {
        most = replay->run[i].tip_blocks > most ? replay->run[i].tip_blocks : most;
        direction->from_orientation = direction->from_orientation || replay->run[i].run->has_orientation;
    }
    double *room = malloc(3 * most * sizeof *room);
    struct bends bends = {.measured = room};
    bool sound = room != NULL;
    for (size_t i = 0; i < replay->runs && sound; i++) {
        bends.nominal = room + most;
        bends.best = room + 2 * most;
        sound = fill_bends(replay, i, nominal, best, &bends);
        if (sound) {
            find_holds(direction, replay, i, &bends, &with_effects);
        }
    }
    free(room);
    if (sound && direction->holds > 0) {
        sum_up(direction);
        direction->end_with_effects_rad = with_effects.count > 0.0 ? with_effects.sum / with_effects.count : NAN;
        put_in_words(direction);
    }
    return sound;
}
