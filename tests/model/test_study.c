/* The founding paper's parametric studies: the directions that it states. */
#include "support/test.h"

#include "study/study.h"

static struct material material;
static struct study_point points[STUDY_POINTS_MAX];
static struct study_answer answers[STUDY_POINTS_MAX];

static size_t solve(enum study_kind kind) {
    const struct study_options options = {.progress = NULL};
    struct description_error error = {""};
    const size_t count = study_points(kind, &material, 0.5 * M_PI, points);
    assert_in_range(count, 4, STUDY_POINTS_MAX);
    if (study_solve(points, count, &options, answers, &error) != SWEEP_DONE) {
        fail_msg("%s", error.text);
    }
    for (size_t i = 0; i < count; i++) {
        assert_true(answers[i].found);
        assert_relative(study_bend_rad(&points[i], &answers[i]), 0.5 * M_PI, 1e-6);
    }
    return count;
}

static int read_material(void **state) {
    struct description_error error;
    (void)state;
    return material_read("tables/materials/ecoflex-0030-positive.yaml", &material, &error) ? 0 : -1;
}

static void thinner_walls_and_longer_chambers_need_less_pressure(void **state) {
    (void)state;
    const size_t walls = solve(STUDY_WALL);
    for (size_t i = 1; i < walls; i++) {
        assert_true(answers[i].state.pressure_pa[0] > answers[i - 1].state.pressure_pa[0]);
    }
    const size_t lengths = solve(STUDY_LENGTH);
    for (size_t i = 1; i < lengths; i++) {
        assert_true(answers[i].state.pressure_pa[0] < answers[i - 1].state.pressure_pa[0]);
        assert_true(answers[i].state.width_bend_plane_m < answers[i - 1].state.width_bend_plane_m);
    }
}

/* Two areas a shape, in the order of the shapes. */
static void ring_sectors_need_least_pressure_and_balloon_most(void **state) {
    (void)state;
    assert_int_equal(solve(STUDY_SHAPE), 2 * STUDY_SHAPES);
    for (size_t area = 0; area < 2; area++) {
        const struct section_state *ring = &answers[2 * CAVITY_RING_SECTOR + area].state;
        for (size_t shape = 0; shape < CAVITY_RING_SECTOR; shape++) {
            assert_true(ring->pressure_pa[0] < answers[2 * shape + area].state.pressure_pa[0]);
            assert_true(ring->width_bend_plane_m > answers[2 * shape + area].state.width_bend_plane_m);
        }
    }
    for (size_t shape = 0; shape < STUDY_SHAPES; shape++) { /* a larger chamber needs less */
        assert_true(answers[2 * shape + 1].state.pressure_pa[0] < answers[2 * shape].state.pressure_pa[0]);
    }
}

static void every_shape_has_the_area_that_was_asked_for(void **state) {
    (void)state;
    for (int shape = 0; shape < STUDY_SHAPES; shape++) {
        struct module_description module;
        study_module((enum cavity_shape)shape, 2e-5, PAPER_WALL_M, &material, &module);
        assert_relative(cavity_area_m2(&module.chamber[0].cavity[0]), 2e-5, 1e-9);
        double reach = 0.0;
        struct cavity_piece piece[CAVITY_PIECES_MAX];
        const size_t count = cavity_outline(&module.chamber[0].cavity[0], piece);
        for (size_t i = 0; i < count; i++) {
            for (int k = 0; k <= 10; k++) {
                double point_m[2];
                cavity_piece_point(&piece[i], 0.1 * k, point_m);
                reach = fmax(reach, hypot(point_m[0], point_m[1]));
            }
        }
        assert_close(reach, PAPER_RADIUS_M - PAPER_WALL_M, 2e-4); /* corners of a sector reach a little less or more */
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(thinner_walls_and_longer_chambers_need_less_pressure),
        cmocka_unit_test(ring_sectors_need_least_pressure_and_balloon_most),
        cmocka_unit_test(every_shape_has_the_area_that_was_asked_for),
    };
    return cmocka_run_group_tests(tests, read_material, NULL);
}
