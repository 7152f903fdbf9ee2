#include "support/test.h"

#include "control/tip_loop.h"
#include "support/synthetic_table.h"

/* Orientation of a tip that is bent by `bend` toward `direction`: a turn about the axis (-sin, cos, 0). */
static void pose(double bend, double direction, float quaternion[4]) {
    quaternion[0] = (float)cos(0.5 * bend);
    quaternion[1] = (float)(-sin(direction) * sin(0.5 * bend));
    quaternion[2] = (float)(cos(direction) * sin(0.5 * bend));
    quaternion[3] = 0.0f;
}

static void bend_vector_of_an_orientation(void **state) {
    (void)state;
    for (int b = 0; b <= 170; b += 10) {
        for (int d = -180; d < 180; d += 15) {
            const double bend = b * M_PI / 180.0, direction = d * M_PI / 180.0;
            float quaternion[4], vector[2];
            pose(bend, direction, quaternion);
            assert_true(tip_loop_bend_of(quaternion, vector));
            assert_close((double)vector[0], bend * cos(direction), 2e-6);
            assert_close((double)vector[1], bend * sin(direction), 2e-6);
            for (int i = 0; i < 4; i++) {
                quaternion[i] = -quaternion[i]; /* the same orientation */
            }
            assert_true(tip_loop_bend_of(quaternion, vector));
            assert_close((double)vector[0], bend * cos(direction), 2e-6);
        }
    }
}

static void a_roll_about_the_tips_axis_does_not_matter(void **state) {
    (void)state;
    /* pose(60 deg toward 0) times a turn of 50 degrees about z */
    const double h = M_PI / 6.0, r = 25.0 * M_PI / 180.0;
    const float quaternion[4] = {(float)(cos(h) * cos(r)), (float)(sin(h) * sin(r)), (float)(sin(h) * cos(r)),
                                 (float)(cos(h) * sin(r))};
    float vector[2];
    assert_true(tip_loop_bend_of(quaternion, vector));
    assert_close((double)vector[0], M_PI / 3.0, 2e-6);
    assert_close((double)vector[1], 0.0, 2e-6);
}

static void what_is_no_orientation_is_refused(void **state) {
    (void)state;
    const float bad[][4] = {{0.0f, 0.0f, 0.0f, 0.0f}, {NAN, 0.0f, 0.0f, 0.0f}, {1.1f, 0.0f, 0.0f, 0.0f},
                            {INFINITY, 0.0f, 0.0f, 0.0f}, {0.5f, 0.5f, 0.5f, 0.0f}};
    float vector[2];
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_false(tip_loop_bend_of(bad[i], vector));
    }
}

static void a_constant_model_error_is_learnt(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct tip_loop_parameters parameters;
    struct tip_loop loop;
    const float pressure_pa[3] = {5000.0f, 0.0f, 0.0f};
    float predicted[2], quaternion[4];
    synthetic_table_create(&synthetic, 9, 10000.0, 0.8, synthetic_module);
    tip_loop_default_parameters(&parameters);
    tip_loop_init(&loop);
    tip_loop_predict(&synthetic.table, pressure_pa, predicted);
    const double x = (double)predicted[0] + 0.1, y = (double)predicted[1] - 0.05;
    pose(hypot(x, y), atan2(y, x), quaternion);
    for (int step = 0; step < 1000; step++) {
        tip_loop_store(&loop, pressure_pa);
        if (step % 10 == 9) {
            assert_true(tip_loop_update(&loop, &parameters, &synthetic.table, quaternion, 5000, 1000));
        }
    }
    assert_close((double)loop.correction_rad[0], 0.1, 1e-4);
    assert_close((double)loop.correction_rad[1], -0.05, 1e-4);
    synthetic_table_free(&synthetic);
}

static void a_sample_is_compared_with_the_pressures_of_its_own_time(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct tip_loop_parameters parameters;
    struct tip_loop loop;
    synthetic_table_create(&synthetic, 17, 10000.0, 0.8, synthetic_module);
    tip_loop_default_parameters(&parameters);
    tip_loop_init(&loop);
    for (int step = 0; step < 60; step++) { /* a ramp: a model without error must find none, however old the sample */
        const float pressure_pa[3] = {100.0f * (float)step, 50.0f, 0.0f};
        tip_loop_store(&loop, pressure_pa);
    }
    for (int64_t age_us = 0; age_us <= 40000; age_us += 7300) {
        const float then_pa[3] = {5900.0f - 0.1f * (float)age_us, 50.0f, 0.0f};
        float then[2], quaternion[4];
        tip_loop_predict(&synthetic.table, then_pa, then);
        pose(hypot((double)then[0], (double)then[1]), atan2((double)then[1], (double)then[0]), quaternion);
        assert_true(tip_loop_update(&loop, &parameters, &synthetic.table, quaternion, age_us, 1000));
        assert_close((double)loop.correction_rad[0], 0.0, 1e-5);
        assert_close((double)loop.correction_rad[1], 0.0, 1e-5);
    }
    synthetic_table_free(&synthetic);
}

static void too_old_and_future_samples_are_refused(void **state) {
    (void)state;
    struct tip_loop_parameters parameters;
    struct tip_loop loop;
    const float straight[4] = {1.0f, 0.0f, 0.0f, 0.0f};
    tip_loop_default_parameters(&parameters);
    tip_loop_init(&loop);
    assert_false(tip_loop_update(&loop, &parameters, NULL, straight, -1, 1000));
    assert_false(tip_loop_update(&loop, &parameters, NULL, straight, parameters.age_limit_us + 1, 1000));
    assert_true(tip_loop_update(&loop, &parameters, NULL, straight, 0, 1000));
}

static void the_correction_is_bounded(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct tip_loop_parameters parameters;
    struct tip_loop loop;
    const float pressure_pa[3] = {0.0f, 0.0f, 0.0f};
    float quaternion[4];
    synthetic_table_create(&synthetic, 9, 10000.0, 0.8, synthetic_module);
    tip_loop_default_parameters(&parameters);
    tip_loop_init(&loop);
    pose(2.5, 0.3, quaternion);
    for (int step = 0; step < 1000; step++) {
        tip_loop_store(&loop, pressure_pa);
        (void)tip_loop_update(&loop, &parameters, &synthetic.table, quaternion, 0, 1000);
    }
    assert_close(hypot((double)loop.correction_rad[0], (double)loop.correction_rad[1]),
                 (double)parameters.correction_limit_rad, 1e-5);
    synthetic_table_free(&synthetic);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bend_vector_of_an_orientation),
        cmocka_unit_test(a_roll_about_the_tips_axis_does_not_matter),
        cmocka_unit_test(what_is_no_orientation_is_refused),
        cmocka_unit_test(a_constant_model_error_is_learnt),
        cmocka_unit_test(a_sample_is_compared_with_the_pressures_of_its_own_time),
        cmocka_unit_test(too_old_and_future_samples_are_refused),
        cmocka_unit_test(the_correction_is_bounded),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
