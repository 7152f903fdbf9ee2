/* The inverse over the whole reachable set of the reference table, and what it answers beyond. */
#include "support/test.h"

#include "control/bend_inverse.h"
#include "program/table_file.h"
#include "sim/random.h"
#include "support/synthetic_table.h"

#define COMMANDS 10000
#define DEGREES (180.0 / M_PI)

static struct table_file file;

static int open_reference(void **state) {
    (void)state;
    return table_file_open(&file, "tables/paper-semicircle.tbt", "paper-semicircle");
}

static int close_reference(void **state) {
    (void)state;
    table_file_close(&file);
    return 0;
}

/* Bend vector of the forward table, in double. */
static bool forward(const struct bend_table *table, const float pressure_pa[3], double bend_rad[2]) {
    struct bend_table_stencil stencil;
    bend_table_locate(table, pressure_pa, &stencil);
    const double length_m = (double)table->module.active_length_m;
    bend_rad[0] = length_m * (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_X);
    bend_rad[1] = length_m * (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_Y);
    return bend_table_is_valid(table, &stencil);
}

/* Pressures whose least is `floor_pa`, at random within the working limit. */
static void random_pressures(struct random_stream *random, float floor_pa, float most_pa, float pressure_pa[3]) {
    const size_t lowest = (size_t)(3.0 * random_uniform(random));
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = floor_pa + (most_pa - floor_pa) * (float)random_uniform(random);
    }
    pressure_pa[lowest] = floor_pa;
}

/* Reached commands; every one within 0.1 degree, no limit exceeded, nothing flagged. */
static int check_reachable(bool warm, double co_contraction_share) {
    const struct bend_table *table = &file.table;
    const float most_pa = table->module.working_pressure_pa;
    struct random_stream random;
    float warm_pa[3] = {0.0f, 0.0f, 0.0f};
    int checked = 0;
    double worst_deg = 0.0;
    random_seed(&random, 2014, warm ? 1 : 2);
    while (checked < COMMANDS) {
        float pressure_pa[3];
        double wanted[2], reached[2];
        const float floor_pa = (float)(co_contraction_share * random_uniform(&random)) * most_pa;
        random_pressures(&random, floor_pa, most_pa, pressure_pa);
        if (!forward(table, pressure_pa, wanted) ||
            hypot(wanted[0], wanted[1]) > (double)table->module.bend_limit_rad) {
            continue;
        }
        checked++;
        const struct bend_inverse_request request = {(float)hypot(wanted[0], wanted[1]),
                                                     (float)atan2(wanted[1], wanted[0]), floor_pa};
        struct bend_inverse_result result;
        bend_inverse_solve(table, &request, warm ? warm_pa : NULL, &result);
        assert_true(forward(table, result.pressure_pa, reached));
        const double residual_deg = DEGREES * hypot(reached[0] - wanted[0], reached[1] - wanted[1]);
        worst_deg = fmax(worst_deg, residual_deg);
        if (residual_deg >= 0.1 || result.flags != 0u) {
            fail_msg("%.4f deg toward %.4f deg over %.1f Pa: residual %.4f deg, flags %u",
                     DEGREES * (double)request.bend_rad, DEGREES * (double)request.direction_rad, (double)floor_pa,
                     residual_deg, (unsigned)result.flags);
        }
        for (size_t c = 0; c < 3; c++) {
            assert_true(result.pressure_pa[c] >= floor_pa - 0.01f && result.pressure_pa[c] <= most_pa);
        }
        memcpy(warm_pa, result.pressure_pa, sizeof warm_pa);
    }
    print_message("           worst residual of %d commands: %.4f deg\n", checked, worst_deg);
    return checked;
}

static void ten_thousand_reachable_commands_from_cold(void **state) {
    (void)state;
    assert_int_equal(check_reachable(false, 0.0), COMMANDS);
}

static void ten_thousand_reachable_commands_warm_started(void **state) {
    (void)state;
    assert_int_equal(check_reachable(true, 0.0), COMMANDS);
}

static void ten_thousand_reachable_commands_with_co_contraction(void **state) {
    (void)state;
    assert_int_equal(check_reachable(false, 0.3), COMMANDS);
}

static void unreachable_bends_get_the_farthest_in_their_direction_and_a_flag(void **state) {
    (void)state;
    const struct bend_table *table = &file.table;
    struct random_stream random;
    random_seed(&random, 7, 7);
    for (int i = 0; i < 500; i++) {
        const float direction_rad = (float)(2.0 * M_PI * random_uniform(&random));
        const struct bend_inverse_request request = {(float)(2.0 + 8.0 * random_uniform(&random)), direction_rad, 0.0f};
        struct bend_inverse_result result;
        double reached[2];
        bend_inverse_solve(table, &request, NULL, &result);
        assert_true((result.flags & (BEND_INVERSE_LIMITED_BEND | BEND_INVERSE_LIMITED_PRESSURE)) != 0u);
        assert_true(forward(table, result.pressure_pa, reached));
        const double bend = hypot(reached[0], reached[1]);
        assert_true(bend <= (double)table->module.bend_limit_rad + 2e-3);
        const double turn = remainder(atan2(reached[1], reached[0]) - (double)direction_rad, 2.0 * M_PI);
        assert_close(DEGREES * turn, 0.0, 0.2);
        /* nearest: a little less would not have been cut */
        const struct bend_inverse_request less = {(float)(bend - 0.01), direction_rad, 0.0f};
        bend_inverse_solve(table, &less, NULL, &result);
        assert_int_equal(result.flags, 0);
        for (size_t c = 0; c < 3; c++) {
            assert_true(result.pressure_pa[c] >= 0.0f && result.pressure_pa[c] <= table->module.working_pressure_pa);
        }
    }
}

static void too_much_co_contraction_is_cut_and_flagged(void **state) {
    (void)state;
    const struct bend_inverse_request request = {1.0f, 0.5f, 1e6f};
    struct bend_inverse_result result;
    bend_inverse_solve(&file.table, &request, NULL, &result);
    assert_true(result.flags != 0u);
    for (size_t c = 0; c < 3; c++) {
        assert_true(result.pressure_pa[c] <= file.table.module.working_pressure_pa);
    }
}

static void nonsense_is_answered_with_no_bend(void **state) {
    (void)state;
    const struct bend_inverse_request bad[] = {
        {NAN, 0.0f, 0.0f}, {1.0f, INFINITY, 0.0f}, {1.0f, 0.0f, NAN}, {INFINITY, 0.0f, 0.0f}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct bend_inverse_result result;
        bend_inverse_solve(&file.table, &bad[i], NULL, &result);
        assert_true((result.flags & BEND_INVERSE_NOT_FINITE) != 0u);
        for (size_t c = 0; c < 3; c++) {
            assert_close((double)result.pressure_pa[c], 0.0, 0.0);
        }
    }
}

static void a_negative_bend_gives_no_pressure(void **state) {
    (void)state;
    const struct bend_inverse_request request = {-1.0f, 0.0f, 0.0f};
    struct bend_inverse_result result;
    bend_inverse_solve(&file.table, &request, NULL, &result);
    assert_close((double)result.bend_rad, 0.0, 1e-3);
}

static void a_bad_warm_start_does_no_harm(void **state) {
    (void)state;
    const float bad[3] = {NAN, -1e9f, 1e9f};
    const struct bend_inverse_request request = {1.0f, 0.5f, 0.0f};
    struct bend_inverse_result result;
    bend_inverse_solve(&file.table, &request, bad, &result);
    assert_under((double)result.residual_rad * DEGREES, 0.1);
}

/* The formula of the synthetic module is known: one chamber's pressure for a bend along its axis. */
static void a_formula_is_inverted_as_by_hand(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 17, 10000.0, 0.8, synthetic_module);
    const double pressure_pa = 6000.0, length_m = 0.055;
    const double bend = length_m * (1e-3 * pressure_pa + 2e-7 * pressure_pa * pressure_pa);
    const struct bend_inverse_request request = {(float)bend, (float)M_PI, 0.0f};
    struct bend_inverse_result result;
    bend_inverse_solve(&synthetic.table, &request, NULL, &result);
    assert_int_equal(result.flags, 0);
    assert_close((double)result.pressure_pa[0], pressure_pa, 5.0);
    assert_close((double)result.pressure_pa[1], 0.0, 5.0);
    assert_close((double)result.pressure_pa[2], 0.0, 5.0);
    synthetic_table_free(&synthetic);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ten_thousand_reachable_commands_from_cold),
        cmocka_unit_test(ten_thousand_reachable_commands_warm_started),
        cmocka_unit_test(ten_thousand_reachable_commands_with_co_contraction),
        cmocka_unit_test(unreachable_bends_get_the_farthest_in_their_direction_and_a_flag),
        cmocka_unit_test(too_much_co_contraction_is_cut_and_flagged),
        cmocka_unit_test(nonsense_is_answered_with_no_bend),
        cmocka_unit_test(a_negative_bend_gives_no_pressure),
        cmocka_unit_test(a_bad_warm_start_does_no_harm),
        cmocka_unit_test(a_formula_is_inverted_as_by_hand),
    };
    return cmocka_run_group_tests(tests, open_reference, close_reference);
}
