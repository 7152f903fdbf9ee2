#include "gap/replay_elsewhere.h"

#include <math.h>
#include <string.h>

#define MATCHED_TIPS 400     /* of a run, that tell the stiffness */
#define STIFFNESS_LEAST 0.25
#define STIFFNESS_MOST 4.0
#define GRID 33              /* stiffnesses tried at first, evenly in their logarithm; then .. */
#define HALVINGS 8           /* .. beside the best, at ever smaller steps */
#define MOVES_LEAST_M 1e-3   /* rms: less says nothing of the stiffness */

static double between(const double *value, size_t steps, double position) {
    const double at = fmin(fmax(position, 0.0), (double)steps);
    const size_t low = (size_t)at < steps ? (size_t)at : steps - 1;
    return value[3 * low] + (at - (double)low) * (value[3 * (low + 1)] - value[3 * low]);
}

void replay_elsewhere_pressures(const struct replay *replay, size_t index, double *pressure_pa) {
    const struct replay_run *run = &replay->run[index];
    const struct gap_run *data = run->run;
    size_t row = 0;
    for (size_t step = 0; step <= run->steps; step++) {
        const double now_s = 1e-6 * (double)(run->start_us + (int64_t)step * replay->step_us);
        while (row + 2 < data->rows && data->time_s[row + 1] <= now_s) {
            row++;
        }
        const double span_s = data->time_s[row + 1] - data->time_s[row];
        const double share = span_s > 0.0 ? fmin(fmax((now_s - data->time_s[row]) / span_s, 0.0), 1.0) : 1.0;
        for (size_t c = 0; c < 3; c++) {
            const double *at_pa = &data->sim_pa[3 * row + c];
            pressure_pa[3 * step + c] = at_pa[0] + share * (at_pa[3] - at_pa[0]);
        }
    }
}

/* --- quaternions w, x, y, z --- */

static void multiply(const double a[4], const double b[4], double product[4]) {
    const double result[4] = {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                              a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                              a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                              a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
    memcpy(product, result, sizeof result);
}

/* --- tip --- */

/* The pressures at which the simulator's pose was computed: its own, or where it gives none, the measured ones, which are what
 * the sensors of the model show of the estimated ones. */
static void base_pressures(const struct replay *replay, size_t index, const struct replay_state *state, struct plant *plant,
                           double time_s, const double pressure_pa[3], struct effect_signals *signals, double base_pa[3]) {
    const struct replay_run *run = &replay->run[index];
    if (run->run->sim_pa != NULL) {
        const double step = (time_s - 1e-6 * (double)run->start_us) / (1e-6 * (double)replay->step_us);
        for (size_t c = 0; c < 3; c++) {
            base_pa[c] = between(state->pressure_pa[index] + c, run->steps, step);
        }
        return;
    }
    memcpy(base_pa, pressure_pa, 3 * sizeof *base_pa);
    signals->reading_pa = base_pa;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_READING, signals);
    signals->reading_pa = NULL;
}

static void nominal_pose(const struct bend_table *table, const double pressure_pa[3], double stiffness_scale,
                         struct tip_pose *pose) {
    const double load_pa[3] = {pressure_pa[0] / stiffness_scale, pressure_pa[1] / stiffness_scale,
                               pressure_pa[2] / stiffness_scale};
    struct body_shape shape;
    body_shape_at(table, load_pa, &shape);
    body_tip_pose(&table->module, &shape, pose);
}

/* pose = the simulator's, moved as from `before` to `after`. Where it has no orientation, that of `after` stands in, for the
 * sensor's effects that turn with the tip. */
static void compose(const struct gap_pose *simulated, const struct tip_pose *before, const struct tip_pose *after,
                    struct tip_pose *pose) {
    const double back[4] = {before->quaternion[0], -before->quaternion[1], -before->quaternion[2], -before->quaternion[3]};
    double turn[4];
    for (size_t k = 0; k < 3; k++) {
        pose->position_m[k] = simulated->position_m[k] + after->position_m[k] - before->position_m[k];
    }
    if (isnan(simulated->quaternion[0])) {
        memcpy(pose->quaternion, after->quaternion, sizeof pose->quaternion);
    } else {
        multiply(after->quaternion, back, turn);
        multiply(turn, simulated->quaternion, pose->quaternion);
    }
}

void replay_elsewhere_sample(const struct replay *replay, size_t index, const struct replay_state *state, struct plant *plant,
                             size_t i, const double pressure_pa[3], double step_s, double chance) {
    const struct gap_run *data = replay->run[index].run;
    const double base_scale = replay->elsewhere.stiffness_scale, scale = base_scale * plant->parameters.gas.stiffness_scale;
    double base_pa[3], load_pa[3] = {pressure_pa[0] / scale, pressure_pa[1] / scale, pressure_pa[2] / scale};
    struct tip_pose before, after;
    struct effect_signals signals = {.time_s = data->tip[i].time_s,
                                     .step_s = step_s,
                                     .temperature_k = plant->temperature_k,
                                     .chance = chance,
                                     .table = plant->table,
                                     .stiffness_scale = scale,
                                     .pressure_pa = pressure_pa};
    base_pressures(replay, index, state, plant, data->tip[i].time_s, pressure_pa, &signals, base_pa);
    nominal_pose(plant->table, base_pa, base_scale, &before);
    signals.load_pa = load_pa;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_LOAD, &signals);
    body_shape_at(plant->table, load_pa, &plant->shape);
    signals.shape = &plant->shape;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_SHAPE, &signals);
    body_tip_pose(&plant->table->module, &plant->shape, &after);
    compose(&data->sim_tip[i], &before, &after, &plant->pose);
    signals.pose = &plant->pose;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_POSE, &signals);
}

double replay_elsewhere_noise_part(const struct gap_run *run, size_t i, size_t kind, size_t k) {
    const struct gap_pose *simulated = &run->sim_tip[i];
    double dot = 0.0;
    for (size_t m = 0; m < 4; m++) {
        dot += simulated->quaternion[m] * run->tip[i].quaternion[m];
    }
    return kind == 0 ? simulated->position_m[k] : (dot < 0.0 ? -2.0 : 2.0) * simulated->quaternion[1 + k];
}

/* --- the table model as stiff as the other simulator --- */

struct apart {
    double square; /* mean square of the difference of the two tips about its mean, m2 */
    double moves;  /* of the simulator's own tip about its mean */
};

static struct apart apart_at(const struct replay *replay, const struct replay_state *state, double stiffness_scale) {
    double sum[2][3] = {{0.0}}, square[2] = {0.0, 0.0}, count = 0.0;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        const size_t stride = run->run->tips / MATCHED_TIPS + 1;
        for (size_t t = 0; t < run->run->tips && run->run->sim_tip != NULL; t += stride) {
            const double step =
                (run->run->tip[t].time_s - 1e-6 * (double)run->start_us) / (1e-6 * (double)replay->step_us);
            double pressure_pa[3];
            struct tip_pose pose;
            for (size_t c = 0; c < 3; c++) {
                pressure_pa[c] = between(state->pressure_pa[i] + c, run->steps, step);
            }
            nominal_pose(replay->table, pressure_pa, stiffness_scale, &pose);
            count += 1.0;
            for (size_t k = 0; k < 3; k++) {
                const double moved_m = run->run->sim_tip[t].position_m[k], off_m = moved_m - pose.position_m[k];
                sum[0][k] += off_m;
                sum[1][k] += moved_m;
                square[0] += off_m * off_m;
                square[1] += moved_m * moved_m;
            }
        }
    }
    for (size_t k = 0; k < 3 && count > 0.0; k++) {
        square[0] -= sum[0][k] * sum[0][k] / count;
        square[1] -= sum[1][k] * sum[1][k] / count;
    }
    return count > 0.0 ? (struct apart){fmax(square[0], 0.0) / count, fmax(square[1], 0.0) / count}
                       : (struct apart){0.0, 0.0};
}

void replay_elsewhere_match(struct replay *replay, const struct replay_state *state) {
    const double ratio = pow(STIFFNESS_MOST / STIFFNESS_LEAST, 1.0 / (GRID - 1.0));
    const struct apart now = apart_at(replay, state, 1.0);
    struct replay_elsewhere *elsewhere = &replay->elsewhere;
    *elsewhere = (struct replay_elsewhere){1.0, sqrt(now.square), sqrt(now.moves)};
    if (elsewhere->moves_m < MOVES_LEAST_M) {
        return;
    }
    double best = 1.0, least = now.square;
    for (size_t k = 0; k < GRID; k++) {
        const double scale = STIFFNESS_LEAST * pow(ratio, (double)k), square = apart_at(replay, state, scale).square;
        best = square < least ? scale : best;
        least = fmin(least, square);
    }
    double width = ratio;
    for (int halving = 0; halving < HALVINGS; halving++, width = sqrt(width)) {
        for (int side = -1; side <= 1; side += 2) {
            const double scale = best * pow(width, 0.5 * side), square = apart_at(replay, state, scale).square;
            if (square < least) {
                best = scale;
                least = square;
            }
        }
    }
    elsewhere->stiffness_scale = best;
    elsewhere->apart_m = sqrt(least);
}
