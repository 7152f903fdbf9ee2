/* Where the tip is: an inextensible-by-shear rod integrated along its arc. Weight and payload bend it about every station
 * with the lever arms of the bent shape; the shape is their fixed point. */
#include <math.h>
#include <string.h>

#include "blind_plant.h"

#define SEGMENTS 48
#define GRAVITY_MPS2 9.80665
#define DENSITY_KGPM3 1070.0  /* platinum-cured silicone */
#define YOUNG_PA 3.0e4        /* three times a shear modulus of 10 kPa */
#define ROUNDS 60
#define RELAXATION 0.6
#define TOLERANCE_RAD 1e-8

void blind_quaternion_product(const double a[4], const double b[4], double product[4]) {
    const double made[4] = {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
    memcpy(product, made, sizeof made);
}

void blind_quaternion_of_rotation(const double rotation_rad[3], double quaternion[4]) {
    const double angle = sqrt(rotation_rad[0] * rotation_rad[0] + rotation_rad[1] * rotation_rad[1] +
                              rotation_rad[2] * rotation_rad[2]);
    const double share = angle > 1e-9 ? sin(0.5 * angle) / angle : 0.5;
    quaternion[0] = cos(0.5 * angle);
    for (int i = 0; i < 3; i++) {
        quaternion[1 + i] = share * rotation_rad[i];
    }
}

static void cross(const double a[3], const double b[3], double product[3]) {
    const double made[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(product, made, sizeof made);
}

void blind_rotate(const double quaternion[4], const double vector[3], double rotated[3]) {
    double once[3], twice[3];
    cross(&quaternion[1], vector, once);
    cross(&quaternion[1], once, twice);
    for (int i = 0; i < 3; i++) {
        rotated[i] = vector[i] + 2.0 * (quaternion[0] * once[i] + twice[i]);
    }
}

struct rod {
    double turn_rad[SEGMENTS][3]; /* of each segment, in its own axes */
    double length_m[SEGMENTS];
    double position_m[SEGMENTS + 1][3]; /* from the end of the proximal cap to the start of the distal one */
    double quaternion[SEGMENTS + 1][4];
    double middle[SEGMENTS][4];
};

/* Each segment is a circular arc. */
static void integrate(struct rod *rod, double cap_m) {
    memset(rod->position_m[0], 0, sizeof rod->position_m[0]);
    rod->position_m[0][2] = cap_m;
    memset(rod->quaternion[0], 0, sizeof rod->quaternion[0]);
    rod->quaternion[0][0] = 1.0;
    for (size_t i = 0; i < SEGMENTS; i++) {
        const double *turn = rod->turn_rad[i];
        const double half[3] = {0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]}, bend = hypot(half[0], half[1]);
        const double chord[3] = {0.0, 0.0, rod->length_m[i] * (bend > 1e-9 ? sin(bend) / bend : 1.0)};
        double by[4], along[3];
        blind_quaternion_of_rotation(half, by);
        blind_quaternion_product(rod->quaternion[i], by, rod->middle[i]);
        blind_rotate(rod->middle[i], chord, along);
        for (size_t d = 0; d < 3; d++) {
            rod->position_m[i + 1][d] = rod->position_m[i][d] + along[d];
        }
        blind_quaternion_product(rod->middle[i], by, rod->quaternion[i + 1]);
    }
}

/* How much of the mean curvature stands at `share` of the length: near clamped ends less (or more), dying away inwards. */
static double restraint_at(double share, double active_share) {
    const double reach = 0.5 * fabs(1.0 - active_share);
    if (reach < 1e-9) {
        return 1.0;
    }
    const double ends = exp(-share / reach) + exp(-(1.0 - share) / reach);
    return active_share < 1.0 ? 1.0 - ends : 1.0 + ends;
}

static void lay_out(const struct bend_table_module *module, const struct blind_shape *shape, struct rod *rod) {
    for (size_t i = 0; i < SEGMENTS; i++) {
        const double share = restraint_at(((double)i + 0.5) / SEGMENTS, shape->active_share) / SEGMENTS;
        rod->turn_rad[i][0] = -shape->bend_rad[1] * share;
        rod->turn_rad[i][1] = shape->bend_rad[0] * share;
        rod->turn_rad[i][2] = shape->twist_rad / SEGMENTS;
        rod->length_m[i] = (double)module->chamber_length_m * shape->stretch / SEGMENTS;
    }
}

struct load {
    double segment_n; /* weight of one segment */
    double cap_n;
    double payload_n;
    double bending_nm2; /* stiffness E I */
    double axial_n;     /* E A */
};

static struct load load_of(const struct bend_table_module *module, double rubber_area_m2, double stiffness_scale,
                           const struct blind_shape *shape) {
    const double radius_m = 0.5 * (double)module->outer_diameter_m, disc_m2 = M_PI * radius_m * radius_m;
    const double specific = DENSITY_KGPM3 * GRAVITY_MPS2 * shape->weight_scale;
    return (struct load){
        .segment_n = specific * rubber_area_m2 * (double)module->chamber_length_m / SEGMENTS,
        .cap_n = specific * disc_m2 * (double)module->cap_distal_m,
        .payload_n = shape->tip_mass_kg * GRAVITY_MPS2,
        .bending_nm2 = YOUNG_PA * stiffness_scale * 0.25 * disc_m2 * radius_m * radius_m * rubber_area_m2 / disc_m2,
        .axial_n = YOUNG_PA * stiffness_scale * rubber_area_m2};
}

/* Adds what the weights beyond each segment make of it; `free` is the rod without them. Largest change, rad. */
static double sag(const struct bend_table_module *module, const struct load *load, const double down[3],
                  const struct rod *free, struct rod *rod) {
    const double cap_m = (double)module->cap_distal_m, end_n = load->cap_n + load->payload_n;
    double force_n = end_n, first_nm[3], largest = 0.0; /* first moment of the weights: sum of place times weight */
    double axis[3];
    const double z[3] = {0.0, 0.0, 1.0};
    blind_rotate(rod->quaternion[SEGMENTS], z, axis);
    for (size_t d = 0; d < 3; d++) {
        first_nm[d] = end_n * rod->position_m[SEGMENTS][d] +
                      axis[d] * cap_m * (0.5 * load->cap_n + load->payload_n);
    }
    for (size_t i = SEGMENTS; i-- > 0;) {
        double arm[3], moment[3], own[3], own_down[3], away[4];
        double middle[3];
        for (size_t d = 0; d < 3; d++) {
            middle[d] = 0.5 * (rod->position_m[i][d] + rod->position_m[i + 1][d]);
            arm[d] = first_nm[d] - force_n * middle[d];
            away[1 + d] = -rod->middle[i][1 + d];
        }
        away[0] = rod->middle[i][0];
        cross(arm, down, moment);
        blind_rotate(away, moment, own);
        blind_rotate(away, down, own_down);
        for (size_t d = 0; d < 2; d++) {
            const double wanted = free->turn_rad[i][d] + own[d] / load->bending_nm2 * rod->length_m[i];
            largest = fmax(largest, fabs(wanted - rod->turn_rad[i][d]) * SEGMENTS);
            rod->turn_rad[i][d] += RELAXATION * (wanted - rod->turn_rad[i][d]);
        }
        rod->length_m[i] = free->length_m[i] * (1.0 + force_n * own_down[2] / load->axial_n);
        force_n += load->segment_n;
        for (size_t d = 0; d < 3; d++) {
            first_nm[d] += load->segment_n * middle[d];
        }
    }
    return largest;
}

void blind_body_pose(const struct bend_table_module *module, double rubber_area_m2, double stiffness_scale,
                     const struct blind_shape *shape, struct blind_pose *pose) {
    const double tip[3] = {0.0, 0.0, (double)module->cap_distal_m};
    struct rod rod, free;
    double cap[3];
    lay_out(module, shape, &rod);
    integrate(&rod, (double)module->cap_proximal_m);
    if (shape->weight_scale > 0.0 || shape->tip_mass_kg > 0.0) {
        const struct load load = load_of(module, rubber_area_m2, stiffness_scale, shape);
        free = rod;
        for (int i = 0; i < ROUNDS && sag(module, &load, shape->down, &free, &rod) > TOLERANCE_RAD; i++) {
            integrate(&rod, (double)module->cap_proximal_m);
        }
        integrate(&rod, (double)module->cap_proximal_m);
    }
    memcpy(pose->quaternion, rod.quaternion[SEGMENTS], sizeof pose->quaternion);
    blind_rotate(pose->quaternion, tip, cap);
    for (size_t d = 0; d < 3; d++) {
        pose->position_m[d] = rod.position_m[SEGMENTS][d] + cap[d];
    }
}
