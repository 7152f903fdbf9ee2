/* Seconds per equilibrium of the full section (three chambers), and how far the default mesh's 90 degree pressure is
 * from a mesh of half the size. Prints; asserts nothing. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "section/section_solver.h"

enum { STEPS = 40 };

static double seconds(void) {
    struct timespec now;
    (void)timespec_get(&now, TIME_UTC);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

struct crossing {
    double target_rad;
    double length_m;
    double last_bend_rad;
    double last_pressure_pa;
    double pressure_pa;
};

static bool stop_at_bend(void *context, const struct section_solver *solver, const struct section_state *state) {
    struct crossing *crossing = context;
    (void)solver;
    const double bend_rad = hypot(state->curvature_x_1pm, state->curvature_y_1pm) * crossing->length_m;
    if (bend_rad >= crossing->target_rad) {
        const double share =
            (crossing->target_rad - crossing->last_bend_rad) / (bend_rad - crossing->last_bend_rad);
        crossing->pressure_pa =
            crossing->last_pressure_pa + share * (state->pressure_pa[0] - crossing->last_pressure_pa);
        return false;
    }
    crossing->last_bend_rad = bend_rad;
    crossing->last_pressure_pa = state->pressure_pa[0];
    return true;
}

static void fail(const struct description_error *error) {
    fprintf(stderr, "bench_model: %s\n", error->text);
    exit(1);
}

static void time_equilibria(struct section_solver *solver) {
    const double start_s = seconds();
    int newton_iterations = 0;
    for (int step = 1; step <= STEPS; step++) {
        const double share = (double)step / STEPS;
        const double pressure_pa[3] = {9000.0 * share, 5000.0 * share, 2000.0 * share};
        if (!section_solver_move_to(solver, pressure_pa)) {
            fprintf(stderr, "bench_model: no equilibrium at step %d\n", step);
            exit(1);
        }
        struct section_state state;
        section_solver_state(solver, &state);
        newton_iterations += state.newton_iterations;
    }
    const double used_s = seconds() - start_s;
    printf("equilibrium            %8.2f ms  (%d three-chamber steps, %.1f Newton iterations each, %zu unknowns)\n",
           1e3 * used_s / STEPS, STEPS, (double)newton_iterations / STEPS, section_solver_unknowns(solver));
}

int main(void) {
    struct module_description module;
    struct description_error error;
    if (!module_description_read("tables/modules/paper-semicircle.yaml", NULL, &module, &error)) {
        fail(&error);
    }
    struct section_mesh_options options = {.size_m = 0.0};
    struct section_mesh *mesh = section_mesh_create(&module, &options, &error);
    struct section_solver *solver = mesh == NULL ? NULL : section_solver_create(mesh, &module, &error);
    if (solver == NULL) {
        fail(&error);
    }
    time_equilibria(solver);

    section_solver_reset(solver);
    struct crossing crossing = {.target_rad = acos(0.0),
                                .length_m = module.chamber_length_m + module.end_correction_m};
    const double direction_pa[3] = {1000.0, 0.0, 0.0};
    const double start_s = seconds();
    if (!section_solver_path(solver, direction_pa, stop_at_bend, &crossing, &error)) {
        fail(&error);
    }
    printf("path to 90 degrees     %8.2f s   (%.1f Pa by linear interpolation between path points)\n",
           seconds() - start_s, crossing.pressure_pa);
    section_solver_free(solver);
    section_mesh_free(mesh);
    return 0;
}
