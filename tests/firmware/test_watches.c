/* Each detector alone: what it must see, when, and what it must let pass. */
#include "support/test.h"

#include "safety/board_watch.h"
#include "safety/flow_watch.h"
#include "safety/sensor_watch.h"
#include "safety/supervisor.h"
#include "safety/tip_watch.h"
#include "sim/random.h"

#define BIT(NAME) (1u << (unsigned)FAULT_##NAME)
#define WARNING_BIT(NAME) (1u << (unsigned)WARNING_##NAME)

/* --- sensor */

struct sensor_bench {
    struct sensor_watch_parameters parameters;
    struct sensor_watch watch;
    struct random_stream random;
    uint32_t step;
};

static void sensor_start(struct sensor_bench *bench) {
    sensor_watch_default_parameters(&bench->parameters, 150.0f);
    sensor_watch_init(&bench->watch);
    random_seed(&bench->random, 1, 1);
    bench->step = 0;
}

static uint32_t sensor_read(struct sensor_bench *bench, double pressure_pa, double noise_pa) {
    const double reading_pa = 12.21 * round((pressure_pa + noise_pa * random_normal(&bench->random)) / 12.21);
    return sensor_watch_step(&bench->watch, &bench->parameters, (float)fmax(reading_pa, 0.0), true, 5.0f, bench->step++);
}

static uint32_t sensor_run(struct sensor_bench *bench, double pressure_pa, double noise_pa, int steps) {
    uint32_t faults = 0;
    for (int i = 0; i < steps; i++) {
        faults |= sensor_read(bench, pressure_pa, noise_pa);
    }
    return faults;
}

static void noise_of_an_hour_is_no_fault(void **state) {
    (void)state;
    struct sensor_bench bench;
    sensor_start(&bench);
    assert_int_equal(sensor_run(&bench, 5000.0, 150.0, 3600000), 0);
    sensor_start(&bench);
    assert_int_equal(sensor_run(&bench, 0.0, 150.0, 100000), 0); /* clipped: half of the readings are alike */
}

static void a_jump_is_a_rate(void **state) {
    (void)state;
    struct sensor_bench bench;
    for (int sign = -1; sign <= 1; sign += 2) {
        sensor_start(&bench);
        (void)sensor_run(&bench, 6000.0, 150.0, 1000);
        assert_true((sensor_run(&bench, 6000.0 + 1400.0 * sign, 150.0, 10) & BIT(PRESSURE_RATE)) != 0u);
        (void)sensor_run(&bench, 6000.0 + 1400.0 * sign, 150.0, 20);
        assert_int_equal(sensor_run(&bench, 6000.0 + 1400.0 * sign, 150.0, 1000), 0); /* and over then */
    }
}

static void what_the_valve_can_do_is_no_rate(void **state) {
    (void)state;
    struct sensor_bench bench;
    uint32_t faults = 0;
    sensor_start(&bench);
    bench.watch.seen = 0;
    for (int i = 0; i < 200; i++) { /* 60 kPa/s, and the model says so */
        faults |= sensor_watch_step(&bench.watch, &bench.parameters, 60.0f * (float)i, true, 60.0f, bench.step++);
    }
    assert_int_equal(faults & BIT(PRESSURE_RATE), 0);
}

static void equal_readings_are_a_stuck_sensor_but_for_zero(void **state) {
    (void)state;
    struct sensor_bench bench;
    sensor_start(&bench);
    assert_int_equal(sensor_run(&bench, 5000.0, 0.0, 25), 0);
    assert_int_equal(sensor_run(&bench, 5000.0, 0.0, 1), BIT(SENSOR_STUCK));
    assert_int_equal(sensor_run(&bench, 5000.0, 150.0, 20) & BIT(SENSOR_STUCK), 0);
    sensor_start(&bench);
    assert_int_equal(sensor_run(&bench, 0.0, 0.0, 1000), 0);
    bench.parameters.stuck_samples = 0u; /* a quiet sensor */
    assert_int_equal(sensor_run(&bench, 300.0, 0.0, 1000), 0);
}

static void four_times_the_noise_is_seen_in_a_tenth_of_a_second(void **state) {
    (void)state;
    struct sensor_bench bench;
    sensor_start(&bench);
    (void)sensor_run(&bench, 5000.0, 150.0, 1000);
    assert_true((sensor_run(&bench, 5000.0, 600.0, 100) & BIT(SENSOR_NOISY)) != 0u);
}

static void a_channel_that_comes_back_starts_anew(void **state) {
    (void)state;
    struct sensor_bench bench;
    sensor_start(&bench);
    (void)sensor_run(&bench, 9000.0, 150.0, 100);
    (void)sensor_watch_step(&bench.watch, &bench.parameters, NAN, false, 5.0f, bench.step++);
    assert_int_equal(sensor_run(&bench, 2000.0, 150.0, 100), 0);
}

/* --- flow: at 10 kPa a step fills by 2.9 Pa or vents by 1.5 Pa */

static const struct flow_watch_view hold = {10000.0f, 0.0f, 0.34f, 2.9f, 1.5f};

static int steps_until(uint32_t fault, float unmodelled_pa, float filled_share, int most) {
    struct flow_watch_parameters parameters;
    struct flow_watch watch;
    struct flow_watch_view view = hold;
    flow_watch_default_parameters(&parameters);
    flow_watch_init(&watch);
    for (int i = 0; i < 1000; i++) {
        assert_int_equal(flow_watch_step(&watch, &parameters, &view), 0);
    }
    view.unmodelled_pa = unmodelled_pa;
    view.filled_share = filled_share;
    for (int i = 1; i <= most; i++) {
        if ((flow_watch_step(&watch, &parameters, &view) & fault) != 0u) {
            return i;
        }
    }
    return -1;
}

static void a_valve_stuck_filling_is_seen_before_it_brings_a_kilopascal(void **state) {
    (void)state;
    const float share = 0.34f, gained_pa = (1.0f - share) * (2.9f + 1.5f);
    const int held = steps_until(BIT(VALVE_STUCK_FILLING), gained_pa, share, 1000);
    assert_in_range(held, 1, 350);
    assert_under(2.9e-3 * held, 1.0);
    assert_in_range(steps_until(BIT(VALVE_STUCK_FILLING), 2.9f + 1.5f, 0.0f, 1000), 1, 150); /* once the loop lets out */
}

static void a_shut_valve_is_seen_whichever_way_it_should_go(void **state) {
    (void)state;
    assert_in_range(steps_until(BIT(VALVE_NOT_VENTING), 1.5f, 0.0f, 3000), 1, 2000);
    assert_in_range(steps_until(BIT(VALVE_NOT_FILLING), -2.9f, 1.0f, 3000), 1, 2000);
}

static void a_valve_at_six_tenths_is_no_fault_but_a_warning(void **state) {
    (void)state;
    struct flow_watch_parameters parameters;
    struct flow_watch watch;
    struct flow_watch_view view = hold;
    flow_watch_default_parameters(&parameters);
    flow_watch_init(&watch);
    bool loses = false, keeps = false;
    for (int i = 0; i < 20000; i++) {
        const bool fills = i % 4000 < 2000;
        view.filled_share = fills ? 1.0f : 0.0f;
        view.unmodelled_pa = fills ? -0.4f * view.fill_pa : 0.4f * view.vent_pa;
        assert_int_equal(flow_watch_step(&watch, &parameters, &view), 0);
        loses = loses || flow_watch_loses(&watch, &parameters);
        keeps = keeps || flow_watch_keeps(&watch, &parameters);
    }
    assert_true(loses);
    assert_true(keeps);
    assert_false(flow_watch_doubts(&watch, &parameters)); /* what it owes in one way it gets back in the other */
}

static void a_reading_that_drifts_off_is_doubted(void **state) {
    (void)state;
    struct flow_watch_parameters parameters;
    struct flow_watch watch;
    struct flow_watch_view view = hold;
    flow_watch_default_parameters(&parameters);
    flow_watch_init(&watch);
    view.filled_share = 0.568f; /* the loop fills on by 1 kPa/s, */
    view.unmodelled_pa = -1.0f; /* and the reading stays */
    int steps = 0;
    while (!flow_watch_doubts(&watch, &parameters)) {
        assert_int_equal(flow_watch_step(&watch, &parameters, &view), 0);
        steps++;
        assert_true(steps < 3000);
    }
    assert_in_range(steps, 500, 3000);
}

/* --- board */

struct board_bench {
    struct board_watch_parameters parameters;
    struct board_watch watch;
    struct hal_health health;
    struct board_watch_view view;
};

static void board_start(struct board_bench *bench) {
    *bench = (struct board_bench){.health = {.steps_late = 0u}};
    board_watch_default_parameters(&bench->parameters, 40000.0f, 11000.0f);
    board_watch_init(&bench->watch);
    bench->view = (struct board_watch_view){
        .supply_pa = 40000.0f, .supply_ok = true, .supply_enabled = true, .moving = true};
}

static uint32_t board_step(struct board_bench *bench, int64_t after_us) {
    bench->view.time_us += after_us;
    bench->view.health = &bench->health;
    return board_watch_step(&bench->watch, &bench->parameters, &bench->view);
}

static uint32_t board_run(struct board_bench *bench, int steps) {
    uint32_t faults = 0;
    for (int i = 0; i < steps; i++) {
        faults |= board_step(bench, 1000);
    }
    return faults;
}

static void the_cause_of_a_restart_is_a_fault_once(void **state) {
    (void)state;
    struct board_bench bench;
    board_start(&bench);
    bench.health.watchdog_reset = true;
    bench.health.brown_out_reset = true;
    assert_int_equal(board_step(&bench, 0), BIT(WATCHDOG_RESET) | BIT(BROWN_OUT));
    assert_int_equal(board_run(&bench, 100), 0); /* so that it can be cleared */
    board_start(&bench);
    bench.health.crashed = true;
    assert_int_equal(board_step(&bench, 0), BIT(WATCHDOG_RESET));
}

static void late_steps_warn_and_many_or_a_long_gap_are_a_fault(void **state) {
    (void)state;
    struct board_bench bench;
    board_start(&bench);
    assert_int_equal(board_run(&bench, 100), 0);
    assert_false(board_watch_was_late(&bench.watch, bench.view.time_us));
    assert_int_equal(board_step(&bench, 9000), 0);
    assert_true(board_watch_was_late(&bench.watch, bench.view.time_us));
    assert_int_equal(board_step(&bench, 10000), BIT(STEP_OVERRUN));
    assert_int_equal(board_run(&bench, 2000), 0);
    assert_false(board_watch_was_late(&bench.watch, bench.view.time_us));
    bench.health.steps_late += 10u; /* as the board counted them */
    assert_int_equal(board_step(&bench, 1000), BIT(STEP_OVERRUN));
    bench.view.moving = false;
    assert_int_equal(board_step(&bench, 50000), 0); /* vented: flash may be written */
}

static void time_that_stands_goes_back_or_jumps_is_a_clock_fault(void **state) {
    (void)state;
    struct board_bench bench;
    board_start(&bench);
    assert_int_equal(board_run(&bench, 10), 0);
    assert_int_equal(board_step(&bench, 0), BIT(CLOCK));
    assert_int_equal(board_step(&bench, -5000), BIT(CLOCK));
    assert_int_equal(board_step(&bench, 1500000), BIT(CLOCK));
    assert_int_equal(board_run(&bench, 10), 0);
}

static void the_supply_is_judged_once_it_is_open(void **state) {
    (void)state;
    struct board_bench bench;
    board_start(&bench);
    bench.view.supply_enabled = false;
    bench.view.supply_pa = 0.0f;
    assert_int_equal(board_run(&bench, 1000), 0);
    bench.view.supply_enabled = true;
    assert_int_equal(board_run(&bench, 299), 0);
    assert_int_equal(board_run(&bench, 30), BIT(SUPPLY_LOST));
    bench.view.supply_pa = 51000.0f;
    assert_int_equal(board_run(&bench, 19), 0);
    assert_int_equal(board_run(&bench, 1), BIT(SUPPLY_HIGH));
    bench.view.supply_ok = false; /* not measured: a warning, elsewhere */
    assert_int_equal(board_run(&bench, 100), 0);
    bench.view.supply_ok = true;
    bench.view.supply_pa = 14000.0f;
    bench.view.highest_pa = 15500.0f;
    assert_int_equal(board_run(&bench, 30), BIT(SENSORS_DISAGREE));
}

static void bus_off_is_a_fault_only_while_moving(void **state) {
    (void)state;
    struct board_bench bench;
    board_start(&bench);
    bench.view.bus_off = true;
    assert_int_equal(board_run(&bench, 1), BIT(CAN_BUS_OFF));
    bench.view.moving = false;
    assert_int_equal(board_run(&bench, 10), 0);
    bench.view.outputs_refused = true;
    assert_int_equal(board_run(&bench, 1), BIT(OUTPUTS_REFUSED));
}

/* --- tip */

static const struct bend_table_module module = {
    .chamber_length_m = 0.055f, .cap_proximal_m = 0.005f, .cap_distal_m = 0.005f};

struct tip_bench {
    struct tip_watch_parameters parameters;
    struct tip_watch watch;
    int64_t time_us;
    float position_m[3];
    float quaternion[4];
    float correction_rad[2];
};

static void tip_start(struct tip_bench *bench) {
    *bench = (struct tip_bench){.position_m = {0.0f, 0.0f, 0.065f}, .quaternion = {1.0f, 0.0f, 0.0f, 0.0f}};
    tip_watch_default_parameters(&bench->parameters);
    tip_watch_init(&bench->watch);
}

static bool tip_sample(struct tip_bench *bench, double bend_rad, uint16_t status) {
    bench->time_us += 10000;
    bench->quaternion[0] = (float)cos(0.5 * bend_rad);
    bench->quaternion[2] = (float)sin(0.5 * bend_rad);
    const struct tip_watch_sample sample = {bench->time_us, bench->position_m, bench->quaternion, status};
    return tip_watch_take(&bench->watch, &bench->parameters, &module, &sample);
}

static uint32_t tip_warnings(const struct tip_bench *bench) {
    return tip_watch_warnings(&bench->watch, &bench->parameters, bench->time_us);
}

static void tip_compare(struct tip_bench *bench, double measured_rad, double predicted_rad, double pressure_pa) {
    const float measured[2] = {(float)measured_rad, 0.0f}, gap[2] = {(float)(measured_rad - predicted_rad), 0.0f};
    const float push[3][2] = {{4e-4f, 0.0f}, {0.0f, 4e-4f}, {0.0f, -4e-4f}}, slope[3] = {4e-4f, 4e-4f, 4e-4f};
    const struct tip_watch_view view = {.time_us = bench->time_us,
                                        .measured_rad = measured,
                                        .gap_rad = gap,
                                        .push_radppa = push,
                                        .slope_radppa = slope,
                                        .pressure_pa = {(float)pressure_pa, 0.0f, 0.0f},
                                        .working_pa = 11000.0f};
    tip_watch_follow(&bench->watch, &bench->parameters, &view, bench->correction_rad);
}

/* A sample that nobody filled has no rotation in it; nor has one that is no number. */
static void a_sample_without_a_rotation_is_refused(void **state) {
    (void)state;
    const float scales[] = {0.0f, 0.5f, 2.0f, NAN};
    for (size_t i = 0; i < sizeof scales / sizeof scales[0]; i++) {
        struct tip_bench bench;
        tip_start(&bench);
        const float position_m[3] = {0.0f, 0.0f, 0.0f}, quaternion[4] = {scales[i], 0.0f, 0.0f, 0.0f};
        const struct tip_watch_sample sample = {10000, position_m, quaternion, 0u};
        assert_false(tip_watch_take(&bench.watch, &bench.parameters, &module, &sample));
        bench.time_us = 10000;
        assert_int_equal(tip_warnings(&bench), WARNING_BIT(TIP_ERRATIC));
    }
}

static void bad_samples_are_refused_and_named(void **state) {
    (void)state;
    struct tip_bench bench;
    tip_start(&bench);
    assert_true(tip_sample(&bench, 0.10, 0u));
    assert_int_equal(tip_warnings(&bench), 0);
    assert_false(tip_sample(&bench, 0.11, TIP_WATCH_SATURATED));
    assert_int_equal(tip_warnings(&bench), WARNING_BIT(TIP_SATURATED));
    assert_false(tip_sample(&bench, 0.12, TIP_WATCH_OUT_OF_BOX));
    assert_false(tip_sample(&bench, 0.9, 0u)); /* 45 degrees in 10 ms */
    assert_int_equal(tip_warnings(&bench),
                     WARNING_BIT(TIP_SATURATED) | WARNING_BIT(TIP_OUT_OF_BOX) | WARNING_BIT(TIP_ERRATIC));
    assert_true(tip_sample(&bench, 0.9, 0u)); /* it stays there: then so be it */
    bench.position_m[0] = 0.3f;
    assert_false(tip_sample(&bench, 0.9, 0u));
    bench.position_m[0] = NAN;
    assert_false(tip_sample(&bench, 0.9, 0u));
    bench.position_m[0] = 0.0f;
    bench.time_us += 300000;
    assert_true(tip_sample(&bench, 0.9, 0u));
    assert_int_equal(tip_warnings(&bench), 0); /* shown for a while only */
}

static void frozen_is_what_stands_still_while_the_table_moves(void **state) {
    (void)state;
    struct tip_bench bench;
    tip_start(&bench);
    bench.correction_rad[0] = 0.05f;
    for (int i = 0; i < 100; i++) { /* at rest samples may well be equal */
        assert_true(tip_sample(&bench, 0.5, 0u));
        tip_compare(&bench, 0.5, 0.5, 6000.0);
    }
    assert_int_equal(tip_warnings(&bench), 0);
    for (int i = 0; i < 20 && !bench.watch.frozen; i++) {
        assert_true(tip_sample(&bench, 0.5, 0u));
        bench.correction_rad[0] -= 0.005f; /* the tip loop believes it */
        tip_compare(&bench, 0.5, 0.5 + 0.01 * (i + 1), 6000.0);
    }
    assert_true(bench.watch.frozen);
    assert_close((double)bench.correction_rad[0], 0.05, 1e-6);
    assert_false(tip_sample(&bench, 0.5, 0u));
    assert_int_equal(tip_warnings(&bench), WARNING_BIT(TIP_FROZEN));
    assert_true(tip_sample(&bench, 0.51, 0u)); /* it lives */
    assert_int_equal(tip_warnings(&bench), 0);
}

static bool disagrees_with(double measured_rad, double predicted_rad, double pressure_pa) {
    struct tip_bench bench;
    tip_start(&bench);
    for (int i = 0; i < 30; i++) {
        (void)tip_sample(&bench, measured_rad + 1e-4 * i, 0u);
        tip_compare(&bench, measured_rad, predicted_rad, pressure_pa);
    }
    const bool disagrees = tip_watch_disagrees(&bench.watch, &bench.parameters, bench.time_us);
    assert_false(tip_watch_disagrees(&bench.watch, &bench.parameters, bench.time_us + 200000)); /* old news */
    return disagrees;
}

static void a_bend_that_means_too_much_pressure_is_a_disagreement(void **state) {
    (void)state;
    assert_false(disagrees_with(1.5, 1.4, 9500.0));
    assert_true(disagrees_with(1.9, 1.2, 9500.0));  /* 1.75 kPa more than read, over the limit */
    assert_false(disagrees_with(1.2, 0.7, 6000.0)); /* far from the limit: a load, a softer body */
    assert_false(disagrees_with(0.6, 0.0, 0.0));    /* its own weight */
    assert_true(disagrees_with(1.7, 0.7, 6000.0));  /* whatever it is, it is too much */
    assert_false(disagrees_with(0.7, 1.7, 9500.0)); /* held back by something */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_of_an_hour_is_no_fault),
        cmocka_unit_test(a_jump_is_a_rate),
        cmocka_unit_test(what_the_valve_can_do_is_no_rate),
        cmocka_unit_test(equal_readings_are_a_stuck_sensor_but_for_zero),
        cmocka_unit_test(four_times_the_noise_is_seen_in_a_tenth_of_a_second),
        cmocka_unit_test(a_channel_that_comes_back_starts_anew),
        cmocka_unit_test(a_valve_stuck_filling_is_seen_before_it_brings_a_kilopascal),
        cmocka_unit_test(a_shut_valve_is_seen_whichever_way_it_should_go),
        cmocka_unit_test(a_valve_at_six_tenths_is_no_fault_but_a_warning),
        cmocka_unit_test(a_reading_that_drifts_off_is_doubted),
        cmocka_unit_test(the_cause_of_a_restart_is_a_fault_once),
        cmocka_unit_test(late_steps_warn_and_many_or_a_long_gap_are_a_fault),
        cmocka_unit_test(time_that_stands_goes_back_or_jumps_is_a_clock_fault),
        cmocka_unit_test(the_supply_is_judged_once_it_is_open),
        cmocka_unit_test(bus_off_is_a_fault_only_while_moving),
        cmocka_unit_test(a_sample_without_a_rotation_is_refused),
        cmocka_unit_test(bad_samples_are_refused_and_named),
        cmocka_unit_test(frozen_is_what_stands_still_while_the_table_moves),
        cmocka_unit_test(a_bend_that_means_too_much_pressure_is_a_disagreement),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
