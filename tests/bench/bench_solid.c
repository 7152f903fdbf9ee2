/* The section solver beside CalculiX: two modules, two rubbers, the same pressures and the same bulk modulus. Prints bend
 * (with the modules' end correction), width and chamber volume of both, and the CPU time of both. Minutes long.
 * usage: bench_solid FOLDER */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "model/ccx/solid_model.h"
#include "section/section_bend.h"

#define DEGREES (180.0 / M_PI)
/* A compressible rubber, since C3D20R has displacements alone: bulk over shear modulus, in both solvers. */
#define BULK_RATIO 200.0

struct comparison {
    const char *module;
    const char *material;
    size_t steps;
    double pressure_pa[SOLID_STEPS_MAX];
};

static const struct comparison comparisons[] = {
    {"paper-circle", "ecoflex-0030-positive", 2, {3000.0, 5500.0}},
    {"paper-semicircle", "ecoflex-0030-positive", 2, {4000.0, 5500.0}},
    {"paper-circle", "ecoflex-0050-measured-ogden", 2, {5000.0, 8000.0}},
    {"paper-semicircle", "ecoflex-0050-measured-ogden", 2, {6000.0, 8500.0}},
};

static double cpu_seconds(void) {
    return (double)clock() / CLOCKS_PER_SEC;
}

struct wanted {
    const struct comparison *comparison;
    struct section_solver *solver;
    struct section_state state[SOLID_STEPS_MAX];
    bool found;
};

static double solve_section(const struct module_description *module, struct wanted *wanted) {
    const double start_s = cpu_seconds();
    struct description_error error;
    struct section_mesh *mesh = section_mesh_create(module, NULL, &error);
    wanted->solver = mesh == NULL ? NULL : section_solver_create(mesh, module, &error);
    wanted->found = wanted->solver != NULL;
    for (size_t s = 0; s < wanted->comparison->steps && wanted->found; s++) {
        const double pressure_pa[3] = {wanted->comparison->pressure_pa[s], 0.0, 0.0};
        wanted->found = section_solver_move_to(wanted->solver, pressure_pa);
        section_solver_state(wanted->solver, &wanted->state[s]);
    }
    section_solver_free(wanted->solver);
    section_mesh_free(mesh);
    return cpu_seconds() - start_s;
}

static bool compare(const struct comparison *comparison, const char *folder) {
    char path[512], material[512], error[256] = "";
    struct module_description module;
    struct description_error why;
    (void)snprintf(path, sizeof path, "tables/modules/%s.yaml", comparison->module);
    (void)snprintf(material, sizeof material, "%s", comparison->material);
    if (!module_description_read(path, material, &module, &why)) {
        fprintf(stderr, "%s\n", why.text);
        return false;
    }
    module.material.bulk_modulus_pa = BULK_RATIO * material_shear_modulus(&module.material);
    struct solid_options options = {.size_m = 1.5e-3, .layers = 6, .cap_layers = 2, .steps = comparison->steps};
    memcpy(options.pressure_pa, comparison->pressure_pa, sizeof options.pressure_pa);
    struct solid_answer answers[SOLID_STEPS_MAX];
    size_t equations = 0;
    double solid_s = 0.0;
    const int reached = solid_model_run(&module, &options, folder, answers, &equations, &solid_s, error, sizeof error);
    if (reached < 1) {
        fprintf(stderr, "%s, %s: %s\n", comparison->module, comparison->material, reached < 0 ? error : "ccx did not converge");
        return false;
    }
    struct wanted wanted = {.comparison = comparison};
    const double section_s = solve_section(&module, &wanted);
    for (int s = 0; s < reached && wanted.found; s++) {
        const struct section_state *state = &wanted.state[s];
        double bend_rad[2];
        section_tip_bend(&module, state, bend_rad);
        const double bend = hypot(bend_rad[0], bend_rad[1]);
        const double ratio = state->volume_m2[0] / cavity_area_m2(&module.chamber[0].cavity[0]);
        printf("%-17s %-28s %6.0f Pa  bend %7.3f %7.3f deg %+6.2f %%  width %6.3f %6.3f mm %+5.2f %%  volume x %.3f %.3f\n",
               comparison->module, comparison->material, comparison->pressure_pa[s], answers[s].bend_rad * DEGREES,
               bend * DEGREES, 100.0 * (bend / answers[s].bend_rad - 1.0), 1e3 * answers[s].width_m,
               1e3 * state->width_bend_plane_m, 100.0 * (state->width_bend_plane_m / answers[s].width_m - 1.0),
               answers[s].volume_ratio, ratio);
    }
    printf("%-17s %-28s CPU time %.1f s for %zu equations in 3-D, %.3f s for the section: x %.0f\n", comparison->module,
           comparison->material, solid_s, equations, section_s, solid_s / section_s);
    (void)fflush(stdout);
    return wanted.found && (size_t)reached == comparison->steps;
}

int main(int argc, char **argv) {
    if (argc != 2 || (mkdir(argv[1], 0777) != 0 && access(argv[1], W_OK) != 0)) {
        fprintf(stderr, "usage: bench_solid FOLDER\n");
        return 2;
    }
    bool sound = true;
    printf("%-46s %10s   3-D, section, difference\n", "module and rubber", "pressure");
    for (size_t i = 0; i < sizeof comparisons / sizeof comparisons[0]; i++) {
        sound = compare(&comparisons[i], argv[1]) && sound;
    }
    return sound ? 0 : 1;
}
