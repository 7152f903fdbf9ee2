/* Seconds per equilibrium of the full section (three chambers) and per path of one chamber to 90 degrees. Prints;
 * asserts nothing. */
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

struct path_end {
    double pressure_pa;
    int points;
};

static bool note_point(void *context, const struct section_state *state) {
    struct path_end *end = context;
    end->pressure_pa = state->pressure_pa[0];
    end->points++;
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
    struct path_end end = {.points = 0};
    const double direction_pa[3] = {1.0, 0.0, 0.0};
    const double curvature_1pm = acos(0.0) / module.chamber_length_m;
    const double start_s = seconds();
    if (!section_solver_path(solver, direction_pa, SECTION_GOAL_CURVATURE, curvature_1pm, note_point, &end, &error)) {
        fail(&error);
    }
    printf("path to 90 degrees     %8.2f s   (%d points, %.1f Pa at its end)\n", seconds() - start_s, end.points,
           end.pressure_pa);
    section_solver_free(solver);
    section_mesh_free(mesh);
    return 0;
}
