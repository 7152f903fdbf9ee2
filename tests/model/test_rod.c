/* The rod: constant curvature without load, small loads against beam theory, large ones against the elastica. */
#include "support/test.h"

#include "rod/rod.h"

static struct module_description module;
static struct section_mesh *mesh;
static struct section_solver *solver;

static int set_up(void **state) {
    struct description_error error;
    const struct section_mesh_options options = {.size_m = 1.5e-3};
    (void)state;
    if (!module_description_read("tables/modules/paper-circle.yaml", NULL, &module, &error)) {
        return -1;
    }
    mesh = section_mesh_create(&module, &options, &error);
    solver = mesh == NULL ? NULL : section_solver_create(mesh, &module, &error);
    return solver != NULL ? 0 : -1;
}

static int tear_down(void **state) {
    (void)state;
    section_solver_free(solver);
    section_mesh_free(mesh);
    return 0;
}

static struct rod_state solved(const struct rod_load *load, size_t stations) {
    struct rod_state state;
    struct description_error error = {""};
    section_solver_reset(solver);
    if (!rod_solve(&module, solver, load, stations, &state, &error)) {
        fail_msg("%s", error.text);
    }
    return state;
}

/* Bending stiffness of the unpressurised section, N m2, from a small moment. */
static double bending_stiffness_nm2(void) {
    const double none_pa[3] = {0.0, 0.0, 0.0};
    const struct section_load load = {0.0, {1e-6, 0.0}};
    struct section_state state;
    section_solver_reset(solver);
    assert_true(section_solver_move_to_loaded(solver, none_pa, &load));
    section_solver_state(solver, &state);
    assert_true(state.curvature_x_1pm > 0.0);
    assert_close(state.curvature_y_1pm, 0.0, 1e-3 * state.curvature_x_1pm);
    return 1e-6 / state.curvature_x_1pm;
}

static void without_load_the_curvature_is_constant(void **state) {
    (void)state;
    const struct rod_load load = {.pressure_pa = {6000.0, 1000.0, 0.0}};
    const struct rod_state rod = solved(&load, 17);
    struct section_state section;
    section_solver_reset(solver);
    assert_true(section_solver_move_to(solver, load.pressure_pa));
    section_solver_state(solver, &section);
    const double curvature_1pm = hypot(section.curvature_x_1pm, section.curvature_y_1pm);
    assert_close(rod.bend_rad, curvature_1pm * module.chamber_length_m, 1e-6);
    assert_close(rod.direction_rad, atan2(section.curvature_y_1pm, section.curvature_x_1pm), 1e-6);
    const double radius_m = section.stretch / curvature_1pm;
    const double lean_m = radius_m * (1.0 - cos(rod.bend_rad)) + module.cap_distal_m * sin(rod.bend_rad);
    assert_relative(hypot(rod.tip_position_m[0], rod.tip_position_m[1]), lean_m, 2e-3);
}

/* A tip force on the straight module: w = F l^3 / 3 EI at the chamber's end, plus the cap's lever. */
static void a_small_force_deflects_as_a_beam(void **state) {
    (void)state;
    const double stiffness = bending_stiffness_nm2(), force_n = 2e-5;
    const double l = module.chamber_length_m, cap = module.cap_distal_m;
    const struct rod_load across = {.force_n = {force_n, 0.0, 0.0}}, aside = {.force_n = {0.0, force_n, 0.0}};
    const struct rod_state x = solved(&across, 33), y = solved(&aside, 33);
    const double angle = force_n * (l * l / 2.0 + cap * l) / stiffness;
    const double deflection_m = force_n * (l * l * l / 3.0 + cap * l * l + cap * cap * l) / stiffness;
    assert_relative(x.bend_rad, angle, 2e-3);
    assert_relative(x.tip_position_m[0], deflection_m, 2e-3);
    assert_relative(y.tip_position_m[1], deflection_m, 1e-2); /* the section is as stiff in every direction */
    assert_close(y.tip_position_m[0], 0.0, 1e-2 * deflection_m);
    assert_relative(x.moment_most_nm, force_n * (l + cap), 1e-3);
}

/* Hanging straight down, gravity stretches and does not bend; a level module sags down; standing, it leans further. */
static void gravity_acts_where_it_should(void **state) {
    (void)state;
    const struct rod_load hanging = {.gravity_mps2 = {0.0, 0.0, 9.81}, .payload_kg = 0.005};
    const struct rod_load level = {.gravity_mps2 = {9.81, 0.0, 0.0}};
    const struct rod_state still = solved(&hanging, 9), sag = solved(&level, 17);
    assert_close(still.bend_rad, 0.0, 1e-9);
    assert_true(still.tip_position_m[2] > module.length_m);
    assert_true(sag.tip_position_m[0] > 0.0);
    assert_close(sag.tip_position_m[1], 0.0, 1e-6);
    const double bent_pa[3] = {5000.0, 0.0, 0.0};
    struct rod_load load = {.pressure_pa = {bent_pa[0], 0.0, 0.0}};
    const double free_rad = solved(&load, 17).bend_rad;
    load.gravity_mps2[2] = -9.81; /* standing: the weight pulls the leaning tip further over */
    const double standing_rad = solved(&load, 17).bend_rad;
    load.gravity_mps2[2] = 9.81;
    const double hanging_rad = solved(&load, 17).bend_rad;
    print_message("           bend free %.2f deg, standing %.2f deg, hanging %.2f deg\n", free_rad * 180.0 / M_PI,
                  standing_rad * 180.0 / M_PI, hanging_rad * 180.0 / M_PI);
    assert_true(standing_rad > free_rad && free_rad > hanging_rad);
}

/* Moments balance in the deformed shape: that at the base is the force times its lever arm. */
static void a_large_force_balances_in_the_deformed_shape(void **state) {
    (void)state;
    const double stiffness = bending_stiffness_nm2();
    const struct rod_load load = {.force_n = {0.8 * stiffness / (module.chamber_length_m * module.chamber_length_m), 0.0, 0.0}};
    const struct rod_state coarse = solved(&load, 17), fine = solved(&load, 33);
    assert_true(fine.bend_rad > 0.2);
    assert_relative(coarse.bend_rad, fine.bend_rad, 2e-3);
    const double lever_m = fine.tip_position_m[2] - module.cap_proximal_m;
    assert_relative(fine.moment_most_nm, load.force_n[0] * lever_m, 1e-6);
}

static void too_much_is_refused_with_a_reason(void **state) {
    (void)state;
    const struct rod_load load = {.pressure_pa = {5000.0, 0.0, 0.0}, .payload_kg = 5.0, .gravity_mps2 = {0.0, 0.0, -9.81}};
    struct rod_state rod;
    struct description_error error = {""};
    section_solver_reset(solver);
    assert_false(rod_solve(&module, solver, &load, 9, &rod, &error));
    assert_true(strstr(error.text, "load") != NULL);
    assert_false(rod_solve(&module, solver, &load, 2, &rod, &error));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_load_the_curvature_is_constant),
        cmocka_unit_test(a_small_force_deflects_as_a_beam),
        cmocka_unit_test(gravity_acts_where_it_should),
        cmocka_unit_test(a_large_force_balances_in_the_deformed_shape),
        cmocka_unit_test(too_much_is_refused_with_a_reason),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
