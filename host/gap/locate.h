/* On what a residual depends: each residual is held against each variable (pressure, rate, direction of loading, time, ..), and
 * a dependence is believed where chance alone would hardly make it.
 *
 * The statistic is Pearson's correlation ratio: the share of a residual's variance that lies between the bins of a variable.
 * Residuals and variables are correlated in time, so its distribution without a dependence comes from the data: the residual is
 * cut, at a random place, into blocks longer than it remembers, and the blocks are put into random order (Carlstein 1986 and
 * Kunsch 1989 for blocks; Besag and Clifford 1991 for ending a test early). Over all pairs the expected share of false
 * discoveries is held to a bound (Benjamini and Hochberg 1995). The same table and seed give the same answer. */
#ifndef TRIBEND_GAP_LOCATE_H
#define TRIBEND_GAP_LOCATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LOCATE_RESIDUALS_MAX 12
#define LOCATE_VARIABLES_MAX 20
#define LOCATE_FOUND_MAX (LOCATE_RESIDUALS_MAX * LOCATE_VARIABLES_MAX + 1)
#define LOCATE_FALSE_SHARE 0.05 /* of what is found, at most, in expectation */

struct locate_variable {
    const char *name;
    const char *unit;    /* of the values; "" where they are counts or directions */
    size_t chamber;      /* 1 to 3; 0: of no chamber */
    bool categories;     /* few values, each a bin of its own */
    const double *value; /* [rows]; NAN: not known */
};

struct locate_residual {
    const char *name;    /* r1_pressure, r2_position, r2_angle */
    const char *channel; /* "chamber 2", "along the bend" */
    size_t chamber;      /* 1 to 3 for pressures, else 0 */
    const double *value; /* [rows]; NAN: not measured */
};

/* Rows at equal steps of time, one run after the other. */
struct locate_table {
    size_t rows;
    size_t residuals;
    struct locate_residual residual[LOCATE_RESIDUALS_MAX];
    size_t variables;
    struct locate_variable variable[LOCATE_VARIABLES_MAX];
    int threads; /* 0: all cores */
};

struct locate_dependence {
    size_t residual; /* index; of the largest, where the variable is the chamber */
    size_t variable; /* index; LOCATE_VARIABLES_MAX: the chamber */
    double share;    /* of the residual's variance that the variable explains, less what chance does */
    double p;        /* of that share or more without a dependence */
    double q;        /* the least bound on false discoveries that would let it in */
    double from;     /* the bin of the variable in which the residual is farthest off; the chamber */
    double to;
    double off;      /* the residual's mean there, in its own unit; its root mean square, where the variable is the chamber */
};

/* Dependences that pass, strongest first; `*tested` is how many pairs were tested. SIZE_MAX: out of memory. */
size_t locate_find(const struct locate_table *table, uint64_t seed, struct locate_dependence found[LOCATE_FOUND_MAX], size_t *tested);

#endif
