#include "sim/body.h"

#include <math.h>

#define STRAIGHT_RAD 1e-9

void body_shape_of(const struct bend_table *table, const struct chambers *chambers, struct body_shape *shape) {
    const double length_m = (double)table->module.active_length_m;
    double curvature_1pm[2];
    chambers_curvature(chambers, table, curvature_1pm);
    shape->bend_x_rad = length_m * curvature_1pm[0];
    shape->bend_y_rad = length_m * curvature_1pm[1];
    shape->stretch = chambers_stretch(chambers, table);
    shape->active_fraction = 1.0;
}

void body_shape_at(const struct bend_table *table, const double pressure_pa[3], struct body_shape *shape) {
    const double length_m = (double)table->module.active_length_m;
    struct table_point point;
    table_point_at(&point, table, pressure_pa);
    shape->bend_x_rad = length_m * table_point_value(&point, BEND_TABLE_CURVATURE_X, NULL);
    shape->bend_y_rad = length_m * table_point_value(&point, BEND_TABLE_CURVATURE_Y, NULL);
    shape->stretch = table_point_value(&point, BEND_TABLE_STRETCH, NULL);
    shape->active_fraction = 1.0;
}

void body_tip_pose(const struct bend_table_module *module, const struct body_shape *shape, struct tip_pose *pose) {
    const double bend = hypot(shape->bend_x_rad, shape->bend_y_rad);
    const double length_m = (double)module->chamber_length_m * shape->stretch;
    const double arc_m = shape->active_fraction * length_m, straight_m = 0.5 * (length_m - arc_m);
    const double cap_m = (double)module->cap_distal_m + straight_m;
    const bool straight = bend < STRAIGHT_RAD;
    const double x = straight ? 1.0 : shape->bend_x_rad / bend, y = straight ? 0.0 : shape->bend_y_rad / bend;
    const double across_m = (straight ? 0.0 : arc_m * (1.0 - cos(bend)) / bend) + cap_m * sin(bend);
    const double along_m = (straight ? arc_m : arc_m * sin(bend) / bend) + cap_m * cos(bend);
    pose->position_m[0] = x * across_m;
    pose->position_m[1] = y * across_m;
    pose->position_m[2] = (double)module->cap_proximal_m + straight_m + along_m;
    pose->quaternion[0] = cos(0.5 * bend);
    pose->quaternion[1] = -y * sin(0.5 * bend);
    pose->quaternion[2] = x * sin(0.5 * bend);
    pose->quaternion[3] = 0.0;
}
