/* The cross-section solver against closed forms, finite differences, symmetry and published numbers. */
#include "support/test.h"

#include <stdlib.h>

#include "section/section_internal.h" /* white box: the exact bending field is written into the unknowns */
#include "section/section_mesh.h"
#include "section/section_solver.h"

#define DEGREES (180.0 / M_PI)

static const struct material neo_hookean = {.law = MATERIAL_NEO_HOOKEAN, .terms = 1, .coefficient_pa = {8000.0},
                                            .bulk_modulus_pa = 1e9, .strain_max = 9.0};
static const struct material quadratic = {.law = MATERIAL_REDUCED_POLYNOMIAL, .terms = 2,
                                          .coefficient_pa = {6000.0, 200.0}, .bulk_modulus_pa = 1e9, .strain_max = 9.0};
static const struct material ogden = {.law = MATERIAL_OGDEN, .terms = 2, .coefficient_pa = {15000.0, 25.0},
                                      .exponent = {2.2, 5.8}, .bulk_modulus_pa = 1e9, .strain_max = 9.0};
static const struct material yeoh = {.law = MATERIAL_YEOH, .terms = 3, .coefficient_pa = {5072.0, 331.0, 15.0},
                                     .bulk_modulus_pa = 1e9, .strain_max = 9.0};

struct fixture {
    struct module_description module;
    struct section_mesh *mesh;
    struct section_solver *solver;
};

static void set_up_module(struct fixture *fixture, const char *path, double size_m) {
    struct description_error error;
    const struct section_mesh_options options = {.size_m = size_m};
    if (!module_description_read(path, NULL, &fixture->module, &error)) {
        fail_msg("%s", error.text);
    }
    fixture->mesh = section_mesh_create(&fixture->module, &options, &error);
    assert_non_null(fixture->mesh);
    fixture->solver = section_solver_create(fixture->mesh, &fixture->module, &error);
    assert_non_null(fixture->solver);
}

static void set_up_disc(struct fixture *fixture, const struct material *material, double hole_m, double size_m) {
    struct description_error error;
    const struct cavity hole = {.shape = CAVITY_CIRCLE, .centre_m = {0.0, 0.0}, .radius_m = hole_m};
    const int chamber = 0;
    memset(fixture, 0, sizeof *fixture);
    fixture->module.material = *material;
    fixture->module.outer_diameter_m = 0.02;
    fixture->mesh = section_mesh_create_disc(0.01, &hole, &chamber, hole_m > 0.0 ? 1 : 0, size_m, &error);
    assert_non_null(fixture->mesh);
    fixture->solver = section_solver_create(fixture->mesh, &fixture->module, &error);
    assert_non_null(fixture->solver);
}

static void tear_down(struct fixture *fixture) {
    section_solver_free(fixture->solver);
    section_mesh_free(fixture->mesh);
}

static struct section_state state_at(struct section_solver *solver, double p1_pa, double p2_pa, double p3_pa) {
    const double pressure_pa[3] = {p1_pa, p2_pa, p3_pa};
    struct section_state state;
    assert_true(section_solver_move_to(solver, pressure_pa));
    section_solver_state(solver, &state);
    return state;
}

/* Uniform in [0, 1), a linear congruential generator. */
static double next_random(uint64_t *random) {
    *random = *random * 6364136223846793005u + 1442695040888963407u;
    return (double)(*random >> 11) / 9007199254740992.0;
}

/* --- the tangent is the derivative of the residual --- */

static void check_tangent_of(struct fixture *fixture, const double pressure_pa[3]) {
    struct section_solver *solver = fixture->solver;
    (void)state_at(solver, pressure_pa[0], pressure_pa[1], pressure_pa[2]);
    const size_t n = section_solver_equations(solver);
    double *direction = calloc(n, sizeof(double)), *product = calloc(n, sizeof(double));
    double *plus = calloc(n, sizeof(double)), *minus = calloc(n, sizeof(double));
    assert_true(direction != NULL && product != NULL && plus != NULL && minus != NULL);
    uint64_t random = 12345;
    for (size_t i = 0; i < n; i++) {
        direction[i] = 2.0 * next_random(&random) - 1.0;
    }
    assert_true(section_solver_tangent_product(solver, direction, product));
    const double h = 1e-6;
    section_solver_displace(solver, h, direction);
    assert_true(section_solver_residual(solver, plus));
    section_solver_displace(solver, -2.0 * h, direction);
    assert_true(section_solver_residual(solver, minus));
    double worst = 0.0, size = 0.0;
    for (size_t i = 0; i < n; i++) {
        worst = fmax(worst, fabs((plus[i] - minus[i]) / (2.0 * h) - product[i]));
        size = fmax(size, fabs(product[i]));
    }
    print_message("           largest entry %.3g, largest deviation %.2g\n", size, worst);
    assert_under(worst, 3e-7 * size);
    free(direction);
    free(product);
    free(plus);
    free(minus);
    tear_down(fixture);
}

static void check_tangent(const struct material *material) {
    const double pressure_pa[3] = {4000.0, 1500.0, 500.0};
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/paper-circle.yaml", 1.5e-3);
    section_solver_free(fixture.solver);
    struct description_error error;
    fixture.module.material = *material;
    fixture.solver = section_solver_create(fixture.mesh, &fixture.module, &error);
    check_tangent_of(&fixture, pressure_pa);
}

/* A bore, pairs of cavities, fibres; layers of other rubbers, one corrugated. */
static void tangent_with_fibres_and_a_bore(void **state) {
    (void)state;
    const double pressure_pa[3] = {60000.0, 20000.0, 5000.0};
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/stiff-flop.yaml", 1.5e-3);
    check_tangent_of(&fixture, pressure_pa);
}

static void tangent_with_a_corrugated_layer(void **state) {
    (void)state;
    const double pressure_pa[3] = {9000.0, 3000.0, 1000.0};
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/paper-composite.yaml", 1.5e-3);
    check_tangent_of(&fixture, pressure_pa);
}

static void tangent_of_neo_hooke(void **state) {
    (void)state;
    check_tangent(&neo_hookean);
}

static void tangent_of_a_reduced_polynomial(void **state) {
    (void)state;
    check_tangent(&quadratic);
}

static void tangent_of_ogden(void **state) {
    (void)state;
    check_tangent(&ogden);
}

static void tangent_of_yeoh(void **state) {
    (void)state;
    check_tangent(&yeoh);
}

/* --- closed thick tube: inflation and lengthening of an incompressible tube with end caps (Ogden 1984, section 5.3) --- */

struct tube {
    const struct material *material;
    double inner_m; /* undeformed */
    double outer_m;
    double fibre_npm;                   /* wound round the inner wall */
    double corrugation_fraction;        /* of the whole wall */
    const struct material *corrugation;
};

/* Pressure that holds inner radius `a` at axial stretch `z`, and the axial force that is left over. */
static double tube_pressure(const struct tube *tube, double a, double z, double *axial) {
    enum { PARTS = 2000 };
    const double b = sqrt(a * a + (tube->outer_m * tube->outer_m - tube->inner_m * tube->inner_m) / z);
    const double hold = a / tube->inner_m > 1.0 ? tube->fibre_npm * (a / tube->inner_m - 1.0) / (a * z) : 0.0;
    const double share = 1.0 - tube->corrugation_fraction;
    double pressure = 0.0, sum = 0.0; /* what the rubber bears */
    for (int pass = 0; pass < 2; pass++) { /* the pressure first, then the axial stress with it */
        double radial = -pressure;
        sum = 0.0;
        for (int i = 0; i < PARTS; i++) {
            const double dr = (b - a) / PARTS, r = a + (i + 0.5) * dr;
            const double rest = sqrt(tube->inner_m * tube->inner_m + (r * r - a * a) * z);
            const double hoop = r / rest, through = rest / (r * z);
            const double stretch[3] = {hoop, through, z};
            double by[3], ignored[3][3];
            material_principal(tube->material, stretch, by, ignored);
            double rings = 0.0, unused;
            if (tube->corrugation != NULL) {
                material_uniaxial(tube->corrugation, hoop, &rings, &unused);
            }
            const double slope =
                (share * (hoop * by[0] - through * by[1]) + tube->corrugation_fraction * rings * hoop) / r;
            sum += (radial + 0.5 * dr * slope + share * (z * by[2] - through * by[1])) * 2.0 * M_PI * r * dr;
            radial += dr * slope;
        }
        if (pass == 0) {
            pressure = radial + pressure; /* zero outside */
        }
    }
    *axial = sum - (pressure + hold) * M_PI * a * a;
    return pressure + hold;
}

static double tube_stretch(const struct tube *tube, double a) {
    double low = 0.5, high = 3.0, axial = 0.0;
    for (int i = 0; i < 60; i++) {
        const double z = 0.5 * (low + high);
        (void)tube_pressure(tube, a, z, &axial);
        *(axial < 0.0 ? &low : &high) = z;
    }
    return 0.5 * (low + high);
}

static void set_up_tube(struct fixture *fixture, const struct tube *tube) {
    struct description_error error;
    const struct cavity hole = {.shape = CAVITY_CIRCLE, .radius_m = tube->inner_m, .hoop_stiffness_npm = tube->fibre_npm};
    const int chamber = 0;
    memset(fixture, 0, sizeof *fixture);
    fixture->module.material = *tube->material;
    fixture->mesh = section_mesh_create_disc(tube->outer_m, &hole, &chamber, 1, 0.5e-3, &error);
    assert_non_null(fixture->mesh);
    if (tube->corrugation != NULL) { /* the whole wall is one layer */
        fixture->module.layer_count = 1;
        fixture->module.layer[0] = (struct module_layer){.material = *tube->material,
                                                         .corrugation_fraction = tube->corrugation_fraction,
                                                         .corrugation = *tube->corrugation};
        fixture->mesh->region_count = 2;
        for (size_t t = 0; t < fixture->mesh->triangle_count; t++) {
            fixture->mesh->region[t] = 1;
        }
    }
    fixture->solver = section_solver_create(fixture->mesh, &fixture->module, &error);
    assert_non_null(fixture->solver);
}

static void check_tube(const struct tube *tube, double most_pa) {
    struct fixture fixture;
    set_up_tube(&fixture, tube);
    for (int step = 1; step <= 4; step++) {
        const struct section_state state = state_at(fixture.solver, most_pa * step / 4.0, 0.0, 0.0);
        double low = tube->inner_m, high = 4.0 * tube->inner_m, axial = 0.0;
        for (int i = 0; i < 60; i++) { /* the tube of the same inner volume */
            const double a = 0.5 * (low + high);
            *(tube_stretch(tube, a) * M_PI * a * a < state.volume_m2[0] ? &low : &high) = a;
        }
        const double stretch = tube_stretch(tube, low), pressure = tube_pressure(tube, low, stretch, &axial);
        print_message("           volume x %.2f: pressure %.2f Pa, closed form %.2f; stretch %.5f, %.5f\n",
                      state.volume_m2[0] / (M_PI * tube->inner_m * tube->inner_m), state.pressure_pa[0], pressure,
                      state.stretch, stretch);
        assert_relative(state.pressure_pa[0], pressure, 1e-3);
        assert_relative(state.stretch, stretch, 1e-3);
        assert_close(state.curvature_x_1pm, 0.0, 1e-3);
        assert_close(state.curvature_y_1pm, 0.0, 1e-3);
        assert_true(state.stable);
    }
    tear_down(&fixture);
}

static void closed_thick_tube_of_neo_hooke(void **state) {
    (void)state;
    const struct tube tube = {.material = &neo_hookean, .inner_m = 0.005, .outer_m = 0.01};
    check_tube(&tube, 8000.0);
}

static void closed_thick_tube_of_yeoh(void **state) {
    (void)state;
    const struct tube tube = {.material = &yeoh, .inner_m = 0.005, .outer_m = 0.01};
    check_tube(&tube, 8000.0);
}

static void closed_thick_tube_of_ogden(void **state) {
    (void)state;
    const struct tube tube = {.material = &ogden, .inner_m = 0.005, .outer_m = 0.01};
    check_tube(&tube, 6400.0);
}

static void closed_thick_tube_with_hoop_fibres(void **state) {
    (void)state;
    const struct tube tube = {.material = &yeoh, .inner_m = 0.005, .outer_m = 0.01, .fibre_npm = 200.0};
    check_tube(&tube, 16000.0);
}

static void closed_thick_tube_with_corrugated_wall(void **state) {
    (void)state;
    const struct tube tube = {.material = &yeoh, .inner_m = 0.005, .outer_m = 0.01, .corrugation_fraction = 0.3,
                              .corrugation = &neo_hookean};
    check_tube(&tube, 6000.0);
}

/* --- pure bending: the exact field of an incompressible bar, sigma_33 = E kappa y alone (Timoshenko and Goodier) --- */

static void stiffness_of_pure_bending_is_youngs_modulus_times_inertia(void **state) {
    (void)state;
    struct fixture fixture;
    set_up_disc(&fixture, &neo_hookean, 0.0, 0.0);
    struct section_solver *solver = fixture.solver;
    const size_t n = section_solver_equations(solver), sparse = solver->sparse_count;
    double *field = calloc(n, sizeof(double)), *pressed = calloc(n, sizeof(double));
    double *field_force = calloc(n, sizeof(double)), *pressed_force = calloc(n, sizeof(double));
    assert_true(field != NULL && pressed != NULL && field_force != NULL && pressed_force != NULL);
    for (size_t i = 0; i < fixture.mesh->node_count; i++) {
        /* F33 = 1 + kappa_x y2: contraction across of half the strain, lengths in radii */
        const double x = solver->rest[2 * i], y = solver->rest[2 * i + 1];
        const size_t *equation = &solver->displacement_equation[2 * i];
        if (equation[0] != NO_EQUATION) {
            field[equation[0]] = -0.5 * x * y;
            field[equation[1]] = -0.25 * (y * y - x * x);
        }
        if (solver->pressure_equation[i] != NO_EQUATION) {
            pressed[solver->pressure_equation[i]] = y; /* the pressure is a multiple of this */
        }
    }
    field[sparse + 1] = 1.0; /* kappa_x, per radius */
    assert_true(section_solver_tangent_product(solver, field, field_force));
    assert_true(section_solver_tangent_product(solver, pressed, pressed_force));
    double cross = 0.0, square = 0.0, field_size = 0.0;
    for (size_t i = 0; i < fixture.mesh->node_count; i++) {
        for (size_t d = 0; d < 2; d++) {
            const size_t e = solver->displacement_equation[2 * i + d];
            cross += e == NO_EQUATION ? 0.0 : field_force[e] * pressed_force[e];
            square += e == NO_EQUATION ? 0.0 : pressed_force[e] * pressed_force[e];
            field_size += e == NO_EQUATION ? 0.0 : field_force[e] * field_force[e];
        }
    }
    const double factor = -cross / square;
    double left = 0.0; /* force on the nodes: none, if the field is an equilibrium */
    for (size_t i = 0; i < 2 * fixture.mesh->node_count; i++) {
        const size_t e = solver->displacement_equation[i];
        left += e == NO_EQUATION ? 0.0 : pow(field_force[e] + factor * pressed_force[e], 2.0);
    }
    assert_under(sqrt(left / field_size), 1e-3);
    const double moment = field_force[sparse + 1] + factor * pressed_force[sparse + 1];
    print_message("           EI over G R^4: %.7f, exact %.7f\n", moment, 0.75 * M_PI);
    assert_relative(moment, 3.0 * M_PI / 4.0, 1e-3); /* E = 3 G, I = pi R^4 / 4 */
    free(field);
    free(pressed);
    free(field_force);
    free(pressed_force);
    tear_down(&fixture);
}

/* --- paths of one chamber --- */

struct path_record {
    double length_m;
    double last_bend_rad;
    double last_pressure_pa;
    double most_pressure_pa;
    bool fell; /* pressure went down along the path */
    bool unstable_seen;
    double width_m;
};

static bool record_point(void *context, const struct section_state *state) {
    struct path_record *record = context;
    record->fell = record->fell || state->pressure_pa[0] < record->last_pressure_pa;
    record->unstable_seen = record->unstable_seen || !state->stable;
    record->last_pressure_pa = state->pressure_pa[0];
    record->most_pressure_pa = fmax(record->most_pressure_pa, state->pressure_pa[0]);
    record->last_bend_rad = hypot(state->curvature_x_1pm, state->curvature_y_1pm) * record->length_m;
    record->width_m = state->width_bend_plane_m;
    return true;
}

static struct path_record follow(struct fixture *fixture, double bend_deg) {
    const double direction_pa[3] = {1.0, 0.0, 0.0};
    struct description_error error;
    struct path_record record = {.length_m = fixture->module.chamber_length_m};
    section_solver_reset(fixture->solver);
    if (!section_solver_path(fixture->solver, direction_pa, SECTION_GOAL_CURVATURE, bend_deg / DEGREES / record.length_m,
                             record_point, &record, &error)) {
        fail_msg("%s", error.text);
    }
    assert_close(record.last_bend_rad * DEGREES, bend_deg, 1e-6);
    return record;
}

static void check_reference(const char *path, const double pressure_pa[3], double width_m) {
    struct fixture fixture;
    set_up_module(&fixture, path, 0.0);
    for (int i = 0; i < 3; i++) {
        const struct path_record record = follow(&fixture, 30.0 * (i + 1));
        print_message("           %d deg: %.1f Pa, prototype %.0f Pa\n", 30 * (i + 1), record.last_pressure_pa,
                      pressure_pa[i]);
        assert_relative(record.last_pressure_pa, pressure_pa[i], 0.01);
        assert_false(record.fell);
        if (i == 2) {
            assert_relative(record.width_m, width_m, 0.01);
        }
    }
    tear_down(&fixture);
}

static void pressures_and_width_of_the_circle(void **state) {
    (void)state;
    const double pressure_pa[3] = {5504.0, 6611.0, 7596.0};
    check_reference("tables/modules/paper-circle.yaml", pressure_pa, 0.03443);
}

static void pressures_and_width_of_the_semicircle(void **state) {
    (void)state;
    const double pressure_pa[3] = {6592.0, 7957.0, 9095.0};
    check_reference("tables/modules/paper-semicircle.yaml", pressure_pa, 0.03391);
}

static void halving_the_mesh_changes_the_90_degree_pressure_by_little(void **state) {
    (void)state;
    double pressure_pa[2];
    for (int fine = 0; fine < 2; fine++) {
        struct fixture fixture;
        set_up_module(&fixture, "tables/modules/paper-semicircle.yaml", fine == 1 ? 0.375e-3 : 0.75e-3);
        pressure_pa[fine] = follow(&fixture, 90.0).last_pressure_pa;
        tear_down(&fixture);
    }
    print_message("           %.1f Pa, %.1f Pa: %.3f %%\n", pressure_pa[0], pressure_pa[1],
                  100.0 * fabs(pressure_pa[1] / pressure_pa[0] - 1.0));
    assert_relative(pressure_pa[1], pressure_pa[0], 3e-3);
}

/* With only the last coefficient's sign turned the module snaps: the path climbs to a fold, falls, and climbs again. */
static void the_path_passes_a_limit_point(void **state) {
    (void)state;
    struct fixture fixture;
    struct description_error error;
    set_up_module(&fixture, "tables/modules/paper-circle.yaml", 0.0);
    section_solver_free(fixture.solver);
    assert_true(material_read("tables/materials/ecoflex-0030-c30-positive.yaml", &fixture.module.material, &error));
    fixture.solver = section_solver_create(fixture.mesh, &fixture.module, &error);
    const double direction_pa[3] = {1.0, 0.0, 0.0};
    struct path_record record = {.length_m = fixture.module.chamber_length_m};
    assert_true(section_solver_path(fixture.solver, direction_pa, SECTION_GOAL_CURVATURE, 20.0 / DEGREES / record.length_m,
                                    record_point, &record, &error));
    assert_true(record.fell);
    assert_true(record.unstable_seen);
    print_message("           fold at %.0f Pa (prototype 3197 Pa)\n", record.most_pressure_pa);
    assert_relative(record.most_pressure_pa, 3197.0, 0.01);
    tear_down(&fixture);
}

/* --- symmetry --- */

static void turning_the_pressures_turns_the_bend(void **state) {
    (void)state;
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/paper-semicircle.yaml", 0.0);
    const struct section_state first = state_at(fixture.solver, 8000.0, 5000.0, 2000.0);
    section_solver_reset(fixture.solver);
    const struct section_state turned = state_at(fixture.solver, 2000.0, 8000.0, 5000.0);
    const double c = cos(2.0 * M_PI / 3.0), s = sin(2.0 * M_PI / 3.0);
    const double size = hypot(first.curvature_x_1pm, first.curvature_y_1pm);
    assert_close(turned.curvature_x_1pm, c * first.curvature_x_1pm - s * first.curvature_y_1pm, 1e-6 * size);
    assert_close(turned.curvature_y_1pm, s * first.curvature_x_1pm + c * first.curvature_y_1pm, 1e-6 * size);
    assert_relative(turned.stretch, first.stretch, 1e-9);
    assert_relative(turned.volume_m2[1], first.volume_m2[0], 1e-6);
    assert_relative(turned.width_max_m, first.width_max_m, 1e-6);
    section_solver_reset(fixture.solver);
    const struct section_state mirrored = state_at(fixture.solver, 8000.0, 2000.0, 5000.0);
    assert_close(mirrored.curvature_x_1pm, first.curvature_x_1pm, 1e-6 * size);
    assert_close(mirrored.curvature_y_1pm, -first.curvature_y_1pm, 1e-6 * size);
    tear_down(&fixture);
}

static void equal_pressures_lengthen_without_bend(void **state) {
    (void)state;
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/paper-semicircle.yaml", 0.0);
    const struct section_state state_now = state_at(fixture.solver, 5000.0, 5000.0, 5000.0);
    assert_close(state_now.curvature_x_1pm, 0.0, 1e-6);
    assert_close(state_now.curvature_y_1pm, 0.0, 1e-6);
    assert_true(state_now.stretch > 1.0);
    tear_down(&fixture);
}

static void chamber_one_alone_bends_toward_minus_x(void **state) {
    (void)state;
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/paper-semicircle.yaml", 0.0);
    const struct section_state bent = state_at(fixture.solver, 6000.0, 0.0, 0.0);
    assert_true(bent.curvature_x_1pm < -1.0);
    assert_close(bent.curvature_y_1pm, 0.0, 1e-6 * fabs(bent.curvature_x_1pm));
    assert_true(bent.width_bend_plane_m > fixture.module.outer_diameter_m);
    tear_down(&fixture);
}

/* A free section of an incompressible material answers pressure with exactly nothing at first order. */
static void bend_grows_with_the_square_of_pressure_at_first(void **state) {
    (void)state;
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/paper-circle.yaml", 0.0);
    const double at_50_pa = fabs(state_at(fixture.solver, 50.0, 0.0, 0.0).curvature_x_1pm);
    const double at_100_pa = fabs(state_at(fixture.solver, 100.0, 0.0, 0.0).curvature_x_1pm);
    assert_relative(at_100_pa / at_50_pa, 4.0, 0.05);
    tear_down(&fixture);
}

static void a_saved_state_is_restored(void **state) {
    (void)state;
    struct fixture fixture;
    set_up_module(&fixture, "tables/modules/paper-circle.yaml", 1.5e-3);
    const struct section_state before = state_at(fixture.solver, 5000.0, 1000.0, 0.0);
    double *saved = calloc(section_solver_unknowns(fixture.solver), sizeof(double));
    assert_non_null(saved);
    section_solver_save(fixture.solver, saved);
    (void)state_at(fixture.solver, 1000.0, 4000.0, 2000.0);
    section_solver_restore(fixture.solver, saved);
    const struct section_state after = state_at(fixture.solver, 5000.0, 1000.0, 0.0);
    assert_relative(after.curvature_x_1pm, before.curvature_x_1pm, 1e-9);
    assert_relative(after.volume_m2[0], before.volume_m2[0], 1e-9);
    free(saved);
    tear_down(&fixture);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tangent_of_neo_hooke),
        cmocka_unit_test(tangent_of_a_reduced_polynomial),
        cmocka_unit_test(tangent_of_yeoh),
        cmocka_unit_test(tangent_of_ogden),
        cmocka_unit_test(tangent_with_fibres_and_a_bore),
        cmocka_unit_test(tangent_with_a_corrugated_layer),
        cmocka_unit_test(closed_thick_tube_of_neo_hooke),
        cmocka_unit_test(closed_thick_tube_of_yeoh),
        cmocka_unit_test(closed_thick_tube_of_ogden),
        cmocka_unit_test(closed_thick_tube_with_hoop_fibres),
        cmocka_unit_test(closed_thick_tube_with_corrugated_wall),
        cmocka_unit_test(stiffness_of_pure_bending_is_youngs_modulus_times_inertia),
        cmocka_unit_test(pressures_and_width_of_the_circle),
        cmocka_unit_test(pressures_and_width_of_the_semicircle),
        cmocka_unit_test(halving_the_mesh_changes_the_90_degree_pressure_by_little),
        cmocka_unit_test(the_path_passes_a_limit_point),
        cmocka_unit_test(turning_the_pressures_turns_the_bend),
        cmocka_unit_test(equal_pressures_lengthen_without_bend),
        cmocka_unit_test(chamber_one_alone_bends_toward_minus_x),
        cmocka_unit_test(bend_grows_with_the_square_of_pressure_at_first),
        cmocka_unit_test(a_saved_state_is_restored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
