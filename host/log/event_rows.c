#include "log/event_rows.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "log/run_columns.h"

void event_rows_start(struct event_rows *events, struct run_log *log, int64_t merge_us) {
    memset(log, 0, sizeof *log);
    *events = (struct event_rows){.log = log, .merge_us = merge_us};
    for (size_t c = 0; c < run_column_count(); c++) {
        (void)snprintf(log->name[log->columns++], RUN_LOG_NAME_BYTES, "%s", run_column_name(c));
    }
}

static bool open_row(struct event_rows *events, int64_t time_us) {
    struct run_log *log = events->log;
    if (log->rows == events->room) {
        const size_t room = events->room == 0 ? 1024 : 2 * events->room;
        double *larger = realloc(log->value, room * log->columns * sizeof *larger);
        if (larger == NULL) {
            return false;
        }
        log->value = larger;
        events->room = room;
    }
    if (log->rows == 0) {
        events->zero_us = time_us;
    }
    double *row = &log->value[log->rows++ * log->columns];
    for (size_t c = 0; c < log->columns; c++) {
        row[c] = NAN;
    }
    row[run_log_column(log, "time_s")] = 1e-6 * (double)(time_us - events->zero_us);
    events->row_us = time_us;
    return true;
}

static double *last_cell(const struct event_rows *events, const char *column) {
    const struct run_log *log = events->log;
    return &log->value[(log->rows - 1) * log->columns + (size_t)run_log_column(log, column)];
}

static bool fits_last_row(const struct event_rows *events, int64_t time_us, const struct event_value *values,
                          size_t count) {
    if (events->log->rows == 0 || time_us < events->row_us || time_us - events->row_us > events->merge_us) {
        return false;
    }
    for (size_t v = 0; v < count; v++) {
        if (!isnan(*last_cell(events, values[v].column))) {
            return false;
        }
    }
    return true;
}

bool event_rows_add(struct event_rows *events, int64_t time_us, const struct event_value *values,
                    size_t count) {
    if (count == 0) {
        return true;
    }
    if (!fits_last_row(events, time_us, values, count) && !open_row(events, time_us)) {
        return false;
    }
    for (size_t v = 0; v < count; v++) {
        *last_cell(events, values[v].column) = values[v].value;
    }
    return true;
}

/* Order of the rows: time first, then as they came. */
static int compare_rows(const void *a, const void *b) {
    const double *left = *(const double *const *)a, *right = *(const double *const *)b;
    const int by_time = (left[0] > right[0]) - (left[0] < right[0]);
    return by_time != 0 ? by_time : (left > right) - (left < right);
}

/* Columns with a value somewhere, in their order; how many. */
static size_t used_columns(const struct run_log *log, size_t used[RUN_LOG_COLUMNS_MAX]) {
    size_t count = 0;
    for (size_t c = 0; c < log->columns; c++) {
        bool any = false;
        for (size_t row = 0; row < log->rows && !any; row++) {
            any = !isnan(log->value[row * log->columns + c]);
        }
        if (any) {
            used[count++] = c;
        }
    }
    return count;
}

static void copy_sorted(const struct run_log *log, const double **order, const size_t *used, size_t count,
                        double *value) {
    const double first_s = order[0][0]; /* time_s is the first column */
    for (size_t row = 0; row < log->rows; row++) {
        for (size_t c = 0; c < count; c++) {
            value[row * count + c] = order[row][used[c]] - (used[c] == 0 ? first_s : 0.0);
        }
    }
}

bool event_rows_finish(struct event_rows *events) {
    struct run_log *log = events->log;
    size_t used[RUN_LOG_COLUMNS_MAX];
    char zero[64];
    if (log->rows == 0) {
        return true;
    }
    const size_t count = used_columns(log, used);
    if (count == 0) {
        return true;
    }
    const double **order = malloc(log->rows * sizeof *order);
    double *value = malloc(log->rows * count * sizeof *value);
    if (order == NULL || value == NULL) {
        free(order);
        free(value);
        return false;
    }
    for (size_t row = 0; row < log->rows; row++) {
        order[row] = &log->value[row * log->columns];
    }
    qsort(order, log->rows, sizeof *order, compare_rows);
    copy_sorted(log, order, used, count, value);
    (void)snprintf(zero, sizeof zero, "%" PRId64 " us in the source",
                   events->zero_us + (int64_t)llround(1e6 * order[0][0]));
    free(order);
    free(log->value);
    log->value = value;
    log->columns = count;
    for (size_t c = 0; c < count; c++) {
        memmove(log->name[c], log->name[used[c]], RUN_LOG_NAME_BYTES);
    }
    return run_log_set_metadata(log, "time_zero", zero);
}
