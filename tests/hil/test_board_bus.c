/* The flashed ELF on a bad or a busy CAN bus. */
#include "comms/node.h"
#include "comms/parameters.h"
#include "hil/hil.h"

static void start_bent(uint64_t seed) {
    hil_start(seed);
    hil_bend(60.0, 45.0);
    hil_run(2500);
    hil_assert_state(SUPERVISOR_ACTIVE);
}

/* It tries again every 100 ms, fails each time, and comes back when the short is gone. */
static void shorted_wires_put_it_off_the_bus_until_they_are_mended(void **state) {
    (void)state;
    start_bent(1);
    can_bus_set_wire(&hil.board.bus, CAN_BUS_SHORTED);
    hil_run(20);
    assert_true(hil.board.fdcan.node.bus_off);
    hil_run(1480);
    assert_int_equal(hil_until_shut(1), 0); /* nobody can talk to it */
    hil_silence();
    can_bus_set_wire(&hil.board.bus, CAN_BUS_SOUND);
    hil_run(1000);
    assert_false(hil.board.fdcan.node.bus_off);
    const struct message_can_counters *counters = &hil.last[MESSAGE_CAN_COUNTERS].can_counters;
    assert_in_range(counters->bus_off_count, 12, 16);
    assert_false(counters->bus_off);
    assert_int_equal(counters->transmit_errors, 0);
    assert_true(counters->transmit_lost > 0); /* what waited had become old */
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.steps_late, 0);
    hil_assert_state(SUPERVISOR_FAULT);
    assert_true(hil_has(FAULT_CAN_BUS_OFF)); /* said as soon as it can be */
    hil_off();
}

static void a_dominant_bus_is_left_once_and_found_again(void **state) {
    (void)state;
    start_bent(7);
    while (hil.board.bus.sender != &hil.board.fdcan.node) {
        board_run(&hil.board, 20);
    }
    can_bus_set_wire(&hil.board.bus, CAN_BUS_DOMINANT);
    hil_run(1500);
    assert_true(hil.board.fdcan.node.bus_off);
    assert_int_equal(hil_until_shut(1), 0);
    hil_silence();
    can_bus_set_wire(&hil.board.bus, CAN_BUS_SOUND);
    hil_run(1000);
    assert_false(hil.board.fdcan.node.bus_off);
    assert_int_equal(hil.last[MESSAGE_CAN_COUNTERS].can_counters.bus_off_count, 1);
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.steps_late, 0);
    hil_off();
}

static void a_cut_wire_leaves_it_passive_not_off(void **state) {
    (void)state;
    start_bent(2);
    can_bus_set_wire(&hil.board.bus, CAN_BUS_OPEN);
    hil_run(1500);
    assert_int_equal(hil.board.fdcan.node.transmit_errors, 128);
    assert_false(hil.board.fdcan.node.bus_off);
    assert_int_equal(hil_until_shut(1), 0);
    can_bus_set_wire(&hil.board.bus, CAN_BUS_SOUND);
    hil_run(700);
    assert_int_equal(hil.last[MESSAGE_CAN_COUNTERS].can_counters.bus_off_count, 0);
    assert_true(hil.heard[MESSAGE_STATUS] > 0);
    hil_off();
}

static void hit_frames_are_sent_again(void **state) {
    (void)state;
    start_bent(3);
    const uint32_t refused = hil.last[MESSAGE_REFUSALS].refusals.total;
    for (int i = 0; i < 100; i++) {
        hil.board.bus.corrupt_next += 1;
        hil_run(20);
    }
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_true(hil.board.bus.errors >= 90);
    assert_int_equal(hil.last[MESSAGE_CAN_COUNTERS].can_counters.transmit_lost, 0);
    assert_int_equal(hil.last[MESSAGE_REFUSALS].refusals.total, refused);
    hil_off();
}

static struct can_host foreign;

static void flood_with(uint32_t id, uint8_t length) {
    const struct hal_can_frame flood = {.id = id, .length = length};
    assert_true(can_host_join(&foreign, &hil.board.bus));
    can_host_flood(&foreign, &flood);
}

static double load_over(int milliseconds) {
    const int64_t busy = hil.board.bus.busy_ticks, from = hil.board.core.now_ticks;
    hil_run(milliseconds);
    return (double)(hil.board.bus.busy_ticks - busy) / (double)(hil.board.core.now_ticks - from);
}

static void assert_on_schedule(uint64_t steps_before, int64_t ms_before) {
    assert_in_range(hil.board.core.step.entries - steps_before, hil.ms - ms_before - 1,
                    hil.ms - ms_before + 1);
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.steps_late, 0);
}

/* Frames for others, of the lowest rank: they fill every gap. */
static void on_a_full_bus_it_keeps_step_and_takes_its_commands(void **state) {
    (void)state;
    start_bent(4);
    const uint64_t steps = hil.board.core.step.entries;
    const int64_t ms = hil.ms;
    flood_with(0x7fe, 8);
    assert_close(load_over(1500), 1.0, 0.001);
    hil_bend(30.0, -60.0);
    assert_close(load_over(2500), 1.0, 0.001);
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_close(hil_true_bend_deg(), 30.0, 1.0);
    assert_on_schedule(steps, ms);
    assert_int_equal(hil.last[MESSAGE_CAN_COUNTERS].can_counters.receive_lost, 0);
    hil_off();
}

/* Short frames that the filters let through: every one is an interrupt, and goes through the node. */
static void a_flood_for_every_board_is_read_and_thrown_away(void **state) {
    (void)state;
    start_bent(5);
    const uint64_t steps = hil.board.core.step.entries, received = hil.board.fdcan.node.received_frames;
    const int64_t ms = hil.ms;
    flood_with(0x7f0, 0);
    hil_run(2000);
    assert_true(hil.board.fdcan.node.received_frames - received > 20000);
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_on_schedule(steps, ms);
    hil_off();
}

/* A flood that outranks its telemetry and the commands is a lost bus: it vents. */
static void a_flood_of_the_highest_rank_vents(void **state) {
    (void)state;
    start_bent(6);
    const uint64_t steps = hil.board.core.step.entries;
    const int64_t ms = hil.ms;
    flood_with(0x002, 8);
    hil_run(2000);
    assert_int_equal(hil_until_shut(1), 0);
    assert_on_schedule(steps, ms);
    can_host_flood(&foreign, NULL);
    hil_run(600);
    assert_true(hil_has(FAULT_COMMAND_TIMEOUT));
    hil_off();
}

static void set_can_fd(uint32_t value) {
    const uint16_t id = parameter_row(PARAMETER_can_fd)->id;
    const struct message_parameter_set set = {.protocol = MESSAGE_PROTOCOL, .parameter = id, .value = value};
    hil_send(MESSAGE_PARAMETER_SET, &set, sizeof set);
    hil_run(100);
    assert_int_equal(hil.last[MESSAGE_PARAMETER_VALUE].parameter_value.status, PARAMETER_OK);
}

/* The parameter holds from the next start on: until then a frame of 64 bytes could not go, and nothing behind
 * it. */
static void can_fd_is_saved_and_carries_telemetry_after_the_next_start(void **state) {
    (void)state;
    hil_start(7);
    set_can_fd(1u);
    const uint32_t pressures = hil.heard[MESSAGE_PRESSURES];
    hil_run(500);
    assert_int_equal(hil.heard[MESSAGE_TELEMETRY], 0);
    assert_in_range(hil.heard[MESSAGE_PRESSURES] - pressures, 99, 101);
    const struct message_parameter_action save = {.protocol = MESSAGE_PROTOCOL, .action = NODE_ACTION_SAVE};
    hil_send(MESSAGE_PARAMETER_ACTION, &save, sizeof save);
    hil_run(500);
    const struct message_reset reset = {.protocol = MESSAGE_PROTOCOL, .key = MESSAGE_RESET_KEY};
    hil_send(MESSAGE_RESET, &reset, sizeof reset);
    hil_run(HIL_BOOT_MS);
    assert_int_equal(hil.board.resets, 1);
    hil_bend(30.0, 20.0);
    hil_run(1000);
    memset(hil.heard, 0, sizeof hil.heard);
    hil_run(1000);
    assert_in_range(hil.heard[MESSAGE_TELEMETRY], 199, 201);
    assert_int_equal(hil.heard[MESSAGE_PRESSURES], 0);
    assert_close(hil_true_bend_deg(), 30.0, 1.0);
    assert_false(hil.board.fdcan.node.bus_off);
    hil_off();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shorted_wires_put_it_off_the_bus_until_they_are_mended),
        cmocka_unit_test(a_dominant_bus_is_left_once_and_found_again),
        cmocka_unit_test(a_cut_wire_leaves_it_passive_not_off),
        cmocka_unit_test(hit_frames_are_sent_again),
        cmocka_unit_test(on_a_full_bus_it_keeps_step_and_takes_its_commands),
        cmocka_unit_test(a_flood_for_every_board_is_read_and_thrown_away),
        cmocka_unit_test(a_flood_of_the_highest_rank_vents),
        cmocka_unit_test(can_fd_is_saved_and_carries_telemetry_after_the_next_start),
    };
    return cmocka_run_group_tests(tests, hil_open_table, hil_close_table);
}
