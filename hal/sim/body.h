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

/* What gravity pulls at. */
struct body_weight {
    double down[3];      /* unit vector */
    double spread_n;     /* evenly over the length that bends */
    double end_n;        /* on the tip's axis, ... */
    double end_beyond_m; /* ... so far before the tip's end of that length */
};
/* Down, of a module mounted with that angle between its axis at the base and down (0: it hangs, pi / 2: level) and down's
 * direction in the x-y plane. */
void body_down(double angle_rad, double direction_rad, double down[3]);
/* Bend a length by a moment of one, 1/(N m2), at rest: estimated from the table, which holds no stiffness (see there). */
double body_bending_compliance(const struct bend_table *table);
/* The length between the end of the arc and the distal cap. */
double body_distal_straight_m(const struct bend_table_module *module, const struct body_shape *shape);
/* Bend `shape` to where the weight and the rubber's stiffness, so many times the table's, are in balance. */
void body_bend_under(const struct bend_table *table, double stiffness_scale, const struct body_weight *weight,
                     struct body_shape *shape);
/* What an arc leaves out of a module under a weight: curvature is greatest where the moment is, near the base, so that for
 * the same bend the tip sags further (a cantilever F L^3 / (3 EI) at a slope of F L^2 / (2 EI), an arc L / 2 times that
 * slope; Timoshenko 1955); and the weight stretches it, by F / (EA), E A = 16 E I / d^2 as of a round section. Moves the
 * pose of the shape that body_bend_under() left. */
void body_sag_further(const struct bend_table *table, double stiffness_scale, const struct body_weight *weight,
                      const struct body_shape *shape, struct tip_pose *pose);

#endif
