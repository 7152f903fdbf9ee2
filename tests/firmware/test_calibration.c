/* What the firmware makes of a calibration: bounds, readings, valves that are late, poses. */
#include "support/test.h"

#include "support/rig.h"

static void numbers_out_of_bounds_are_cut_and_counted(void **state) {
    (void)state;
    struct controller_calibration calibration;
    calibration_none(&calibration);
    assert_int_equal(calibration_limit(&calibration), 0);
    calibration.reading_gain[1] = 3.0f;
    calibration.reading_offset_pa[2] = -1e9f;
    calibration.fill_scale[0] = (float)NAN;
    calibration.tip_arm_m[1] = (float)INFINITY;
    calibration.tip_late_us = 1000000;
    calibration.valve_late_us[0] = -1;
    assert_int_equal(calibration_limit(&calibration), 6);
    assert_close((double)calibration.reading_gain[1], 1.3, 1e-6);
    assert_close((double)calibration.reading_offset_pa[2], -8000.0, 0.0);
    assert_close((double)calibration.fill_scale[0], 1.0, 0.0);
    assert_close((double)calibration.tip_arm_m[1], 0.0, 0.0);
    assert_int_equal(calibration.tip_late_us, 45000);
    assert_int_equal(calibration.valve_late_us[0], 0);
    assert_int_equal(calibration_limit(&calibration), 0);
}

static void the_identity_changes_no_bit_of_a_reading_or_pose(void **state) {
    (void)state;
    struct controller_calibration calibration;
    struct calibration_frames frames;
    const float readings_pa[] = {0.0f, -0.0f, 1.0f / 3.0f, 12345.678f, -7.0f, (float)INFINITY};
    calibration_none(&calibration);
    calibration_frames_of(&calibration, &frames);
    for (size_t i = 0; i < sizeof readings_pa / sizeof readings_pa[0]; i++) {
        const float pressure_pa = calibration_pressure(&calibration, 0, readings_pa[i], 150.0f, 500.0f);
        assert_memory_equal(&pressure_pa, &readings_pa[i], sizeof pressure_pa);
    }
    float position_m[3] = {0.01f, -0.0f, 0.06f}, quaternion[4] = {0.9f, -0.0f, 0.43588989f, 0.0f};
    const float position_was_m[3] = {0.01f, -0.0f, 0.06f}, quaternion_was[4] = {0.9f, -0.0f, 0.43588989f, 0.0f};
    calibration_pose(&frames, position_m, quaternion);
    assert_memory_equal(position_m, position_was_m, sizeof position_m);
    assert_memory_equal(quaternion, quaternion_was, sizeof quaternion);
}

static void a_reading_that_the_sensor_clips_only_bounds_the_pressure(void **state) {
    (void)state;
    struct controller_calibration calibration;
    calibration_none(&calibration);
    calibration.reading_offset_pa[0] = -800.0f;
    calibration.reading_offset_pa[1] = 800.0f;
    calibration.reading_gain[1] = 1.25f;
    /* shows nothing: anything up to 800 Pa may stand there */
    assert_close((double)calibration_pressure(&calibration, 0, 0.0f, 150.0f, 100.0f), 100.0, 0.0);
    assert_close((double)calibration_pressure(&calibration, 0, 0.0f, 150.0f, 3000.0f), 800.0, 0.0);
    assert_close((double)calibration_pressure(&calibration, 0, 2000.0f, 150.0f, 100.0f), 2800.0, 0.0);
    assert_close((double)calibration_pressure(&calibration, 1, 5800.0f, 150.0f, 100.0f), 4000.0, 0.0);
}

/* --- pressure loops on a plant that differs --- */

static void open_known(struct rig *rig, const char *effect_text, const struct controller_calibration *calibration,
                       uint64_t seed) {
    struct sim_link_setup setup;
    struct effect effect;
    char error[256];
    memset(rig, 0, sizeof *rig);
    sim_link_default_setup(&setup, &rig_file.table, seed);
    setup.controller.calibration = *calibration;
    setup.controller.flow_watch.most_pa = 1e9f; /* not knowing, it would take some of these for a fault */
    sim_link_open_setup(&rig->sim, &setup, &rig->link);
    assert_true(effect_parse(effect_text, &effect, error, sizeof error));
    assert_true(sim_add_effect(&rig->sim.sim, &effect));
    while (rig->report.status.state != SUPERVISOR_SAFE) {
        assert_true(rig->report.time_us < 2000000);
        rig_step(rig);
    }
}

struct step_answer {
    double most_pa;
    double wander_pa; /* rms of period means about the target over the last second */
};

static struct step_answer answer_to_step(struct rig *rig, double target_pa) {
    const struct controller_command command = rig_pressure(target_pa, target_pa, 0.0);
    struct step_answer answer = {0.0, 0.0};
    double mean_pa = 0.0;
    rig_command(rig, &command);
    for (int i = 0; i < 4000; i++) {
        rig_step(rig);
        mean_pa += 0.1 * rig->sim.sim.plant.pressure_pa[0];
        if (i % 10 == 9) {
            answer.most_pa = fmax(answer.most_pa, mean_pa);
            answer.wander_pa += i >= 3000 ? (mean_pa - target_pa) * (mean_pa - target_pa) / 100.0 : 0.0;
            mean_pa = 0.0;
        }
    }
    assert_int_equal(rig->report.status.faults, 0);
    answer.wander_pa = sqrt(answer.wander_pa);
    return answer;
}

/* Against the same step on the nominal plant; not knowing the delay it swings. */
static void a_valve_that_is_known_to_be_late_does_not_make_the_pressure_swing(void **state) {
    (void)state;
    static struct rig rig;
    struct controller_calibration none, known;
    calibration_none(&none);
    calibration_none(&known);
    for (size_t c = 0; c < 3; c++) {
        known.valve_late_us[c] = 50000;
    }
    open_known(&rig, "valve_dead_time:delay=0.05", &none, 3);
    const struct step_answer unknown = answer_to_step(&rig, 5000.0);
    open_known(&rig, "valve_dead_time:delay=0.05", &known, 3);
    const struct step_answer late = answer_to_step(&rig, 5000.0);
    print_message("           50 ms late: most %.0f Pa, wander %.0f Pa; known %.0f Pa, %.0f Pa\n", unknown.most_pa,
                  unknown.wander_pa, late.most_pa, late.wander_pa);
    assert_under(late.most_pa, 1.05 * 5000.0);
    assert_under(late.wander_pa, 60.0);
    assert_under(late.wander_pa, 0.7 * unknown.wander_pa);
}

static struct pressure_loop_clock clock_at(const struct pressure_loop_parameters *parameters, int64_t time_us) {
    return pressure_loop_clock_at(time_us, time_us - time_us % parameters->pwm_period_us, 1000);
}

static void cut_a_late_valve(int64_t from_us) {
    struct pressure_loop_parameters parameters;
    struct pressure_loop loop;
    pressure_loop_default_parameters(&parameters);
    parameters.late_us = 60000;
    pressure_loop_init(&loop);
    struct pressure_loop_clock clock = {.now_us = 0};
    for (int64_t time_us = from_us + 1000; time_us <= from_us + 100000; time_us += 1000) {
        clock = clock_at(&parameters, time_us);
        pressure_loop_predict(&loop, &parameters, 40000.0f, 2e-4f, &clock);
        (void)pressure_loop_duty(&loop, &parameters, 8000.0f, 40000.0f, 2e-4f, &clock);
    }
    assert_true(loop.estimate_pa > 0.0f);
    pressure_loop_vent(&loop, &parameters, &clock);
    const float at_cut_pa = loop.estimate_pa;
    for (int64_t time_us = from_us + 101000; time_us <= from_us + 300000; time_us += 1000) {
        clock = clock_at(&parameters, time_us);
        pressure_loop_predict(&loop, &parameters, 40000.0f, 2e-4f, &clock);
        assert_true(loop.estimate_pa <= at_cut_pa + 20.0f); /* what a close delay of 1 ms still lets in */
    }
    assert_true(loop.estimate_pa < 0.9f * at_cut_pa);
}

static void a_late_valve_that_is_cut_stays_shut(void **state) {
    (void)state;
    cut_a_late_valve(0);
}

/* The loop's 32-bit times wrap 71.6 minutes after the start, and look half a wrap away at 35.8. */
static void pulses_cross_the_wrap_of_their_clock(void **state) {
    (void)state;
    cut_a_late_valve(2147483648 - 648 - 60000);
    cut_a_late_valve(4294967296 - 7296 - 60000);
}

static void a_valve_shut_for_hours_still_counts_as_vented(void **state) {
    (void)state;
    struct pressure_loop_parameters parameters;
    struct pressure_loop loop;
    pressure_loop_default_parameters(&parameters);
    pressure_loop_init(&loop);
    for (int64_t time_us = 1000000; time_us < 20000000000; time_us += 1000000) {
        const struct pressure_loop_clock clock = clock_at(&parameters, time_us);
        pressure_loop_predict(&loop, &parameters, 40000.0f, 2e-4f, &clock);
        assert_true(pressure_loop_vented_us(&loop, &clock) >= 1000000);
        assert_true(loop.estimate_pa <= 0.0f);
    }
}

static void a_known_dead_band_is_stepped_over(void **state) {
    (void)state;
    static struct rig rig;
    struct controller_calibration none, known;
    calibration_none(&none);
    calibration_none(&known);
    for (size_t c = 0; c < 3; c++) {
        known.least_duty[c] = 0.305f;
        known.lost_duty[c] = 0.3f;
    }
    open_known(&rig, "valve_dead_band:least_duty=0.3,loss=1", &none, 5);
    const struct step_answer unknown = answer_to_step(&rig, 3000.0);
    open_known(&rig, "valve_dead_band:least_duty=0.3,loss=1", &known, 5);
    const struct step_answer stepped = answer_to_step(&rig, 3000.0);
    print_message("           dead band: wander %.0f Pa; known %.0f Pa\n", unknown.wander_pa, stepped.wander_pa);
    assert_under(stepped.wander_pa, 60.0);
    assert_under(stepped.wander_pa, 0.7 * unknown.wander_pa);
}

/* --- creep --- */

static void a_known_creep_is_foreseen_without_a_tip_sensor(void **state) {
    (void)state;
    static struct rig rig;
    struct controller_calibration none, known;
    double error_deg[2];
    calibration_none(&none);
    calibration_none(&known);
    known.creep_share[0] = 0.12f;
    known.creep_time_s[0] = 1.0f;
    for (int k = 0; k < 2; k++) {
        const struct controller_command command = rig_bend(45.0, 100.0);
        open_known(&rig, "creep:amplitude=0.12,time_constant=1", k == 0 ? &none : &known, 7);
        rig.sim.sim.faults.tip_stops = true;
        rig_command(&rig, &command);
        rig_run(&rig, 6000);
        const struct body_shape *shape = &rig.sim.sim.plant.shape;
        error_deg[k] = 180.0 / M_PI * hypot(shape->bend_x_rad, shape->bend_y_rad) - 45.0;
    }
    print_message("           creep after 6 s: %.2f deg too far; known %.2f deg\n", error_deg[0], error_deg[1]);
    assert_true(error_deg[0] > 4.0);
    assert_close(error_deg[1], 0.0, 1.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_out_of_bounds_are_cut_and_counted),
        cmocka_unit_test(the_identity_changes_no_bit_of_a_reading_or_pose),
        cmocka_unit_test(a_reading_that_the_sensor_clips_only_bounds_the_pressure),
        cmocka_unit_test(a_valve_that_is_known_to_be_late_does_not_make_the_pressure_swing),
        cmocka_unit_test(a_late_valve_that_is_cut_stays_shut),
        cmocka_unit_test(pulses_cross_the_wrap_of_their_clock),
        cmocka_unit_test(a_valve_shut_for_hours_still_counts_as_vented),
        cmocka_unit_test(a_known_dead_band_is_stepped_over),
        cmocka_unit_test(a_known_creep_is_foreseen_without_a_tip_sensor),
    };
    return cmocka_run_group_tests(tests, rig_open, rig_close);
}
