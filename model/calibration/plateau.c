#include "calibration/plateau.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_BYTES 4096
#define COLUMNS 7 /* three pressures, four terms of the quaternion */
#define PA_PER_BAR 1e5

/* Where the columns stand in a row, and whether pressures are in bar. */
struct layout {
    size_t at[COLUMNS];
    bool bar;
};

struct rows {
    double (*value)[COLUMNS]; /* Pa; quaternion of length one */
    size_t count;
    size_t room;
};

static bool find_column(const char *header, const char *name, size_t *at) {
    const size_t length = strlen(name);
    size_t column = 0;
    for (const char *word = header; word != NULL; column++) {
        word += strspn(word, " ");
        if (strncmp(word, name, length) == 0 && strchr(",\r\n ", word[length]) != NULL) {
            *at = column;
            return true;
        }
        word = strchr(word, ',');
        word = word == NULL ? NULL : word + 1;
    }
    return false;
}

static bool find_columns(const char *path, const char *header, struct layout *layout, char *error, size_t error_bytes) {
    static const char *const sets[][COLUMNS] = {
        {"p1_pa", "p2_pa", "p3_pa", "tip_qw", "tip_qx", "tip_qy", "tip_qz"},
        {"p1_bar_abs", "p2_bar_abs", "p3_bar_abs", "tip_qa", "tip_qb", "tip_qc", "tip_qd"}};
    const char *missing = "";
    for (size_t s = 0; s < 2; s++) {
        bool all = true;
        for (size_t c = 0; c < COLUMNS; c++) {
            if (!find_column(header, sets[s][c], &layout->at[c])) {
                missing = all && s == 0 ? sets[s][c] : missing;
                all = false;
            }
        }
        layout->bar = s == 1;
        if (all) {
            return true;
        }
    }
    (void)snprintf(error, error_bytes, "%s: no column %s; wanted p1_pa.. and tip_qw.., or p1_bar_abs.. and tip_qa..", path,
                   missing);
    return false;
}

/* One row into `value`; false with the column that is no number. Rows without a tip sample have an empty quaternion. */
static bool parse_row(const char *line, const struct layout *layout, double value[COLUMNS], size_t *bad, bool *empty) {
    size_t column = 0;
    bool found[COLUMNS] = {false};
    *empty = false;
    for (const char *word = line; word != NULL; column++) {
        for (size_t c = 0; c < COLUMNS; c++) {
            if (layout->at[c] == column) {
                char *end = NULL;
                value[c] = strtod(word, &end);
                const bool blank = end == word && strchr(",\r\n", *word) != NULL;
                *empty = *empty || blank;
                found[c] = blank || (end != word && strchr(",\r\n", *end) != NULL && isfinite(value[c]));
            }
        }
        word = strchr(word, ',');
        word = word == NULL ? NULL : word + 1;
    }
    for (size_t c = 0; c < COLUMNS; c++) {
        if (!found[c]) {
            *bad = layout->at[c] + 1;
            return false;
        }
    }
    return true;
}

static bool append(struct rows *rows, const double value[COLUMNS], bool bar) {
    if (rows->count == rows->room) {
        rows->room = rows->room == 0 ? 1024 : 2 * rows->room;
        double(*more)[COLUMNS] = realloc(rows->value, rows->room * sizeof *more);
        if (more == NULL) {
            return false;
        }
        rows->value = more;
    }
    double *row = rows->value[rows->count++];
    double length = 0.0;
    for (size_t c = 3; c < COLUMNS; c++) {
        length += value[c] * value[c];
    }
    for (size_t c = 0; c < COLUMNS; c++) {
        row[c] = c < 3 ? value[c] * (bar ? PA_PER_BAR : 1.0) : value[c] / sqrt(length);
    }
    return true;
}

static bool read_rows(const char *path, struct rows *rows, char *error, size_t error_bytes) {
    FILE *file = fopen(path, "r");
    char line[LINE_BYTES];
    struct layout layout = {.bar = false};
    bool have_header = false, sound = true;
    if (file == NULL) {
        (void)snprintf(error, error_bytes, "%s: %s", path, strerror(errno));
        return false;
    }
    for (int number = 1; sound && fgets(line, sizeof line, file) != NULL; number++) {
        double value[COLUMNS] = {0.0};
        size_t bad = 0;
        bool empty = false;
        if (line[0] == '#' || line[strspn(line, " \r\n")] == '\0') {
            continue;
        }
        if (!have_header) {
            have_header = sound = find_columns(path, line, &layout, error, error_bytes);
        } else if (!parse_row(line, &layout, value, &bad, &empty)) {
            (void)snprintf(error, error_bytes, "%s:%d: column %zu is not a number", path, number, bad);
            sound = false;
        } else if (!empty && !append(rows, value, layout.bar)) {
            (void)snprintf(error, error_bytes, "%s:%d: out of memory", path, number);
            sound = false;
        }
    }
    (void)fclose(file);
    return sound;
}

/* Means over the last half of rows [from, to); quaternions of either sign mean the same pose. */
static void average(const struct rows *rows, size_t from, size_t to, double mean[COLUMNS]) {
    const double *last = rows->value[to - 1];
    const size_t start = from + (to - from) / 2;
    double length = 0.0;
    memset(mean, 0, COLUMNS * sizeof *mean);
    for (size_t i = start; i < to; i++) {
        const double *row = rows->value[i];
        const double dot = row[3] * last[3] + row[4] * last[4] + row[5] * last[5] + row[6] * last[6];
        for (size_t c = 0; c < COLUMNS; c++) {
            mean[c] += c < 3 ? row[c] / (double)(to - start) : copysign(1.0, dot) * row[c];
        }
    }
    for (size_t c = 3; c < COLUMNS; c++) {
        length += mean[c] * mean[c];
    }
    for (size_t c = 3; c < COLUMNS; c++) {
        mean[c] /= sqrt(length);
    }
}

static bool jumps(const struct rows *rows, size_t i, double jump_pa) {
    for (size_t c = 0; c < 3; c++) {
        if (fabs(rows->value[i][c] - rows->value[i - 1][c]) > jump_pa) {
            return true;
        }
    }
    return false;
}

static size_t find_plateaus(const struct rows *rows, const struct plateau_options *options, struct plateau *plateaus) {
    double rest[COLUMNS], mean[COLUMNS];
    bool have_rest = false;
    size_t count = 0, from = 0;
    for (size_t i = 1; i <= rows->count && count < PLATEAUS_MAX; i++) {
        if (i < rows->count && !jumps(rows, i, options->jump_pa)) {
            continue;
        }
        if (i - from >= options->rows_least) {
            average(rows, from, i, mean);
            if (!have_rest) {
                memcpy(rest, mean, sizeof rest);
                have_rest = true;
            }
            struct plateau *plateau = &plateaus[count];
            double greatest = 0.0, dot = 0.0;
            for (size_t c = 0; c < 3; c++) {
                plateau->pressure_pa[c] = mean[c] - rest[c];
                greatest = fmax(greatest, plateau->pressure_pa[c]);
            }
            for (size_t c = 3; c < COLUMNS; c++) {
                dot += mean[c] * rest[c];
            }
            plateau->bend_rad = 2.0 * acos(fmin(1.0, fabs(dot)));
            plateau->first_row = from;
            plateau->rows = i - from;
            count += greatest > options->loaded_pa;
        }
        from = i;
    }
    return count;
}

size_t plateaus_read(const char *path, const struct plateau_options *options, struct plateau *plateaus, char *error,
                     size_t error_bytes) {
    struct rows rows = {.count = 0};
    size_t count = 0;
    if (read_rows(path, &rows, error, error_bytes)) {
        count = find_plateaus(&rows, options, plateaus);
        if (count == 0) {
            (void)snprintf(error, error_bytes,
                           "%s: no plateau of %zu rows above %.0f Pa after one at rest in %zu rows with a tip pose", path,
                           options->rows_least, options->loaded_pa, rows.count);
        }
    }
    free(rows.value);
    return count;
}
