#include "gap/replay_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/replay_elsewhere.h"

#define SUPPLY_SPREAD_PA 60.0 /* of a block: how well a supply reading says what the valves feel */
/* What a sensor's steps and the table's interpolation leave in a mean, however many samples it has. */
#define POSITION_FLOOR_M 1.5e-5
#define ANGLE_FLOOR_RAD (0.015 * M_PI / 180.0)
#define NUDGE_PA 20.0
#define NOISE_MOST_LEAST 1.2  /* of a mean square: weights say one, and a bit for chance */
#define HEAVY_TAILS 2.0       /* mean square over what the median of a Gaussian's would say */
#define MEDIAN_OF_SQUARE 0.4549 /* of a standard normal's */
#define TIMING_SHARE 0.998 /* of the jumps under the format's own timing: another must leave fewer */

/* How freely a pressure wanders is seen within stretches: the jumps between them are taken off. */
static void level_stretches(const struct replay *replay, const struct replay_run *run, double *observed) {
    for (size_t i = 0; i <= run->run->breaks && run->run->breaks > 0 && !run->run->has_duty; i++) {
        const struct replay_stretch part = replay_stretch_at(replay, run, i);
        double sum = 0.0, count = 0.0;
        for (size_t b = part.block; b < part.block + part.blocks; b++) {
            const bool seen = isfinite(observed[run->blocks + b]);
            sum += seen ? observed[b] : 0.0;
            count += seen;
        }
        for (size_t b = part.block; b < part.block + part.blocks && count > 0.0; b++) {
            observed[b] -= sum / count;
        }
    }
}

static bool fit_smoothers(struct replay *replay, struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        struct replay_run *run = &replay->run[i];
        const bool from_readings = !run->run->has_duty;
        double *room = malloc(2 * run->blocks * sizeof *room);
        if (room == NULL) {
            return false;
        }
        for (size_t c = 0; c < 3; c++) {
            for (size_t b = 0; b < run->blocks; b++) {
                room[b] = state->difference[i][3 * b + c];
                room[run->blocks + b] = run->variance[3 * b + c];
            }
            level_stretches(replay, run, room);
            const bool rigid = replay->rigid && run->run->has_duty;
            if (!smoother_fit(&run->smoother[c], room, room + run->blocks, run->blocks, rigid,
                              from_readings)) {
                free(room);
                return false;
            }
        }
        free(room);
    }
    return true;
}

/* Block means of the readings themselves, for a run without duties. */
static void readings_as_differences(const struct replay *replay, struct replay_state *state, size_t index) {
    const struct replay_run *run = &replay->run[index];
    double *count = calloc(3 * run->blocks + 1, sizeof *count);
    memset(state->difference[index], 0, 3 * run->blocks * sizeof(double));
    for (size_t row = 0; row < run->run->rows && count != NULL; row++) {
        for (size_t c = 0; c < 3; c++) {
            const size_t at = 3 * replay_block_of_step(replay, run->row_step[row]) + c;
            const double reading_pa = run->run->reading_pa[3 * row + c];
            if (!isnan(reading_pa)) {
                count[at] += 1.0;
                state->difference[index][at] += (reading_pa - state->difference[index][at]) / count[at];
            }
        }
    }
    free(count);
}

static size_t tips_in_block(const struct replay_run *run, size_t *tip, size_t block) {
    size_t count = 0;
    for (; *tip < run->run->tips && replay_tip_block(run, *tip) == block; (*tip)++) {
        count++;
    }
    return count;
}

static bool weigh_tip(struct replay *replay, const struct gap_model *model, const struct replay_state *state,
                      size_t index) {
    struct replay_run *run = &replay->run[index];
    const size_t all = REPLAY_TIP_CHANNELS * run->tip_blocks;
    double *mean = calloc(2 * all + 1, sizeof *mean), *spread2 = calloc(all + 1, sizeof *spread2);
    if (mean == NULL || spread2 == NULL) {
        free(mean);
        free(spread2);
        return false;
    }
    replay_tip_of_run(replay, model, state, index, false, 0.0, 3, mean);
    for (size_t c = 0; c < 3 && run->run->has_reading; c++) {
        double *moved = mean + all;
        replay_tip_of_run(replay, model, state, index, false, NUDGE_PA, c, moved);
        for (size_t k = 0; k < all; k++) {
            const double change = (moved[k] - mean[k]) / NUDGE_PA * run->smoother[c].spread;
            spread2[k] += change * change;
        }
    }
    size_t tip = 0;
    for (size_t b = 0; b < run->tip_blocks; b++) {
        const size_t count = tips_in_block(run, &tip, b);
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
            const bool angle = k >= 3;
            const double floor_of = angle ? ANGLE_FLOOR_RAD : POSITION_FLOOR_M, noise = run->tip_noise[angle];
            const bool seen = count > 0 && (!angle || run->run->has_orientation);
            const double variance = noise * noise / fmax((double)count, 1.0) + floor_of * floor_of +
                                    spread2[REPLAY_TIP_CHANNELS * b + k];
            replay->weight[run->tip_at + REPLAY_TIP_CHANNELS * b + k] = seen ? 1.0 / sqrt(variance) : 0.0;
            replay->lasting[run->tip_at + REPLAY_TIP_CHANNELS * b + k] =
                run->run->has_duty ? 0.0 : spread2[REPLAY_TIP_CHANNELS * b + k] / variance;
        }
    }
    free(mean);
    free(spread2);
    return true;
}

static void weigh_pressures(struct replay *replay, size_t index) {
    const struct replay_run *run = &replay->run[index];
    const bool usable = run->run->has_duty && run->run->has_reading;
    for (size_t k = 0; k < 3 * run->blocks; k++) {
        replay->weight[run->pressure_at + k] = usable ? 1.0 / sqrt(run->variance[k]) : 0.0;
    }
    for (size_t b = 0; b < run->blocks; b++) {
        const double spread_pa = hypot(run->supply_noise_pa, SUPPLY_SPREAD_PA);
        replay->weight[run->supply_at + b] = usable && run->run->has_supply ? 1.0 / spread_pa : 0.0;
    }
}

/* By how much the differences jump from block to block: a duty that counts a period too early or late shows
 * there, and the slow errors of a model that lacks something do not. */
static double jumps(const struct replay *replay, const struct replay_state *state) {
    double sum = 0.0;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t k = 3; k < 3 * run->blocks && run->run->has_duty; k++) {
            const bool seen = isfinite(run->variance[k]) && isfinite(run->variance[k - 3]);
            sum += seen ? fabs(state->difference[i][k] - state->difference[i][k - 3]) : 0.0;
        }
    }
    return sum;
}

/* Logs differ in whether the duty of a row that stands at a period's start is the one that this period has.
 * Both are tried on the nominal model; the first, which the run log's format means, unless the other fits
 * better. */
static void choose_duty_timing(struct replay *replay, const struct gap_model *model,
                               struct replay_state *state) {
    double cost[2];
    for (int late = 0; late < 2; late++) {
        for (size_t i = 0; i < replay->runs; i++) {
            replay->run[i].duty_from_next_period = late == 1;
        }
        replay_pressures(replay, model, state);
        cost[late] = jumps(replay, state);
    }
    for (size_t i = 0; i < replay->runs; i++) {
        replay->run[i].duty_from_next_period = cost[1] < TIMING_SHARE * cost[0];
    }
}

static int by_size(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Half the squared differences of neighbouring blocks of one group, into `half_square`; returns how many. */
static size_t list_differences(const struct replay *replay, const double *residual, enum fit_group group, double *half_square) {
    size_t count = 0;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        const bool tip = group == FIT_TIP; /* of the pressures, the supply would tell nothing new */
        const size_t stride = tip ? REPLAY_TIP_CHANNELS : 3, start = tip ? run->tip_at : run->pressure_at;
        const size_t end = start + stride * (tip ? run->tip_blocks : run->blocks);
        for (size_t k = start + stride; k < end; k++) {
            if (replay->weight[k] > 0.0 && replay->weight[k - stride] > 0.0 && !replay->apart[k]) {
                const double step = residual[k] - residual[k - stride];
                half_square[count++] = 0.5 * step * step + replay->lasting[k];
            }
        }
    }
    return count;
}

/* Pulses that err are only replayed where there are duties; without, noise is what it is, and not the same throughout. */
static bool find_noise_most(struct replay *replay, const struct gap_model *model, const struct replay_state *state) {
    bool pulses = true;
    for (size_t i = 0; i < replay->runs; i++) {
        pulses = pulses && replay->run[i].run->has_duty;
    }
    if (!pulses) {
        replay->noise_most[FIT_PRESSURE] = replay->noise_most[FIT_TIP] = INFINITY;
        return true;
    }
    double *residual = calloc(2 * replay->residuals + 1, sizeof *residual);
    if (residual == NULL) {
        return false;
    }
    replay_take_pressures(replay, state, residual);
    replay_tip(replay, model, state, false, residual);
    for (int group = 0; group < FIT_GROUPS; group++) {
        double *half_square = residual + replay->residuals;
        const size_t count = list_differences(replay, residual, (enum fit_group)group, half_square);
        qsort(half_square, count, sizeof half_square[0], by_size);
        const double quiet = count > 0 ? half_square[count / 2] / MEDIAN_OF_SQUARE : 0.0;
        replay->noise_most[group] = fmax(HEAVY_TAILS * quiet, NOISE_MOST_LEAST);
    }
    free(residual);
    return true;
}

bool replay_prepare(struct replay *replay, const struct gap_model *model, struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        weigh_pressures(replay, i);
    }
    choose_duty_timing(replay, model, state);
    if (replay->data->from_simulator) {
        if (!replay_tune(replay, model, state)) {
            return false;
        }
        replay_elsewhere_match(replay, state);
    }
    return replay_tune(replay, model, state);
}

bool replay_tune(struct replay *replay, const struct gap_model *model, struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        weigh_pressures(replay, i);
        if (!replay->run[i].run->has_duty) {
            readings_as_differences(replay, state, i);
        }
    }
    replay_pressures(replay, model, state);
    for (size_t i = 0; i < replay->runs; i++) {
        if (!replay->run[i].run->has_duty) {
            readings_as_differences(replay, state, i);
        }
    }
    if (!fit_smoothers(replay, state)) {
        return false;
    }
    replay_pressures(replay, model, state);
    for (size_t i = 0; i < replay->runs; i++) {
        if (!weigh_tip(replay, model, state, i)) {
            return false;
        }
    }
    return find_noise_most(replay, model, state);
}
