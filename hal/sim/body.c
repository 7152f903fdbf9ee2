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
    double value[3], gradient[3][3];
    table_point_at(&point, table, pressure_pa);
    table_point_values(&point, BEND_TABLE_CURVATURE_X, value, gradient);
    shape->bend_x_rad = length_m * value[0];
    shape->bend_y_rad = length_m * value[1];
    shape->stretch = value[2];
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

/* --- under weight --- */

/* d (area) / (area dp) times the shear modulus, of a chamber at rest: 1 for a round hole in a wide body (Lame
 * 1852). Sections of the founding paper that were solved, with their chambers near the surface: 1.5
 * (circle), 2.1 (semicircle), 2.3 (sector). */
#define INFLATION_BY_MODULUS 2.1
/* Of a chamber's centroid from the axis over the outer diameter: 0.29 to 0.36 in these. */
#define CHAMBER_OFFSET (1.0 / 3.0)

/* Two ways to bend more: a chamber that lengthens more under its thrust, or softer rubber round it. Fibres
 * leave the first, and without fibres the widening of a chamber shortens it as much as the thrust lengthens
 * it, which leaves the second:
 *
 *     1 / EI = kappa' / (A d) + A' / A / (3 k I),   ' by the pressure of one chamber, at rest
 *
 * A chamber's area, d its offset, k = INFLATION_BY_MODULUS, E = 3 G. Against rods whose stiffness is solved:
 * right to 3 % for the reference module, 15 % for one with fibres, 40 % for round chambers without. */
double body_bending_compliance(const struct bend_table *table) {
    const double rest_pa[3] = {0.0, 0.0, 0.0}, diameter_m = (double)table->module.outer_diameter_m;
    const double offset_m = CHAMBER_OFFSET * diameter_m;
    double curvature[3], inflation[3];
    struct table_point point;
    table_point_at(&point, table, rest_pa);
    const double area_m2 = table_point_value(&point, BEND_TABLE_VOLUME_1, inflation);
    (void)table_point_value(&point, BEND_TABLE_CURVATURE_X, curvature);
    const double second_moment_m4 = M_PI / 64.0 * pow(diameter_m, 4.0) - 1.5 * area_m2 * offset_m * offset_m;
    return fmax(-curvature[0], 0.0) / (area_m2 * offset_m) +
           fmax(inflation[0], 0.0) / (area_m2 * 3.0 * INFLATION_BY_MODULUS * second_moment_m4);
}

void body_down(double angle_rad, double direction_rad, double down[3]) {
    down[0] = sin(angle_rad) * cos(direction_rad);
    down[1] = sin(angle_rad) * sin(direction_rad);
    down[2] = cos(angle_rad);
}

double body_distal_straight_m(const struct bend_table_module *module, const struct body_shape *shape) {
    return 0.5 * (1.0 - shape->active_fraction) * (double)module->chamber_length_m * shape->stretch;
}

/* Functions of the bend squared, u, that the arc's points are made of, and their derivatives by u. */
struct arc_functions {
    double cosine, sine, tip, mean; /* cos b; sin b / b; (1 - cos b) / b^2; (1 - sin b / b) / b^2 */
    double cosine_u, sine_u, tip_u, mean_u;
};

static struct arc_functions arc_functions_at(double u) {
    struct arc_functions f;
    if (u < 0.01) { /* Taylor; what is left out is under 1e-12 */
        f.sine = 1.0 - u / 6.0 * (1.0 - u / 20.0 * (1.0 - u / 42.0));
        f.cosine = 1.0 - u / 2.0 * (1.0 - u / 12.0 * (1.0 - u / 30.0 * (1.0 - u / 56.0)));
        f.tip = 1.0 / 2.0 - u / 24.0 * (1.0 - u / 30.0 * (1.0 - u / 56.0));
        f.mean = 1.0 / 6.0 - u / 120.0 * (1.0 - u / 42.0 * (1.0 - u / 72.0));
        f.sine_u = -1.0 / 6.0 + u / 60.0 * (1.0 - u / 28.0 * (1.0 - u / 54.0));
        f.tip_u = -1.0 / 24.0 + u / 360.0 * (1.0 - 3.0 * u / 112.0);
        f.mean_u = -1.0 / 120.0 + u / 2520.0 * (1.0 - u / 48.0);
    } else {
        const double b = sqrt(u);
        f.cosine = cos(b);
        f.sine = sin(b) / b;
        f.tip = (1.0 - f.cosine) / u;
        f.mean = (1.0 - f.sine) / u;
        f.sine_u = 0.5 * (f.cosine - f.sine) / u;
        f.tip_u = (0.5 * f.sine - f.tip) / u;
        f.mean_u = -(f.sine_u + f.mean) / u;
    }
    f.cosine_u = -0.5 * f.sine;
    return f;
}

/* Gradient by the bend vector of the work that the weight does, N m: of an arc of `length_m` the mean point
 * lies at b L mean across and L tip along, its end at b L tip and L sine. */
static void work_gradient(const struct body_weight *weight, double length_m, const double b[2],
                          double gradient[2]) {
    const struct arc_functions f = arc_functions_at(b[0] * b[0] + b[1] * b[1]);
    const double spread = weight->spread_n * length_m, end = weight->end_n * length_m;
    const double beyond = weight->end_n * weight->end_beyond_m;
    const double across = spread * f.mean + end * f.tip + beyond * f.sine;
    const double across_u = spread * f.mean_u + end * f.tip_u + beyond * f.sine_u;
    const double along_u = spread * f.tip_u + end * f.sine_u + beyond * f.cosine_u;
    const double level = weight->down[0] * b[0] + weight->down[1] * b[1];
    for (int i = 0; i < 2; i++) {
        gradient[i] = across * weight->down[i] + 2.0 * b[i] * (level * across_u + weight->down[2] * along_u);
    }
}

/* The step of a Newton method on an energy; where that curves down, it goes downhill all the same. */
static void descend(double hessian[2][2], const double slope[2], double step[2]) {
    const double least = 0.2; /* curvature along a principal direction */
    const double half = 0.5 * (hessian[0][0] - hessian[1][1]), middle = 0.5 * (hessian[0][0] + hessian[1][1]);
    const double off = 0.5 * (hessian[0][1] + hessian[1][0]), radius = hypot(half, off);
    const double angle = 0.5 * atan2(off, half), c = cos(angle), s = sin(angle);
    const double first = (c * slope[0] + s * slope[1]) / fmax(fabs(middle + radius), least);
    const double second = (c * slope[1] - s * slope[0]) / fmax(fabs(middle - radius), least);
    step[0] = -(c * first - s * second);
    step[1] = -(s * first + c * second);
}

/* A module with a weight on it. */
struct sag {
    const struct body_weight *weight;
    double length_m;
    double give; /* bend by a moment of one, rad/(N m) */
    double start[2];
};

/* First and second derivatives of the energy, over the bending stiffness. */
static void energy_slopes(const struct sag *sag, const double b[2], double slope[2], double hessian[2][2]) {
    const double nudge = 1e-5;
    double gradient[2], moved[2];
    work_gradient(sag->weight, sag->length_m, b, gradient);
    for (int k = 0; k < 2; k++) {
        double beside[2] = {b[0], b[1]};
        beside[k] += nudge;
        work_gradient(sag->weight, sag->length_m, beside, moved);
        for (int j = 0; j < 2; j++) {
            hessian[j][k] = (j == k) - sag->give * (moved[j] - gradient[j]) / nudge;
        }
        slope[k] = b[k] - sag->start[k] - sag->give * gradient[k];
    }
}

/* Least of the energies that arcs can have (Rayleigh 1877, Ritz 1909), bending (b - b0)^2 / (2 give) less the
 * work of the weight. For small bends of a level module that is the slope of a cantilever, w L^3 / (6 EI) and
 * F L^2 / (2 EI). */
void body_bend_under(const struct bend_table *table, double stiffness_scale, const struct body_weight *weight,
                     struct body_shape *shape) {
    enum { STEPS = 20 };
    const double length_m = shape->active_fraction * (double)table->module.chamber_length_m * shape->stretch;
    const struct sag sag = {weight,
                            length_m,
                            body_bending_compliance(table) / stiffness_scale * length_m,
                            {shape->bend_x_rad, shape->bend_y_rad}};
    const double longest = 0.5, enough = 1e-7;
    double b[2] = {sag.start[0], sag.start[1]}, size = 1.0;
    for (int i = 0; i < STEPS && size > enough; i++) {
        double slope[2], hessian[2][2], step[2];
        energy_slopes(&sag, b, slope, hessian);
        descend(hessian, slope, step);
        size = hypot(step[0], step[1]);
        const double kept = size > longest ? longest / size : 1.0;
        b[0] += kept * step[0];
        b[1] += kept * step[1];
    }
    shape->bend_x_rad = b[0];
    shape->bend_y_rad = b[1];
}

/* --- along the arc --- */

#define SAG_NODES 10

static void cross3(const double a[3], const double b[3], double product[3]) {
    product[0] = a[1] * b[2] - a[2] * b[1];
    product[1] = a[2] * b[0] - a[0] * b[2];
    product[2] = a[0] * b[1] - a[1] * b[0];
}

/* Place and tangent on the arc at `along_m` from its start, in the base frame but for the start's height. */
static void arc_at(const struct body_shape *shape, double arc_m, double along_m, double place_m[3], double tangent[3]) {
    const double bend = hypot(shape->bend_x_rad, shape->bend_y_rad), angle = bend * along_m / arc_m;
    const bool straight = bend < STRAIGHT_RAD;
    const double x = straight ? 1.0 : shape->bend_x_rad / bend, y = straight ? 0.0 : shape->bend_y_rad / bend;
    const double across_m = straight ? 0.0 : arc_m / bend * (1.0 - cos(angle));
    const double sine = straight ? 0.0 : sin(angle);
    place_m[0] = x * across_m;
    place_m[1] = y * across_m;
    place_m[2] = straight ? along_m : arc_m / bend * sine;
    tangent[0] = x * sine;
    tangent[1] = y * sine;
    tangent[2] = straight ? 1.0 : cos(angle);
}

void body_sag_further(const struct bend_table *table, double stiffness_scale, const struct body_weight *weight,
                      const struct body_shape *shape, struct tip_pose *pose) {
    const double length_m = (double)table->module.chamber_length_m * shape->stretch;
    const double arc_m = shape->active_fraction * length_m, part_m = arc_m / SAG_NODES;
    const double straight_m = 0.5 * (length_m - arc_m), diameter_m = (double)table->module.outer_diameter_m;
    const double give = body_bending_compliance(table) / stiffness_scale, part_n = weight->spread_n / SAG_NODES;
    double place[SAG_NODES][3], tangent[SAG_NODES][3], turn[SAG_NODES][3], mean[3] = {0.0, 0.0, 0.0};
    double end_m[3], along[3], force_n = weight->end_n, first_nm[3];
    arc_at(shape, arc_m, arc_m, end_m, along);
    for (size_t k = 0; k < 3; k++) {
        first_nm[k] = weight->end_n * (end_m[k] + weight->end_beyond_m * along[k]);
    }
    for (size_t i = SAG_NODES; i-- > 0;) {
        double arm[3], moment[3];
        arc_at(shape, arc_m, ((double)i + 0.5) * part_m, place[i], tangent[i]);
        for (size_t k = 0; k < 3; k++) { /* of this part the half beyond its middle hangs at a quarter of its length */
            arm[k] = first_nm[k] - force_n * place[i][k] + 0.125 * part_n * part_m * tangent[i][k];
        }
        cross3(arm, weight->down, moment);
        const double twist = moment[0] * tangent[i][0] + moment[1] * tangent[i][1] + moment[2] * tangent[i][2];
        const double pull_n = (force_n + 0.5 * part_n) * (weight->down[0] * tangent[i][0] + weight->down[1] * tangent[i][1] +
                                                          weight->down[2] * tangent[i][2]);
        for (size_t k = 0; k < 3; k++) {
            turn[i][k] = give * part_m * (moment[k] - twist * tangent[i][k]);
            mean[k] += turn[i][k] / SAG_NODES;
            pose->position_m[k] += pull_n * give * diameter_m * diameter_m / 16.0 * part_m * tangent[i][k];
            first_nm[k] += part_n * place[i][k];
        }
        force_n += part_n;
    }
    const double beyond_m = straight_m + (double)table->module.cap_distal_m;
    for (size_t i = 0; i < SAG_NODES; i++) {
        double arm[3], more[3], moved[3];
        for (size_t k = 0; k < 3; k++) {
            arm[k] = end_m[k] + beyond_m * along[k] - place[i][k];
            more[k] = turn[i][k] - mean[k];
        }
        cross3(more, arm, moved);
        for (size_t k = 0; k < 3; k++) {
            pose->position_m[k] += moved[k];
        }
    }
}
