/* Run logs: CSV with `# tribend-run 1` on the first line, `# key: value` lines, a header and rows. Columns
 * may be missing and fields empty (not measured in that row); SI units. Which columns there are:
 * log/run_columns.h. */
#ifndef TRIBEND_RUN_LOG_H
#define TRIBEND_RUN_LOG_H

#include "link/link.h"
#include "program/output_file.h"

#define RUN_LOG_COLUMNS_MAX 64
#define RUN_LOG_NAME_BYTES 32
#define RUN_LOG_KEY_BYTES 256
#define RUN_LOG_METADATA_MAX 64

/* --- writing while a run goes on --- */

struct run_log_writer {
    struct output_file file;
};

struct run_log_metadata {
    const char *module;
    uint64_t table_hash;
    double rate_hz;
    const char *note;
};

bool run_log_create(struct run_log_writer *writer, const char *path, const struct run_log_metadata *metadata,
                    char *error, size_t error_bytes);
/* One row; `command` is the one being followed (bend columns stay empty for others). */
void run_log_append(struct run_log_writer *writer, const struct link_report *report,
                    const struct controller_command *command);
bool run_log_finish(struct run_log_writer *writer, char *error, size_t error_bytes);
void run_log_discard(struct run_log_writer *writer);

/* --- writing what is in memory --- */

struct run_log_pair {
    const char *key;
    const char *value;
};

/* Any columns: `value[row * columns + column]` in SI, NaN for an empty field, states as enum
 * supervisor_state. `path` appears whole or not at all; false: `error` says why. */
bool run_log_write_columns(const char *path, const char *const *names, const double *value, size_t rows,
                           size_t columns, const struct run_log_pair *metadata, size_t pairs, char *error,
                           size_t error_bytes);

/* --- in memory --- */

struct run_log_entry {
    char *key;
    char *value;
};

struct run_log {
    size_t rows;
    size_t columns;
    char name[RUN_LOG_COLUMNS_MAX][RUN_LOG_NAME_BYTES];
    double *value; /* [row * columns + column]; NaN where empty; states as enum supervisor_state */
    char module[RUN_LOG_KEY_BYTES];
    size_t header_line; /* in its file, from 1; row r stands in line header_line + 1 + r. 0: not from a file */
    size_t metadata_count;
    struct run_log_entry metadata[RUN_LOG_METADATA_MAX]; /* in the file's order, `module` among them */
};

/* False: `error` names file, line, column and what is wrong. */
bool run_log_read(const char *path, struct run_log *log, char *error, size_t error_bytes);
bool run_log_write(const char *path, const struct run_log *log, char *error, size_t error_bytes);
void run_log_free(struct run_log *log);
/* Index of a column, or -1. */
int run_log_column(const struct run_log *log, const char *name);
/* The value of a `# key: value` line, or NULL. */
const char *run_log_metadata(const struct run_log *log, const char *key);
/* Add a line or change it; `module` also sets log->module. False: no memory or no room. */
bool run_log_set_metadata(struct run_log *log, const char *key, const char *value);
/* How many columns are none of ours (they are kept, and nothing reads them); their names joined by ", " into
 * `text`. */
size_t run_log_unknown_columns(const struct run_log *log, char *text, size_t text_bytes);

#endif
