#include "log/run_log.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_LINE "# tribend-run 1"
#define LINE_BYTES 4096

/* --- writing --- */

static const char header[] = "time_s,valve1,valve2,valve3,p1_cmd_pa,p2_cmd_pa,p3_cmd_pa,p1_pa,p2_pa,p3_pa,supply_pa,"
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
    fprintf(file, ",%.8g,%.8g,%.8g", (double)status->pressure_target_pa[0], (double)status->pressure_target_pa[1],
            (double)status->pressure_target_pa[2]);
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

/* --- reading --- */

struct reader {
    FILE *file;
    const char *path;
    int line_number;
    char line[LINE_BYTES];
    size_t room;
    char *error;
    size_t error_bytes;
};

static bool fail(struct reader *reader, const char *what) {
    (void)snprintf(reader->error, reader->error_bytes, "%s:%d: %s", reader->path, reader->line_number, what);
    return false;
}

/* Next line without its end; false at the end of the file. */
static bool next_line(struct reader *reader) {
    if (fgets(reader->line, sizeof reader->line, reader->file) == NULL) {
        return false;
    }
    reader->line_number++;
    reader->line[strcspn(reader->line, "\r\n")] = '\0';
    return true;
}

static bool read_header(struct reader *reader, struct run_log *log) {
    char *rest = NULL;
    for (char *name = strtok_r(reader->line, ",", &rest); name != NULL; name = strtok_r(NULL, ",", &rest)) {
        if (log->columns == RUN_LOG_COLUMNS_MAX || strlen(name) >= RUN_LOG_NAME_BYTES) {
            return fail(reader, "too many columns, or a column's name is too long");
        }
        if (run_log_column(log, name) >= 0) {
            return fail(reader, "a column appears twice");
        }
        memcpy(log->name[log->columns++], name, strlen(name) + 1);
    }
    return run_log_column(log, "time_s") >= 0 || fail(reader, "the header has no column time_s");
}

static bool read_preamble(struct reader *reader, struct run_log *log) {
    if (!next_line(reader) || strcmp(reader->line, FIRST_LINE) != 0) {
        return fail(reader, "this is no run log: the first line is not '" FIRST_LINE "'");
    }
    while (next_line(reader)) {
        if (reader->line[0] != '#') {
            return read_header(reader, log);
        }
        if (strncmp(reader->line, "# module: ", 10) == 0) {
            (void)snprintf(log->module, sizeof log->module, "%.255s", reader->line + 10);
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

static bool read_row(struct reader *reader, struct run_log *log) {
    const int state = run_log_column(log, "state");
    char *field = reader->line, message[128];
    if (log->rows == reader->room) {
        reader->room = reader->room == 0 ? 4096 : 2 * reader->room;
        double *larger = realloc(log->value, reader->room * log->columns * sizeof(double));
        if (larger == NULL) {
            return fail(reader, "out of memory");
        }
        log->value = larger;
    }
    for (size_t c = 0; c < log->columns; c++) {
        char *comma = strchr(field, ',');
        const bool last = c + 1 == log->columns;
        if ((comma == NULL) != last) {
            (void)snprintf(message, sizeof message, "the row has %s fields than the header's %zu",
                           last ? "more" : "fewer", log->columns);
            return fail(reader, message);
        }
        if (comma != NULL) {
            *comma = '\0';
        }
        if (!parse_field(field, (int)c == state, &log->value[log->rows * log->columns + c])) {
            (void)snprintf(message, sizeof message, "column %s: '%.32s' is not a number", log->name[c], field);
            return fail(reader, message);
        }
        field = comma == NULL ? field : comma + 1;
    }
    const int time = run_log_column(log, "time_s");
    const double now = log->value[log->rows * log->columns + (size_t)time];
    if (isnan(now) || (log->rows > 0 && now < log->value[(log->rows - 1) * log->columns + (size_t)time])) {
        return fail(reader, "time_s is empty or runs backwards");
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
    if (sound && log->rows == 0) {
        sound = fail(&reader, "the log has no rows");
    }
    if (!sound) {
        run_log_free(log);
    }
    return sound;
}

void run_log_free(struct run_log *log) {
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
