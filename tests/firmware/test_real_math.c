#include "support/test.h"

#include "control/real_math.h"

static void sine_and_cosine_follow_libm(void **state) {
    (void)state;
    double worst_sin = 0.0, worst_cos = 0.0;
    for (int i = -200000; i <= 200000; i++) {
        const float x = (float)i * 5e-4f;
        worst_sin = fmax(worst_sin, fabs((double)real_sin(x) - sin((double)x)));
        worst_cos = fmax(worst_cos, fabs((double)real_cos(x) - cos((double)x)));
    }
    assert_under(worst_sin, 2e-7);
    assert_under(worst_cos, 2e-7);
}

static void arctangent_covers_every_quadrant(void **state) {
    (void)state;
    double worst = 0.0;
    for (int i = 0; i < 100000; i++) {
        const double angle = -M_PI + 2.0 * M_PI * (i + 0.5) / 100000.0;
        const float y = (float)(3.7 * sin(angle)), x = (float)(3.7 * cos(angle));
        worst = fmax(worst, fabs((double)real_atan2(y, x) - atan2((double)y, (double)x)));
    }
    assert_under(worst, 4e-7);
    assert_close((double)real_atan2(0.0f, 0.0f), 0.0, 0.0);
    assert_close((double)real_atan2(0.0f, -1.0f), M_PI, 1e-6);
    assert_close((double)real_atan2(-1.0f, 0.0f), -M_PI / 2.0, 1e-6);
}

static void wrapped_angles_are_the_same_angle(void **state) {
    (void)state;
    for (int i = -1000; i <= 1000; i++) {
        const float angle = 0.0371f * (float)i;
        const double wrapped = (double)real_wrap_angle(angle);
        assert_true(wrapped > -M_PI - 1e-6 && wrapped <= M_PI + 1e-6);
        assert_close(remainder(wrapped - (double)angle, 2.0 * M_PI), 0.0, 1e-5);
    }
}

static void bad_numbers_have_defined_answers(void **state) {
    (void)state;
    assert_false(real_is_finite(NAN));
    assert_false(real_is_finite(INFINITY));
    assert_true(real_is_finite(-3.0f));
    assert_close((double)real_sin(NAN), 0.0, 0.0);
    assert_close((double)real_cos(INFINITY), 1.0, 0.0);
    assert_close((double)real_sqrt(-1.0f), 0.0, 0.0);
    assert_close((double)real_sqrt(NAN), 0.0, 0.0);
    assert_close((double)real_clamp(NAN, 2.0f, 3.0f), 2.0, 0.0);
    assert_close((double)real_clamp(9.0f, 2.0f, 3.0f), 3.0, 0.0);
    assert_close((double)real_hypot(3.0f, -4.0f), 5.0, 1e-6);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sine_and_cosine_follow_libm),
        cmocka_unit_test(arctangent_covers_every_quadrant),
        cmocka_unit_test(wrapped_angles_are_the_same_angle),
        cmocka_unit_test(bad_numbers_have_defined_answers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
