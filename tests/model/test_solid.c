/* The section against a three-dimensional solution of the same module (CalculiX), on a coarse mesh at a moderate bend;
 * `make bench` compares further and finer. */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "model/ccx/solid_model.h"
#include "section/section_bend.h"
#include "support/scratch.h"

#define BULK_RATIO 200.0

static char folder[SCRATCH_BYTES];

static int make_folder(void **state) {
    (void)state;
    return scratch_folder(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
    static const char *const files[] = {"inp", "dat", "frd", "sta", "cvg", "12d"};
    char path[SCRATCH_WITHIN_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        (void)snprintf(path, sizeof path, "%s/solid.%s", folder, files[i]);
        (void)remove(path);
    }
    (void)snprintf(path, sizeof path, "%s/ccx.log", folder);
    (void)remove(path);
    (void)snprintf(path, sizeof path, "%s/spooles.out", folder);
    (void)remove(path);
    return rmdir(folder);
}

static void section_and_solid_agree(void **state) {
    (void)state;
    static const double pressure_pa[3] = {5000.0, 0.0, 0.0};
    struct solid_options options = {.size_m = 1.5e-3, .layers = 6, .cap_layers = 2, .steps = 1, .pressure_pa = {5000.0}};
    struct solid_answer answer;
    struct module_description module;
    struct description_error error;
    struct section_state section;
    char message[256] = "";
    double cpu_s = 0.0, bend_rad[2];
    size_t equations = 0;
    assert_true(module_description_read("tables/modules/paper-semicircle.yaml", "ecoflex-0050-measured-ogden", &module, &error));
    module.material.bulk_modulus_pa = BULK_RATIO * material_shear_modulus(&module.material);
    if (solid_model_run(&module, &options, folder, &answer, &equations, &cpu_s, message, sizeof message) != 1) {
        fail_msg("%s", message[0] == '\0' ? "ccx did not converge" : message);
    }
    struct section_mesh *mesh = section_mesh_create(&module, NULL, &error);
    struct section_solver *solver = section_solver_create(mesh, &module, &error);
    assert_non_null(solver);
    assert_true(section_solver_move_to(solver, pressure_pa));
    section_solver_state(solver, &section);
    section_tip_bend(&module, &section, bend_rad);
    const double bend = hypot(bend_rad[0], bend_rad[1]);
    print_message("           %zu equations, %.0f s: bend %.3f deg, section %.3f; width %.3f mm, section %.3f\n", equations,
                  cpu_s, answer.bend_rad * 180.0 / M_PI, bend * 180.0 / M_PI, 1e3 * answer.width_m,
                  1e3 * section.width_bend_plane_m);
    assert_relative(bend, answer.bend_rad, 0.03);
    assert_relative(section.width_bend_plane_m, answer.width_m, 0.01);
    assert_relative(section.volume_m2[0] / cavity_area_m2(&module.chamber[0].cavity[0]), answer.volume_ratio, 0.06);
    section_solver_free(solver);
    section_mesh_free(mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(section_and_solid_agree)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
