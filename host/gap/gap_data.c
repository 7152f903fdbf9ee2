#include "gap/gap_data.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gap/baseline.h"
#include "gap/unit_check.h"
#include "log/run_log.h"
#include "safety/supervisor.h"

#define UNIT_TOLERANCE 0.05  /* of a quaternion's length */
#define TELLING_LEAST 20    /* samples that say anything */
#define WINDOW 15            /* samples on either side: longer than repeats go on .. */
#define MOVED_M 6e-3         /* .. over which the tip moves so far that an exact repeat is no coincidence of the steps, .. */
#define TURNED_RAD 0.025     /* .. or turns so far on either side, where it never moves as far */
#define FINE_LEAST 100       /* pairs of samples that tell whether steps are fine */
#define FINE_SHARE 0.01      /* of their coordinates that are the same */
#define ONSET_STEP_S 0.1     /* an onset of repeats is not sought closer than that */
#define ONSET_GAIN 12.0      /* by so much the logarithm of the likelihood speaks for it */
#define ONSET_BEFORE 0.1     /* share of repeats before it, of that after, at most */

static double cell(const struct run_log *log, size_t row, int column) {
    return column < 0 ? NAN : log->value[row * log->columns + (size_t)column];
}

static bool fill3(const struct run_log *log, const char *const names[3], double *to, bool hold) {
    bool any = false;
    for (size_t c = 0; c < 3; c++) {
        const int column = run_log_column(log, names[c]);
        double last = hold ? 0.0 : NAN;
        for (size_t row = 0; row < log->rows; row++) {
            const double value = cell(log, row, column);
            any = any || !isnan(value);
            last = hold && isnan(value) ? last : value;
            to[3 * row + c] = last;
        }
    }
    return any;
}

/* A set-point that was written down as if measured says nothing: measured values are never all the same. */
static bool fill1(const struct run_log *log, const char *name, double *to) {
    const int column = run_log_column(log, name);
    double first = NAN;
    bool varies = false;
    for (size_t row = 0; row < log->rows; row++) {
        to[row] = cell(log, row, column);
        first = isnan(first) ? to[row] : first;
        varies = varies || (!isnan(to[row]) && to[row] != first);
    }
    return varies;
}

static bool is_repeat(const struct gap_tip *a, const struct gap_tip *b) {
    bool same = true;
    for (size_t k = 0; k < 3; k++) {
        same = same && a->position_m[k] == b->position_m[k];
    }
    for (size_t k = 0; k < 4 && !isnan(a->quaternion[0]); k++) {
        same = same && a->quaternion[k] == b->quaternion[k];
    }
    return same;
}

static bool take_tip(struct gap_run *run, const struct run_log *log, size_t row, const int column[8]) {
    struct gap_tip *tip = &run->tip[run->tips];
    double size = 0.0;
    *tip = (struct gap_tip){.time_s = run->time_s[row] - GAP_TIP_AGE_S};
    for (size_t i = 0; i < 3; i++) {
        tip->position_m[i] = cell(log, row, column[i]);
    }
    for (size_t i = 0; i < 4; i++) {
        tip->quaternion[i] = cell(log, row, column[3 + i]);
        size += tip->quaternion[i] * tip->quaternion[i];
    }
    if (isnan(tip->position_m[0] + tip->position_m[1] + tip->position_m[2])) {
        return false;
    }
    const double status = cell(log, row, column[7]);
    const bool wrong = !isnan(size) && fabs(sqrt(size) - 1.0) > UNIT_TOLERANCE;
    if (wrong || (!isnan(status) && status != 0.0)) {
        run->tips_skipped++;
        return false;
    }
    run->has_orientation = run->has_orientation || !isnan(size);
    return true;
}

static double moved_m(const struct gap_tip *from, const struct gap_tip *to) {
    double moved = 0.0;
    for (size_t k = 0; k < 3; k++) {
        moved = hypot(moved, to->position_m[k] - from->position_m[k]);
    }
    return moved;
}

static double turned_rad(const struct gap_tip *from, const struct gap_tip *to) {
    double along = 0.0;
    for (size_t k = 0; k < 4; k++) {
        along += to->quaternion[k] * from->quaternion[k];
    }
    return isnan(along) ? 0.0 : 2.0 * acos(fmin(fabs(along), 1.0));
}

/* Does the tip move about this sample? Seen over a window, so that repeats themselves do not decide. */
static bool is_moving(const struct gap_run *run, size_t i) {
    return moved_m(&run->tip[i >= WINDOW ? i - WINDOW : 0],
                   &run->tip[i + WINDOW < run->tips ? i + WINDOW : run->tips - 1]) > MOVED_M;
}

/* .. or turn, before it and after it? That shows slower bends, of which the window holds a rest as well. */
static bool is_turning(const struct gap_run *run, size_t i) {
    return i >= WINDOW && i + WINDOW < run->tips && turned_rad(&run->tip[i - WINDOW], &run->tip[i]) > TURNED_RAD &&
           turned_rad(&run->tip[i], &run->tip[i + WINDOW]) > TURNED_RAD;
}

/* Coordinates that come back one by one are those of a sensor with coarse steps, which may also all come back at once. */
static bool has_fine_steps(const struct gap_run *run) {
    size_t pairs = 0, same = 0;
    for (size_t i = 1; i < run->tips; i++) {
        if (!run->tip[i].repeated) {
            pairs++;
            for (size_t k = 0; k < 3; k++) {
                same += run->tip[i].position_m[k] == run->tip[i - 1].position_m[k] ? 1 : 0;
            }
        }
    }
    return pairs >= FINE_LEAST && (double)same < FINE_SHARE * 3.0 * (double)pairs;
}

static void find_repeats(struct gap_run *run) {
    for (size_t i = 1; i < run->tips; i++) {
        run->tip[i].repeated = is_repeat(&run->tip[i], &run->tip[i - 1]);
    }
    const bool fine = has_fine_steps(run);
    size_t telling = 0;
    for (size_t i = 1; i < run->tips; i++) {
        run->tip[i].telling = fine || is_moving(run, i);
        telling += run->tip[i].telling ? 1 : 0;
    }
    for (size_t i = 1; i < run->tips && telling < TELLING_LEAST; i++) {
        run->tip[i].telling = is_turning(run, i);
    }
}

static bool is_driving(double state) {
    return state == (double)SUPERVISOR_ACTIVE || state == (double)SUPERVISOR_HOLD;
}

/* Where the state says that control ends, no coil is left energised until its period ends. */
static void find_cuts(struct gap_run *run, const struct run_log *log) {
    const int column = run_log_column(log, "state");
    bool driving = false;
    for (size_t row = 0; row < run->rows; row++) {
        const double state = cell(log, row, column);
        run->cut[row] = driving && !isnan(state) && !is_driving(state);
        driving = isnan(state) ? driving : is_driving(state);
    }
}

/* The first row at or after a time that was written down with three decimals. */
static size_t row_at(const struct gap_run *run, double time_s) {
    size_t row = 0;
    while (row < run->rows && run->time_s[row] < time_s - 6e-4) {
        row++;
    }
    return row;
}

/* Where somebody cut the recording: the import wrote down when its segments start. False: out of memory. */
static bool find_breaks(struct gap_run *run, const struct run_log *log) {
    const char *text = run_log_metadata(log, "segments");
    run->break_row = calloc(run->rows + 1, sizeof *run->break_row);
    while (run->break_row != NULL && text != NULL) {
        char *end;
        const double start_s = strtod(text, &end);
        if (end == text) {
            break;
        }
        const size_t row = row_at(run, start_s);
        const size_t last = run->breaks > 0 ? run->break_row[run->breaks - 1] : 0;
        if (row > last && row < run->rows) {
            run->break_row[run->breaks++] = row;
        }
        text = end;
    }
    return run->break_row != NULL;
}

static bool out_of_memory(struct gap_run *run, char *error, size_t error_bytes) {
    (void)snprintf(error, error_bytes, "%s: out of memory", run->path);
    return false;
}

static bool take_log(struct gap_run *run, const struct run_log *log, char *error, size_t error_bytes) {
    static const char *const duties[3] = {"valve1", "valve2", "valve3"};
    static const char *const readings[3] = {"p1_pa", "p2_pa", "p3_pa"};
    static const char *const commands[3] = {"p1_cmd_pa", "p2_cmd_pa", "p3_cmd_pa"};
    static const char *const tips[8] = {"tip_x_m", "tip_y_m", "tip_z_m", "tip_qw",
                                        "tip_qx",  "tip_qy",  "tip_qz",  "tip_status"};
    int tip_column[8];
    const char *table_hash = run_log_metadata(log, "table");
    run->rows = log->rows;
    run->header_line = log->header_line;
    run->table_hash = table_hash != NULL ? strtoull(table_hash, NULL, 16) : 0;
    run->time_s = malloc(log->rows * sizeof(double));
    run->duty = malloc(3 * log->rows * sizeof(double));
    run->reading_pa = malloc(3 * log->rows * sizeof(double));
    run->command_pa = malloc(3 * log->rows * sizeof(double));
    run->supply_pa = malloc(log->rows * sizeof(double));
    run->temperature_k = malloc(log->rows * sizeof(double));
    run->tip = malloc(log->rows * sizeof *run->tip);
    run->cut = calloc(log->rows, sizeof *run->cut);
    if (run->time_s == NULL || run->duty == NULL || run->reading_pa == NULL || run->command_pa == NULL ||
        run->supply_pa == NULL || run->temperature_k == NULL || run->tip == NULL || run->cut == NULL) {
        return out_of_memory(run, error, error_bytes);
    }
    const int time = run_log_column(log, "time_s");
    for (size_t row = 0; row < log->rows; row++) {
        run->time_s[row] = cell(log, row, time);
    }
    run->has_duty = fill3(log, duties, run->duty, true);
    run->has_reading = fill3(log, readings, run->reading_pa, false);
    run->has_command = fill3(log, commands, run->command_pa, true);
    run->has_supply = fill1(log, "supply_pa", run->supply_pa);
    run->has_temperature = fill1(log, "temperature_k", run->temperature_k);
    for (size_t i = 0; i < 8; i++) {
        tip_column[i] = run_log_column(log, tips[i]);
    }
    for (size_t row = 0; row < log->rows; row++) {
        run->tips += take_tip(run, log, row, tip_column);
    }
    find_repeats(run);
    find_cuts(run, log);
    if (!find_breaks(run, log)) {
        return out_of_memory(run, error, error_bytes);
    }
    return gap_baseline_take(run, log, error, error_bytes);
}

bool gap_data_read(struct gap_data *data, const char *const *paths, size_t count, char *error, size_t error_bytes) {
    memset(data, 0, sizeof *data);
    if (count == 0 || count > GAP_RUNS_MAX) {
        (void)snprintf(error, error_bytes, "a diagnosis takes 1 to %d run logs, not %zu", GAP_RUNS_MAX, count);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        struct run_log log;
        struct gap_run *run = &data->run[data->runs++];
        (void)snprintf(run->path, sizeof run->path, "%s", paths[i]);
        bool taken = run_log_read(paths[i], &log, error, error_bytes);
        if (taken) {
            if (i == 0) {
                (void)snprintf(data->module, sizeof data->module, "%s", log.module);
            } else if (strcmp(data->module, log.module) != 0) {
                (void)snprintf(error, error_bytes, "%s is of module %s, but %s of module %s: diagnose them apart", paths[i],
                               log.module, paths[0], data->module);
                taken = false;
            }
            taken = taken && unit_check(paths[i], &log, error, error_bytes) && take_log(run, &log, error, error_bytes);
            run_log_free(&log);
        }
        if (!taken) {
            gap_data_free(data);
            return false;
        }
    }
    return true;
}

/* --- repeated samples --- */

struct repeat_count {
    double samples;
    double repeats;
    double runs; /* of repeats without another sample between */
};

static struct repeat_count count_since(const struct gap_data *data, double since_s, double until_s) {
    struct repeat_count count = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < data->runs; i++) {
        const struct gap_run *run = &data->run[i];
        for (size_t t = 0; t < run->tips; t++) {
            const struct gap_tip *tip = &run->tip[t];
            if (tip->telling && tip->time_s >= since_s && tip->time_s < until_s) {
                count.samples += 1.0;
                count.repeats += tip->repeated ? 1.0 : 0.0;
                count.runs += tip->repeated && t > 0 && !run->tip[t - 1].repeated ? 1.0 : 0.0;
            }
        }
    }
    return count;
}

static double log_likelihood(const struct repeat_count *count) {
    const double share = fmin(fmax(count->repeats / fmax(count->samples, 1.0), 1e-4), 1.0 - 1e-4);
    return count->repeats * log(share) + (count->samples - count->repeats) * log1p(-share);
}

struct gap_repeats gap_data_repeats(const struct gap_data *data) {
    const struct repeat_count all = count_since(data, -INFINITY, INFINITY);
    struct repeat_count after = all;
    double most = 0.0, onset_s = 0.0, last_s = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct gap_run *run = &data->run[i];
        last_s = run->tips > 0 ? fmax(last_s, run->tip[run->tips - 1].time_s) : last_s;
    }
    const double run_samples = fmax(all.repeats / fmax(all.runs, 1.0), 1.0);
    const int steps = (int)fmin(last_s / ONSET_STEP_S, 1e5);
    for (int step = 1; step < steps && all.repeats >= TELLING_LEAST; step++) {
        const double at_s = step * ONSET_STEP_S;
        const struct repeat_count early = count_since(data, -INFINITY, at_s), late = count_since(data, at_s, INFINITY);
        /* what comes in runs says less */
        const double gain = (log_likelihood(&early) + log_likelihood(&late) - log_likelihood(&all)) / run_samples;
        const bool rare = early.repeats * late.samples < ONSET_BEFORE * late.repeats * early.samples;
        if (rare && early.samples >= TELLING_LEAST && late.samples >= TELLING_LEAST && gain > fmax(most, ONSET_GAIN)) {
            most = gain;
            onset_s = at_s;
            after = late;
        }
    }
    const bool enough = after.samples >= TELLING_LEAST;
    return (struct gap_repeats){onset_s, enough ? after.repeats / after.samples : 0.0, after.samples,
                                fmax(after.repeats / fmax(after.runs, 1.0), 1.0)};
}

void gap_data_free(struct gap_data *data) {
    for (size_t i = 0; i < data->runs; i++) {
        struct gap_run *run = &data->run[i];
        gap_baseline_free(run);
        free(run->time_s);
        free(run->duty);
        free(run->reading_pa);
        free(run->command_pa);
        free(run->supply_pa);
        free(run->temperature_k);
        free(run->tip);
        free(run->cut);
        free(run->break_row);
    }
    memset(data, 0, sizeof *data);
}

double gap_data_duration_s(const struct gap_data *data) {
    double sum_s = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        sum_s += data->run[i].time_s[data->run[i].rows - 1] - data->run[i].time_s[0];
    }
    return sum_s;
}
