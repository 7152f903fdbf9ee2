/* The bend table of a calibrated module, made from the nominal one without solving anything anew.
 *
 * A module that is so many times stiffer takes each state at that many times the pressure, so its table is the nominal
 * one with stretched pressure axes; a chamber with a gain stretches its own axis only. Limits come down with the
 * stiffness and never go up: they are promises to people. With every scale at one, the image keeps every bit. */
#ifndef TRIBEND_GAP_TABLE_SCALED_H
#define TRIBEND_GAP_TABLE_SCALED_H

#include "control/bend_table.h"

struct table_scales {
    double stiffness;       /* pressures of every state */
    double gain[3];         /* a chamber acts like so many times its pressure */
    double azimuth_rad[3];  /* and what it adds to the bend points so much further counter-clockwise */
    double active_fraction; /* of the length that bends */
};

struct table_scaled {
    struct bend_table table;
    unsigned char *image;
};

void table_scales_none(struct table_scales *scales);
/* `from` is one that bend_table_open() accepted; it is not needed afterwards. Free with table_scaled_free(). False:
 * `error` says why. */
bool table_scaled(struct table_scaled *scaled, const struct bend_table *from, const struct table_scales *scales,
                  char *error, size_t error_bytes);
void table_scaled_free(struct table_scaled *scaled);

#endif
