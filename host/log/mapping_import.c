#include "log/mapping_import.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "log/run_columns.h"
#include "log/tip_track.h"

#define STILL_MOVED_SHARE                                                                                    \
    0.9 /* of the middle displacement while moved: below it the tip is on its way back */
#define SEGMENTS_BYTES 4096

static const char *const tip_columns[] = {"tip_x_m", "tip_y_m", "tip_z_m", "tip_qw",
                                          "tip_qx",  "tip_qy",  "tip_qz"};

struct import {
    const struct mapping *mapping;
    const char *path;
    const struct mapping_setting *settings;
    size_t settings_count;
    struct source_table table;
    struct rest_rows rest;
    struct tip_pose *pose; /* NULL: no tip */
    struct run_log *log;
    char *error;
    size_t error_bytes;
};

/* `line` 0: about the whole file. */
static bool fail(struct import *import, int line, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static bool fail(struct import *import, int line, const char *format, ...) {
    char what[512], at[16] = "";
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (line > 0) {
        (void)snprintf(at, sizeof at, ":%d", line);
    }
    (void)snprintf(import->error, import->error_bytes, "%s%s: %s", import->path, at, what);
    return false;
}

static bool note(struct import *import, const char *key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static bool note(struct import *import, const char *key, const char *format, ...) {
    char text[SEGMENTS_BYTES];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return run_log_set_metadata(import->log, key, text) || fail(import, 0, "out of memory");
}

static double *cell(const struct import *import, size_t row, const char *column) {
    const int at = run_log_column(import->log, column);
    return at < 0 ? NULL : &import->log->value[row * import->log->columns + (size_t)at];
}

/* --- the columns that there will be --- */

static const struct mapping_constant *find_constant(const struct import *import, const char *column) {
    for (unsigned c = 0; c < import->mapping->constants_count; c++) {
        if (strcmp(import->mapping->constants[c].to, column) == 0) {
            return &import->mapping->constants[c];
        }
    }
    return NULL;
}

static const struct mapping_setting *find_setting(const struct import *import, const char *column) {
    for (size_t s = 0; s < import->settings_count; s++) {
        if (strcmp(import->settings[s].column, column) == 0) {
            return &import->settings[s];
        }
    }
    return NULL;
}

static bool add_column(struct import *import, const char *name) {
    struct run_log *log = import->log;
    if (log->columns == RUN_LOG_COLUMNS_MAX) {
        return fail(import, 0, "more than %d columns", RUN_LOG_COLUMNS_MAX);
    }
    (void)snprintf(log->name[log->columns++], RUN_LOG_NAME_BYTES, "%s", name);
    return true;
}

static bool add_setting(struct import *import, const struct mapping_setting *setting) {
    const struct mapping_constant *constant = find_constant(import, setting->column);
    if (constant != NULL) {
        return (constant->value == NULL && constant->steps_count == 0) ||
               fail(import, 0, "%s cannot be set: mapping %s gives its value already", setting->column,
                    import->mapping->name);
    }
    if (run_log_column(import->log, setting->column) >= 0) {
        return fail(import, 0, "%s cannot be set: mapping %s takes it from the file, or it is set twice",
                    setting->column, import->mapping->name);
    }
    return add_column(import, setting->column);
}

static bool lay_out(struct import *import) {
    const struct mapping *mapping = import->mapping;
    bool sound = add_column(import, "time_s");
    for (unsigned c = 0; sound && c < mapping->columns_count; c++) {
        sound = strcmp(mapping->columns[c].to, "time_s") == 0 || add_column(import, mapping->columns[c].to);
    }
    for (unsigned c = 0; sound && c < mapping->constants_count; c++) {
        sound = add_column(import, mapping->constants[c].to);
    }
    const size_t tip_count = mapping->tip == NULL ? 0 : tip_track_has_rotation(mapping) ? 7 : 3;
    for (size_t k = 0; sound && k < tip_count; k++) {
        sound = add_column(import, tip_columns[k]);
    }
    for (size_t s = 0; sound && s < import->settings_count; s++) {
        sound = add_setting(import, &import->settings[s]);
    }
    return sound;
}

static bool want_columns(struct import *import) {
    bool sound = tip_track_want(import->mapping, &import->table);
    for (unsigned c = 0; sound && c < import->mapping->columns_count; c++) {
        sound = source_table_want(&import->table, import->mapping->columns[c].column) >= 0;
    }
    return sound || fail(import, 0, "mapping %s wants more than %d columns", import->mapping->name,
                         SOURCE_COLUMNS_MAX);
}

/* --- measured columns --- */

static void fill_column(struct import *import, const struct mapping_column *column) {
    const struct run_unit *unit = run_unit_find(column->unit);
    const double factor =
        (column->sign == NULL ? 1.0 : *column->sign) * (column->scale == NULL ? 1.0 : *column->scale);
    const size_t from = (size_t)source_table_want(&import->table, column->column);
    for (size_t row = 0; row < import->table.rows; row++) {
        const double value = import->table.value[row * import->table.wanted_count + from];
        *cell(import, row, column->to) = run_unit_to_si(unit, factor * (value - column->offset));
    }
}

static bool fill_time(struct import *import) {
    const double start_s = *cell(import, 0, "time_s");
    for (size_t row = 0; row < import->log->rows; row++) {
        double *time_s = cell(import, row, "time_s");
        if (isnan(*time_s)) {
            return fail(import, import->table.line[row], "the time is missing; every row needs it");
        }
        if (row > 0 && *time_s - start_s < *cell(import, row - 1, "time_s")) {
            return fail(import, import->table.line[row], "time runs backwards, from %.9g to %.9g s",
                        *cell(import, row - 1, "time_s") + start_s, *time_s);
        }
        *time_s -= start_s;
    }
    return !(fabs(start_s) > 0.0) || note(import, "time_zero", "%.6f s in the source", start_s);
}

static bool find_rest(struct import *import) {
    const struct mapping_rest *rest = import->mapping->rest;
    if (rest == NULL) {
        return true;
    }
    while (import->rest.first < import->log->rows &&
           *cell(import, import->rest.first, "time_s") < rest->from_s) {
        import->rest.first++;
    }
    import->rest.end = import->rest.first;
    while (import->rest.end < import->log->rows &&
           *cell(import, import->rest.end, "time_s") < rest->until_s) {
        import->rest.end++;
    }
    return import->rest.end > import->rest.first ||
           fail(
               import, 0,
               "no row lies between %g and %g s after the start, where mapping %s says the module is at rest",
               rest->from_s, rest->until_s, import->mapping->name);
}

static bool subtract_rest(struct import *import, const struct mapping_column *column) {
    double sum = 0.0;
    size_t count = 0;
    for (size_t row = import->rest.first; row < import->rest.end; row++) {
        const double value = *cell(import, row, column->to);
        if (!isnan(value)) {
            sum += value;
            count++;
        }
    }
    if (count == 0) {
        return fail(import, 0, "column '%s' is empty in every row at rest", column->column);
    }
    const double mean = sum / (double)count;
    for (size_t row = 0; row < import->log->rows; row++) {
        *cell(import, row, column->to) -= mean;
    }
    char key[RUN_LOG_NAME_BYTES + 8];
    (void)snprintf(key, sizeof key, "rest_%s", column->to);
    return note(import, key, "%.6g taken off, the mean of %zu rows", mean, count);
}

static bool fill_columns(struct import *import) {
    const struct mapping *mapping = import->mapping;
    for (unsigned c = 0; c < mapping->columns_count; c++) {
        fill_column(import, &mapping->columns[c]);
    }
    bool sound = fill_time(import) && find_rest(import);
    for (unsigned c = 0; sound && c < mapping->columns_count; c++) {
        sound = !mapping->columns[c].subtract_rest || subtract_rest(import, &mapping->columns[c]);
    }
    return sound;
}

static bool fill_tip(struct import *import) {
    if (import->mapping->tip == NULL) {
        return true;
    }
    import->pose = calloc(import->log->rows, sizeof *import->pose);
    if (import->pose == NULL) {
        return fail(import, 0, "out of memory");
    }
    if (!tip_track_build(import->mapping, &import->table, &import->rest, import->path, import->pose,
                         import->error, import->error_bytes)) {
        return false;
    }
    for (size_t row = 0; row < import->log->rows; row++) {
        const struct tip_pose *pose = &import->pose[row];
        for (size_t k = 0; pose->has_position && k < 3; k++) {
            *cell(import, row, tip_columns[k]) = pose->position_m[k];
        }
        for (size_t k = 0; pose->has_rotation && k < 4; k++) {
            *cell(import, row, tip_columns[3 + k]) = pose->rotation[k];
        }
    }
    return true;
}

/* --- constant columns --- */

static int compare(const void *a, const void *b) {
    const double left = *(const double *)a, right = *(const double *)b;
    return (left > right) - (left < right);
}

/* Rows [*first, *last] from the first in which the tip is away from rest to the last before it returns. */
static bool find_motion(struct import *import, const struct mapping_constant *constant, size_t *first,
                        size_t *last) {
    const size_t rows = import->log->rows;
    double rest_m[3];
    double *moved_m = calloc(2 * rows, sizeof *moved_m), *sorted_m = moved_m + rows;
    size_t count = 0;
    bool found = moved_m != NULL && tip_track_rest_position(import->pose, &import->rest, rest_m);
    for (size_t row = 0; found && row < rows; row++) {
        const double *at_m = import->pose[row].position_m;
        const bool known = import->pose[row].has_position;
        moved_m[row] =
            known ? hypot(hypot(at_m[0] - rest_m[0], at_m[1] - rest_m[1]), at_m[2] - rest_m[2]) : 0.0;
        if (moved_m[row] > constant->while_moved_m) {
            *first = count == 0 ? row : *first;
            sorted_m[count++] = moved_m[row];
        }
    }
    if (count > 0) {
        qsort(sorted_m, count, sizeof *sorted_m, compare);
        const double still_m = STILL_MOVED_SHARE * sorted_m[count / 2];
        for (size_t row = *first; row < rows; row++) {
            *last = moved_m[row] >= still_m ? row : *last;
        }
    }
    free(moved_m);
    return count > 0 ||
           fail(import, 0, "the tip never moves by more than %g mm from rest, so that no step of %s is found",
                1e3 * constant->while_moved_m, constant->to);
}

static bool fill_while_moved(struct import *import, const struct mapping_constant *constant, double value) {
    size_t first = 0, last = 0;
    if (!find_motion(import, constant, &first, &last)) {
        return false;
    }
    for (size_t row = 0; row < import->log->rows; row++) {
        *cell(import, row, constant->to) = row >= first && row <= last ? value : 0.0;
    }
    char key[RUN_LOG_NAME_BYTES + 8];
    (void)snprintf(key, sizeof key, "step_%s", constant->to);
    return note(import, key, "%.6g from %.3f to %.3f s, found by the tip moving more than %g mm from rest%s",
                value, *cell(import, first, "time_s"), *cell(import, last, "time_s"),
                1e3 * constant->while_moved_m, last + 1 == import->log->rows ? "; it holds to the end" : "");
}

static double step_value(const struct mapping_constant *constant, const struct run_unit *unit,
                         double time_s) {
    double value = NAN;
    for (unsigned s = 0; s < constant->steps_count && constant->steps[s].at[0] <= time_s; s++) {
        value = run_unit_to_si(unit, constant->steps[s].at[1]);
    }
    return value;
}

static bool fill_constant(struct import *import, const struct mapping_constant *constant) {
    const struct run_unit *unit = constant->unit == NULL ? NULL : run_unit_find(constant->unit);
    const struct mapping_setting *setting = find_setting(import, constant->to);
    for (size_t row = 0; constant->steps_count > 0 && row < import->log->rows; row++) {
        *cell(import, row, constant->to) = step_value(constant, unit, *cell(import, row, "time_s"));
    }
    if (constant->steps_count > 0) {
        return true;
    }
    if (constant->value == NULL && setting == NULL) {
        enum run_dimension dimension = RUN_NUMBER;
        (void)run_column_find(constant->to, &dimension);
        return fail(import, 0, "the file does not say what %s was: give it with --set %s=VALUE; it is %s",
                    constant->to, constant->to, run_dimension_words(dimension));
    }
    const double value = constant->value != NULL ? run_unit_to_si(unit, *constant->value) : setting->value;
    if (constant->while_moved_m > 0.0) {
        return fill_while_moved(import, constant, value);
    }
    for (size_t row = 0; row < import->log->rows; row++) {
        *cell(import, row, constant->to) = value;
    }
    return true;
}

static bool fill_constants(struct import *import) {
    bool sound = true;
    for (unsigned c = 0; sound && c < import->mapping->constants_count; c++) {
        sound = fill_constant(import, &import->mapping->constants[c]);
    }
    for (size_t s = 0; sound && s < import->settings_count; s++) {
        const struct mapping_setting *setting = &import->settings[s];
        for (size_t row = 0; find_constant(import, setting->column) == NULL && row < import->log->rows;
             row++) {
            *cell(import, row, setting->column) = setting->value;
        }
    }
    return sound;
}

/* --- segments --- */

static bool starts_segment(const struct import *import, size_t row) {
    static const char *const pressures[] = {"p1_pa", "p2_pa", "p3_pa"};
    const struct mapping_gaps *gaps = import->mapping->gaps;
    if (gaps->cut_after_s > 0.0 &&
        *cell(import, row, "time_s") - *cell(import, row - 1, "time_s") > gaps->cut_after_s) {
        return true;
    }
    for (size_t c = 0; gaps->pressure_jump_pa > 0.0 && c < 3; c++) {
        const double *now_pa = cell(import, row, pressures[c]);
        if (now_pa != NULL && fabs(*now_pa - *cell(import, row - 1, pressures[c])) > gaps->pressure_jump_pa) {
            return true;
        }
    }
    return false;
}

/* "0.000 8.050 11.050": where a stretch without a cut starts, in s. */
static bool note_segments(struct import *import) {
    char text[SEGMENTS_BYTES];
    size_t used = (size_t)snprintf(text, sizeof text, "%.3f", *cell(import, 0, "time_s"));
    if (import->mapping->gaps == NULL) {
        return true;
    }
    for (size_t row = 1; row < import->log->rows && used < sizeof text; row++) {
        if (starts_segment(import, row)) {
            used += (size_t)snprintf(text + used, sizeof text - used, " %.3f", *cell(import, row, "time_s"));
        }
    }
    return used < sizeof text
               ? note(import, "segments", "%s", text)
               : fail(import, 0, "more segments than can be listed: raise the limits under 'gaps:'");
}

/* --- all of it --- */

static bool note_origin(struct import *import) {
    const char *slash = strrchr(import->path, '/');
    const struct mapping *mapping = import->mapping;
    return (mapping->module == NULL || note(import, "module", "%s", mapping->module)) &&
           note(import, "imported", "%s by mapping %s", slash == NULL ? import->path : slash + 1,
                mapping->name) &&
           note(import, "source", "%s", mapping->source) &&
           (mapping->note == NULL || note(import, "note", "%s", mapping->note));
}

static bool import_all(struct import *import) {
    const struct source_format format = mapping_format(import->mapping);
    if (!want_columns(import) || !lay_out(import) ||
        !source_table_read(import->path, &format, &import->table, import->error, import->error_bytes)) {
        return false;
    }
    struct run_log *log = import->log;
    log->rows = import->table.rows;
    log->value = malloc(log->rows * log->columns * sizeof *log->value);
    if (log->value == NULL) {
        return fail(import, 0, "out of memory");
    }
    for (size_t i = 0; i < log->rows * log->columns; i++) {
        log->value[i] = NAN;
    }
    return note_origin(import) && fill_columns(import) && fill_tip(import) && fill_constants(import) &&
           note_segments(import);
}

bool mapping_import(const struct mapping *mapping, const char *path, const struct mapping_setting *settings,
                    size_t count, struct run_log *log, char *error, size_t error_bytes) {
    struct import import = {.mapping = mapping,
                            .path = path,
                            .settings = settings,
                            .settings_count = count,
                            .log = log,
                            .error = error,
                            .error_bytes = error_bytes};
    memset(log, 0, sizeof *log);
    const bool sound = import_all(&import);
    source_table_free(&import.table);
    free(import.pose);
    if (!sound) {
        run_log_free(log);
    }
    return sound;
}
