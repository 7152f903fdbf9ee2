/* What the bend table says between its nodes, read from the node values alone: inside a cell each quantity is one polynomial,
 * cubic in each pressure, whose coefficients are made when the cell is first entered. Outside the axes it goes on along its
 * tangent. In double; shares no arithmetic with the firmware's interpolation. Units: Pa gauge; those of the table. */
#ifndef TRIBEND_BLIND_FIELD_H
#define TRIBEND_BLIND_FIELD_H

#include "control/bend_table.h"

enum blind_quantity {
    BLIND_VOLUME_1, /* m2 */
    BLIND_VOLUME_2,
    BLIND_VOLUME_3,
    BLIND_CURVATURE_X, /* 1/m */
    BLIND_CURVATURE_Y,
    BLIND_STRETCH,
    BLIND_QUANTITY_COUNT
};

struct blind_cell {
    double coefficient[BLIND_QUANTITY_COUNT][4][4][4];
};

struct blind_field {
    const struct bend_table *table; /* by pointer */
    struct blind_cell **cell;       /* NULL until entered */
    size_t cells;
};

/* False: out of memory. */
bool blind_field_open(struct blind_field *field, const struct bend_table *table);
void blind_field_close(struct blind_field *field);
/* `count` quantities from `first`; `gradient` (by the three pressures) may be NULL. False: out of memory. */
bool blind_field_at(struct blind_field *field, const double pressure_pa[3], enum blind_quantity first, size_t count,
                    double *value, double (*gradient)[3]);
/* Bend vector (towards which the tip leans, rad) and stretch. */
bool blind_field_bend(struct blind_field *field, const double pressure_pa[3], double bend_rad[2], double *stretch);

#endif
