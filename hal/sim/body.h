/* The module's body: quasi-static, constant curvature over the chambers between two straight rigid end caps (Webster
 * and Jones 2010). Base frame of the design page; m, rad. */
#ifndef TRIBEND_SIM_BODY_H
#define TRIBEND_SIM_BODY_H

#include "sim/chamber.h"

struct body_shape {
    double bend_x_rad; /* bend vector: bend times the unit vector of the direction in which the tip moves */
    double bend_y_rad;
    double stretch;
    double active_fraction; /* of the length that bends; the rest is straight, half of it at either end */
};

struct tip_pose {
    double position_m[3];
    double quaternion[4]; /* w, x, y, z */
};

void body_shape_of(const struct bend_table *table, const struct chambers *chambers, struct body_shape *shape);
/* At these pressures, below any snap. */
void body_shape_at(const struct bend_table *table, const double pressure_pa[3], struct body_shape *shape);
/* Pose of the tip face's centre. */
void body_tip_pose(const struct bend_table_module *module, const struct body_shape *shape, struct tip_pose *pose);

#endif
