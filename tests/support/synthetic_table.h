/* A bend table image written from formulas, so that what the reader makes of it can be computed by hand. */
#ifndef TRIBEND_SYNTHETIC_TABLE_H
#define TRIBEND_SYNTHETIC_TABLE_H

#include "control/bend_table.h"

/* A channel's value at pressures. */
typedef double (*synthetic_channel)(enum bend_table_channel channel, const double pressure_pa[3]);

struct synthetic_table {
    uint8_t *image; /* malloc's alignment */
    size_t size;
    struct bend_table table;
};

/* `nodes` on every axis from 0 to `most_pa`, packed toward zero by `exponent` (1: evenly). Fails the test on trouble. */
void synthetic_table_create(struct synthetic_table *synthetic, uint32_t nodes, double most_pa, double exponent,
                            synthetic_channel channel);
/* Appends a ballooned grid: `nodes` volumes of chamber 1 from `least_m2` to `most_m2`, evenly spaced logarithms, the other
 * chambers from 0 to `others_pa`. `channel` is then asked at {volume of chamber 1, pressure of 2, pressure of 3}. */
void synthetic_table_add_ballooned(struct synthetic_table *synthetic, uint32_t nodes, double least_m2, double most_m2,
                                   double others_pa, float jump_up_pa, float jump_down_pa, synthetic_channel channel);
/* The CRC of the image as it now is, for tests that damage it on purpose. */
void synthetic_table_seal(struct synthetic_table *synthetic);
void synthetic_table_free(struct synthetic_table *synthetic);
/* Three soft chambers: curvature 1e-3 p + 2e-7 p^2 (1/m, Pa) a chamber, 120 degrees apart, chamber 1 alone toward -x. */
double synthetic_module(enum bend_table_channel channel, const double pressure_pa[3]);

#endif
