/* The bridge without sockets: what passes its gate, what its messages say, how its clocks map, and that
 * everything it leaves is counted. Messages are packed and unpacked by lcm-gen's code. */
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include "comms/node.h"
#include "lcm/bridge_logs.h"
#include "lcm/bridge_messages.h"
#include "log/lcm_type.h"
#include "support/test.h"
#include "support/scratch.h"
#include "tribend_bridge_t.h"
#include "tribend_command_t.h"
#include "tribend_gap_t.h"
#include "tribend_parameter_t.h"
#include "tribend_status_t.h"
#include "tribend_tip_t.h"

#define NODE 3
#define START_HOST_US 1700000000000000
#define START_BOARD_US 5000000

/* --- a bridge with what it lets out --- */

static struct {
    struct bridge bridge;
    struct bridge_now now;
    bool no_room;
    uint64_t frames;
    struct hal_can_frame frame; /* the last */
    uint64_t messages[BRIDGE_CHANNEL_COUNT];
    uint8_t data[BRIDGE_CHANNEL_COUNT][BRIDGE_MESSAGE_BYTES];
    uint32_t bytes[BRIDGE_CHANNEL_COUNT];
    int64_t board_us;
    struct message_status status; /* as the board says it with every report */
} world;

static bool note_message(void *context, enum bridge_channel channel, const void *data, uint32_t bytes) {
    (void)context;
    world.messages[channel]++;
    memcpy(world.data[channel], data, bytes);
    world.bytes[channel] = bytes;
    return true;
}

static bool note_frame(void *context, const struct hal_can_frame *frame) {
    (void)context;
    if (world.no_room) {
        return false;
    }
    world.frames++;
    world.frame = *frame;
    return true;
}

static int set_up(void **state) {
    const struct bridge_out out = {NULL, note_message, note_frame};
    (void)state;
    memset(&world, 0, sizeof world);
    world.now = (struct bridge_now){START_HOST_US, 1000000};
    world.board_us = START_BOARD_US;
    world.status = (struct message_status){.state = SUPERVISOR_SAFE, .protocol = MESSAGE_PROTOCOL};
    bridge_init(&world.bridge, NODE, &out, &world.now);
    return 0;
}

static void pass(int64_t duration_us) {
    world.now.host_us += duration_us;
    world.now.monotonic_us += duration_us;
    world.board_us += duration_us;
    bridge_step(&world.bridge, &world.now);
}

static void board_says(enum message_id id, const void *message, int64_t late_us) {
    struct message_trouble trouble = {.out_of_range = 0};
    struct transport_frame frame = {.time_us = world.now.host_us + late_us};
    message_frame(id, NODE, message, &frame.frame, &trouble);
    bridge_take_frame(&world.bridge, &frame, &world.now);
}

static uint16_t step(void) {
    return (uint16_t)(world.board_us / 1000);
}

/* TIME, STATUS and a report of now. */
static void board_reports(int64_t late_us) {
    const struct message_time time = {.time_us = (uint64_t)world.board_us, .step = step()};
    const struct message_pressures pressures = {1000.0f, 2000.0f, NAN, step()};
    board_says(MESSAGE_TIME, &time, late_us);
    board_says(MESSAGE_STATUS, &world.status, late_us);
    board_says(MESSAGE_PRESSURES, &pressures, late_us);
}

static void sender_says(int kind, int64_t utime_us) {
    const tribend_command_t command = {
        .utime = utime_us, .kind = (int8_t)kind, .bend_urad = 500000, .direction_urad = -100000};
    uint8_t data[128];
    const int bytes = tribend_command_t_encode(data, 0, sizeof data, &command);
    bridge_take_message(&world.bridge, BRIDGE_CHANNEL_COMMAND, data, (uint32_t)bytes, &world.now);
}

static enum message_id last_command(void) {
    enum message_id id = MESSAGE_COUNT;
    (void)message_find(world.frame.id >> MESSAGE_NODE_BITS, &id);
    return id;
}

/* The board is heard for long enough that only the gate's pause counts. */
static void hear_for(int64_t duration_us) {
    for (int64_t at = 0; at < duration_us; at += 5000) {
        board_reports(0);
        pass(5000);
    }
}

/* --- the gate --- */

static void a_command_already_flying_is_refused_until_it_pauses(void **state) {
    (void)state;
    board_reports(0);
    const uint64_t before = world.frames;
    for (int i = 0; i < 100; i++) { /* 5 s at 20 Hz, from the start on */
        sender_says(COMMAND_BEND, world.now.host_us);
        hear_for(50000);
    }
    assert_int_equal(world.frames, before);
    assert_int_equal(world.bridge.counters.commands_flying, 100);
    hear_for(GATE_PAUSE_US);
    sender_says(COMMAND_BEND, world.now.host_us);
    pass(0);
    assert_int_equal(world.frames, before + 1);
    assert_int_equal(last_command(), MESSAGE_BEND_COMMAND);
    assert_int_equal(world.frame.id & MESSAGE_NODE_MOST, NODE);
}

static void an_arm_opens_the_gate_at_once(void **state) {
    (void)state;
    board_reports(0);
    sender_says(COMMAND_NONE, 1);
    sender_says(COMMAND_BEND, 2);
    pass(0);
    assert_int_equal(last_command(), MESSAGE_BEND_COMMAND);
    assert_int_equal(world.bridge.counters.commands_forwarded, 1);
}

static void a_vent_always_passes_and_shuts_the_gate(void **state) {
    (void)state;
    board_reports(0);
    sender_says(COMMAND_NONE, 1);
    sender_says(COMMAND_BEND, 2);
    sender_says(COMMAND_VENT, 0);
    pass(0);
    assert_int_equal(last_command(), MESSAGE_VENT);
    assert_int_equal(world.bridge.counters.commands_superseded, 1);
    sender_says(COMMAND_BEND, 3);
    pass(0);
    assert_int_equal(last_command(), MESSAGE_VENT);
    assert_int_equal(world.bridge.counters.commands_flying, 1);
}

static void a_board_that_was_away_shuts_the_gate(void **state) {
    (void)state;
    hear_for(20000);
    sender_says(COMMAND_NONE, 1);
    sender_says(COMMAND_BEND, 2);
    pass(0);
    assert_int_equal(world.bridge.counters.commands_forwarded, 1);
    for (int i = 0; i < 45; i++) {
        pass(50000);
        sender_says(COMMAND_BEND, 3 + i);
    }
    assert_int_equal(world.bridge.counters.board_silences, 1);
    assert_false(world.bridge.gate.is_open);
    board_reports(0);
    sender_says(COMMAND_BEND, 100);
    pass(0);
    assert_true(world.bridge.counters.commands_flying > 0);
    assert_int_equal(world.bridge.waiting.kind, COMMAND_NONE);
    assert_false(world.bridge.gate.is_open);
}

static void a_board_that_started_anew_shuts_the_gate(void **state) {
    (void)state;
    hear_for(20000);
    sender_says(COMMAND_NONE, 1);
    world.board_us = 100000;
    board_reports(0);
    assert_int_equal(world.bridge.counters.board_restarts, 1);
    assert_false(world.bridge.gate.is_open);
}

static void the_freshest_command_wins(void **state) {
    (void)state;
    board_reports(0);
    sender_says(COMMAND_NONE, 0);
    const uint64_t before = world.frames;
    sender_says(COMMAND_BEND, 10);
    sender_says(COMMAND_PRESSURE, 30);
    sender_says(COMMAND_BEND, 20);
    sender_says(COMMAND_PRESSURE, 30);
    pass(0);
    assert_int_equal(world.frames, before + 1);
    assert_int_equal(last_command(), MESSAGE_PRESSURE_COMMAND);
    assert_int_equal(world.bridge.counters.commands_superseded, 1);
    assert_int_equal(world.bridge.counters.commands_late, 2);
    pass(50000);
    assert_int_equal(world.frames, before + 1); /* once: nothing is kept alive */
}

static void what_no_frame_can_carry_is_refused(void **state) {
    (void)state;
    const tribend_command_t far = {.utime = 1, .kind = COMMAND_BEND, .bend_urad = 9000000};
    const uint8_t junk[] = {1, 2, 3};
    uint8_t data[128];
    const int bytes = tribend_command_t_encode(data, 0, sizeof data, &far);
    board_reports(0);
    sender_says(COMMAND_NONE, 0);
    sender_says(17, 5);
    bridge_take_message(&world.bridge, BRIDGE_CHANNEL_COMMAND, data, (uint32_t)bytes, &world.now);
    bridge_take_message(&world.bridge, BRIDGE_CHANNEL_COMMAND, junk, sizeof junk, &world.now);
    assert_int_equal(world.bridge.counters.commands_malformed, 3);
    assert_int_equal(world.bridge.waiting.kind, COMMAND_NONE);
}

static void every_command_is_in_one_counter(void **state) {
    (void)state;
    const struct bridge_counters *counters = &world.bridge.counters;
    uint64_t arms = 0;
    board_reports(0);
    for (int i = 0; i < 2000; i++) {
        const int kind = (i * 7919 % 97) % 8;
        arms += kind == COMMAND_NONE ? 1 : 0;
        sender_says(kind, i * 31 % 400);
        if (i % 3 == 0) {
            hear_for(i % 50 == 0 ? 1200000 : 5000);
        }
    }
    pass(0);
    assert_int_equal(counters->commands_received, 2000);
    assert_int_equal(counters->commands_forwarded + counters->commands_flying +
                         counters->commands_superseded + counters->commands_late +
                         counters->commands_malformed + arms,
                     2000);
    assert_true(counters->commands_forwarded > 0 && counters->commands_flying > 0 &&
                counters->commands_late > 0 && counters->commands_superseded > 0 &&
                counters->commands_malformed > 0);
}

static void the_end_vents_what_was_set_in_motion(void **state) {
    (void)state;
    board_reports(0);
    const uint64_t before = world.frames;
    bridge_vent(&world.bridge, &world.now);
    assert_int_equal(world.frames, before); /* another host's motion is not ours to end */
    sender_says(COMMAND_NONE, 1);
    sender_says(COMMAND_BEND, 2);
    pass(0);
    bridge_vent(&world.bridge, &world.now);
    assert_int_equal(last_command(), MESSAGE_VENT);
}

/* --- messages --- */

static void a_report_becomes_a_status(void **state) {
    (void)state;
    const struct message_bend bend = {.bend = 0.5f, .direction = -1.0f, .flags = 1u << NODE_BEND_MEASURED};
    const struct message_status status = {
        .state = SUPERVISOR_FAULT, .protocol = MESSAGE_PROTOCOL, .faults = 0x80000004u};
    tribend_status_t out;
    board_says(MESSAGE_BEND, &bend, 0);
    world.status = status;
    board_reports(0);
    assert_true(tribend_status_t_decode(world.data[BRIDGE_CHANNEL_STATUS], 0,
                                        (int)world.bytes[BRIDGE_CHANNEL_STATUS], &out) > 0);
    assert_int_equal(out.pressure_pa[0], 1000);
    assert_int_equal(out.pressure_pa[2], BRIDGE_LACKS);
    assert_int_equal(out.bend_urad, 500000);
    assert_int_equal(out.direction_urad, -1000000);
    assert_int_equal(out.bend_is_measured, 1);
    assert_int_equal(out.state, SUPERVISOR_FAULT);
    assert_int_equal((uint32_t)out.faults, 0x80000004u);
    assert_int_equal(out.utime, START_HOST_US);
}

static void a_tip_sample_becomes_a_message(void **state) {
    (void)state;
    const struct message_tip_position position = {0.01f, -0.02f, 0.06f,
                                                  (uint16_t)((START_BOARD_US - 10000) / 64)};
    const struct message_tip_orientation orientation = {1.0f, 0.0f, 0.0f, 0.0f};
    tribend_tip_t out;
    board_reports(0);
    pass(5000);
    board_says(MESSAGE_TIP_POSITION, &position, 0);
    board_says(MESSAGE_TIP_ORIENTATION, &orientation, 0);
    board_reports(0);
    assert_int_equal(world.messages[BRIDGE_CHANNEL_TIP], 1);
    assert_true(tribend_tip_t_decode(world.data[BRIDGE_CHANNEL_TIP], 0, (int)world.bytes[BRIDGE_CHANNEL_TIP],
                                     &out) > 0);
    assert_int_equal(out.position_um[1], -20000);
    assert_int_equal(out.quaternion_nano[0], 1000000000);
    assert_in_range(out.measured_utime, START_HOST_US - 10000 - 64, START_HOST_US - 10000 + 64);
}

static void the_gap_becomes_a_message(void **state) {
    (void)state;
    const struct message_gap gap = {.stage = 2, .chamber = 3, .bend_gap = 0.1f, .bend_threshold = NAN};
    tribend_gap_t out;
    board_says(MESSAGE_GAP, &gap, 0);
    assert_true(tribend_gap_t_decode(world.data[BRIDGE_CHANNEL_GAP], 0, (int)world.bytes[BRIDGE_CHANNEL_GAP],
                                     &out) > 0);
    assert_int_equal(out.stage, 2);
    assert_int_equal(out.chamber, 3);
    assert_int_equal(out.bend_gap_urad, 100000);
    assert_int_equal(out.bend_threshold_urad, BRIDGE_LACKS);
}

/* What the importer knows of the types is what lcm-gen made of them. */
static void fingerprints_are_those_of_the_generated_code(void **state) {
    (void)state;
    board_reports(0);
    uint64_t fingerprint = 0;
    for (int b = 0; b < 8; b++) {
        fingerprint = fingerprint << 8 | world.data[BRIDGE_CHANNEL_STATUS][b];
    }
    assert_string_equal(lcm_types[0].name, "status_t");
    assert_true(fingerprint == lcm_type_fingerprint(&lcm_types[0]));
    assert_int_equal(world.bytes[BRIDGE_CHANNEL_STATUS], lcm_type_bytes(&lcm_types[0]));
}

static void counters_go_into_the_status_of_the_bridge(void **state) {
    (void)state;
    tribend_bridge_t out;
    const struct transport_frame foreign = {.frame = {.id = 0x7ff}}, error = {.is_error = true};
    struct transport_frame cut = {.frame = {.id = message_identifier(MESSAGE_STATUS, NODE), .length = 3}};
    bridge_take_frame(&world.bridge, &foreign, &world.now);
    bridge_take_frame(&world.bridge, &error, &world.now);
    bridge_take_frame(&world.bridge, &cut, &world.now);
    pass(BRIDGE_STATUS_US);
    assert_true(tribend_bridge_t_decode(world.data[BRIDGE_CHANNEL_BRIDGE], 0,
                                        (int)world.bytes[BRIDGE_CHANNEL_BRIDGE], &out) > 0);
    assert_int_equal(out.frames_received, 2);
    assert_int_equal(out.frames_foreign, 1);
    assert_int_equal(out.frames_undecodable, 1);
    assert_int_equal(out.error_frames, 1);
    assert_int_equal(out.gate_is_open, 0);
#define BRIDGE_COUNTER(name, text) +sizeof out.name
    assert_int_equal(offsetof(tribend_bridge_t, frames_received) + BRIDGE_COUNTERS(BRIDGE_COUNTER),
                     sizeof out);
#undef BRIDGE_COUNTER
}

/* --- parameters --- */

static void request(int kind, int parameter) {
    const tribend_parameter_t message = {.request = (int8_t)kind, .parameter = parameter};
    uint8_t data[128];
    const int bytes = tribend_parameter_t_encode(data, 0, sizeof data, &message);
    bridge_take_message(&world.bridge, BRIDGE_CHANNEL_PARAMETER_REQUEST, data, (uint32_t)bytes, &world.now);
}

static void a_parameter_is_asked_for_and_answered(void **state) {
    (void)state;
    const struct message_parameter_value other = {.parameter = 7, .value = 1},
                                         value = {.parameter = 19, .value = 0x44480000};
    tribend_parameter_t out;
    board_reports(0);
    request(BRIDGE_PARAMETER_GET, 19);
    pass(0);
    assert_int_equal(last_command(), MESSAGE_PARAMETER_GET);
    board_says(MESSAGE_PARAMETER_VALUE, &other, 0);
    assert_int_equal(world.messages[BRIDGE_CHANNEL_PARAMETER], 0);
    board_says(MESSAGE_PARAMETER_VALUE, &value, 0);
    assert_true(tribend_parameter_t_decode(world.data[BRIDGE_CHANNEL_PARAMETER], 0,
                                           (int)world.bytes[BRIDGE_CHANNEL_PARAMETER], &out) > 0);
    assert_int_equal(out.value, 0x44480000);
    assert_int_equal(out.is_float, 1);
    assert_int_equal(out.status, 0);
}

static void unanswered_and_superfluous_requests_are_counted(void **state) {
    (void)state;
    board_reports(0);
    for (unsigned i = 0; i < BRIDGE_REQUESTS_MOST + 3; i++) {
        request(BRIDGE_PARAMETER_GET, 19);
    }
    assert_int_equal(world.bridge.counters.requests_dropped, 3);
    for (unsigned i = 0; i < BRIDGE_REQUESTS_MOST + 1; i++) {
        pass(BRIDGE_ANSWER_US);
    }
    assert_int_equal(world.bridge.counters.requests_unanswered, BRIDGE_REQUESTS_MOST);
    assert_int_equal(world.messages[BRIDGE_CHANNEL_PARAMETER], BRIDGE_REQUESTS_MOST);
    assert_int_equal(world.bridge.requests, 0);
}

static void a_full_bus_is_counted(void **state) {
    (void)state;
    board_reports(0);
    sender_says(COMMAND_NONE, 1);
    sender_says(COMMAND_BEND, 2);
    world.no_room = true;
    pass(0);
    assert_int_equal(world.bridge.counters.frames_unsent, 1);
    assert_int_equal(world.bridge.counters.commands_unsent, 1);
    assert_int_equal(world.bridge.counters.commands_forwarded, 0);
}

/* --- clocks --- */

#define DRIFT 80e-6
/* A board whose clock runs slow, reports that come 0 to 3 ms late: offset and drift are found. */
static void offset_and_drift_are_found_under_delays(void **state) {
    struct clock_map map;
    uint32_t random = 1;
    int64_t host_us = 0;
    (void)state;
    clock_map_init(&map);
    for (int64_t board_us = 0; board_us < 40000000; board_us += 5000) {
        random = random * 1664525u + 1013904223u;
        const int64_t true_us = START_HOST_US + board_us + llround(DRIFT * (double)board_us);
        clock_map_take(&map, board_us, true_us + (int64_t)(random >> 22) * 3);
    }
    assert_true(clock_map_host_us(&map, 40000000, &host_us));
    const int64_t true_us = START_HOST_US + 40000000 + llround(DRIFT * 40e6);
    assert_in_range(host_us, true_us - 20, true_us + 100);
    assert_true(fabs(map.drift - DRIFT) < 3e-6);
    assert_int_equal(map.resets, 0);
}

static void a_clock_that_jumps_is_mapped_anew(void **state) {
    struct clock_map map;
    int64_t host_us = 0;
    (void)state;
    clock_map_init(&map);
    for (int64_t board_us = 0; board_us < 5000000; board_us += 5000) {
        clock_map_take(&map, board_us, START_HOST_US + board_us + (board_us > 3000000 ? 7000000 : 0));
    }
    assert_true(map.resets == 1 && clock_map_host_us(&map, 5000000, &host_us));
    assert_in_range(host_us, START_HOST_US + 12000000 - 10, START_HOST_US + 12000000 + 10);
}

static void delays_are_told_within_nine_percent(void **state) {
    static struct latency latency;
    (void)state;
    memset(&latency, 0, sizeof latency);
    for (int64_t delay_us = 1; delay_us <= 10000; delay_us++) {
        latency_add(&latency, delay_us);
    }
    assert_true(fabs((double)latency_of(&latency, 0.5) / 5000.0 - 1.0) < 0.09);
    assert_true(fabs((double)latency_of(&latency, 0.99) / 9900.0 - 1.0) < 0.09);
}

/* --- logs --- */

static void a_log_that_is_there_is_not_touched(void **state) {
    struct bridge_logs logs;
    char path[SCRATCH_BYTES], error[256];
    (void)state;
    const int descriptor = scratch_file(path);
    assert_true(descriptor >= 0);
    (void)close(descriptor);
    const struct bridge_logs_paths paths = {.can = path};
    assert_false(bridge_logs_open(&logs, &paths, "can0", NULL, error, sizeof error));
    assert_non_null(strstr(error, path));
    assert_non_null(strstr(error, "remove it"));
    (void)remove(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_command_already_flying_is_refused_until_it_pauses, set_up),
        cmocka_unit_test_setup(an_arm_opens_the_gate_at_once, set_up),
        cmocka_unit_test_setup(a_vent_always_passes_and_shuts_the_gate, set_up),
        cmocka_unit_test_setup(a_board_that_was_away_shuts_the_gate, set_up),
        cmocka_unit_test_setup(a_board_that_started_anew_shuts_the_gate, set_up),
        cmocka_unit_test_setup(the_freshest_command_wins, set_up),
        cmocka_unit_test_setup(what_no_frame_can_carry_is_refused, set_up),
        cmocka_unit_test_setup(every_command_is_in_one_counter, set_up),
        cmocka_unit_test_setup(the_end_vents_what_was_set_in_motion, set_up),
        cmocka_unit_test_setup(a_report_becomes_a_status, set_up),
        cmocka_unit_test_setup(a_tip_sample_becomes_a_message, set_up),
        cmocka_unit_test_setup(the_gap_becomes_a_message, set_up),
        cmocka_unit_test_setup(fingerprints_are_those_of_the_generated_code, set_up),
        cmocka_unit_test_setup(counters_go_into_the_status_of_the_bridge, set_up),
        cmocka_unit_test_setup(a_parameter_is_asked_for_and_answered, set_up),
        cmocka_unit_test_setup(unanswered_and_superfluous_requests_are_counted, set_up),
        cmocka_unit_test_setup(a_full_bus_is_counted, set_up),
        cmocka_unit_test(offset_and_drift_are_found_under_delays),
        cmocka_unit_test(a_clock_that_jumps_is_mapped_anew),
        cmocka_unit_test(delays_are_told_within_nine_percent),
        cmocka_unit_test(a_log_that_is_there_is_not_touched),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
