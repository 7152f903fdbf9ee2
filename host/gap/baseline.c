#include "gap/baseline.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define UNIT_TOLERANCE 0.05  /* of a quaternion's length */
#define SENSOR_AGE_S 0.010   /* the row in which a pose arrives is so much later than the pose */
#define HOLE_S 0.25          /* longer ones are not interpolated over .. */
#define HOLE_SPACINGS 3.0    /* .. nor those of more than so many of the usual spacings */
#define CLEARLY 0.95         /* a squared difference that much smaller decides on the age */
#define COPY_TOLERANCE 1e-6
#define COPY_SHARE 0.99      /* of the rows that repeat the readings: then nothing was simulated */

static const char *const tip_names[7] = {"sim_tip_x_m", "sim_tip_y_m", "sim_tip_z_m", "sim_tip_qw",
                                         "sim_tip_qx",  "sim_tip_qy",  "sim_tip_qz"};
static const char *const pressure_names[3] = {"sim_p1_pa", "sim_p2_pa", "sim_p3_pa"};

struct gap_simulator {
    double *pressure_pa;   /* [rows * 3] as logged; NULL: none */
    size_t poses;
    double *pose_time_s;   /* [poses] */
    struct gap_pose *pose; /* [poses] in the order of time */
    bool has_orientation;
};

/* --- reading --- */

static bool fail(const struct gap_run *run, char *error, size_t error_bytes, const char *what, const char *remedy) {
    (void)snprintf(error, error_bytes, "%s: %s: %s", run->path, what, remedy);
    return false;
}

/* All of the columns (1), none (0), or some (-1), whose first missing one is then named. A column without a value is none. */
static int find_columns(const struct run_log *log, const char *const *names, size_t count, int *column, const char **missing) {
    size_t found = 0;
    *missing = NULL;
    for (size_t i = 0; i < count; i++) {
        bool any = false;
        column[i] = run_log_column(log, names[i]);
        for (size_t row = 0; row < log->rows && column[i] >= 0 && !any; row++) {
            any = !isnan(log->value[row * log->columns + (size_t)column[i]]);
        }
        found += any;
        *missing = !any && *missing == NULL ? names[i] : *missing;
    }
    return found == 0 ? 0 : found == count ? 1 : -1;
}

static bool reject_missing(const struct gap_run *run, const char *missing, const char *group, char *error,
                           size_t error_bytes) {
    (void)snprintf(error, error_bytes, "%s: column %s is missing or empty, but others of %s are there: give all of them or none",
                   run->path, missing, group);
    return false;
}

static bool take_pose(const struct gap_run *run, const struct run_log *log, size_t row, const int column[7],
                      struct gap_simulator *simulator, char *error, size_t error_bytes) {
    struct gap_pose pose = {{NAN, NAN, NAN}, {NAN, NAN, NAN, NAN}};
    double size = 0.0;
    for (size_t k = 0; k < 7; k++) {
        const double value = column[k] < 0 ? NAN : log->value[row * log->columns + (size_t)column[k]];
        *(k < 3 ? &pose.position_m[k] : &pose.quaternion[k - 3]) = value;
        size += k < 3 ? 0.0 : value * value;
    }
    if (isnan(pose.position_m[0] + pose.position_m[1] + pose.position_m[2])) {
        return true;
    }
    if (!isnan(size) && fabs(sqrt(size) - 1.0) > UNIT_TOLERANCE) {
        (void)snprintf(error, error_bytes,
                       "%s:%zu: columns sim_tip_qw to sim_tip_qz: their length is %.3g, not 1: they are no quaternion (w, x, y, z); "
                       "leave them empty where the simulator gives no orientation",
                       run->path, log->header_line + 1 + row, sqrt(size));
        return false;
    }
    for (size_t k = 0; k < 4; k++) {
        pose.quaternion[k] = isnan(size) ? NAN : pose.quaternion[k] / sqrt(size);
    }
    simulator->has_orientation = simulator->has_orientation || !isnan(size);
    simulator->pose_time_s[simulator->poses] = run->time_s[row];
    simulator->pose[simulator->poses++] = pose;
    return true;
}

bool gap_baseline_take(struct gap_run *run, const struct run_log *log, char *error, size_t error_bytes) {
    int place[3], turn[4], pressure[3], tip[7];
    const char *missing;
    const int places = find_columns(log, tip_names, 3, place, &missing);
    if (places < 0) {
        return reject_missing(run, missing, "sim_tip_x_m to sim_tip_z_m", error, error_bytes);
    }
    const int turns = find_columns(log, tip_names + 3, 4, turn, &missing);
    if (turns < 0) {
        return reject_missing(run, missing, "sim_tip_qw to sim_tip_qz", error, error_bytes);
    }
    if (turns > 0 && places == 0) {
        return reject_missing(run, tip_names[0], "sim_tip_x_m to sim_tip_qz", error, error_bytes);
    }
    const int pressures = find_columns(log, pressure_names, 3, pressure, &missing);
    if (pressures < 0) {
        return reject_missing(run, missing, "sim_p1_pa to sim_p3_pa", error, error_bytes);
    }
    if (places == 0 && pressures == 0) {
        return true;
    }
    struct gap_simulator *simulator = run->simulator = calloc(1, sizeof *run->simulator);
    if (simulator == NULL) {
        return fail(run, error, error_bytes, "sim_ columns", "out of memory");
    }
    simulator->pressure_pa = pressures > 0 ? malloc(3 * log->rows * sizeof(double)) : NULL;
    simulator->pose_time_s = malloc(log->rows * sizeof(double));
    simulator->pose = malloc(log->rows * sizeof *simulator->pose);
    if (simulator->pose == NULL || simulator->pose_time_s == NULL || (pressures > 0 && simulator->pressure_pa == NULL)) {
        return fail(run, error, error_bytes, "sim_ columns", "out of memory");
    }
    for (size_t k = 0; k < 7; k++) {
        tip[k] = k < 3 ? place[k] : turns > 0 ? turn[k - 3] : -1;
    }
    for (size_t row = 0; row < log->rows; row++) {
        for (size_t c = 0; c < 3 && pressures > 0; c++) {
            simulator->pressure_pa[3 * row + c] = log->value[row * log->columns + (size_t)pressure[c]];
        }
        if (places > 0 && !take_pose(run, log, row, tip, simulator, error, error_bytes)) {
            return false;
        }
    }
    return true;
}

void gap_baseline_free(struct gap_run *run) {
    if (run->simulator != NULL) {
        free(run->simulator->pressure_pa);
        free(run->simulator->pose_time_s);
        free(run->simulator->pose);
    }
    free(run->simulator);
    free(run->sim_pa);
    free(run->sim_tip);
    run->simulator = NULL;
    run->sim_pa = NULL;
    run->sim_tip = NULL;
}

bool gap_baseline_present(const struct gap_data *data) {
    for (size_t i = 0; i < data->runs; i++) {
        if (data->run[i].simulator != NULL) {
            return true;
        }
    }
    return false;
}

/* --- pressures --- */

/* Were the readings written down as the simulator's own? */
static bool is_copy(const struct gap_run *run) {
    size_t same = 0, both = 0;
    for (size_t k = 0; k < 3 * run->rows; k++) {
        const double simulated_pa = run->simulator->pressure_pa[k], reading_pa = run->reading_pa[k];
        if (!isnan(simulated_pa) && !isnan(reading_pa)) {
            both++;
            same += fabs(simulated_pa - reading_pa) <= COPY_TOLERANCE * fabs(reading_pa);
        }
    }
    return both > 0 && (double)same > COPY_SHARE * (double)both;
}

/* Over the holes by straight lines, which body effects need; readings there are not compared. */
static void fill_chamber(struct gap_run *run, size_t c) {
    const double *from = run->simulator->pressure_pa;
    size_t before = SIZE_MAX;
    for (size_t row = 0; row < run->rows; row++) {
        if (isnan(from[3 * row + c])) {
            continue;
        }
        for (size_t hole = before == SIZE_MAX ? 0 : before + 1; hole < row; hole++) {
            const double span_s = before == SIZE_MAX ? 0.0 : run->time_s[row] - run->time_s[before];
            const double share = span_s > 0.0 ? (run->time_s[hole] - run->time_s[before]) / span_s : 1.0;
            const double start_pa = before == SIZE_MAX ? from[3 * row + c] : from[3 * before + c];
            run->sim_pa[3 * hole + c] = start_pa + share * (from[3 * row + c] - start_pa);
        }
        run->sim_pa[3 * row + c] = from[3 * row + c];
        before = row;
    }
    for (size_t row = before + 1; row < run->rows; row++) {
        run->sim_pa[3 * row + c] = from[3 * before + c];
    }
}

static bool use_pressures(struct gap_run *run) {
    run->sim_is_copy = run->simulator->pressure_pa != NULL && is_copy(run);
    run->has_duty = false;
    run->has_supply = false;
    for (size_t row = 0; row < run->rows; row++) {
        run->supply_pa[row] = NAN;
    }
    if (run->simulator->pressure_pa == NULL || run->sim_is_copy) {
        return true;
    }
    run->sim_pa = malloc(3 * run->rows * sizeof(double));
    if (run->sim_pa == NULL) {
        return false;
    }
    for (size_t c = 0; c < 3; c++) {
        fill_chamber(run, c);
    }
    run->has_duty = true;
    for (size_t row = 0; row < run->rows; row++) {
        bool dropped = false;
        for (size_t c = 0; c < 3; c++) {
            double *reading_pa = &run->reading_pa[3 * row + c];
            if (isnan(run->simulator->pressure_pa[3 * row + c]) && !isnan(*reading_pa)) {
                *reading_pa = NAN;
                dropped = true;
            }
        }
        run->rows_without_sim += dropped;
    }
    return true;
}

/* --- poses --- */

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* What counts as a hole between poses. False: out of memory. */
static bool find_hole(const struct gap_simulator *simulator, double *hole_s) {
    double *spacing_s = malloc((simulator->poses + 1) * sizeof *spacing_s);
    *hole_s = HOLE_S;
    if (spacing_s == NULL) {
        return false;
    }
    for (size_t i = 1; i < simulator->poses; i++) {
        spacing_s[i - 1] = simulator->pose_time_s[i] - simulator->pose_time_s[i - 1];
    }
    if (simulator->poses > 1) {
        qsort(spacing_s, simulator->poses - 1, sizeof *spacing_s, compare);
        *hole_s = fmax(HOLE_S, HOLE_SPACINGS * spacing_s[(simulator->poses - 1) / 2]);
    }
    free(spacing_s);
    return true;
}

/* The simulator's pose at a time, between the poses about it; `at` remembers where the last one was. False: there is none. */
static bool pose_at(const struct gap_simulator *simulator, double time_s, double hole_s, size_t *at, struct gap_pose *pose) {
    const double *times_s = simulator->pose_time_s;
    const double close_s = 1e-6;
    while (*at + 1 < simulator->poses && times_s[*at + 1] <= time_s + close_s) {
        (*at)++;
    }
    while (*at > 0 && times_s[*at] > time_s + close_s) {
        (*at)--;
    }
    const struct gap_pose *a = &simulator->pose[*at];
    if (simulator->poses == 0 || fabs(times_s[*at] - time_s) <= close_s) {
        *pose = simulator->poses == 0 ? (struct gap_pose){{NAN, NAN, NAN}, {NAN, NAN, NAN, NAN}} : *a;
        return simulator->poses > 0;
    }
    if (*at + 1 == simulator->poses || times_s[*at] > time_s || times_s[*at + 1] - times_s[*at] > hole_s) {
        return false;
    }
    const struct gap_pose *b = &simulator->pose[*at + 1];
    const double share = (time_s - times_s[*at]) / (times_s[*at + 1] - times_s[*at]);
    double dot = 0.0, size = 0.0;
    for (size_t k = 0; k < 3; k++) {
        pose->position_m[k] = a->position_m[k] + share * (b->position_m[k] - a->position_m[k]);
    }
    for (size_t k = 0; k < 4; k++) {
        dot += a->quaternion[k] * b->quaternion[k];
    }
    for (size_t k = 0; k < 4; k++) { /* rotations near each other: straight and normalised is as good as along the sphere */
        pose->quaternion[k] = (1.0 - share) * a->quaternion[k] + share * (dot < 0.0 ? -1.0 : 1.0) * b->quaternion[k];
        size += pose->quaternion[k] * pose->quaternion[k];
    }
    for (size_t k = 0; k < 4; k++) {
        pose->quaternion[k] /= sqrt(size);
    }
    return true;
}

/* Mean square distance between measured and simulated tip about its mean, the simulator's clock ahead by `ahead_s`. */
static double apart(const struct gap_run *run, double ahead_s, double hole_s) {
    double sum[3] = {0.0}, square = 0.0, count = 0.0;
    size_t at = 0;
    for (size_t i = 0; i < run->tips; i++) {
        struct gap_pose pose;
        if (pose_at(run->simulator, run->tip[i].time_s + ahead_s, hole_s, &at, &pose)) {
            count += 1.0;
            for (size_t k = 0; k < 3; k++) {
                const double difference_m = run->tip[i].position_m[k] - pose.position_m[k];
                sum[k] += difference_m;
                square += difference_m * difference_m;
            }
        }
    }
    return count > 0.0 ? (square - (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]) / count) / count : INFINITY;
}

static bool use_poses(struct gap_run *run) {
    size_t kept = 0, at = 0;
    double hole_s;
    run->has_orientation = false;
    if (run->simulator->poses == 0) {
        run->tips_without_sim = run->tips;
        run->tips = 0;
        return true;
    }
    run->sim_tip = malloc((run->tips + 1) * sizeof *run->sim_tip);
    if (run->sim_tip == NULL || !find_hole(run->simulator, &hole_s)) {
        return false;
    }
    run->sim_as_shown = apart(run, SENSOR_AGE_S, hole_s) < CLEARLY * apart(run, 0.0, hole_s);
    for (size_t i = 0; i < run->tips; i++) {
        struct gap_tip tip = run->tip[i];
        struct gap_pose pose;
        if (!pose_at(run->simulator, tip.time_s + (run->sim_as_shown ? SENSOR_AGE_S : 0.0), hole_s, &at, &pose)) {
            run->tips_without_sim++;
            continue;
        }
        if (isnan(pose.quaternion[0])) {
            memcpy(tip.quaternion, pose.quaternion, sizeof tip.quaternion);
        }
        run->has_orientation = run->has_orientation || !isnan(tip.quaternion[0]);
        run->tip[kept] = tip;
        run->sim_tip[kept++] = pose;
    }
    run->tips = kept;
    return true;
}

/* --- all --- */

static bool same_kind(const struct gap_run *a, const struct gap_run *b) {
    return b->simulator != NULL && (a->simulator->pressure_pa != NULL) == (b->simulator->pressure_pa != NULL) &&
           (a->simulator->poses > 0) == (b->simulator->poses > 0);
}

bool gap_baseline_use(struct gap_data *data, char *error, size_t error_bytes) {
    for (size_t i = 0; i < data->runs; i++) {
        struct gap_run *run = &data->run[i];
        const bool alike = run->simulator != NULL && same_kind(run, &data->run[0]);
        if (!alike) {
            (void)snprintf(error, error_bytes,
                           "%s and %s do not have the same sim_ columns: give every log those of the same simulator, or leave them "
                           "all aside with --baseline table",
                           data->run[0].path, run->path);
            return false;
        }
        if (!use_pressures(run) || !use_poses(run)) {
            return fail(run, error, error_bytes, "sim_ columns", "out of memory");
        }
        if (run->tips == 0 && !(run->sim_pa != NULL && run->has_reading)) {
            return fail(run, error, error_bytes, "nothing that was measured can be held against the sim_ columns",
                        "record p1_pa..p3_pa beside sim_p1_pa.., tip_x_m.. beside sim_tip_x_m.., in rows of the same times; or leave "
                        "them aside with --baseline table");
        }
    }
    data->from_simulator = true;
    return true;
}

static bool knows_pressures(const struct gap_data *data) {
    for (size_t i = 0; i < data->runs; i++) {
        const struct gap_run *run = &data->run[i];
        if (run->sim_pa == NULL && !run->has_reading && !run->has_command) {
            return false;
        }
    }
    return true;
}

const char *gap_baseline_why_not(const struct gap_data *data, const struct effect_kind *kind) {
    if (effect_has(kind, EFFECT_HOOK_COMMAND) || effect_has(kind, EFFECT_HOOK_GAS)) {
        return "it acts on the gas, which only our own replay simulates (--baseline table)";
    }
    if (data->run[0].sim_tip == NULL && !(kind->stage == EFFECT_STAGE_PRESSURE_SENSOR)) {
        return "the other simulator gives no tip pose (sim_tip_x_m to sim_tip_qz)";
    }
    if ((effect_has(kind, EFFECT_HOOK_LOAD) || effect_has(kind, EFFECT_HOOK_SHAPE)) && !knows_pressures(data)) {
        return "what it changes depends on the pressures, and there are none (p1_pa.., p1_cmd_pa.. or sim_p1_pa..)";
    }
    return NULL;
}
