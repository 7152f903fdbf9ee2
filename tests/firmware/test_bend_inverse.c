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

static double residual_of(const struct bend_table *table, const float pressure_pa[3], const double wanted[2]) {
    double reached[2];
    assert_true(forward(table, pressure_pa, reached));
    return DEGREES * hypot(reached[0] - wanted[0], reached[1] - wanted[1]);
}

/* What a control step goes by before the answer is there: after the second step it is near enough. */
static double preview_after_two_steps(const struct bend_table *table, const double wanted[2], float floor_pa) {
    const float bend_rad[2] = {(float)wanted[0], (float)wanted[1]};
    struct bend_inverse inverse;
    float pressure_pa[3];
    bend_inverse_begin(&inverse, table, bend_rad, floor_pa);
    const bool done = bend_inverse_step(&inverse) || bend_inverse_step(&inverse);
    if (!bend_inverse_preview(&inverse, pressure_pa)) {
        assert_false(done);
        return -1.0;
    }
    return residual_of(table, pressure_pa, wanted);
}

/* Reached commands; every one within 0.1 degree, no limit exceeded, nothing flagged. */
static int check_reachable(uint64_t seed, double co_contraction_share) {
    const struct bend_table *table = &file.table;
    const float most_pa = table->module.working_pressure_pa;
    struct random_stream random;
    int checked = 0, unseen = 0;
    double worst_deg = 0.0, worst_preview_deg = 0.0;
    random_seed(&random, 2014, seed);
    while (checked < COMMANDS) {
        float pressure_pa[3];
        double wanted[2];
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
        bend_inverse_solve(table, &request, &result);
        const double residual_deg = residual_of(table, result.pressure_pa, wanted);
        const double preview_deg = preview_after_two_steps(table, wanted, floor_pa);
        worst_deg = fmax(worst_deg, residual_deg);
        worst_preview_deg = fmax(worst_preview_deg, preview_deg);
        unseen += preview_deg < 0.0 ? 1 : 0;
        assert_close(residual_deg, DEGREES * (double)result.residual_rad, 2e-3);
        if (residual_deg >= 0.1 || result.flags != 0u) {
            fail_msg("%.4f deg toward %.4f deg over %.1f Pa: residual %.4f deg, flags %u",
                     DEGREES * (double)request.bend_rad, DEGREES * (double)request.direction_rad, (double)floor_pa,
                     residual_deg, (unsigned)result.flags);
        }
        for (size_t c = 0; c < 3; c++) {
            assert_true(result.pressure_pa[c] >= floor_pa - 0.01f && result.pressure_pa[c] <= most_pa);
        }
    }
    print_message("           worst residual of %d commands: %.4f deg, after two steps %.4f deg, of %d nothing yet\n",
                  checked, worst_deg, worst_preview_deg, unseen);
    assert_under(worst_preview_deg, 0.1);
    assert_true(unseen <= checked / 100); /* close to a limit there is none until the answer */
    return checked;
}

static void ten_thousand_reachable_commands(void **state) {
    (void)state;
    assert_int_equal(check_reachable(1, 0.0), COMMANDS);
}

static void ten_thousand_reachable_commands_with_some_co_contraction(void **state) {
    (void)state;
    assert_int_equal(check_reachable(2, 0.3), COMMANDS);
}

static void ten_thousand_reachable_commands_with_any_co_contraction(void **state) {
    (void)state;
    assert_int_equal(check_reachable(3, 0.95), COMMANDS);
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
        bend_inverse_solve(table, &request, &result);
        assert_true((result.flags & (BEND_INVERSE_LIMITED_BEND | BEND_INVERSE_LIMITED_PRESSURE)) != 0u);
        assert_true(forward(table, result.pressure_pa, reached));
        const double bend = hypot(reached[0], reached[1]);
        assert_true(bend <= (double)table->module.bend_limit_rad + 2e-3);
        const double turn = remainder(atan2(reached[1], reached[0]) - (double)direction_rad, 2.0 * M_PI);
        assert_close(DEGREES * turn, 0.0, 0.2);
        /* nearest: a little less would not have been cut */
        const struct bend_inverse_request less = {(float)(bend - 0.01), direction_rad, 0.0f};
        bend_inverse_solve(table, &less, &result);
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
    bend_inverse_solve(&file.table, &request, &result);
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
        bend_inverse_solve(&file.table, &bad[i], &result);
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
    bend_inverse_solve(&file.table, &request, &result);
    assert_close((double)result.bend_rad, 0.0, 1e-3);
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
    bend_inverse_solve(&synthetic.table, &request, &result);
    assert_int_equal(result.flags, 0);
    assert_close((double)result.pressure_pa[0], pressure_pa, 5.0);
    assert_close((double)result.pressure_pa[1], 0.0, 5.0);
    assert_close((double)result.pressure_pa[2], 0.0, 5.0);
    synthetic_table_free(&synthetic);
}

/* --- tables that are hard to invert --- */

/* Cells are valid where the pressures' sum is under 14 kPa: a staircase. */
static void stop_at_a_staircase(struct synthetic_table *synthetic) {
    const struct bend_table *table = &synthetic->table;
    uint8_t *tag = synthetic->image + (table->tag - synthetic->image);
    const uint32_t n = table->nodes[0];
    for (uint32_t i = 0; i < n * n * n; i++) {
        const float sum_pa = table->axis_pa[0][i / n / n] + table->axis_pa[1][i / n % n] + table->axis_pa[2][i % n];
        tag[i] = (uint8_t)(sum_pa < 14000.0f ? BEND_TABLE_TAG_VALID : 0u);
    }
    synthetic_table_seal(synthetic);
}

/* The greatest bend in a direction, among pressures that the table holds for, by looking everywhere. */
static double farthest(const struct bend_table *table, double direction_rad) {
    double most_rad = 0.0;
    for (int other = 0; other < 3; other++) {
        for (int i = 0; i <= 400; i++) {
            for (int j = 0; j <= 400; j++) {
                float pressure_pa[3] = {25.0f * (float)i, 25.0f * (float)j, 0.0f};
                const float turned_pa[3] = {pressure_pa[(0 + other) % 3], pressure_pa[(1 + other) % 3],
                                            pressure_pa[(2 + other) % 3]};
                double bend[2];
                if (forward(table, turned_pa, bend) &&
                    fabs(remainder(atan2(bend[1], bend[0]) - direction_rad, 2.0 * M_PI)) < 0.003) {
                    most_rad = fmax(most_rad, hypot(bend[0], bend[1]));
                }
            }
        }
    }
    return most_rad;
}

static void bends_beyond_a_fold_stop_at_its_edge(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 17, 10000.0, 0.8, synthetic_module);
    stop_at_a_staircase(&synthetic);
    for (int d = 0; d < 24; d++) {
        const struct bend_inverse_request request = {1.9f, (float)(0.11 + d * M_PI / 12.0), 0.0f};
        struct bend_inverse_result result;
        double reached[2];
        bend_inverse_solve(&synthetic.table, &request, &result);
        assert_true((result.flags & BEND_INVERSE_LIMITED_PRESSURE) != 0u);
        assert_true(forward(&synthetic.table, result.pressure_pa, reached));
        const double turn = remainder(atan2(reached[1], reached[0]) - (double)request.direction_rad, 2.0 * M_PI);
        assert_close(DEGREES * turn, 0.0, 0.2);
        const double most_rad = farthest(&synthetic.table, (double)request.direction_rad);
        assert_close(DEGREES * hypot(reached[0], reached[1]), DEGREES * most_rad, 0.6);
    }
    synthetic_table_free(&synthetic);
}

/* A controller goes by previews at once, and with a stream of requests all the time. */
static void on_the_way_to_a_limit_nothing_is_said(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 17, 10000.0, 0.8, synthetic_module);
    for (int d = 0; d < 48; d++) {
        const float direction_rad = (float)(0.11 + d * M_PI / 24.0);
        const float bend_rad[2] = {1.95f * cosf(direction_rad), 1.95f * sinf(direction_rad)};
        struct bend_inverse inverse;
        struct bend_inverse_result result;
        float pressure_pa[3];
        bend_inverse_begin(&inverse, &synthetic.table, bend_rad, 0.0f);
        while (!bend_inverse_step(&inverse)) {
            assert_false(bend_inverse_preview(&inverse, pressure_pa));
        }
        bend_inverse_finish(&inverse, &result);
        assert_true((result.flags & BEND_INVERSE_LIMITED_PRESSURE) != 0u);
    }
    synthetic_table_free(&synthetic);
}

/* Chamber 2 pushes 6 degrees off its place, and is weaker: what a calibrated table may say. */
static double askew_module(enum bend_table_channel channel, const double pressure_pa[3]) {
    const double off = 6.0 / DEGREES, curvature = 0.8 * (1e-3 * pressure_pa[1] + 2e-7 * pressure_pa[1] * pressure_pa[1]);
    const double others[3] = {pressure_pa[0], 0.0, pressure_pa[2]};
    if (channel == BEND_TABLE_CURVATURE_X) {
        return synthetic_module(channel, others) - curvature * cos(2.0 * M_PI / 3.0 + off);
    }
    if (channel == BEND_TABLE_CURVATURE_Y) {
        return synthetic_module(channel, others) - curvature * sin(2.0 * M_PI / 3.0 + off);
    }
    return synthetic_module(channel, pressure_pa);
}

static void a_chamber_that_pushes_askew_gives_way_to_the_neighbouring_pair(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 17, 10000.0, 0.8, askew_module);
    for (int d = 0; d < 720; d++) {
        const struct bend_inverse_request request = {0.5f, (float)(d * M_PI / 360.0), 0.0f};
        struct bend_inverse_result result;
        bend_inverse_solve(&synthetic.table, &request, &result);
        if (result.flags != 0u || (double)result.residual_rad * DEGREES >= 0.1) {
            fail_msg("toward %.1f deg: residual %.4f deg, flags %u", 0.5 * d, DEGREES * (double)result.residual_rad,
                     (unsigned)result.flags);
        }
    }
    synthetic_table_free(&synthetic);
}

/* Four nodes for a steep curve: between them the interpolant dips, Newton's slope misleads, brackets must hold. */
static double steep_module(enum bend_table_channel channel, const double pressure_pa[3]) {
    double steep_pa[3];
    for (int c = 0; c < 3; c++) {
        steep_pa[c] = 10000.0 * pow(pressure_pa[c] / 10000.0, 5.0) + 0.02 * pressure_pa[c];
    }
    return synthetic_module(channel, steep_pa);
}

static void a_small_bend_is_never_answered_with_a_large_one(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 4, 10000.0, 0.9, steep_module);
    for (int i = 0; i < 4000; i++) {
        const struct bend_inverse_request request = {1e-4f * (float)(1 + i / 40), (float)(i % 40) * 0.1571f, 0.0f};
        struct bend_inverse_result result;
        bend_inverse_solve(&synthetic.table, &request, &result);
        assert_under((double)result.residual_rad * DEGREES, 0.2); /* of a curve that bends 2 degrees the wrong way first */
        assert_under(DEGREES * (double)(result.bend_rad - request.bend_rad), 0.1);
        assert_true(result.evaluations <= BEND_INVERSE_STEPS_MOST);
    }
    synthetic_table_free(&synthetic);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ten_thousand_reachable_commands),
        cmocka_unit_test(ten_thousand_reachable_commands_with_some_co_contraction),
        cmocka_unit_test(ten_thousand_reachable_commands_with_any_co_contraction),
        cmocka_unit_test(unreachable_bends_get_the_farthest_in_their_direction_and_a_flag),
        cmocka_unit_test(too_much_co_contraction_is_cut_and_flagged),
        cmocka_unit_test(nonsense_is_answered_with_no_bend),
        cmocka_unit_test(a_negative_bend_gives_no_pressure),
        cmocka_unit_test(a_formula_is_inverted_as_by_hand),
        cmocka_unit_test(on_the_way_to_a_limit_nothing_is_said),
        cmocka_unit_test(bends_beyond_a_fold_stop_at_its_edge),
        cmocka_unit_test(a_chamber_that_pushes_askew_gives_way_to_the_neighbouring_pair),
        cmocka_unit_test(a_small_bend_is_never_answered_with_a_large_one),
    };
    return cmocka_run_group_tests(tests, open_reference, close_reference);
}
