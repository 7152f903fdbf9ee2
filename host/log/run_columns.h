/* The columns that a run log may have, what each of them measures, and the units in which other programs
 * write it. */
#ifndef TRIBEND_RUN_COLUMNS_H
#define TRIBEND_RUN_COLUMNS_H

#include <stdbool.h>
#include <stddef.h>

enum run_dimension {
    RUN_TIME,        /* s */
    RUN_PRESSURE,    /* Pa */
    RUN_LENGTH,      /* m */
    RUN_ANGLE,       /* rad */
    RUN_TEMPERATURE, /* K */
    RUN_NUMBER,      /* shares, terms of a quaternion, quality and status words */
    RUN_STATE        /* enum supervisor_state */
};

/* In SI: (value + zero) * factor. */
struct run_unit {
    const char *name;
    enum run_dimension dimension;
    double factor;
    double zero;
};

/* False: no run log of ours has a column of this name. */
bool run_column_find(const char *name, enum run_dimension *dimension);
/* NULL: not one of m, mm, um, s, ms, us, bar, mbar, kPa, Pa, psi, deg, rad, degC, K, 1, %. */
const struct run_unit *run_unit_find(const char *name);
/* "a pressure (Pa, kPa, mbar, bar or psi)" */
const char *run_dimension_words(enum run_dimension dimension);
double run_unit_to_si(const struct run_unit *unit, double value);
/* A number with its unit, such as 100mbar, for column `name`; numbers without dimension need no unit. False:
 * `error` says what the column takes. */
bool run_column_parse(const char *name, const char *text, double *value, char *error, size_t error_bytes);
size_t run_column_count(void);
const char *run_column_name(size_t index);
/* The names of all columns, joined by ", ". */
void run_column_list(char *text, size_t text_bytes);

#endif
