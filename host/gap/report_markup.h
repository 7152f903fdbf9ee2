/* Text and numbers of the HTML report: escaped, in the units that people use, with as many digits as they are
 * worth. */
#ifndef TRIBEND_GAP_REPORT_MARKUP_H
#define TRIBEND_GAP_REPORT_MARKUP_H

#include <stdio.h>

#include "gap/diagnosis.h"

struct markup_unit {
    double factor;    /* shown = factor * SI */
    const char *name; /* "" for a plain number */
};

/* Escaped for element content and double-quoted attributes; bytes that are no UTF-8 text become U+FFFD. */
void markup_text(FILE *out, const char *text);
/* A number with as many decimals as show a change of `resolution` or, where that is 0 or NAN, with about
 * three digits; a dash for NAN. */
void markup_number(FILE *out, double value, double resolution);
/* A share as whole percent. */
void markup_percent(FILE *out, double share);
/* mm, deg, kPa, ml, ms, ..: of a quantity in that SI unit and of about that size. */
struct markup_unit markup_unit(const char *si_unit, double size);
/* "1.20 (1.10 to 1.30) mm" */
void markup_interval(FILE *out, const struct diagnosis_interval *interval, const char *si_unit);
/* "1.2 mm" */
void markup_quantity(FILE *out, double value, const char *si_unit);
/* Names of tables are words joined by underscores; as words for people. */
void markup_words(FILE *out, const char *name);
/* "chamber 2, amplitude 0.1, time constant 3 s" */
void markup_parameters(FILE *out, const struct effect *effect);

#endif
