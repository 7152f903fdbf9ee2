#include "log/run_log.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "log/run_columns.h"

#define FIRST_LINE "# tribend-run 1"
#define ROWS_LEAST 2

/* --- writing while a run goes on --- */

static const char header[] =
    "time_s,valve1,valve2,valve3,p1_cmd_pa,p2_cmd_pa,p3_cmd_pa,p1_pa,p2_pa,p3_pa,supply_pa,"
    "tip_x_m,tip_y_m,tip_z_m,tip_qw,tip_qx,tip_qy,tip_qz,tip_quality,tip_status,state,"
    "bend_cmd_rad,direction_cmd_rad\n";

bool run_log_create(struct run_log_writer *writer, const char *path, const struct run_log_metadata *metadata,
                    char *error, size_t error_bytes) {
    if (!output_file_open(&writer->file, path, error, error_bytes)) {
        return false;
    }
    fprintf(writer->file.stream, "%s\n# module: %s\n# table: %016" PRIx64 "\n# rate: %.6g Hz\n# note: %s\n%s",
            FIRST_LINE, metadata->module, metadata->table_hash, metadata->rate_hz, metadata->note, header);
    return true;
}

void run_log_append(struct run_log_writer *writer, const struct link_report *report,
                    const struct controller_command *command) {
    FILE *file = writer->file.stream;
    const struct controller_status *status = &report->status;
    fprintf(file, "%.6f,%.6g,%.6g,%.6g", 1e-6 * (double)report->time_us, (double)report->duty[0],
            (double)report->duty[1], (double)report->duty[2]);
    fprintf(file, ",%.8g,%.8g,%.8g", (double)status->pressure_target_pa[0],
            (double)status->pressure_target_pa[1], (double)status->pressure_target_pa[2]);
    fprintf(file, ",%.8g,%.8g,%.8g,%.8g", (double)report->pressure_pa[0], (double)report->pressure_pa[1],
            (double)report->pressure_pa[2], (double)report->supply_pa);
    if (report->tip_new) {
        fprintf(file, ",%.7g,%.7g,%.7g,%.9g,%.9g,%.9g,%.9g,%u,%u", (double)report->tip_position_m[0],
                (double)report->tip_position_m[1], (double)report->tip_position_m[2],
                (double)report->tip_quaternion[0], (double)report->tip_quaternion[1],
                (double)report->tip_quaternion[2], (double)report->tip_quaternion[3], report->tip_quality,
                report->tip_status);
    } else {
        fputs(",,,,,,,,,", file);
    }
    fprintf(file, ",%s", supervisor_state_name(status->state));
    if (command->kind == COMMAND_BEND) {
        fprintf(file, ",%.8g,%.8g\n", (double)command->bend_rad, (double)command->direction_rad);
    } else {
        fputs(",,\n", file);
    }
}

bool run_log_finish(struct run_log_writer *writer, char *error, size_t error_bytes) {
    return output_file_commit(&writer->file, error, error_bytes);
}

void run_log_discard(struct run_log_writer *writer) {
    output_file_discard(&writer->file);
}

/* --- writing what is in memory --- */

/* A line break in a value would end its line: what follows would be read as something else. */
static void write_value(FILE *file, const char *text) {
    for (; *text != '\0'; text++) {
        fputc(*text == '\n' || *text == '\r' ? ' ' : *text, file);
    }
}

static void write_field(FILE *file, const char *name, double value) {
    if (isnan(value)) {
        return;
    }
    if (strcmp(name, "state") == 0 && value >= 0.0 && value < (double)SUPERVISOR_STATE_COUNT) {
        fputs(supervisor_state_name((enum supervisor_state)value), file);
    } else if (strcmp(name, "time_s") == 0) {
        fprintf(file, "%.6f", value);
    } else {
        fprintf(file, "%.9g", value);
    }
}

bool run_log_write_columns(const char *path, const char *const *names, const double *value, size_t rows,
                           size_t columns, const struct run_log_pair *metadata, size_t pairs, char *error,
                           size_t error_bytes) {
    struct output_file output;
    if (!output_file_open(&output, path, error, error_bytes)) {
        return false;
    }
    fputs(FIRST_LINE "\n", output.stream);
    for (size_t p = 0; p < pairs; p++) {
        fprintf(output.stream, "# %s: ", metadata[p].key);
        write_value(output.stream, metadata[p].value);
        fputc('\n', output.stream);
    }
    for (size_t c = 0; c < columns; c++) {
        fprintf(output.stream, "%s%s", names[c], c + 1 < columns ? "," : "\n");
    }
    for (size_t row = 0; row < rows; row++) {
        for (size_t c = 0; c < columns; c++) {
            write_field(output.stream, names[c], value[row * columns + c]);
            fputc(c + 1 < columns ? ',' : '\n', output.stream);
        }
    }
    return output_file_commit(&output, error, error_bytes);
}

bool run_log_write(const char *path, const struct run_log *log, char *error, size_t error_bytes) {
    const char *names[RUN_LOG_COLUMNS_MAX];
    struct run_log_pair pairs[RUN_LOG_METADATA_MAX];
    for (size_t c = 0; c < log->columns; c++) {
        names[c] = log->name[c];
    }
    for (size_t p = 0; p < log->metadata_count; p++) {
        pairs[p] = (struct run_log_pair){log->metadata[p].key, log->metadata[p].value};
    }
    return run_log_write_columns(path, names, log->value, log->rows, log->columns, pairs, log->metadata_count,
                                 error, error_bytes);
}

/* --- reading --- */

struct reader {
    FILE *file;
    const char *path;
    int line_number;
    char *line;
    size_t line_room;
    size_t room;
    char *error;
    size_t error_bytes;
};

static bool fail(struct reader *reader, const char *format, ...) __attribute__((format(printf, 2, 3)));
static bool fail(struct reader *reader, const char *format, ...) {
    char what[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    (void)snprintf(reader->error, reader->error_bytes, "%s:%d: %s", reader->path, reader->line_number, what);
    return false;
}

/* Next line without its end; false at the end of the file. A line with a zero byte ends there, and its fields
 * are missed. */
static bool next_line(struct reader *reader) {
    if (getline(&reader->line, &reader->line_room, reader->file) < 0) {
        return false;
    }
    reader->line_number++;
    reader->line[strcspn(reader->line, "\r\n")] = '\0';
    return true;
}

static bool read_header(struct reader *reader, struct run_log *log) {
    char *rest = reader->line;
    if (*rest == '\0') {
        return fail(reader, "the header is empty; it lists the columns, time_s among them");
    }
    for (const char *name = strsep(&rest, ","); name != NULL; name = strsep(&rest, ",")) {
        if (log->columns == RUN_LOG_COLUMNS_MAX) {
            return fail(reader, "the header has more than %d columns: leave out what is not needed",
                        RUN_LOG_COLUMNS_MAX);
        }
        if (*name == '\0' || strlen(name) >= RUN_LOG_NAME_BYTES) {
            return fail(reader, "column %zu of the header: '%.40s' is no name of 1 to %d characters",
                        log->columns + 1, name, RUN_LOG_NAME_BYTES - 1);
        }
        if (run_log_column(log, name) >= 0) {
            return fail(reader, "column %s appears twice in the header", name);
        }
        memcpy(log->name[log->columns++], name, strlen(name) + 1);
    }
    return run_log_column(log, "time_s") >= 0 ||
           fail(reader, "the header has no column time_s, which every log needs");
}

/* "# key: value"; other comments are skipped. */
static bool read_metadata(struct reader *reader, struct run_log *log) {
    char *key = reader->line + 1, *colon = strchr(reader->line, ':');
    key += strspn(key, " ");
    if (colon == NULL || colon == key) {
        return true;
    }
    *colon = '\0';
    const char *value = colon + 1;
    return run_log_set_metadata(log, key, value + strspn(value, " ")) ||
           fail(reader, "more than %d '# key: value' lines: leave out what is not needed",
                RUN_LOG_METADATA_MAX);
}

static bool read_preamble(struct reader *reader, struct run_log *log) {
    if (!next_line(reader)) {
        reader->line_number = 1;
        return fail(reader, "the file is empty: a run log starts with '" FIRST_LINE "', metadata, a header and rows");
    }
    if (strcmp(reader->line, FIRST_LINE) != 0) {
        return fail(reader, "this is no run log: the first line is not '" FIRST_LINE
                            "'; for the logs of other programs see tribend import");
    }
    while (next_line(reader)) {
        if (reader->line[0] != '#') {
            log->header_line = (size_t)reader->line_number;
            return read_header(reader, log);
        }
        if (!read_metadata(reader, log)) {
            return false;
        }
    }
    return fail(reader, "the file ends before its header");
}

static bool parse_field(const char *text, bool is_state, double *value) {
    *value = NAN;
    if (*text == '\0') {
        return true;
    }
    for (int s = 0; is_state && s < (int)SUPERVISOR_STATE_COUNT; s++) {
        if (strcmp(text, supervisor_state_name((enum supervisor_state)s)) == 0) {
            *value = (double)s;
            return true;
        }
    }
    char *end = NULL;
    *value = strtod(text, &end);
    return *end == '\0' && end != text && isfinite(*value);
}

static bool reject_field(struct reader *reader, const char *column, const char *field) {
    char *end = NULL;
    const double value = strtod(field, &end);
    if (strcmp(column, "state") == 0) {
        return fail(reader, "column state: there is no state '%.32s'", field);
    }
    if (end != field && *end == '\0' && !isfinite(value)) {
        return fail(reader,
                    "column %s: %.32s is no finite number; leave the field empty where nothing was measured",
                    column, field);
    }
    return fail(reader, "column %s: '%.32s' is not a number", column, field);
}

static bool make_room(struct reader *reader, struct run_log *log) {
    if (log->rows < reader->room) {
        return true;
    }
    reader->room = reader->room == 0 ? 4096 : 2 * reader->room;
    double *larger = realloc(log->value, reader->room * log->columns * sizeof(double));
    if (larger == NULL) {
        return fail(reader, "out of memory");
    }
    log->value = larger;
    return true;
}

static bool check_time(struct reader *reader, const struct run_log *log) {
    const size_t time = (size_t)run_log_column(log, "time_s");
    const double now_s = log->value[log->rows * log->columns + time];
    if (isnan(now_s)) {
        return fail(reader, "column time_s: it is empty; every row needs its time");
    }
    if (log->rows == 0) {
        return true;
    }
    const double before_s = log->value[(log->rows - 1) * log->columns + time];
    return now_s >= before_s ||
           fail(reader,
                "column time_s: time runs backwards from %.9g to %.9g s; sort the rows, or "
                "split the log where the clock was set",
                before_s, now_s);
}

static bool read_row(struct reader *reader, struct run_log *log) {
    const int state = run_log_column(log, "state");
    char *field = reader->line;
    if (!make_room(reader, log)) {
        return false;
    }
    for (size_t c = 0; c < log->columns; c++) {
        char *comma = strchr(field, ',');
        if (comma == NULL && c + 1 < log->columns) {
            return fail(reader,
                        "the row has fewer fields than the header: %zu, not %zu; column %s is missing", c + 1,
                        log->columns, log->name[c + 1]);
        }
        if (comma != NULL && c + 1 == log->columns) {
            return fail(reader,
                        "the row has more fields than the header's %zu: something stands after column %s",
                        log->columns, log->name[c]);
        }
        if (comma != NULL) {
            *comma = '\0';
        }
        if (!parse_field(field, (int)c == state, &log->value[log->rows * log->columns + c])) {
            return reject_field(reader, log->name[c], field);
        }
        field = comma == NULL ? field : comma + 1;
    }
    if (!check_time(reader, log)) {
        return false;
    }
    log->rows++;
    return true;
}

bool run_log_read(const char *path, struct run_log *log, char *error, size_t error_bytes) {
    struct reader reader = {.path = path, .error = error, .error_bytes = error_bytes};
    memset(log, 0, sizeof *log);
    reader.file = fopen(path, "r");
    if (reader.file == NULL) {
        (void)snprintf(error, error_bytes, "%s: %s", path, strerror(errno));
        return false;
    }
    bool sound = read_preamble(&reader, log);
    while (sound && next_line(&reader)) {
        sound = read_row(&reader, log);
    }
    (void)fclose(reader.file);
    free(reader.line);
    if (sound && log->rows < ROWS_LEAST) {
        sound = fail(&reader, "the log has %s; a run is at least %d",
                     log->rows == 0 ? "no rows" : "one row only", ROWS_LEAST);
    }
    if (!sound) {
        run_log_free(log);
    }
    return sound;
}

/* --- in memory --- */

void run_log_free(struct run_log *log) {
    for (size_t p = 0; p < log->metadata_count; p++) {
        free(log->metadata[p].key);
        free(log->metadata[p].value);
    }
    free(log->value);
    memset(log, 0, sizeof *log);
}

int run_log_column(const struct run_log *log, const char *name) {
    for (size_t c = 0; c < log->columns; c++) {
        if (strcmp(log->name[c], name) == 0) {
            return (int)c;
        }
    }
    return -1;
}

static int metadata_index(const struct run_log *log, const char *key) {
    for (size_t p = 0; p < log->metadata_count; p++) {
        if (strcmp(log->metadata[p].key, key) == 0) {
            return (int)p;
        }
    }
    return -1;
}

const char *run_log_metadata(const struct run_log *log, const char *key) {
    const int at = metadata_index(log, key);
    return at < 0 ? NULL : log->metadata[at].value;
}

/* Index of a new entry without value, or -1. */
static int add_entry(struct run_log *log, const char *key) {
    if (log->metadata_count == RUN_LOG_METADATA_MAX) {
        return -1;
    }
    struct run_log_entry *entry = &log->metadata[log->metadata_count];
    entry->value = NULL;
    entry->key = strdup(key);
    return entry->key == NULL ? -1 : (int)log->metadata_count++;
}

bool run_log_set_metadata(struct run_log *log, const char *key, const char *value) {
    int at = metadata_index(log, key);
    char *copy = strdup(value);
    if (copy != NULL && at < 0) {
        at = add_entry(log, key);
    }
    if (copy == NULL || at < 0) {
        free(copy);
        return false;
    }
    free(log->metadata[at].value);
    log->metadata[at].value = copy;
    if (strcmp(key, "module") == 0) {
        (void)snprintf(log->module, sizeof log->module, "%.255s", value);
    }
    return true;
}

size_t run_log_unknown_columns(const struct run_log *log, char *text, size_t text_bytes) {
    size_t count = 0, used = 0;
    (void)snprintf(text, text_bytes, "%s", "");
    for (size_t c = 0; c < log->columns; c++) {
        enum run_dimension dimension;
        if (run_column_find(log->name[c], &dimension)) {
            continue;
        }
        if (used < text_bytes) {
            used +=
                (size_t)snprintf(text + used, text_bytes - used, "%s%s", count > 0 ? ", " : "", log->name[c]);
        }
        count++;
    }
    return count;
}
