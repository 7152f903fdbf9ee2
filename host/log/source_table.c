#include "log/source_table.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define FIELDS_MAX 1024
#define ROWS_LEAST 2
#define NOT_FOUND ((size_t)-1)

struct source_reader {
    const char *path;
    const struct source_format *format;
    FILE *file;
    char *line;
    size_t line_room;
    int number;
    char *field[FIELDS_MAX];
    size_t fields;
    size_t at[SOURCE_COLUMNS_MAX]; /* field of each wanted column */
    size_t room;
    char *error;
    size_t error_bytes;
};

static bool fail(struct source_reader *reader, const char *format, ...) __attribute__((format(printf, 2, 3)));
static bool fail(struct source_reader *reader, const char *format, ...) {
    char what[768];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    (void)snprintf(reader->error, reader->error_bytes, "%s:%d: %s", reader->path, reader->number, what);
    return false;
}

int source_table_want(struct source_table *table, const char *column) {
    for (size_t w = 0; w < table->wanted_count; w++) {
        if (strcmp(table->wanted[w], column) == 0) {
            return (int)w;
        }
    }
    if (table->wanted_count == SOURCE_COLUMNS_MAX) {
        return -1;
    }
    table->wanted[table->wanted_count] = column;
    return (int)table->wanted_count++;
}

static bool next_line(struct source_reader *reader) {
    do {
        if (getline(&reader->line, &reader->line_room, reader->file) < 0) {
            return false;
        }
        reader->number++;
        reader->line[strcspn(reader->line, "\r\n")] = '\0';
    } while (reader->format->comment != '\0' && reader->line[0] == reader->format->comment);
    return true;
}

/* Without blanks and quotes around it. */
static char *trim(char *text) {
    text += strspn(text, " \t\"");
    size_t length = strlen(text);
    while (length > 0 && strchr(" \t\"", text[length - 1]) != NULL) {
        text[--length] = '\0';
    }
    return text;
}

static bool split(struct source_reader *reader) {
    const bool blanks = reader->format->delimiter == ' ';
    const char delimiters[3] = {reader->format->delimiter, blanks ? '\t' : '\0', '\0'};
    char *rest = blanks ? trim(reader->line) : reader->line;
    reader->fields = 0;
    for (char *field = strsep(&rest, delimiters); field != NULL; field = strsep(&rest, delimiters)) {
        if (blanks && *field == '\0') {
            continue;
        }
        if (reader->fields == FIELDS_MAX) {
            return fail(reader, "the line has more than %d fields; is the delimiter right?", FIELDS_MAX);
        }
        reader->field[reader->fields++] = trim(field);
    }
    return true;
}

static size_t find_field(const struct source_reader *reader, const char *name) {
    for (size_t f = 0; reader->format->header_lines > 0 && f < reader->fields; f++) {
        if (strcmp(reader->field[f], name) == 0) {
            return f;
        }
    }
    char *end = NULL;
    const long number = strtol(name, &end, 10);
    return *end == '\0' && number >= 1 && number <= FIELDS_MAX ? (size_t)number - 1 : NOT_FOUND;
}

static bool reject_name(struct source_reader *reader, const char *name) {
    char list[512] = "";
    size_t used = 0;
    if (reader->format->header_lines == 0) {
        return fail(reader, "there is no column '%s': without header_lines, columns are numbered from 1",
                    name);
    }
    for (size_t f = 0; f < reader->fields && used < sizeof list; f++) {
        used +=
            (size_t)snprintf(list + used, sizeof list - used, "%s%s", f > 0 ? ", " : "", reader->field[f]);
    }
    return fail(reader, "there is no column '%s'; the file has: %s", name, list);
}

static bool read_header(struct source_reader *reader, const struct source_table *table) {
    for (int line = 0; line < reader->format->header_lines; line++) {
        if (!next_line(reader)) {
            return fail(reader, "the file ends within its %d header lines", reader->format->header_lines);
        }
    }
    if (reader->format->header_lines > 0 && !split(reader)) {
        return false;
    }
    for (size_t w = 0; w < table->wanted_count; w++) {
        reader->at[w] = find_field(reader, table->wanted[w]);
        if (reader->at[w] == NOT_FOUND) {
            return reject_name(reader, table->wanted[w]);
        }
    }
    return true;
}

static bool make_room(struct source_reader *reader, struct source_table *table) {
    if (table->rows < reader->room) {
        return true;
    }
    const size_t room = reader->room == 0 ? 1024 : 2 * reader->room;
    double *value = realloc(table->value, room * (table->wanted_count + 1) * sizeof *value);
    if (value == NULL) {
        return fail(reader, "out of memory");
    }
    table->value = value;
    int *line = realloc(table->line, room * sizeof *line);
    if (line == NULL) {
        return fail(reader, "out of memory");
    }
    table->line = line;
    reader->room = room;
    return true;
}

static bool parse_number(const char *text, double *value) {
    *value = NAN;
    if (*text == '\0' || strcasecmp(text, "nan") == 0 || strcasecmp(text, "NA") == 0) {
        return true;
    }
    char *end = NULL;
    *value = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*value);
}

static bool read_row(struct source_reader *reader, struct source_table *table) {
    if (!make_room(reader, table) || !split(reader)) {
        return false;
    }
    for (size_t w = 0; w < table->wanted_count; w++) {
        if (reader->at[w] >= reader->fields) {
            return fail(reader, "the row has too few fields: %zu, and column '%s' is number %zu",
                        reader->fields, table->wanted[w], reader->at[w] + 1);
        }
        const char *text = reader->field[reader->at[w]];
        if (!parse_number(text, &table->value[table->rows * table->wanted_count + w])) {
            return fail(
                reader,
                "column '%s': '%.32s' is no finite number; leave the field empty where nothing was measured",
                table->wanted[w], text);
        }
    }
    table->line[table->rows++] = reader->number;
    return true;
}

bool source_table_read(const char *path, const struct source_format *format, struct source_table *table,
                       char *error, size_t error_bytes) {
    struct source_reader reader = {
        .path = path, .format = format, .error = error, .error_bytes = error_bytes};
    reader.file = fopen(path, "r");
    if (reader.file == NULL) {
        (void)snprintf(error, error_bytes, "%s: %s", path, strerror(errno));
        return false;
    }
    bool sound = read_header(&reader, table);
    while (sound && next_line(&reader)) {
        sound = reader.line[strspn(reader.line, " \t")] == '\0' || read_row(&reader, table);
    }
    (void)fclose(reader.file);
    free(reader.line);
    if (sound && table->rows < ROWS_LEAST) {
        sound = fail(&reader, "there %s after the header; a run is at least %d",
                     table->rows == 0 ? "are no rows" : "is one row only", ROWS_LEAST);
    }
    if (!sound) {
        source_table_free(table);
    }
    return sound;
}

void source_table_free(struct source_table *table) {
    free(table->value);
    free(table->line);
    table->value = NULL;
    table->line = NULL;
    table->rows = 0;
}
