/* A calibrated module in the solver: each state comes at so many times the pressure. */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "description/calibration_file.h"
#include "section/section_bend.h"

#define SIZE_M 1.5e-3

static void read_module(const char *name, struct module_description *module) {
    struct description_error error;
    char path[128];
    (void)snprintf(path, sizeof path, "tables/modules/%s.yaml", name);
    if (!module_description_read(path, NULL, module, &error)) {
        fail_msg("%s", error.text);
    }
}

static void solve(const struct module_description *module, double pressure_pa, struct section_state *found) {
    const struct section_mesh_options options = {.size_m = SIZE_M};
    const double pressures_pa[3] = {pressure_pa, 0.5 * pressure_pa, 0.0};
    struct description_error error;
    struct section_mesh *mesh = section_mesh_create(module, &options, &error);
    struct section_solver *solver = section_solver_create(mesh, module, &error);
    assert_true(section_solver_move_to(solver, pressures_pa));
    section_solver_state(solver, found);
    section_solver_free(solver);
    section_mesh_free(mesh);
}

/* Of one rubber, and of one with fibres and layers. */
static void a_stiffer_module_takes_each_state_at_as_much_more_pressure(void **state) {
    (void)state;
    static const char *const names[] = {"paper-semicircle", "stiff-flop", "paper-composite"};
    static const double pressures_pa[] = {5000.0, 40000.0, 12000.0};
    for (size_t n = 0; n < sizeof names / sizeof names[0]; n++) {
        struct module_description nominal, stiffer;
        struct section_state before, after;
        read_module(names[n], &nominal);
        read_module(names[n], &stiffer);
        module_description_stiffen(&stiffer, 1.3);
        solve(&nominal, pressures_pa[n], &before);
        solve(&stiffer, 1.3 * pressures_pa[n], &after);
        assert_true(hypot(before.curvature_x_1pm, before.curvature_y_1pm) > 0.5);
        assert_relative(after.curvature_x_1pm, before.curvature_x_1pm, 1e-5);
        assert_relative(after.curvature_y_1pm, before.curvature_y_1pm, 1e-5);
        assert_relative(after.stretch, before.stretch, 1e-6);
        assert_relative(after.volume_m2[0], before.volume_m2[0], 1e-6);
        assert_true(module_description_hash(&stiffer) != module_description_hash(&nominal));
    }
}

static void limits_come_down_and_never_go_up(void **state) {
    (void)state;
    struct module_description nominal, module;
    read_module("paper-semicircle", &nominal);
    module = nominal;
    module_description_stiffen(&module, 1.3);
    assert_close(module.working_pressure_pa, nominal.working_pressure_pa, 0.0);
    assert_close(module.burst_pressure_pa, nominal.burst_pressure_pa, 0.0);
    module = nominal;
    module_description_stiffen(&module, 0.7);
    assert_relative(module.working_pressure_pa, 0.7 * nominal.working_pressure_pa, 1e-12);
    assert_relative(module.burst_pressure_pa, 0.7 * nominal.burst_pressure_pa, 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stiffer_module_takes_each_state_at_as_much_more_pressure),
        cmocka_unit_test(limits_come_down_and_never_go_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
