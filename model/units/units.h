/* Quantities as people type them: a number and its unit, with nothing between or after. False: no number, no unit, an
 * unknown unit or a number that is not finite; `error` says which units are taken. */
#ifndef TRIBEND_UNITS_H
#define TRIBEND_UNITS_H

#include <stdbool.h>
#include <stddef.h>

enum units_kind { UNITS_PRESSURE, UNITS_ANGLE, UNITS_TIME, UNITS_LENGTH, UNITS_MASS, UNITS_FORCE };

/* To Pa, rad, s, m, kg or N. */
bool units_parse(enum units_kind kind, const char *text, double *value, char *error, size_t error_bytes);
/* The kind whose unit the text carries; false: none of them. */
bool units_kind_of(const char *text, enum units_kind *kind);

#endif
