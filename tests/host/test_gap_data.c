/* What a diagnosis reads of a log by itself: samples that are there again. */
#include <math.h>
#include <unistd.h>

#include "gap/gap_data.h"
#include "support/scratch.h"
#include "support/test.h"

#define SAMPLES 600
#define EVERY 5 /* that sample is the one before it once more */
#define STEP_M 1e-4
#define STEP_RAD 4e-4

static double in_steps(double value, double step) {
    return step * round(value / step);
}

/* Of a sensor of 100 Hz with steps and no noise, whose tip swings to and fro by these amplitudes. */
static struct gap_repeats repeats_of(double turn_rad, double move_m, bool repeats) {
    char path[SCRATCH_BYTES], error[512];
    struct gap_data data;
    const int file = scratch_file(path);
    assert_true(file >= 0);
    FILE *log = fdopen(file, "w");
    assert_non_null(log);
    (void)fputs("# tribend-run 1\n# module: paper-semicircle\ntime_s,valve1,valve2,valve3,p1_pa,p2_pa,p3_pa,tip_x_m,tip_y_m,tip_z_m,"
                "tip_qw,tip_qx,tip_qy,tip_qz\n", log);
    for (int i = 0; i < SAMPLES; i++) {
        const int at = repeats && i % EVERY == 0 && i > 0 ? i - 1 : i;
        const double swing = sin(0.01 * at), turned = in_steps(turn_rad * swing, STEP_RAD);
        (void)fprintf(log, "%.3f,0.1,0,0,%.1f,0,0,%.5f,0,0.06,%.9f,%.9f,0,0\n", 0.01 * i, 4000.0 + 1000.0 * swing,
                      in_steps(move_m * swing, STEP_M), cos(0.5 * turned), sin(0.5 * turned));
    }
    assert_int_equal(fclose(log), 0);
    const char *const paths[] = {path};
    if (!gap_data_read(&data, paths, 1, error, sizeof error)) {
        fail_msg("%s", error);
    }
    const struct gap_repeats found = gap_data_repeats(&data);
    gap_data_free(&data);
    assert_int_equal(unlink(path), 0);
    return found;
}

static void repeats_show_while_the_tip_moves(void **state) {
    (void)state;
    assert_close(repeats_of(1.0, 0.04, true).share, 1.0 / EVERY, 0.02);
    assert_true(repeats_of(1.0, 0.04, false).share < 0.02);
}

/* The orientation has finer steps, for what it turns by, than the position for what it moves by. */
static void repeats_of_a_slow_tip_show_in_its_orientation(void **state) {
    (void)state;
    assert_close(repeats_of(0.4, 0.01, true).share, 1.0 / EVERY, 0.02);
    assert_true(repeats_of(0.4, 0.01, false).share < 0.02);
}

/* A sensor with steps repeats itself at rest: that tells nothing. */
static void tip_at_rest_tells_nothing(void **state) {
    (void)state;
    const struct gap_repeats found = repeats_of(0.001, 0.0, true);
    assert_true(found.share == 0.0);
    assert_true(found.samples < 20.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(repeats_show_while_the_tip_moves),
                                       cmocka_unit_test(repeats_of_a_slow_tip_show_in_its_orientation),
                                       cmocka_unit_test(tip_at_rest_tells_nothing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
