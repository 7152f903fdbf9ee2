/* Fixed-point iteration with Aitken's relaxation over the curvatures of the stations: shape from curvatures, forces and
 * moments from the shape (all loads are dead), curvatures from the section under them. */
#include "rod/rod.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define ITERATIONS_MAX 60
#define TOLERANCE 1e-7 /* of curvature times length, rad, and of the stretch */
#define RELAXATION_FIRST 0.7
#define RELAXATION_LEAST 0.05
#define RELAXATION_MOST 1.2

struct frame {
    double axis[3][3]; /* d1, d2, d3 */
};

/* Strains of a station: curvature x, y (1/m of reference length) and stretch. */
struct strain {
    double value[3];
};

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double c[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* Turn the frame by a rotation vector given in its own axes (Rodrigues). */
static void turn(struct frame *frame, const double own[3]) {
    const double angle = sqrt(dot(own, own));
    if (angle == 0.0) {
        return;
    }
    double about[3];
    for (size_t d = 0; d < 3; d++) {
        about[d] = (own[0] * frame->axis[0][d] + own[1] * frame->axis[1][d] + own[2] * frame->axis[2][d]) / angle;
    }
    for (size_t k = 0; k < 3; k++) {
        double side[3];
        const double along = dot(about, frame->axis[k]) * (1.0 - cos(angle));
        cross(about, frame->axis[k], side);
        for (size_t d = 0; d < 3; d++) {
            frame->axis[k][d] = frame->axis[k][d] * cos(angle) + side[d] * sin(angle) + about[d] * along;
        }
    }
}

/* Positions and frames of all stations from their strains; half a turn, a step, half a turn between stations. */
static void integrate(const struct strain *strain, size_t stations, double spacing_m, double cap_m,
                      double (*position_m)[3], struct frame *frame) {
    const struct frame base = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    frame[0] = base;
    position_m[0][0] = position_m[0][1] = 0.0;
    position_m[0][2] = cap_m;
    for (size_t i = 1; i < stations; i++) {
        double mean[3];
        for (size_t k = 0; k < 3; k++) {
            mean[k] = 0.5 * (strain[i - 1].value[k] + strain[i].value[k]);
        }
        /* bending towards +x turns about +d2, towards +y about -d1 */
        const double half[3] = {-0.5 * mean[1] * spacing_m, 0.5 * mean[0] * spacing_m, 0.0};
        frame[i] = frame[i - 1];
        turn(&frame[i], half);
        for (size_t d = 0; d < 3; d++) {
            position_m[i][d] = position_m[i - 1][d] + mean[2] * spacing_m * frame[i].axis[2][d];
        }
        turn(&frame[i], half);
    }
}

double rod_section_area_m2(const struct module_description *module) {
    const double outer_m = module->outer_diameter_m, bore_m = module->bore_diameter_m;
    double area_m2 = 0.25 * M_PI * (outer_m * outer_m - bore_m * bore_m);
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            area_m2 -= cavity_area_m2(&module->chamber[c].cavity[k]);
        }
    }
    return area_m2;
}

/* What hangs on the chamber's end: force and moment about its last station. */
static void end_load(const struct module_description *module, const struct rod_load *load, const double tip_axis[3],
                     double force_n[3], double moment_nm[3]) {
    const double outer_m = module->outer_diameter_m, bore_m = module->bore_diameter_m, cap_m = module->cap_distal_m;
    const double cap_kg = module->material.density_kgpm3 * 0.25 * M_PI * (outer_m * outer_m - bore_m * bore_m) * cap_m;
    double at_cap[3], at_tip[3], arm_m[3], part[3];
    for (size_t d = 0; d < 3; d++) {
        at_cap[d] = cap_kg * load->gravity_mps2[d];
        at_tip[d] = load->payload_kg * load->gravity_mps2[d] + load->force_n[d];
        force_n[d] = at_cap[d] + at_tip[d];
        arm_m[d] = 0.5 * cap_m * tip_axis[d];
    }
    cross(arm_m, at_cap, moment_nm);
    for (size_t d = 0; d < 3; d++) {
        arm_m[d] *= 2.0;
    }
    cross(arm_m, at_tip, part);
    for (size_t d = 0; d < 3; d++) {
        moment_nm[d] += part[d];
    }
}

/* Section loads at every station, from the tip down. The weight of the rubber between stations acts half-way. */
static void pass_down(const struct module_description *module, const struct rod_load *load, size_t stations,
                      double spacing_m, double (*position_m)[3], const struct frame *frame, struct section_load *section) {
    const double line_kgpm = module->material.density_kgpm3 * rod_section_area_m2(module);
    double force_n[3], moment_nm[3];
    end_load(module, load, frame[stations - 1].axis[2], force_n, moment_nm);
    for (size_t i = stations; i-- > 0;) {
        section[i].axial_n = dot(force_n, frame[i].axis[2]);
        section[i].moment_nm[0] = dot(moment_nm, frame[i].axis[1]);
        section[i].moment_nm[1] = -dot(moment_nm, frame[i].axis[0]);
        if (i == 0) {
            break;
        }
        double weight_n[3], arm_m[3], half_m[3], part[3];
        for (size_t d = 0; d < 3; d++) {
            weight_n[d] = line_kgpm * spacing_m * load->gravity_mps2[d];
            arm_m[d] = position_m[i][d] - position_m[i - 1][d];
            half_m[d] = 0.5 * arm_m[d];
        }
        cross(arm_m, force_n, part);
        for (size_t d = 0; d < 3; d++) {
            moment_nm[d] += part[d];
        }
        cross(half_m, weight_n, part);
        for (size_t d = 0; d < 3; d++) {
            moment_nm[d] += part[d];
            force_n[d] += weight_n[d];
        }
    }
}

/* The section's strains under its load; false where it has no equilibrium. */
static bool respond(struct section_solver *solver, const double pressure_pa[3], const struct section_load *load,
                    struct strain *strain) {
    struct section_state state;
    const bool found = section_solver_move_to_loaded(solver, pressure_pa, load);
    section_solver_state(solver, &state);
    strain->value[0] = state.curvature_x_1pm;
    strain->value[1] = state.curvature_y_1pm;
    strain->value[2] = state.stretch;
    return found;
}

static void report(const struct module_description *module, const struct section_load *section, const struct frame *tip,
                   struct rod_state *state) {
    const double *end_m = state->position_m[state->stations - 1];
    for (size_t d = 0; d < 3; d++) {
        state->tip_axis[d] = tip->axis[2][d];
        state->tip_position_m[d] = end_m[d] + module->cap_distal_m * tip->axis[2][d];
    }
    state->bend_rad = atan2(hypot(state->tip_axis[0], state->tip_axis[1]), state->tip_axis[2]);
    state->direction_rad = atan2(state->tip_axis[1], state->tip_axis[0]);
    state->moment_most_nm = 0.0;
    for (size_t i = 0; i < state->stations; i++) {
        state->moment_most_nm = fmax(state->moment_most_nm, hypot(section[i].moment_nm[0], section[i].moment_nm[1]));
    }
}

bool rod_solve(const struct module_description *module, struct section_solver *solver, const struct rod_load *load,
               size_t stations, struct rod_state *state, struct description_error *error) {
    struct strain strain[ROD_STATIONS_MAX], gap[ROD_STATIONS_MAX], last[ROD_STATIONS_MAX] = {{{0.0}}};
    struct section_load section[ROD_STATIONS_MAX];
    struct frame frame[ROD_STATIONS_MAX];
    const struct section_load none = {0.0, {0.0, 0.0}};
    memset(state, 0, sizeof *state);
    if (stations < 3 || stations > ROD_STATIONS_MAX) {
        (void)snprintf(error->text, sizeof error->text, "a rod takes 3 to %d stations, not %zu", ROD_STATIONS_MAX, stations);
        return false;
    }
    state->stations = stations;
    const double spacing_m = module->chamber_length_m / (double)(stations - 1);
    if (!respond(solver, load->pressure_pa, &none, &strain[0])) {
        (void)snprintf(error->text, sizeof error->text, "the section has no stable equilibrium at these pressures without load");
        return false;
    }
    for (size_t i = 1; i < stations; i++) {
        strain[i] = strain[0];
    }
    double relaxation = RELAXATION_FIRST;
    for (state->iterations = 1; state->iterations <= ITERATIONS_MAX; state->iterations++) {
        double most = 0.0, change = 0.0, product = 0.0;
        integrate(strain, stations, spacing_m, module->cap_proximal_m, state->position_m, frame);
        pass_down(module, load, stations, spacing_m, state->position_m, frame, section);
        for (size_t i = 0; i < stations; i++) {
            struct strain answer;
            if (!respond(solver, load->pressure_pa, &section[i], &answer)) {
                (void)snprintf(error->text, sizeof error->text,
                               "no equilibrium %.1f mm from the base under a moment of %.3g N m and %.3g N: the load is more "
                               "than the module bears at this pressure",
                               1e3 * (double)i * spacing_m, hypot(section[i].moment_nm[0], section[i].moment_nm[1]),
                               section[i].axial_n);
                return false;
            }
            for (size_t k = 0; k < 3; k++) {
                gap[i].value[k] = answer.value[k] - strain[i].value[k];
                const double size = fabs(gap[i].value[k]) * (k < 2 ? module->chamber_length_m : 1.0);
                most = fmax(most, size);
                if (state->iterations > 1) {
                    const double step = gap[i].value[k] - last[i].value[k];
                    change += step * step;
                    product += last[i].value[k] * step;
                }
            }
        }
        if (most < TOLERANCE) {
            report(module, section, &frame[stations - 1], state);
            return true;
        }
        if (state->iterations > 1 && change > 0.0) { /* Aitken's relaxation (Irons and Tuck 1969) */
            relaxation = fmin(RELAXATION_MOST, fmax(RELAXATION_LEAST, fabs(relaxation * product / change)));
        }
        for (size_t i = 0; i < stations; i++) {
            for (size_t k = 0; k < 3; k++) {
                strain[i].value[k] += relaxation * gap[i].value[k];
            }
            last[i] = gap[i];
        }
    }
    (void)snprintf(error->text, sizeof error->text,
                   "the rod's shape did not settle in %d iterations: the load may be near the buckling load", ITERATIONS_MAX);
    return false;
}
