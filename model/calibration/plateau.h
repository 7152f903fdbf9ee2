/* Plateaus of a recorded run: stretches of steady pressure, with the mean pressures and the bend from the unpressurised
 * pose. SI units. */
#ifndef TRIBEND_PLATEAU_H
#define TRIBEND_PLATEAU_H

#include <stdbool.h>
#include <stddef.h>

#define PLATEAUS_MAX 256

struct plateau {
    double pressure_pa[3]; /* over that of the first plateau, which must be at rest */
    double bend_rad;       /* rotation of the tip against the first plateau */
    size_t first_row;      /* of the file's rows, from 0 */
    size_t rows;
};

struct plateau_options {
    double jump_pa;    /* a greater change from row to row ends a plateau */
    size_t rows_least; /* shorter ones are dropped */
    double loaded_pa;  /* below it in every chamber, a plateau is at rest and is not reported */
};

/* Reads a CSV with a header (lines that start with # are skipped): pressures p1_pa.. (gauge) or p1_bar_abs.., tip
 * quaternion tip_qw, tip_qx, tip_qy, tip_qz or tip_qa.. in any order of its four terms. The last half of each plateau is
 * averaged: creep has slowed there. Returns how many loaded plateaus there are; 0: `error` names file and line. */
size_t plateaus_read(const char *path, const struct plateau_options *options, struct plateau *plateaus, char *error,
                     size_t error_bytes);

#endif
