#include "material/tensile_test.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_BYTES 512
#define COLUMNS 5
#define COLUMN_STRAIN 3
#define COLUMN_STRESS 4

/* Numbers of one row; fewer than COLUMNS means a header line. */
static int parse_row(const char *line, double value[COLUMNS]) {
    int count = 0;
    while (count < COLUMNS) {
        char *end = NULL;
        value[count] = strtod(line, &end);
        if (end == line) {
            break;
        }
        count++;
        if (*end != ';') {
            break;
        }
        line = end + 1;
    }
    return count;
}

static bool append(struct tensile_test *test, size_t *room, double strain, double stress_pa) {
    if (test->count == *room) {
        *room = *room == 0 ? 256 : 2 * *room;
        double *strains = realloc(test->strain, *room * sizeof(double));
        if (strains != NULL) {
            test->strain = strains;
        }
        double *stresses = realloc(test->stress_pa, *room * sizeof(double));
        if (stresses != NULL) {
            test->stress_pa = stresses;
        }
        if (strains == NULL || stresses == NULL) {
            return false;
        }
    }
    test->strain[test->count] = strain;
    test->stress_pa[test->count++] = stress_pa;
    return true;
}

bool tensile_test_read(const char *path, struct tensile_test *test, char *error, size_t error_bytes) {
    memset(test, 0, sizeof *test);
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        (void)snprintf(error, error_bytes, "%s: %s", path, strerror(errno));
        return false;
    }
    char line[LINE_BYTES];
    size_t room = 0;
    bool sound = true;
    for (int number = 1; sound && fgets(line, sizeof line, file) != NULL; number++) {
        double value[COLUMNS];
        const int count = parse_row(line, value);
        const bool blank = line[strspn(line, "; \t\r\n")] == '\0';
        if (count == COLUMNS && isfinite(value[COLUMN_STRAIN]) && isfinite(value[COLUMN_STRESS])) {
            sound = append(test, &room, value[COLUMN_STRAIN], 1e6 * value[COLUMN_STRESS]);
            if (!sound) {
                (void)snprintf(error, error_bytes, "%s:%d: out of memory", path, number);
            }
        } else if (test->count > 0 && !blank) {
            (void)snprintf(error, error_bytes, "%s:%d: a row needs %d numbers parted by semicolons, this one has %d", path,
                           number, COLUMNS, count);
            sound = false;
        }
    }
    (void)fclose(file);
    if (sound && test->count < TENSILE_POINTS_LEAST) {
        (void)snprintf(error, error_bytes,
                       "%s: %zu rows of numbers, too few; expected time s;true strain;true stress MPa;engineering "
                       "strain;engineering stress MPa",
                       path, test->count);
        sound = false;
    }
    if (!sound) {
        tensile_test_free(test);
    }
    return sound;
}

void tensile_test_free(struct tensile_test *test) {
    free(test->strain);
    free(test->stress_pa);
    memset(test, 0, sizeof *test);
}
