#include "support/test.h"

#include "safety/limits.h"
#include "safety/supervisor.h"
#include "support/synthetic_table.h"

#define ALL_REQUESTS 5

static void run_to_safe(struct supervisor *supervisor) {
    supervisor_init(supervisor);
    for (int64_t time_us = 0; supervisor->state != SUPERVISOR_SAFE; time_us += 1000) {
        assert_true(supervisor_step(supervisor, time_us, 0u, true, SUPERVISOR_REQUEST_NONE));
        assert_true(time_us < 100000);
    }
}

static void start_goes_through_self_test_to_safe(void **state) {
    (void)state;
    struct supervisor supervisor;
    supervisor_init(&supervisor);
    assert_int_equal(supervisor.state, SUPERVISOR_BOOT);
    assert_false(supervisor_valves_enabled(&supervisor));
    assert_false(supervisor_supply_enabled(&supervisor));
    (void)supervisor_step(&supervisor, 0, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
    (void)supervisor_step(&supervisor, SUPERVISOR_SELFTEST_US - 1, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
    (void)supervisor_step(&supervisor, SUPERVISOR_SELFTEST_US, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SAFE);
    assert_false(supervisor_valves_enabled(&supervisor));
}

static void an_unhealthy_module_stays_in_self_test(void **state) {
    (void)state;
    struct supervisor supervisor;
    supervisor_init(&supervisor);
    for (int64_t time_us = 0; time_us < 5000000; time_us += 1000) {
        (void)supervisor_step(&supervisor, time_us, 0u, false, SUPERVISOR_REQUEST_MOVE);
    }
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
    assert_false(supervisor_valves_enabled(&supervisor));
}

static void moves_and_holds_and_vents(void **state) {
    (void)state;
    struct supervisor supervisor;
    run_to_safe(&supervisor);
    assert_false(supervisor_step(&supervisor, 1, 0u, true, SUPERVISOR_REQUEST_HOLD)); /* nothing to hold */
    assert_true(supervisor_step(&supervisor, 2, 0u, true, SUPERVISOR_REQUEST_MOVE));
    assert_int_equal(supervisor.state, SUPERVISOR_ACTIVE);
    assert_true(supervisor_valves_enabled(&supervisor));
    assert_true(supervisor_step(&supervisor, 3, 0u, true, SUPERVISOR_REQUEST_HOLD));
    assert_int_equal(supervisor.state, SUPERVISOR_HOLD);
    assert_true(supervisor_step(&supervisor, 4, 0u, true, SUPERVISOR_REQUEST_MOVE));
    assert_int_equal(supervisor.state, SUPERVISOR_ACTIVE);
    assert_true(supervisor_step(&supervisor, 5, 0u, true, SUPERVISOR_REQUEST_VENT));
    assert_int_equal(supervisor.state, SUPERVISOR_SAFE);
    assert_false(supervisor_valves_enabled(&supervisor));
}

/* Every state, every request, every fault: a present fault always wins, and only CLEAR without a cause ends it. */
static void faults_win_over_every_request_in_every_state(void **state) {
    (void)state;
    for (int s = 0; s < (int)SUPERVISOR_STATE_COUNT; s++) {
        for (int r = 0; r < ALL_REQUESTS; r++) {
            for (int f = 0; f < (int)FAULT_COUNT; f++) {
                struct supervisor supervisor = {.state = (enum supervisor_state)s, .faults = 0u, .entered_us = 0};
                (void)supervisor_step(&supervisor, 10, 1u << (unsigned)f, true, (enum supervisor_request)r);
                assert_int_equal(supervisor.state, SUPERVISOR_FAULT);
                assert_int_equal(supervisor.faults, 1u << (unsigned)f);
                assert_false(supervisor_valves_enabled(&supervisor));
                assert_false(supervisor_supply_enabled(&supervisor));
            }
        }
    }
}

static void only_clear_without_a_cause_ends_a_fault(void **state) {
    (void)state;
    for (int r = 0; r < ALL_REQUESTS; r++) {
        struct supervisor supervisor = {.state = SUPERVISOR_FAULT, .faults = 5u, .entered_us = 0};
        const bool accepted = supervisor_step(&supervisor, 10, 0u, true, (enum supervisor_request)r);
        if (r == (int)SUPERVISOR_REQUEST_CLEAR) {
            assert_true(accepted);
            assert_int_equal(supervisor.state, SUPERVISOR_SAFE);
            assert_int_equal(supervisor.faults, 0);
        } else {
            assert_int_equal(supervisor.state, SUPERVISOR_FAULT);
            assert_int_equal(supervisor.faults, 5);
        }
    }
    struct supervisor supervisor = {.state = SUPERVISOR_FAULT, .faults = 1u, .entered_us = 0};
    assert_false(supervisor_step(&supervisor, 10, 2u, true, SUPERVISOR_REQUEST_CLEAR));
    assert_int_equal(supervisor.faults, 3);
}

static void a_move_is_refused_before_safe_and_in_fault(void **state) {
    (void)state;
    const enum supervisor_state closed[] = {SUPERVISOR_BOOT, SUPERVISOR_SELFTEST, SUPERVISOR_FAULT};
    for (size_t i = 0; i < 3; i++) {
        struct supervisor supervisor = {.state = closed[i], .faults = 0u, .entered_us = 0};
        assert_false(supervisor_step(&supervisor, 1, 0u, true, SUPERVISOR_REQUEST_MOVE));
        assert_false(supervisor_valves_enabled(&supervisor));
    }
}

static void every_state_and_fault_has_words(void **state) {
    (void)state;
    for (int s = 0; s < (int)SUPERVISOR_STATE_COUNT; s++) {
        assert_true(strlen(supervisor_state_name((enum supervisor_state)s)) > 3);
    }
    for (int f = 0; f < (int)FAULT_COUNT; f++) {
        const struct supervisor_fault_row *row = supervisor_fault_describe((enum supervisor_fault)f);
        assert_non_null(row);
        assert_true(strlen(row->name) > 5 && strlen(row->detector) > 5);
        assert_true(strlen(row->reaction) > 5 && strlen(row->clear) > 5);
    }
    for (int w = 0; w < (int)WARNING_COUNT; w++) {
        assert_true(strlen(supervisor_warning_text((enum supervisor_warning)w)) > 10);
    }
    assert_null(supervisor_fault_describe(FAULT_COUNT));
}

/* --- limits --- */

static void pressures_at_and_over_the_limits(void **state) {
    (void)state;
    struct limits_parameters parameters;
    limits_default_parameters(&parameters, NULL);
    const bool ok[3] = {true, true, true};
    const struct {
        float pressure_pa;
        uint32_t faults;
    } cases[] = {{0.0f, 0u},
                 {-2000.0f, 0u}, /* an offset of the sensor is no fault */
                 {parameters.working_pressure_pa, 0u},
                 {parameters.hard_pressure_pa, 0u},
                 {parameters.hard_pressure_pa + 1.0f, 1u << FAULT_OVERPRESSURE},
                 {parameters.sensor_least_pa - 1.0f, 1u << FAULT_SENSOR_RANGE},
                 {NAN, 1u << FAULT_SENSOR_RANGE},
                 {-INFINITY, 1u << FAULT_SENSOR_RANGE}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        for (size_t c = 0; c < 3; c++) {
            float pressure_pa[3] = {0.0f, 0.0f, 0.0f};
            pressure_pa[c] = cases[i].pressure_pa;
            assert_int_equal(limits_check_pressures(&parameters, pressure_pa, ok), cases[i].faults);
        }
    }
    const bool channel_2_lost[3] = {true, false, true};
    const float fine[3] = {1000.0f, 1000.0f, 1000.0f};
    assert_int_equal(limits_check_pressures(&parameters, fine, channel_2_lost), 1u << FAULT_SENSOR_RANGE);
}

/* Any flipped bit of the checked part is found within one round, and a sound table never is. */
static void the_running_table_check_finds_every_damage(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct limits_parameters parameters;
    struct limits limits;
    synthetic_table_create(&synthetic, 5, 10000.0, 1.0, synthetic_module);
    limits_default_parameters(&parameters, &synthetic.table);
    limits_init(&limits);
    const uint32_t round = synthetic.table.image_bytes / parameters.table_bytes_per_step + 2u;
    for (uint32_t step = 0; step < 5u * round; step++) {
        assert_false(limits_check_table(&limits, &parameters, &synthetic.table));
    }
    for (size_t byte = 16; byte < synthetic.size; byte += 101) {
        limits_init(&limits);
        for (uint32_t step = 0; step < byte % round; step++) {
            assert_false(limits_check_table(&limits, &parameters, &synthetic.table));
        }
        synthetic.image[byte] ^= 4u;
        bool found = false;
        for (uint32_t step = 0; step < 2u * round && !found; step++) {
            found = limits_check_table(&limits, &parameters, &synthetic.table);
        }
        synthetic.image[byte] ^= 4u;
        assert_true(found);
        assert_true(limits_check_table(&limits, &parameters, &synthetic.table)); /* latched: restart to go on */
    }
    synthetic_table_free(&synthetic);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_goes_through_self_test_to_safe),
        cmocka_unit_test(an_unhealthy_module_stays_in_self_test),
        cmocka_unit_test(moves_and_holds_and_vents),
        cmocka_unit_test(faults_win_over_every_request_in_every_state),
        cmocka_unit_test(only_clear_without_a_cause_ends_a_fault),
        cmocka_unit_test(a_move_is_refused_before_safe_and_in_fault),
        cmocka_unit_test(every_state_and_fault_has_words),
        cmocka_unit_test(pressures_at_and_over_the_limits),
        cmocka_unit_test(the_running_table_check_finds_every_damage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
