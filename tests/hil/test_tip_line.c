/* The tip sensor's serial line gone wrong under the flashed ELF: random bytes, half records, wrong phasing,
 * ten times the rate. It must not crash, be late, or bend on garbage, and must understand the second whole
 * record after the trouble at the latest. */
#include "hil/hil.h"
#include "sim/random.h"

#define RECORD_MS 10

static struct random_stream chance;

static void start_bent(uint64_t seed) {
    hil_start(seed);
    random_seed(&chance, seed, 77);
    hil_bend(50.0, 100.0);
    hil_run(2500);
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_close(hil_true_bend_deg(), 50.0, 1.0);
}

static uint8_t random_byte(void) {
    return (uint8_t)(256.0 * random_uniform(&chance));
}

static size_t garbage(void *context, uint8_t bytes[WIRING_RECORD_BYTES], size_t count) {
    (void)context;
    for (size_t i = 0; i < count; i++) {
        bytes[i] = random_byte();
    }
    return count;
}

static size_t half_a_record(void *context, uint8_t bytes[WIRING_RECORD_BYTES], size_t count) {
    (void)context;
    (void)bytes;
    return 1u + (size_t)((double)(count - 1) * random_uniform(&chance));
}

/* The phasing bit anywhere but where it belongs. */
static size_t wrong_phase(void *context, uint8_t bytes[WIRING_RECORD_BYTES], size_t count) {
    (void)context;
    bytes[0] &= 0x7fu;
    bytes[1u + (size_t)((double)(count - 1) * random_uniform(&chance))] |= 0x80u;
    return count;
}

static size_t one_byte_lost(void *context, uint8_t bytes[WIRING_RECORD_BYTES], size_t count) {
    const size_t lost = (size_t)((double)count * random_uniform(&chance));
    (void)context;
    memmove(bytes + lost, bytes + lost + 1u, count - lost - 1u);
    return count - 1u;
}

static size_t zeros(void *context, uint8_t bytes[WIRING_RECORD_BYTES], size_t count) {
    (void)context;
    memset(bytes, 0, count);
    bytes[0] = 0x80u;
    return count;
}

/* Records understood: each is reported. */
static uint32_t records(void) {
    return hil.heard[MESSAGE_TIP_POSITION];
}

static void assert_sound(void) {
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_int_equal(hil.board.resets, 0);
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.steps_late, 0);
    assert_under(fabs(hil_true_bend_deg() - 50.0), 8.0);
}

/* Let the trouble pass, then count records: all but the first must be understood. */
static void assert_recovers(const char *what) {
    hil.board.wiring.tamper = NULL;
    hil_run(2 * RECORD_MS); /* what was on the line, and the record that may be lost */
    const uint32_t before = records();
    hil_run(20 * RECORD_MS);
    if (records() - before < 19u || records() - before > 21u) {
        fail_msg("%s: %u records understood of 20", what, records() - before);
    }
    hil_run(600);
    assert_false(hil_warns(WARNING_TIP_LOST));
    assert_close(hil_true_bend_deg(), 50.0, 1.5);
}

static void run_trouble(const char *what, wiring_tamper tamper, uint64_t seed) {
    start_bent(seed);
    hil.board.wiring.tamper = tamper;
    hil_run(1500);
    assert_sound();
    assert_recovers(what);
    hil_off();
}

static void random_bytes_are_thrown_away(void **state) {
    (void)state;
    run_trouble("random bytes", garbage, 1);
}

static void half_records_are_thrown_away(void **state) {
    (void)state;
    run_trouble("half records", half_a_record, 2);
}

static void wrong_phasing_is_thrown_away(void **state) {
    (void)state;
    run_trouble("wrong phasing", wrong_phase, 3);
}

static void lost_bytes_cost_their_record(void **state) {
    (void)state;
    run_trouble("lost bytes", one_byte_lost, 4);
}

/* Right phasing, and nothing in it: no pose of a straight module. */
static void records_of_zeros_are_thrown_away(void **state) {
    (void)state;
    run_trouble("zeros", zeros, 8);
}

/* One bad record between good ones costs at most itself and the next. */
static void one_bad_record_costs_at_most_two(void **state) {
    static const wiring_tamper troubles[] = {garbage, half_a_record, wrong_phase, one_byte_lost, zeros};
    (void)state;
    start_bent(5);
    for (int i = 0; i < 40; i++) {
        const uint32_t before = records();
        hil.board.wiring.tamper = troubles[i % 5];
        hil_run(RECORD_MS);
        hil.board.wiring.tamper = NULL;
        hil_run(10 * RECORD_MS);
        assert_in_range(records() - before, 9, 12);
    }
    assert_sound();
    hil_off();
}

/* Records without a pause, a thousand a second as the sensor would have it: the line carries 640 of them. */
static void ten_times_the_rate_is_taken(void **state) {
    (void)state;
    start_bent(6);
    hil.board.wiring.parameters.sensor.tip_period_us = 1000;
    hil_run(1500);
    assert_sound();
    assert_in_range(hil.board.wiring.tip_dropped, 400, 700); /* of 1500, the line carries two thirds */
    assert_int_equal(hil.board.usart.overruns, 0);
    hil_off();
}

/* A line that never stops, with bytes of no meaning. */
static void a_babbling_sensor_is_no_load(void **state) {
    uint8_t babble[512];
    (void)state;
    start_bent(7);
    hil.board.wiring.faults.tip_stops = true;
    for (int i = 0; i < 30; i++) {
        for (size_t k = 0; k < sizeof babble; k++) {
            babble[k] = i % 2 == 0 ? 0xffu : random_byte();
        }
        wiring_send_bytes(&hil.board.wiring, babble, sizeof babble);
        hil_run(44);
    }
    assert_sound();
    assert_true(hil_warns(WARNING_TIP_LOST));
    hil.board.wiring.faults.tip_stops = false;
    hil_run(100);
    assert_recovers("babble");
    hil_off();
}

/* What else goes wrong meanwhile is seen as soon as ever: a reading that is lost, one over the limit, a valve that sticks. */
static void no_fault_is_missed_under_a_bad_line(void **state) {
    static const wiring_tamper troubles[] = {garbage, half_a_record, wrong_phase, one_byte_lost, zeros, NULL};
    (void)state;
    for (size_t i = 0; i < sizeof troubles / sizeof troubles[0]; i++) {
        for (int fault = 0; fault < 3; fault++) {
            start_bent(20 + i);
            hil.board.wiring.tamper = troubles[i];
            hil.board.wiring.parameters.sensor.tip_period_us = 1000; /* ten times the rate as well */
            hil_run(300);
            hil_assert_state(SUPERVISOR_ACTIVE);
            hil.board.wiring.faults.channel_fails[1] = fault == 0;
            hil.board.wiring.faults.reading_replaced[0] = fault == 1;
            hil.board.wiring.faults.reading_pa[0] = 20000.0f;
            hil.board.wiring.plant.valve[2].stuck = fault == 2 ? VALVE_STUCK_FILLING : hil.board.wiring.plant.valve[2].stuck;
            hil_watch();
            int taken_ms = 0;
            while (hil.board.wiring.supply_open && taken_ms < 500) {
                hil_run(1);
                taken_ms++;
            }
            assert_in_range(taken_ms, 0, fault == 2 ? 400 : 4);
            assert_false(hil.board.wiring.coils_driven);
            hil_run(60);
            assert_true(hil_has(fault == 0 ? FAULT_SENSOR_RANGE : fault == 1 ? FAULT_OVERPRESSURE : FAULT_VALVE_STUCK_FILLING));
            assert_under(fmax(fmax(hil.most_pa[0], hil.most_pa[1]), hil.most_pa[2]),
                         (double)hil_file.table.module.working_pressure_pa);
            assert_int_equal(hil.board.resets, 0);
            hil_off();
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_bytes_are_thrown_away),     cmocka_unit_test(half_records_are_thrown_away),
        cmocka_unit_test(wrong_phasing_is_thrown_away),     cmocka_unit_test(lost_bytes_cost_their_record),
        cmocka_unit_test(records_of_zeros_are_thrown_away),
        cmocka_unit_test(one_bad_record_costs_at_most_two), cmocka_unit_test(ten_times_the_rate_is_taken),
        cmocka_unit_test(a_babbling_sensor_is_no_load),
        cmocka_unit_test(no_fault_is_missed_under_a_bad_line),
    };
    return cmocka_run_group_tests(tests, hil_open_table, hil_close_table);
}
