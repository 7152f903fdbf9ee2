#include "gap/report_series.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEGREES (180.0 / M_PI)
#define STEP_S (1e-6 * REPLAY_STEP_US)
/* Lengths of the replay's blocks. */
#define PRESSURE_BLOCK_STEPS ((size_t)(REPLAY_PRESSURE_BLOCK_S / STEP_S + 0.5))
#define TIP_BLOCK_S REPLAY_TIP_BLOCK_S
/* Of a straighter tip the direction is noise. */
#define STRAIGHT_BELOW_DEG 3.0
#define STRAIGHT_BELOW_MM 1.0

static double *row_of(const struct report_table *table, size_t row) {
    return table->cell + row * REPORT_COLUMNS;
}

static bool table_open(struct report_table *table, size_t rows) {
    table->cell = malloc((rows + 1) * REPORT_COLUMNS * sizeof(double));
    table->rows = table->cell == NULL ? 0 : rows;
    for (size_t i = 0; i < (rows + 1) * REPORT_COLUMNS && table->cell != NULL; i++) {
        table->cell[i] = NAN;
    }
    return table->cell != NULL;
}

bool report_table_has(const struct report_table *table, size_t column) {
    for (size_t row = 0; row < table->rows; row++) {
        if (!isnan(row_of(table, row)[column])) {
            return true;
        }
    }
    return false;
}

double report_table_rms(const struct report_table *table, size_t column) {
    double sum = 0.0, count = 0.0;
    for (size_t row = 0; row < table->rows; row++) {
        const double value = row_of(table, row)[column];
        sum += isnan(value) ? 0.0 : value * value;
        count += !isnan(value);
    }
    return count > 0.0 ? sqrt(sum / count) : NAN;
}

/* --- rotations: quaternions w, x, y, z --- */

static void multiply(const double a[4], const double b[4], double product[4]) {
    product[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    product[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    product[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
    product[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

/* The rotation vector's inverse, as a quaternion. */
static void undo(const double rotation[3], double quaternion[4]) {
    const double angle =
        sqrt(rotation[0] * rotation[0] + rotation[1] * rotation[1] + rotation[2] * rotation[2]);
    const double share = angle > 1e-12 ? sin(0.5 * angle) / angle : 0.5;
    quaternion[0] = cos(0.5 * angle);
    for (size_t k = 0; k < 3; k++) {
        quaternion[1 + k] = -share * rotation[k];
    }
}

static void tip_axis(const double q[4], double axis[3]) {
    axis[0] = 2.0 * (q[1] * q[3] + q[0] * q[2]);
    axis[1] = 2.0 * (q[2] * q[3] - q[0] * q[1]);
    axis[2] = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3];
}

/* Bend vector in degrees. */
static void bend_of(const double quaternion[4], double bend_deg[2]) {
    double axis[3];
    tip_axis(quaternion, axis);
    const double across = hypot(axis[0], axis[1]);
    const double scale = DEGREES * (across > 1e-9 ? atan2(across, axis[2]) / across : 1.0);
    bend_deg[0] = scale * axis[0];
    bend_deg[1] = scale * axis[1];
}

/* --- measured --- */

static void fill_readings(const struct replay_run *run, struct report_table *table) {
    const struct gap_run *data = run->run;
    double *count = calloc(4 * table->rows + 1, sizeof *count);
    for (size_t row = 0; row < data->rows && count != NULL; row++) {
        const size_t block = run->row_step[row] / PRESSURE_BLOCK_STEPS;
        for (size_t c = 0; c < 4; c++) {
            const double reading_pa = c < 3 ? data->reading_pa[3 * row + c] : data->supply_pa[row];
            if (isnan(reading_pa) || block >= table->rows || (c == 3 && !data->has_supply)) {
                continue;
            }
            double *mean = &row_of(table, block)[REPORT_MEASURED + c];
            *mean = isnan(*mean) ? 0.0 : *mean;
            *mean += (1e-3 * reading_pa - *mean) / ++count[4 * block + c];
        }
    }
    free(count);
}

/* Mean pose of a block. */
struct pose_sum {
    double count;
    double position_mm[3];
    double quaternion[4];
};

static void add_pose(struct pose_sum *sum, const struct gap_tip *tip) {
    double same_side = 0.0;
    for (size_t k = 0; k < 4; k++) {
        same_side += sum->quaternion[k] * tip->quaternion[k];
    }
    for (size_t k = 0; k < 4; k++) {
        sum->quaternion[k] += same_side < 0.0 ? -tip->quaternion[k] : tip->quaternion[k];
    }
    sum->count += 1.0;
    for (size_t k = 0; k < 3; k++) {
        sum->position_mm[k] += (1e3 * tip->position_m[k] - sum->position_mm[k]) / sum->count;
    }
}

static struct pose_sum *sum_poses(const struct replay_run *run) {
    const struct gap_run *data = run->run;
    struct pose_sum *sum = calloc(run->tip_blocks + 1, sizeof *sum);
    for (size_t i = 0; i < data->tips && sum != NULL; i++) {
        const double since_s = data->tip[i].time_s - 1e-6 * (double)run->start_us;
        const size_t block = since_s > 0.0 ? (size_t)(since_s / TIP_BLOCK_S) : 0;
        if (block < run->tip_blocks) {
            add_pose(&sum[block], &data->tip[i]);
        }
    }
    for (size_t b = 0; b < run->tip_blocks && sum != NULL; b++) {
        double *q = sum[b].quaternion;
        const double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (size_t k = 0; k < 4; k++) {
            q[k] = size > 0.0 ? q[k] / size : NAN;
        }
    }
    return sum;
}

static void put_bend(double *row, size_t first_channel, const double bend_deg[2]) {
    const double bend = hypot(bend_deg[0], bend_deg[1]);
    row[first_channel + REPORT_TIP_BEND] = bend;
    row[first_channel + REPORT_TIP_DIRECTION] =
        bend > STRAIGHT_BELOW_DEG ? atan2(bend_deg[1], bend_deg[0]) * DEGREES : NAN;
}

/* Bend and direction as variables: from the orientation, or else from how far the tip stands off the axis. */
static void put_pose(double *row, const struct pose_sum *pose) {
    double bend_deg[2];
    memcpy(row + REPORT_MEASURED + REPORT_TIP_X, pose->position_mm, sizeof pose->position_mm);
    if (!isnan(pose->quaternion[0])) {
        bend_of(pose->quaternion, bend_deg);
        put_bend(row, REPORT_MEASURED, bend_deg);
        row[REPORT_BEND] = row[REPORT_MEASURED + REPORT_TIP_BEND];
        row[REPORT_DIRECTION] = row[REPORT_MEASURED + REPORT_TIP_DIRECTION];
        return;
    }
    const double off_mm = hypot(pose->position_mm[0], pose->position_mm[1]);
    row[REPORT_BEND] = off_mm;
    row[REPORT_DIRECTION] =
        off_mm > STRAIGHT_BELOW_MM ? atan2(pose->position_mm[1], pose->position_mm[0]) * DEGREES : NAN;
}

/* --- simulated --- */

static void put_pressures(const struct replay *replay, const struct replay_run *run, const double *residual,
                          size_t model, struct report_table *table) {
    const size_t simulated = model == 0 ? REPORT_BEFORE : REPORT_AFTER;
    const size_t off = model == 0 ? REPORT_RESIDUAL_BEFORE : REPORT_RESIDUAL_AFTER;
    for (size_t b = 0; b < table->rows; b++) {
        double *row = row_of(table, b);
        for (size_t c = 0; c < 4; c++) {
            const size_t at = c < 3 ? run->pressure_at + 3 * b + c : run->supply_at + b;
            if (replay->weight[at] > 0.0 && !isnan(row[REPORT_MEASURED + c])) {
                row[off + c] = 1e-3 * residual[at] / replay->weight[at];
                row[simulated + c] = row[REPORT_MEASURED + c] - row[off + c];
            }
        }
    }
}

/* Components along and across the direction in which `towards` points. */
static void split(const double vector[2], const double towards[2], double least, double parts[2]) {
    const double size = hypot(towards[0], towards[1]);
    parts[0] = size > least ? (vector[0] * towards[0] + vector[1] * towards[1]) / size : NAN;
    parts[1] = size > least ? (vector[1] * towards[0] - vector[0] * towards[1]) / size : NAN;
}

static void put_position(double *row, size_t simulated, size_t off, const double difference_mm[3]) {
    for (size_t k = 0; k < 3; k++) {
        row[simulated + REPORT_TIP_X + k] = row[REPORT_MEASURED + REPORT_TIP_X + k] - difference_mm[k];
    }
    split(difference_mm, &row[REPORT_BEFORE + REPORT_TIP_X], STRAIGHT_BELOW_MM, &row[off + REPORT_OFF_ALONG]);
    row[off + REPORT_OFF_HEIGHT] = difference_mm[2];
    row[simulated == REPORT_BEFORE ? REPORT_APART_BEFORE : REPORT_APART_AFTER] =
        sqrt(difference_mm[0] * difference_mm[0] + difference_mm[1] * difference_mm[1] +
             difference_mm[2] * difference_mm[2]);
}

static void put_orientation(double *row, size_t simulated, size_t off, const double measured[4],
                            const double rotation[3]) {
    double back[4], quaternion[4], bend_deg[2], measured_deg[2], axis[3];
    undo(rotation, back);
    multiply(back, measured, quaternion);
    bend_of(quaternion, bend_deg);
    bend_of(measured, measured_deg);
    put_bend(row, simulated, bend_deg);
    const double difference[2] = {measured_deg[0] - bend_deg[0], measured_deg[1] - bend_deg[1]};
    const double towards[2] = {bend_deg[0], bend_deg[1]};
    split(difference, towards, STRAIGHT_BELOW_DEG, &row[off + REPORT_TURNED_ALONG]);
    tip_axis(measured, axis);
    row[off + REPORT_TWISTED] =
        DEGREES * (rotation[0] * axis[0] + rotation[1] * axis[1] + rotation[2] * axis[2]);
}

static void put_tips(const struct replay *replay, const struct replay_run *run, const struct pose_sum *pose,
                     const double *residual, size_t model, struct report_table *table) {
    const size_t simulated = model == 0 ? REPORT_BEFORE : REPORT_AFTER;
    const size_t off = model == 0 ? REPORT_RESIDUAL_BEFORE : REPORT_RESIDUAL_AFTER;
    for (size_t b = 0; b < table->rows; b++) {
        const double *at = residual + run->tip_at + REPLAY_TIP_CHANNELS * b;
        const double *weight = replay->weight + run->tip_at + REPLAY_TIP_CHANNELS * b;
        double difference[REPLAY_TIP_CHANNELS];
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
            difference[k] = weight[k] > 0.0 ? (k < 3 ? 1e3 : 1.0) * at[k] / weight[k] : NAN;
        }
        if (pose[b].count > 0.0 && weight[0] > 0.0) {
            put_position(row_of(table, b), simulated, off, difference);
        }
        if (pose[b].count > 0.0 && weight[3] > 0.0 && !isnan(pose[b].quaternion[0])) {
            put_orientation(row_of(table, b), simulated, off, pose[b].quaternion, difference + 3);
        }
    }
}

/* --- variables --- */

/* What the best model, corrected by the readings, says of a chamber's pressure. */
static double estimate_kpa(const struct replay_run *run, const struct replay_state *state, size_t index,
                           size_t step, size_t chamber) {
    const size_t kept = step < run->steps ? step : run->steps, block = kept / PRESSURE_BLOCK_STEPS;
    return 1e-3 *
           (state->pressure_pa[index][3 * kept + chamber] + state->correction[index][3 * block + chamber]);
}

static void put_variables(const struct replay_run *run, const struct replay_state *state, size_t index,
                          double block_s, struct report_table *table) {
    const double steps = block_s / STEP_S;
    for (size_t b = 0; b < table->rows; b++) {
        double *row = row_of(table, b), rate_sum = 0.0;
        const double first = fmax(((double)b - 0.5) * steps, 0.0);
        const size_t from = (size_t)first, middle = (size_t)(((double)b + 0.5) * steps),
                     to = from + (size_t)(2.0 * steps);
        row[REPORT_TIME] = ((double)b + 0.5) * block_s;
        for (size_t c = 0; c < 3; c++) {
            const double rise =
                estimate_kpa(run, state, index, to, c) - estimate_kpa(run, state, index, from, c);
            row[REPORT_PRESSURE_1 + c] = estimate_kpa(run, state, index, middle, c);
            row[REPORT_RATE_1 + c] = rise / (2.0 * block_s);
            rate_sum += row[REPORT_RATE_1 + c];
        }
        row[REPORT_RATE_MEAN] = rate_sum / 3.0;
    }
}

static void mark_held_out(const struct replay *replay, const struct replay_run *run, struct report_run *to) {
    for (size_t b = 0; b < to->pressure.rows; b++) {
        row_of(&to->pressure, b)[REPORT_HELD_OUT] = replay->held_out[run->pressure_at + 3 * b];
    }
    for (size_t b = 0; b < to->tip.rows; b++) {
        row_of(&to->tip, b)[REPORT_HELD_OUT] = replay->held_out[run->tip_at + REPLAY_TIP_CHANNELS * b];
    }
}

/* A pressure block takes bend and direction from the tip block over it. */
static void lend_pose(struct report_run *to) {
    for (size_t b = 0; b < to->pressure.rows; b++) {
        double *row = row_of(&to->pressure, b);
        const size_t tip = (size_t)(row[REPORT_TIME] / TIP_BLOCK_S);
        if (tip < to->tip.rows) {
            row[REPORT_BEND] = row_of(&to->tip, tip)[REPORT_BEND];
            row[REPORT_DIRECTION] = row_of(&to->tip, tip)[REPORT_DIRECTION];
        }
    }
}

/* --- all --- */

static bool fill_model(struct report_series *series, const struct search *search,
                       const struct gap_model *const models[2], size_t model, struct pose_sum *const *pose,
                       struct replay_state *state) {
    const struct replay *replay = &search->replay;
    double *residual = calloc(replay->residuals + 1, sizeof *residual);
    if (residual == NULL) {
        return false;
    }
    replay_pressures(replay, models[model], state);
    replay_take_pressures(replay, state, residual);
    replay_tip(replay, models[model], state, false, residual);
    for (size_t i = 0; i < replay->runs; i++) {
        put_pressures(replay, &replay->run[i], residual, model, &series->run[i].pressure);
        put_tips(replay, &replay->run[i], pose[i], residual, model, &series->run[i].tip);
        if (model == 1) {
            put_variables(&replay->run[i], state, i, PRESSURE_BLOCK_STEPS * STEP_S, &series->run[i].pressure);
            put_variables(&replay->run[i], state, i, TIP_BLOCK_S, &series->run[i].tip);
        }
    }
    free(residual);
    return true;
}

static bool fill_measured(struct report_run *to, const struct replay_run *run, struct pose_sum **pose) {
    *pose = sum_poses(run);
    to->duration_s = STEP_S * (double)run->steps;
    if (!table_open(&to->pressure, run->blocks) || !table_open(&to->tip, run->tip_blocks) || *pose == NULL) {
        return false;
    }
    fill_readings(run, &to->pressure);
    for (size_t b = 0; b < run->tip_blocks; b++) {
        if ((*pose)[b].count > 0.0) {
            put_pose(row_of(&to->tip, b), &(*pose)[b]);
        }
    }
    return true;
}

bool report_series_open(struct report_series *series, const struct search *search) {
    return report_series_open_models(series, search, &search->nominal.model, &search->best.model);
}

bool report_series_open_models(struct report_series *series, const struct search *search,
                               const struct gap_model *before, const struct gap_model *after) {
    const struct gap_model *const models[2] = {before, after};
    const struct replay *replay = &search->replay;
    struct pose_sum *pose[GAP_RUNS_MAX] = {NULL};
    struct replay_state state;
    memset(series, 0, sizeof *series);
    bool sound = replay_state_open(&state, replay);
    for (size_t i = 0; i < replay->runs && sound; i++) {
        series->runs++;
        sound = fill_measured(&series->run[i], &replay->run[i], &pose[i]);
    }
    for (size_t model = 0; model < 2 && sound; model++) {
        sound = fill_model(series, search, models, model, pose, &state);
    }
    for (size_t i = 0; i < series->runs && sound; i++) {
        mark_held_out(replay, &replay->run[i], &series->run[i]);
        lend_pose(&series->run[i]);
    }
    for (size_t i = 0; i < GAP_RUNS_MAX; i++) {
        free(pose[i]);
    }
    replay_state_close(&state, replay);
    if (!sound) {
        report_series_close(series);
    }
    return sound;
}

void report_series_close(struct report_series *series) {
    for (size_t i = 0; i < series->runs; i++) {
        free(series->run[i].pressure.cell);
        free(series->run[i].tip.cell);
    }
    memset(series, 0, sizeof *series);
}
