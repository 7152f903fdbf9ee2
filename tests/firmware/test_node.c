#include "support/test.h"

#include <stdlib.h>

#include "comms/node.h"
#include "control/crc32.h"
#include "program/table_file.h"
#include "sim/sim_hal.h"
#include "support/sim_bus.h"
#include "support/sim_storage.h"

#define TABLE "tables/paper-semicircle.tbt"
#define SLOT_BYTES SIM_STORAGE_TABLE_BYTES
#define NODE 1u
#define READING_GAIN_1 100u
#define CAN_FD 4u
#define SLOWDOWN 5u
#define WORKING_PRESSURE 24u

static struct table_file file;
static struct sim sim;
static struct hal hal;
static struct sim_bus bus;
static struct sim_storage storage;
static struct node_setup setup;
static struct node node;
static uint8_t sequence;
static uint32_t most_sent; /* in one step */

static int open_table(void **state) {
    (void)state;
    return table_file_open(&file, TABLE, NULL);
}

static int close_table(void **state) {
    (void)state;
    table_file_close(&file);
    return 0;
}

/* --- a board with a module */

static void step(void) {
    const uint32_t before = bus.sent;
    node_step(&node);
    (void)app_step(&node.app);
    node_report(&node);
    sim_advance(&sim, CONTROLLER_STEP_US);
    most_sent = bus.sent - before > most_sent ? bus.sent - before : most_sent;
}

static void run(int steps) {
    for (int i = 0; i < steps; i++) {
        step();
    }
}

static void power_up(void) {
    struct sim_parameters parameters;
    sim_default_parameters(&parameters);
    sim_init(&sim, &file.table, &parameters, 5u);
    sim_bind(&sim, &hal);
    sim_bus_init(&bus);
    sim_storage_power_up(&storage);
    node_init(&node, &setup);
    most_sent = 0u;
}

static enum supervisor_state state_of_node(void) {
    return node.app.controller.status.state;
}

static void run_to_safe(void) {
    for (int steps = 0; state_of_node() != SUPERVISOR_SAFE; steps++) {
        step();
        assert_true(steps < 1000);
    }
}

/* A new board with the reference table, and storage that holds nothing; up to SAFE. */
static void start(void) {
    sim_storage_init(&storage, SLOT_BYTES);
    setup = (struct node_setup){.hal = &hal,
                                .bus = &bus.hal,
                                .storage = &storage.hal,
                                .table_image = file.table.image,
                                .table_bytes = file.table.image_bytes,
                                .firmware = 0x12345678u};
    sequence = 0u;
    power_up();
    run_to_safe();
}

/* --- the host */

static void put_to(enum message_id id, uint32_t address, const void *message) {
    struct message_trouble trouble = {0};
    struct hal_can_frame frame;
    message_frame(id, address, message, &frame, &trouble);
    sim_bus_put(&bus, &frame);
}

static void put(enum message_id id, const void *message) {
    put_to(id, NODE, message);
}

static void put_bend(float bend, float direction) {
    const struct message_bend_command command = {
        .sequence = ++sequence, .protocol = MESSAGE_PROTOCOL, .bend = bend, .direction = direction};
    put(MESSAGE_BEND_COMMAND, &command);
}

static void put_pressure(float pressure_pa) {
    const struct message_pressure_command command = {
        .sequence = ++sequence, .protocol = MESSAGE_PROTOCOL, .pressure_1 = pressure_pa};
    put(MESSAGE_PRESSURE_COMMAND, &command);
}

static void put_heartbeat(void) {
    const struct message_host_heartbeat heartbeat = {.sequence = ++sequence, .protocol = MESSAGE_PROTOCOL};
    put(MESSAGE_HOST_HEARTBEAT, &heartbeat);
}

static void put_hold(void) {
    const struct message_hold hold = {.sequence = ++sequence, .protocol = MESSAGE_PROTOCOL};
    put(MESSAGE_HOLD, &hold);
}

static void put_vent(uint32_t address) {
    const struct message_vent vent = {.sequence = ++sequence, .protocol = MESSAGE_PROTOCOL};
    put_to(MESSAGE_VENT, address, &vent);
}

static void put_clear(uint32_t faults) {
    const struct message_clear clear = {
        .sequence = ++sequence, .protocol = MESSAGE_PROTOCOL, .key = MESSAGE_CLEAR_KEY, .faults = faults};
    put(MESSAGE_CLEAR, &clear);
}

static void run_with_heartbeats(int steps) {
    for (int i = 0; i < steps; i++) {
        if (i % 100 == 0) {
            put_heartbeat();
        }
        step();
    }
}

/* The newest message of this kind that the node sent. */
static bool last_sent(enum message_id id, void *message) {
    const uint32_t oldest = bus.sent > SIM_BUS_FRAMES ? bus.sent - SIM_BUS_FRAMES : 0u;
    for (uint32_t i = bus.sent; i > oldest; i--) {
        const struct hal_can_frame *frame = &bus.out[(i - 1u) % SIM_BUS_FRAMES];
        if (frame->id == message_identifier(id, node.node_id)) {
            struct message_trouble trouble = {0};
            assert_int_equal(frame->length, message_row(id)->bytes);
            message_unpack(id, frame->data, message, &trouble);
            return true;
        }
    }
    return false;
}

static uint32_t count_sent(enum message_id id) {
    uint32_t count = 0;
    assert_true(bus.sent <= SIM_BUS_FRAMES);
    for (uint32_t i = 0; i < bus.sent; i++) {
        count += bus.out[i].id == message_identifier(id, NODE) ? 1u : 0u;
    }
    return count;
}

/* One request, and its answer. */
static struct message_parameter_value request(enum message_id id, const void *message) {
    struct message_parameter_value value;
    sim_bus_forget(&bus);
    put(id, message);
    for (int steps = 0; !last_sent(MESSAGE_PARAMETER_VALUE, &value); steps++) {
        step();
        assert_true(steps < 3000);
    }
    return value;
}

static struct message_parameter_value set_parameter(uint32_t id, uint32_t value) {
    const struct message_parameter_set message = {
        .protocol = MESSAGE_PROTOCOL, .parameter = (uint16_t)id, .value = value};
    return request(MESSAGE_PARAMETER_SET, &message);
}

static struct message_parameter_value get_parameter(uint32_t id) {
    const struct message_parameter_get message = {.protocol = MESSAGE_PROTOCOL, .parameter = (uint16_t)id};
    return request(MESSAGE_PARAMETER_GET, &message);
}

static struct message_parameter_value act(enum node_action action) {
    const struct message_parameter_action message = {.protocol = MESSAGE_PROTOCOL, .action = (uint8_t)action};
    return request(MESSAGE_PARAMETER_ACTION, &message);
}

static uint32_t bits_of(float value) {
    uint32_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* One frame is refused, for this reason and no other, and the next REFUSALS says so. */
static void assert_refused(enum node_refusal reason, enum message_id id) {
    struct message_refusals refusals;
    const uint32_t count = node.refused[reason].count, total = node.counters.refused,
                   accepted = node.counters.accepted;
    sim_bus_forget(&bus);
    for (int steps = 0; !last_sent(MESSAGE_REFUSALS, &refusals) || refusals.reason != (uint8_t)reason;
         steps++) {
        step();
        assert_true(steps < 5);
    }
    assert_int_equal(node.refused[reason].count, count + 1u);
    assert_int_equal(node.counters.refused, total + 1u);
    assert_int_equal(node.counters.accepted, accepted);
    assert_int_equal(refusals.message, message_row(id)->number);
    assert_int_equal(refusals.count, count + 1u);
    assert_int_equal(refusals.total, total + 1u);
}

/* --- commands */

static void a_bend_command_bends_the_module(void **state) {
    (void)state;
    struct message_bend bend;
    struct message_status status;
    struct message_tip_position position;
    start();
    put_bend(0.6f, 0.5f);
    run_with_heartbeats(3000);
    assert_true(last_sent(MESSAGE_BEND, &bend));
    assert_close(bend.bend, 0.6, 0.02);
    assert_close(bend.direction, 0.5, 0.03);
    assert_int_equal(bend.flags, 1u << NODE_BEND_MEASURED);
    assert_true(last_sent(MESSAGE_STATUS, &status));
    assert_int_equal(status.state, SUPERVISOR_ACTIVE);
    assert_int_equal(status.protocol, MESSAGE_PROTOCOL);
    assert_int_equal(status.faults, 0);
    assert_true(last_sent(MESSAGE_TIP_POSITION, &position));
    assert_close(atan2((double)position.y, (double)position.x), 0.5, 0.05);
    assert_int_equal(node.counters.reported.out_of_range, 0);
}

static void pressures_and_hold_are_taken(void **state) {
    (void)state;
    struct message_targets targets;
    struct message_estimates estimates;
    start();
    put_pressure(6000.0f);
    run_with_heartbeats(1500);
    assert_true(last_sent(MESSAGE_TARGETS, &targets));
    assert_close(targets.target_1, 6000.0, 0.5);
    put_hold();
    run_with_heartbeats(1500);
    assert_int_equal(state_of_node(), SUPERVISOR_HOLD);
    assert_true(last_sent(MESSAGE_ESTIMATES, &estimates));
    assert_close(estimates.estimate_1, 6000.0, 200.0);
    put_vent(NODE);
    step();
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
}

static void without_commands_or_heartbeats_the_module_vents(void **state) {
    (void)state;
    start();
    put_bend(0.4f, 0.0f);
    run_with_heartbeats(1000);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    run(399);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    run(103);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    assert_int_equal(node.app.controller.status.faults, 1u << FAULT_COMMAND_TIMEOUT);
    run_with_heartbeats(1000);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
}

static void a_heartbeat_starts_nothing(void **state) {
    (void)state;
    start();
    run_with_heartbeats(700);
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
    put_bend(0.4f, 0.0f);
    run_with_heartbeats(300);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    put_vent(NODE);
    run_with_heartbeats(1000);
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
    put_bend(0.4f, 0.0f);
    run(700); /* times out */
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    run(1000);
    put_clear(1u << FAULT_COMMAND_TIMEOUT);
    run_with_heartbeats(1000);
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
}

static void vent_is_obeyed_whatever_it_holds(void **state) {
    (void)state;
    for (int variant = 0; variant < 5; variant++) {
        struct hal_can_frame frame = {.id = message_identifier(MESSAGE_VENT, variant == 3 ? 0u : NODE),
                                      .length = (uint8_t)(variant == 1 ? 8 : 2),
                                      .data = {sequence, 15}};
        frame.length = variant == 0 ? 0 : frame.length;
        frame.fd = variant == 4;
        start();
        put_bend(0.4f, 0.0f);
        run_with_heartbeats(300);
        assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
        sim_bus_put(&bus, &frame);
        step();
        assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
        run_with_heartbeats(700);
        assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
        assert_int_equal(node.counters.refused, 0);
    }
}

static void vent_wins_over_what_comes_in_the_same_step(void **state) {
    (void)state;
    start();
    put_bend(0.4f, 0.0f);
    run_with_heartbeats(300);
    put_bend(0.5f, 0.0f);
    put_vent(NODE);
    step();
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
    run(600);
    put_bend(0.4f, 0.0f);
    run_with_heartbeats(300);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    put_vent(NODE);
    put_bend(0.5f, 0.0f);
    put_heartbeat();
    step();
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
    assert_int_equal(node.refused[NODE_REFUSED_STATE].count, 1);
}

static void a_clear_must_name_the_faults_and_hold_the_key(void **state) {
    (void)state;
    struct message_clear clear = {.protocol = MESSAGE_PROTOCOL, .key = MESSAGE_CLEAR_KEY ^ 1u};
    start();
    put_bend(0.4f, 0.0f);
    run(700);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    run(1000);
    clear.faults = 1u << FAULT_COMMAND_TIMEOUT;
    clear.sequence = ++sequence;
    put(MESSAGE_CLEAR, &clear);
    assert_refused(NODE_REFUSED_KEY, MESSAGE_CLEAR);
    put_clear(0u);
    assert_refused(NODE_REFUSED_UNSEEN_FAULT, MESSAGE_CLEAR);
    put_clear(UINT32_MAX);
    assert_refused(NODE_REFUSED_UNSEEN_FAULT, MESSAGE_CLEAR);
    run(1000);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    put_clear(1u << FAULT_COMMAND_TIMEOUT);
    run(1000);
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
    assert_int_equal(node.app.controller.status.faults, 0);
}

/* --- refusals */

static void a_sequence_that_stands_still_or_goes_back_is_stale(void **state) {
    (void)state;
    start();
    put_bend(0.3f, 0.0f);
    run(2);
    sequence--;
    put_bend(0.4f, 0.0f); /* the same again */
    assert_refused(NODE_REFUSED_STALE, MESSAGE_BEND_COMMAND);
    sequence = (uint8_t)(sequence - 2u);
    put_heartbeat();
    assert_refused(NODE_REFUSED_STALE, MESSAGE_HOST_HEARTBEAT);
    sequence = (uint8_t)(sequence + 1u + 128u); /* half way round: old rather than new */
    put_bend(0.4f, 0.0f);
    assert_refused(NODE_REFUSED_STALE, MESSAGE_BEND_COMMAND);
    assert_close(node.app.controller.active.bend_rad, 0.3, 1e-6);
    sequence = (uint8_t)(sequence - 129u + 3u);
    put_bend(0.5f, 0.0f);
    run(2);
    assert_close(node.app.controller.active.bend_rad, 0.5, 1e-6);
    assert_int_equal(node.counters.sequence_lost, 3);
}

static void the_sequence_wraps(void **state) {
    (void)state;
    start();
    sequence = 250u;
    for (int i = 0; i < 600; i++) {
        put_pressure(1000.0f + (float)i);
        step();
    }
    assert_int_equal(node.counters.refused, 0);
    assert_int_equal(node.counters.sequence_lost, 0);
    assert_close(node.app.controller.active.pressure_pa[0], 1599.0, 0.0);
}

/* A frozen sender repeats one frame for ever: its command runs out like any other. */
static void a_frozen_sender_keeps_nothing_alive(void **state) {
    (void)state;
    start();
    for (int i = 0; i < 600; i++) {
        const struct message_pressure_command command = {
            .sequence = 9u, .protocol = MESSAGE_PROTOCOL, .pressure_1 = 3000.0f};
        put(MESSAGE_PRESSURE_COMMAND, &command);
        step();
    }
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    assert_true(node.refused[NODE_REFUSED_STALE].count > 400u);
}

/* Neither does it move the module once the fault is cleared. */
static void a_frozen_sender_starts_nothing_after_a_clear(void **state) {
    (void)state;
    start();
    for (int i = 0; i < 3000; i++) {
        const struct message_pressure_command command = {
            .sequence = 9u, .protocol = MESSAGE_PROTOCOL, .pressure_1 = 3000.0f};
        put(MESSAGE_PRESSURE_COMMAND, &command);
        if (i == 1500) {
            sequence = 20u;
            put_clear(1u << FAULT_COMMAND_TIMEOUT);
        }
        step();
    }
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
}

/* A host that did not notice the fault goes on commanding: after the clear it must pause first, and is told
 * so. */
static void a_stream_that_went_on_through_a_fault_must_pause(void **state) {
    (void)state;
    start();
    put_pressure(3000.0f);
    run(2);
    sim.faults.channel_fails[1] = true;
    run(200);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    sim.faults.channel_fails[1] = false;
    for (int i = 0; i < 2000; i++) {
        if (i == 1000) {
            put_clear(node.app.controller.status.faults);
        } else if (i % 50 == 0) {
            put_pressure(3000.0f);
        }
        step();
    }
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
    assert_true(node.refused[NODE_REFUSED_STATE].count > 10u);
    assert_true(node.refused[NODE_REFUSED_CONTROLLER].count > 10u);
    assert_int_equal(node.refused[NODE_REFUSED_CONTROLLER].message,
                     message_row(MESSAGE_PRESSURE_COMMAND)->number);
    run(600);
    put_pressure(3000.0f);
    run(2);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
}

/* A board that restarts in mid motion: frames of the host that did not notice start nothing, however slowly they come. */
static void a_stream_that_flew_at_a_restart_must_pause(void **state) {
    (void)state;
    static const int periods[] = {20, 100, 350, 490};
    for (size_t p = 0; p < sizeof periods / sizeof periods[0]; p++) {
        start();
        power_up();
        for (int i = 0; i < 3000; i++) {
            if ((i + 30) % periods[p] == 0) {
                put_bend(0.4f, 0.0f);
            }
            step();
            assert_false(supervisor_valves_enabled(&node.app.controller.supervisor));
        }
        assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
        assert_int_equal(node.app.controller.status.faults, 0);
        assert_true(node.refused[NODE_REFUSED_CONTROLLER].count >= 5u);
        run(500);
        put_bend(0.4f, 0.0f);
        run(2);
        assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    }
}

static void a_clear_whose_cause_is_still_there_is_refused(void **state) {
    (void)state;
    start();
    sim.faults.channel_fails[1] = true;
    run(1000);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    put_clear(node.app.controller.status.faults);
    assert_refused(NODE_REFUSED_CONTROLLER, MESSAGE_CLEAR);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
}

/* A host that was started anew counts from anywhere. */
static void after_a_pause_any_sequence_will_do(void **state) {
    (void)state;
    start();
    sequence = 100u;
    put_bend(0.3f, 0.0f);
    run_with_heartbeats(200);
    put_vent(NODE);
    run(600);
    sequence = 3u;
    put_bend(0.3f, 0.0f);
    run(2);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    assert_int_equal(node.counters.refused, 0);
}

static void every_message_of_another_length_is_refused(void **state) {
    (void)state;
    start();
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const enum message_id id = (enum message_id)m;
        if (message_row(id)->direction == MESSAGE_TO_HOST || id == MESSAGE_VENT) {
            continue;
        }
        for (uint32_t length = 0; length <= HAL_CAN_DATA_BYTES;
             length = length < 8u ? length + 1u : length * 2u) {
            struct hal_can_frame frame = {.id = message_identifier(id, NODE), .length = (uint8_t)length};
            frame.data[1] = MESSAGE_PROTOCOL;
            if (length != message_row(id)->bytes) {
                sim_bus_put(&bus, &frame);
                assert_refused(NODE_REFUSED_LENGTH, id);
            }
        }
    }
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
}

static void every_command_of_another_version_is_refused(void **state) {
    (void)state;
    start();
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const enum message_id id = (enum message_id)m;
        const bool any = id == MESSAGE_VENT || id == MESSAGE_TRANSFER_DATA || id == MESSAGE_RESET ||
                         id == MESSAGE_IDENTIFY;
        if (message_row(id)->direction == MESSAGE_TO_HOST || any) {
            continue;
        }
        for (uint8_t version = 0; version < 16u; version++) {
            struct hal_can_frame frame = {.id = message_identifier(id, NODE),
                                          .length = message_row(id)->bytes};
            frame.data[1] = version;
            if (version != MESSAGE_PROTOCOL) {
                sim_bus_put(&bus, &frame);
                assert_refused(NODE_REFUSED_VERSION, id);
            }
        }
    }
}

static void numbers_out_of_range_are_refused(void **state) {
    (void)state;
    const uint16_t words[][3] = {{60001, 0, 0}, {0, 65535, 0}, {0, 0, 60001}};
    start();
    for (int w = 0; w < 3; w++) {
        struct hal_can_frame frame = {.id = message_identifier(MESSAGE_PRESSURE_COMMAND, NODE), .length = 8};
        frame.data[0] = ++sequence;
        frame.data[1] = MESSAGE_PROTOCOL;
        memcpy(frame.data + 2, words[w], 6);
        sim_bus_put(&bus, &frame);
        assert_refused(NODE_REFUSED_RANGE, MESSAGE_PRESSURE_COMMAND);
    }
    const uint16_t bends[][3] = {{31417, 0, 0}, {0, 31417, 0}, {0, 0x8000, 0}, {0, 0, 60001}};
    for (int b = 0; b < 4; b++) {
        struct hal_can_frame frame = {.id = message_identifier(MESSAGE_BEND_COMMAND, NODE), .length = 8};
        frame.data[0] = ++sequence;
        frame.data[1] = MESSAGE_PROTOCOL;
        memcpy(frame.data + 2, bends[b], 6);
        sim_bus_put(&bus, &frame);
        assert_refused(NODE_REFUSED_RANGE, MESSAGE_BEND_COMMAND);
    }
    const struct message_parameter_action action = {.protocol = MESSAGE_PROTOCOL,
                                                    .action = NODE_ACTION_COUNT};
    put(MESSAGE_PARAMETER_ACTION, &action);
    assert_refused(NODE_REFUSED_RANGE, MESSAGE_PARAMETER_ACTION);
    const struct message_transfer_begin begin = {
        .protocol = MESSAGE_PROTOCOL, .kind = TRANSFER_KIND_COUNT, .bytes = 9};
    put(MESSAGE_TRANSFER_BEGIN, &begin);
    assert_refused(NODE_REFUSED_RANGE, MESSAGE_TRANSFER_BEGIN);
    assert_int_equal(state_of_node(), SUPERVISOR_SAFE);
}

static void commands_out_of_place_are_refused(void **state) {
    (void)state;
    start();
    put_hold();
    assert_refused(NODE_REFUSED_STATE, MESSAGE_HOLD); /* there is nothing to hold */
    put_bend(0.4f, 0.0f);
    run(700);
    assert_int_equal(state_of_node(), SUPERVISOR_FAULT);
    put_bend(0.4f, 0.0f);
    assert_refused(NODE_REFUSED_STATE, MESSAGE_BEND_COMMAND);
    put_pressure(1000.0f);
    assert_refused(NODE_REFUSED_STATE, MESSAGE_PRESSURE_COMMAND);
}

static void only_vent_and_identify_go_to_every_board(void **state) {
    (void)state;
    struct message_identity identity;
    start();
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const enum message_id id = (enum message_id)m;
        if (message_row(id)->direction == MESSAGE_TO_BOARD && id != MESSAGE_VENT && id != MESSAGE_IDENTIFY) {
            struct hal_can_frame frame = {.id = message_identifier(id, 0u), .length = message_row(id)->bytes};
            frame.data[1] = MESSAGE_PROTOCOL;
            sim_bus_put(&bus, &frame);
            assert_refused(NODE_REFUSED_BROADCAST, id);
        }
    }
    const struct message_identify identify = {.protocol = 9};
    put_to(MESSAGE_IDENTIFY, 0u, &identify);
    run(5);
    assert_true(last_sent(MESSAGE_IDENTITY, &identity));
    assert_int_equal(identity.protocol, MESSAGE_PROTOCOL);
}

static void without_a_table_a_bend_is_refused_and_pressures_are_taken(void **state) {
    (void)state;
    struct message_identity_table identity;
    const struct message_identify identify = {.protocol = MESSAGE_PROTOCOL};
    start();
    setup.table_image = NULL;
    power_up();
    run_to_safe();
    put_bend(0.4f, 0.0f);
    assert_refused(NODE_REFUSED_NO_TABLE, MESSAGE_BEND_COMMAND);
    put_pressure(1000.0f);
    put(MESSAGE_IDENTIFY, &identify);
    run(20);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    assert_true(last_sent(MESSAGE_IDENTITY_TABLE, &identity));
    assert_true(identity.table_hash == 0);
}

static void another_board_with_this_id_is_noticed(void **state) {
    (void)state;
    const struct message_status status = {.state = SUPERVISOR_ACTIVE};
    start();
    put(MESSAGE_STATUS, &status);
    assert_refused(NODE_REFUSED_DUPLICATE_NODE, MESSAGE_STATUS);
    put_to(MESSAGE_STATUS, 2u, &status); /* another board's */
    step();
    assert_int_equal(node.refused[NODE_REFUSED_DUPLICATE_NODE].count, 1);
    assert_int_equal(node.counters.foreign, 1);
}

/* --- other people's frames */

static void foreign_frames_are_skipped_and_counted(void **state) {
    (void)state;
    start();
    const struct hal_can_frame foreign[] = {{.id = 0x7ff, .length = 8},
                                            {.id = message_identifier(MESSAGE_VENT, 2u), .length = 2},
                                            {.id = message_identifier(MESSAGE_VENT, NODE), .extended = true},
                                            {.id = 0x18ff0011u, .extended = true, .length = 8},
                                            {.id = 0xffffffffu},
                                            {.id = 0x7e1, .length = 8}};
    put_bend(0.4f, 0.0f);
    run(2);
    for (int i = 0; i < 6; i++) {
        sim_bus_put(&bus, &foreign[i]);
    }
    step();
    assert_int_equal(node.counters.foreign, 6);
    assert_int_equal(node.counters.refused, 0);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
}

/* A full bus of 0-byte frames, 1 Mbit/s: 21 a step. Own commands come through in the step in which they
 * arrive. */
static void a_bus_full_of_foreign_frames_delays_no_command(void **state) {
    (void)state;
    const struct hal_can_frame foreign = {.id = 0x123};
    start();
    for (int i = 0; i < 1000; i++) {
        for (int f = 0; f < 21; f++) {
            sim_bus_put(&bus, &foreign);
            if (f == 10 && i % 50 == 0) {
                put_pressure(1000.0f + (float)i);
            }
        }
        step();
        assert_int_equal(bus.in_first, bus.in_end);
        assert_close(node.app.controller.active.pressure_pa[0], 1000.0 + i / 50 * 50, 0.0);
    }
    assert_int_equal(node.counters.foreign, 21000);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
}

static void a_step_takes_a_bounded_number_of_frames(void **state) {
    (void)state;
    const struct hal_can_frame foreign = {.id = 0x123};
    start();
    for (int f = 0; f < 200; f++) {
        sim_bus_put(&bus, &foreign);
    }
    bus.receives = 0;
    step();
    assert_int_equal(bus.receives, NODE_FRAMES_A_STEP);
    run(20);
    for (int f = 0; f < 30; f++) {
        put_heartbeat();
    }
    bus.receives = 0;
    step();
    assert_int_equal(bus.receives, NODE_COMMANDS_A_STEP);
    run(30 / (int)NODE_COMMANDS_A_STEP - 1);
    assert_int_equal(node.counters.accepted, 30);
}

/* --- telemetry */

static void every_telemetry_message_keeps_its_period(void **state) {
    (void)state;
    start();
    put_bend(0.4f, 0.0f);
    run_with_heartbeats(1000);
    sim_bus_forget(&bus);
    most_sent = 0u;
    run_with_heartbeats(2000);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        if (row->period_ms > 0u && (enum message_id)m != MESSAGE_TELEMETRY) {
            const uint32_t expected = 2000u / row->period_ms, sent = count_sent((enum message_id)m);
            assert_true(sent >= expected && sent <= expected + 1u);
        }
    }
    assert_in_range(count_sent(MESSAGE_TIP_POSITION), 199, 201);
    assert_in_range(count_sent(MESSAGE_TIP_ORIENTATION), 199, 201);
    assert_int_equal(count_sent(MESSAGE_TELEMETRY), 0);
    assert_int_equal(most_sent, NODE_REPORTS_A_STEP);
    assert_int_equal(node.counters.reports_dropped, 0);
}

/* Two commands in every step leave each message its turn, if not each of its turns. */
static void a_flood_of_commands_starves_no_telemetry(void **state) {
    (void)state;
    start();
    sim_bus_forget(&bus);
    for (int i = 0; i < 2000; i++) {
        put_pressure(1000.0f);
        put_heartbeat();
        const uint32_t before = bus.sent;
        step();
        assert_true(bus.sent - before <= 1u);
    }
    assert_int_equal(node.counters.refused, 0);
    assert_in_range(count_sent(MESSAGE_PRESSURES), 340, 401);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const uint32_t period_ms = message_row((enum message_id)m)->period_ms;
        if (period_ms > 0u && (enum message_id)m != MESSAGE_TELEMETRY) {
            assert_true(count_sent((enum message_id)m) >= 1700u / period_ms);
        }
    }
}

static void a_new_state_is_said_at_once(void **state) {
    (void)state;
    struct message_status status;
    start();
    run(23);
    put_bend(0.4f, 0.0f);
    sim_bus_forget(&bus);
    run(2);
    assert_true(last_sent(MESSAGE_STATUS, &status));
    assert_int_equal(status.state, SUPERVISOR_ACTIVE);
    sim.faults.channel_fails[1] = true;
    for (int steps = 0; state_of_node() != SUPERVISOR_FAULT; steps++) {
        step();
        assert_true(steps < 100);
    }
    run(2);
    assert_true(last_sent(MESSAGE_STATUS, &status));
    assert_int_equal(status.state, SUPERVISOR_FAULT);
    assert_int_equal(status.faults, node.app.controller.status.faults);
    assert_int_not_equal(status.faults, 0);
}

static void readings_that_are_missing_are_said_to_be(void **state) {
    (void)state;
    struct message_pressures pressures;
    struct message_duties duties;
    start();
    sim.faults.channel_fails[1] = true;
    sim.faults.supply_unknown = true;
    run(20);
    assert_true(last_sent(MESSAGE_PRESSURES, &pressures));
    assert_true(!isnan(pressures.pressure_1));
    assert_true(isnan(pressures.pressure_2));
    assert_true(last_sent(MESSAGE_DUTIES, &duties));
    assert_true(isnan(duties.supply));
    assert_int_equal(node.counters.reported.out_of_range, 0);
    assert_true(node.counters.reported.lacking > 0);
}

/* TIME and the steps give every sample its board time. */
static void the_step_of_a_sample_leads_to_its_time(void **state) {
    (void)state;
    struct message_pressures pressures;
    struct message_time time;
    start();
    run(777);
    assert_true(last_sent(MESSAGE_TIME, &time));
    assert_true(last_sent(MESSAGE_PRESSURES, &pressures));
    const int64_t now_us = node.app.input.time_us;
    const int64_t since = (int16_t)(uint16_t)(pressures.step - time.step);
    const int64_t pressures_us = (int64_t)time.time_us + since * CONTROLLER_STEP_US;
    assert_true(now_us - pressures_us >= 0 && now_us - pressures_us <= 5000);
    assert_int_equal(pressures_us % 1000, 0);
}

static void a_full_bus_loses_telemetry_and_says_so(void **state) {
    (void)state;
    struct message_node_counters counters;
    struct message_can_counters can;
    start();
    bus.room = 0u;
    run(1000);
    assert_int_equal(bus.sent > 0, true);
    const uint32_t dropped = node.counters.reports_dropped;
    assert_true(dropped > 600u);
    bus.room = UINT32_MAX;
    sim_bus_forget(&bus);
    run(520);
    assert_true(node.counters.reports_dropped <= dropped + 4u);
    assert_true(last_sent(MESSAGE_NODE_COUNTERS, &counters));
    assert_int_equal(counters.reports_dropped, node.counters.reports_dropped);
    assert_true(last_sent(MESSAGE_CAN_COUNTERS, &can));
    assert_int_equal(can.transmit_lost, bus.state.transmit_lost);
    assert_true(most_sent <= NODE_REPORTS_A_STEP);
}

/* With room for one frame in three steps, every message still gets its turn. */
static void a_slow_bus_starves_no_message(void **state) {
    (void)state;
    start();
    sim_bus_forget(&bus);
    for (int i = 0; i < 4000; i++) {
        bus.room = i % 3 == 0 ? 1u : 0u;
        step();
    }
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        if (message_row((enum message_id)m)->period_ms > 0u && (enum message_id)m != MESSAGE_TELEMETRY) {
            assert_true(count_sent((enum message_id)m) >= 4u);
        }
    }
}

static void telemetry_slows_down_as_asked(void **state) {
    (void)state;
    start();
    assert_int_equal(set_parameter(SLOWDOWN, 10u).status, PARAMETER_OK);
    run(2000);
    sim_bus_forget(&bus);
    run(2000);
    assert_in_range(count_sent(MESSAGE_PRESSURES), 39, 41);
    assert_in_range(count_sent(MESSAGE_STATUS), 3, 5);
}

static void with_can_fd_one_frame_says_it_all(void **state) {
    (void)state;
    struct message_telemetry telemetry;
    start();
    bus.hal.fd = true;
    put_bend(0.6f, 0.5f);
    run_with_heartbeats(3000);
    sim_bus_forget(&bus);
    run_with_heartbeats(1000);
    assert_in_range(count_sent(MESSAGE_TELEMETRY), 199, 201);
    assert_int_equal(count_sent(MESSAGE_PRESSURES) + count_sent(MESSAGE_TARGETS) +
                         count_sent(MESSAGE_ESTIMATES) + count_sent(MESSAGE_DUTIES) +
                         count_sent(MESSAGE_TIP_POSITION) + count_sent(MESSAGE_TIP_ORIENTATION) +
                         count_sent(MESSAGE_BEND) + count_sent(MESSAGE_TIME),
                     0);
    assert_in_range(count_sent(MESSAGE_STATUS), 19, 21);
    assert_true(last_sent(MESSAGE_TELEMETRY, &telemetry));
    const struct controller_status *status = &node.app.controller.status;
    assert_close(telemetry.bend, 0.6, 0.02);
    assert_close(telemetry.estimate_2, status->pressure_estimate_pa[1], 300.0);
    assert_close(telemetry.target_3, status->pressure_target_pa[2], 300.0);
    assert_close(telemetry.tip_qw * telemetry.tip_qw + telemetry.tip_qx * telemetry.tip_qx +
                     telemetry.tip_qy * telemetry.tip_qy + telemetry.tip_qz * telemetry.tip_qz,
                 1.0, 1e-3);
    assert_int_equal(telemetry.state, SUPERVISOR_ACTIVE);
    assert_int_equal(telemetry.protocol, MESSAGE_PROTOCOL);
    assert_true(telemetry.valves_enabled && telemetry.supply_enabled);
    assert_int_equal(node.counters.reported.out_of_range, 0);
}

/* A frame of 64 bytes that a classic bus cannot carry would stand before all others for ever. */
static void can_fd_holds_from_the_next_start_on(void **state) {
    (void)state;
    start();
    assert_int_equal(set_parameter(CAN_FD, 1u).status, PARAMETER_OK);
    run(1000);
    sim_bus_forget(&bus);
    run(1000);
    assert_int_equal(count_sent(MESSAGE_TELEMETRY), 0);
    assert_in_range(count_sent(MESSAGE_PRESSURES), 199, 201);
}

static void the_state_of_the_bus_reaches_the_controller(void **state) {
    (void)state;
    struct message_can_counters can;
    start();
    bus.state = (struct hal_can_state){
        .transmit_errors = 200, .receive_errors = 3, .error_passive = true, .bus_off_count = 7};
    step();
    assert_true(node.app.input.error_passive);
    assert_false(node.app.input.bus_off);
    bus.state.bus_off = true;
    step();
    assert_true(node.app.input.bus_off);
    run(520);
    assert_true(last_sent(MESSAGE_CAN_COUNTERS, &can));
    assert_int_equal(can.transmit_errors, 200);
    assert_int_equal(can.receive_errors, 3);
    assert_int_equal(can.bus_off_count, 7);
    assert_true(can.error_passive && can.bus_off);
}

static void a_board_says_who_it_is(void **state) {
    (void)state;
    struct message_identity identity;
    struct message_identity_table table;
    const struct message_identify identify = {.protocol = MESSAGE_PROTOCOL};
    char name[36] = "";
    start();
    sim_bus_forget(&bus);
    put(MESSAGE_IDENTIFY, &identify);
    run(40);
    assert_true(last_sent(MESSAGE_IDENTITY, &identity));
    assert_int_equal(identity.firmware, 0x12345678u);
    assert_int_equal(identity.parameters, PARAMETER_COUNT);
    assert_int_equal(identity.parameters_version, PARAMETERS_VERSION);
    assert_true(last_sent(MESSAGE_IDENTITY_TABLE, &table));
    assert_true(table.table_hash == file.table.module.inputs_hash);
    for (uint32_t i = 0; i < bus.sent; i++) {
        if (bus.out[i].id == message_identifier(MESSAGE_IDENTITY_NAME, NODE)) {
            memcpy(name + 7 * bus.out[i].data[0], bus.out[i].data + 1, 7);
        }
    }
    assert_string_equal(name, file.table.module.name);
    assert_int_equal(count_sent(MESSAGE_IDENTITY_NAME), 5);
}

static void the_tip_stream_counters_are_reported(void **state) {
    (void)state;
    struct tip_stream_counters counters = {
        .bad_phasing = 70000, .short_records = 2, .out_of_range = 3, .overflow = 4};
    struct message_tip_stream message;
    start();
    setup.tip_stream = &counters;
    run(520);
    assert_true(last_sent(MESSAGE_TIP_STREAM, &message));
    assert_int_equal(message.bad_phasing, 70000 - 65536); /* wraps */
    assert_int_equal(message.short_records, 2);
    assert_int_equal(message.out_of_range, 3);
    assert_int_equal(message.overflow, 4);
}

/* --- parameters */

static void parameters_are_read_changed_and_kept(void **state) {
    (void)state;
    start();
    struct message_parameter_value value = get_parameter(READING_GAIN_1);
    assert_int_equal(value.status, PARAMETER_OK);
    assert_int_equal(value.value, bits_of(1.0f));
    value = set_parameter(READING_GAIN_1, bits_of(1.2f));
    assert_int_equal(value.status, PARAMETER_OK);
    assert_int_equal(value.parameter, READING_GAIN_1);
    assert_int_equal(value.value, bits_of(1.2f));
    assert_close(node.app.controller.parameters.calibration.reading_gain[0], 1.2, 1e-6);
    power_up();
    run_to_safe();
    assert_int_equal(get_parameter(READING_GAIN_1).value, bits_of(1.0f)); /* was not saved */
    (void)set_parameter(READING_GAIN_1, bits_of(1.2f));
    value = act(NODE_ACTION_SAVE);
    assert_int_equal(value.status, PARAMETER_OK);
    assert_int_equal(value.parameter, 65535);
    assert_int_equal(value.action, NODE_ACTION_SAVE);
    power_up();
    run_to_safe();
    assert_int_equal(get_parameter(READING_GAIN_1).value, bits_of(1.2f));
    assert_int_equal(act(NODE_ACTION_DEFAULTS).status, PARAMETER_OK);
    assert_int_equal(get_parameter(READING_GAIN_1).value, bits_of(1.0f));
    assert_close(node.app.controller.parameters.calibration.reading_gain[0], 1.0, 0.0);
}

static void parameters_say_why_they_do_not_change(void **state) {
    (void)state;
    start();
    assert_int_equal(get_parameter(9999u).status, PARAMETER_UNKNOWN);
    assert_int_equal(set_parameter(9999u, 0u).status, PARAMETER_UNKNOWN);
    assert_int_equal(set_parameter(READING_GAIN_1, bits_of(2.0f)).status, PARAMETER_OUT_OF_BOUNDS);
    assert_int_equal(set_parameter(READING_GAIN_1, bits_of(NAN)).status, PARAMETER_OUT_OF_BOUNDS);
    assert_int_equal(set_parameter(WORKING_PRESSURE, bits_of(100000.0f)).status, PARAMETER_CONFLICT);
    put_bend(0.3f, 0.0f);
    run(2);
    const struct message_parameter_value refused = set_parameter(READING_GAIN_1, bits_of(1.2f));
    assert_int_equal(refused.status, PARAMETER_NOT_NOW);
    assert_int_equal(refused.value, bits_of(1.0f)); /* what it still is */
    assert_int_equal(act(NODE_ACTION_SAVE).status, PARAMETER_NOT_NOW);
    assert_int_equal(act(NODE_ACTION_DEFAULTS).status, PARAMETER_NOT_NOW);
    assert_int_equal(set_parameter(SLOWDOWN, 2u).status, PARAMETER_OK); /* at any time */
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    assert_int_equal(node.app.controller.status.faults, 0);
}

/* A bend that came in the same step will let air in: a parameter that wants none flowing waits. */
static void a_motion_of_the_same_step_counts(void **state) {
    (void)state;
    const struct message_parameter_set set = {
        .protocol = MESSAGE_PROTOCOL, .parameter = READING_GAIN_1, .value = bits_of(1.2f)};
    start();
    put_bend(0.3f, 0.0f);
    assert_int_equal(request(MESSAGE_PARAMETER_SET, &set).status, PARAMETER_NOT_NOW);
    start();
    put_pressure(1000.0f);
    assert_int_equal(request(MESSAGE_PARAMETER_SET, &set).status, PARAMETER_NOT_NOW);
}

static void nothing_moves_while_parameters_are_saved(void **state) {
    (void)state;
    const struct message_parameter_action save = {.protocol = MESSAGE_PROTOCOL, .action = NODE_ACTION_SAVE};
    start();
    put(MESSAGE_PARAMETER_ACTION, &save);
    run(3);
    assert_false(store_is_idle(&node.store));
    put_bend(0.3f, 0.0f);
    assert_refused(NODE_REFUSED_BUSY, MESSAGE_BEND_COMMAND);
    const struct message_reset reset = {.key = MESSAGE_RESET_KEY};
    put(MESSAGE_RESET, &reset);
    assert_refused(NODE_REFUSED_BUSY, MESSAGE_RESET);
    assert_int_equal(set_parameter(READING_GAIN_1, bits_of(1.2f)).status, PARAMETER_BUSY);
    run(400);
    assert_true(store_is_idle(&node.store));
    put_bend(0.3f, 0.0f);
    run(2);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
}

static void a_board_without_storage_says_that_nothing_is_kept(void **state) {
    (void)state;
    start();
    setup.storage = NULL;
    power_up();
    run_to_safe();
    assert_int_equal(act(NODE_ACTION_SAVE).status, PARAMETER_NOT_STORED);
    storage.fails = true;
    setup.storage = &storage.hal;
    power_up();
    run_to_safe();
    assert_int_equal(act(NODE_ACTION_SAVE).status, PARAMETER_NOT_STORED);
    storage.fails = false;
    assert_int_equal(act(NODE_ACTION_SAVE).status, PARAMETER_OK);
}

/* A board whose id was changed answers to the new one from the next reset on. */
static void a_new_node_id_holds_from_the_next_start_on(void **state) {
    (void)state;
    const struct message_identify identify = {.protocol = MESSAGE_PROTOCOL};
    struct message_identity identity;
    start();
    assert_int_equal(set_parameter(1u, 9u).status, PARAMETER_OK);
    assert_int_equal(act(NODE_ACTION_SAVE).status, PARAMETER_OK);
    power_up();
    put_to(MESSAGE_IDENTIFY, NODE, &identify);
    run(30);
    assert_false(last_sent(MESSAGE_IDENTITY, &identity));
    put_to(MESSAGE_IDENTIFY, 9u, &identify);
    run(30);
    assert_true(last_sent(MESSAGE_IDENTITY, &identity));
}

/* --- transfers */

static struct message_transfer_state transfer_state(void) {
    struct message_transfer_state state = {0};
    assert_true(last_sent(MESSAGE_TRANSFER_STATE, &state));
    return state;
}

/* A host that follows TRANSFER_STATE: sends what there is room for, goes on from the offset it is told. */
static struct message_transfer_state transfer(enum transfer_kind kind, const uint8_t *image, uint32_t bytes) {
    const struct message_transfer_begin begin = {
        .protocol = MESSAGE_PROTOCOL, .kind = (uint8_t)kind, .bytes = bytes};
    const struct message_transfer_end end = {.protocol = MESSAGE_PROTOCOL,
                                             .crc = crc32_update(0u, image, bytes)};
    struct message_transfer_state state;
    uint32_t sent = 0u;
    sim_bus_forget(&bus);
    put(MESSAGE_TRANSFER_BEGIN, &begin);
    run(5);
    state = transfer_state();
    for (int steps = 0; state.state == TRANSFER_RECEIVING && state.offset < bytes; steps++) {
        sent = state.offset > sent ? state.offset : sent;
        for (int f = 0; f < 3 && sent < bytes && sent + 7u <= state.offset + state.room; f++) {
            struct message_transfer_data data = {.chunk = (uint8_t)(sent / 7u)};
            memcpy(&data.data, image + sent, bytes - sent < 7u ? bytes - sent : 7u);
            put(MESSAGE_TRANSFER_DATA, &data);
            sent += bytes - sent < 7u ? bytes - sent : 7u;
        }
        step();
        state = transfer_state();
        assert_true(steps < 300000);
    }
    put(MESSAGE_TRANSFER_END, &end);
    for (int steps = 0; state.state < TRANSFER_DONE; steps++) {
        step();
        state = transfer_state();
        assert_true(steps < 30000);
    }
    return state;
}

static void a_table_comes_over_the_bus_and_runs_after_a_reset(void **state) {
    (void)state;
    const struct message_reset reset = {.key = MESSAGE_RESET_KEY};
    const uint32_t bytes = file.table.image_bytes;
    uint8_t *image = malloc(bytes);
    const uint64_t hash = 0x1122334455667788u;
    uint32_t crc = 0;
    assert_non_null(image);
    memcpy(image, file.table.image, bytes);
    memcpy(image + 48, &hash, sizeof hash); /* another one of the same module */
    crc = crc32_update(0u, image + 16, bytes - 16u);
    memcpy(image + 12, &crc, sizeof crc);
    start();
    const struct message_transfer_state end = transfer(TRANSFER_KIND_TABLE, image, bytes);
    assert_int_equal(end.error, TRANSFER_ERROR_NONE);
    assert_int_equal(end.state, TRANSFER_DONE);
    assert_int_equal(end.offset, bytes);
    assert_int_equal(end.kind, TRANSFER_KIND_TABLE);
    assert_true(node.table.module.inputs_hash == file.table.module.inputs_hash);
    assert_false(node.reset_wanted);
    put(MESSAGE_RESET, &reset);
    step();
    assert_true(node.reset_wanted);
    power_up();
    run_to_safe();
    assert_true(node.table.module.inputs_hash == hash);
    assert_int_equal(storage.misuses, 0);
    put_bend(0.4f, 0.0f);
    run_with_heartbeats(200);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
    free(image);
}

static void a_damaged_table_leaves_the_old_one(void **state) {
    (void)state;
    const uint32_t bytes = file.table.image_bytes;
    uint8_t *image = malloc(bytes);
    assert_non_null(image);
    memcpy(image, file.table.image, bytes);
    image[bytes / 2u] ^= 4u;
    start();
    const struct message_transfer_state end = transfer(TRANSFER_KIND_TABLE, image, bytes);
    assert_int_equal(end.state, TRANSFER_FAILED);
    assert_int_equal(end.error, TRANSFER_ERROR_BAD_TABLE);
    power_up();
    run_to_safe();
    assert_true(node.has_table);
    assert_false(node.store.table_found);
    free(image);
}

static void transfers_begin_only_while_vented_and_one_at_a_time(void **state) {
    (void)state;
    const struct message_transfer_begin begin = {
        .protocol = MESSAGE_PROTOCOL, .kind = TRANSFER_KIND_TABLE, .bytes = 1000};
    start();
    put_bend(0.3f, 0.0f);
    run(2);
    put(MESSAGE_TRANSFER_BEGIN, &begin);
    run(3);
    assert_int_equal(transfer_state().error, TRANSFER_ERROR_NOT_NOW);
    assert_int_equal(transfer_state().state, TRANSFER_IDLE);
    put_vent(NODE);
    run(3);
    put(MESSAGE_TRANSFER_BEGIN, &begin);
    run(3);
    assert_int_equal(transfer_state().state, TRANSFER_RECEIVING);
    assert_int_equal(transfer_state().error, TRANSFER_ERROR_NONE);
    put(MESSAGE_TRANSFER_BEGIN, &begin);
    run(3);
    assert_int_equal(transfer_state().error, TRANSFER_ERROR_BUSY);
    assert_int_equal(transfer_state().state, TRANSFER_RECEIVING); /* the first goes on */
    run(600);
    put_bend(0.3f, 0.0f);
    assert_refused(NODE_REFUSED_BUSY, MESSAGE_BEND_COMMAND);
    run(2000);
    assert_int_equal(transfer_state().error, TRANSFER_ERROR_TIMEOUT);
    put_bend(0.3f, 0.0f);
    run(2);
    assert_int_equal(state_of_node(), SUPERVISOR_ACTIVE);
}

static void a_parameter_image_is_taken_over_and_kept(void **state) {
    (void)state;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    struct parameters parameters;
    parameters_default(&parameters, &file.table);
    parameters.controller.tip_loop.gain = 0.125f;
    parameters.controller.calibration.reading_gain[2] = 1.125f;
    const uint32_t bytes = parameters_write(&parameters, &file.table, 1u, image);
    start();
    assert_int_equal(transfer(TRANSFER_KIND_PARAMETERS, image, bytes).state, TRANSFER_DONE);
    assert_close(node.app.controller.parameters.tip_loop.gain, 0.125, 0.0);
    assert_close(node.app.controller.parameters.calibration.reading_gain[2], 1.125, 0.0);
    run(2000);
    assert_int_equal(node.app.controller.status.faults, 0);
    power_up();
    run_to_safe();
    assert_close(node.app.controller.parameters.tip_loop.gain, 0.125, 0.0);
}

static void a_reset_needs_its_key_and_vented_valves(void **state) {
    (void)state;
    const struct message_reset right = {.key = MESSAGE_RESET_KEY}, wrong = {.key = MESSAGE_RESET_KEY + 1u};
    start();
    put(MESSAGE_RESET, &wrong);
    assert_refused(NODE_REFUSED_KEY, MESSAGE_RESET);
    put_bend(0.3f, 0.0f);
    run(2);
    put(MESSAGE_RESET, &right);
    assert_refused(NODE_REFUSED_STATE, MESSAGE_RESET);
    assert_false(node.reset_wanted);
}

/* --- anything at all */

/* Random frames at the node's own identifiers: nothing breaks, and everything is counted. */
static void random_frames_are_all_counted(void **state) {
    (void)state;
    uint64_t random = 99u;
    start();
    const struct node_counters before = node.counters;
    uint32_t given = 0;
    for (int i = 0; i < 30000; i++) {
        struct hal_can_frame frame;
        for (size_t b = 0; b < sizeof frame.data; b++) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            frame.data[b] = (uint8_t)(random >> 56);
        }
        frame.id = (uint32_t)(frame.data[60] % 100u) << 4 | (frame.data[61] & 1u);
        frame.data[1] =
            frame.data[62] % 4u != 0u ? (uint8_t)(frame.data[1] & 0xf0u) | MESSAGE_PROTOCOL : frame.data[1];
        frame.length = frame.data[63] % 4u != 0u ? 8u : frame.data[63] % 65u;
        frame.extended = frame.data[59] == 0u;
        frame.fd = frame.length > 8u;
        sim_bus_put(&bus, &frame);
        given++;
        step();
    }
    run(10);
    const struct node_counters *after = &node.counters;
    assert_int_equal(after->accepted - before.accepted + after->foreign - before.foreign + after->refused -
                         before.refused,
                     given);
    uint32_t refused = 0;
    for (int r = 0; r < (int)NODE_REFUSAL_COUNT; r++) {
        refused += node.refused[r].count;
    }
    assert_int_equal(refused, after->refused);
}

static void refusals_flags_and_actions_have_words(void **state) {
    (void)state;
    for (int r = 0; r < (int)NODE_REFUSAL_COUNT; r++) {
        assert_true(strlen(node_refusal_text((enum node_refusal)r)) > 5);
    }
    for (int f = 0; f < (int)NODE_BEND_FLAG_COUNT; f++) {
        assert_true(strlen(node_bend_flag_text((enum node_bend_flag)f)) > 5);
    }
    for (int a = 0; a < (int)NODE_ACTION_COUNT; a++) {
        assert_true(strlen(node_action_text((enum node_action)a)) > 5);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bend_command_bends_the_module),
        cmocka_unit_test(pressures_and_hold_are_taken),
        cmocka_unit_test(without_commands_or_heartbeats_the_module_vents),
        cmocka_unit_test(a_heartbeat_starts_nothing),
        cmocka_unit_test(vent_is_obeyed_whatever_it_holds),
        cmocka_unit_test(vent_wins_over_what_comes_in_the_same_step),
        cmocka_unit_test(a_clear_must_name_the_faults_and_hold_the_key),
        cmocka_unit_test(a_sequence_that_stands_still_or_goes_back_is_stale),
        cmocka_unit_test(the_sequence_wraps),
        cmocka_unit_test(a_frozen_sender_keeps_nothing_alive),
        cmocka_unit_test(a_frozen_sender_starts_nothing_after_a_clear),
        cmocka_unit_test(a_stream_that_went_on_through_a_fault_must_pause),
        cmocka_unit_test(a_stream_that_flew_at_a_restart_must_pause),
        cmocka_unit_test(a_clear_whose_cause_is_still_there_is_refused),
        cmocka_unit_test(after_a_pause_any_sequence_will_do),
        cmocka_unit_test(every_message_of_another_length_is_refused),
        cmocka_unit_test(every_command_of_another_version_is_refused),
        cmocka_unit_test(numbers_out_of_range_are_refused),
        cmocka_unit_test(commands_out_of_place_are_refused),
        cmocka_unit_test(only_vent_and_identify_go_to_every_board),
        cmocka_unit_test(without_a_table_a_bend_is_refused_and_pressures_are_taken),
        cmocka_unit_test(another_board_with_this_id_is_noticed),
        cmocka_unit_test(foreign_frames_are_skipped_and_counted),
        cmocka_unit_test(a_bus_full_of_foreign_frames_delays_no_command),
        cmocka_unit_test(a_step_takes_a_bounded_number_of_frames),
        cmocka_unit_test(every_telemetry_message_keeps_its_period),
        cmocka_unit_test(a_flood_of_commands_starves_no_telemetry),
        cmocka_unit_test(a_new_state_is_said_at_once),
        cmocka_unit_test(readings_that_are_missing_are_said_to_be),
        cmocka_unit_test(the_step_of_a_sample_leads_to_its_time),
        cmocka_unit_test(a_full_bus_loses_telemetry_and_says_so),
        cmocka_unit_test(a_slow_bus_starves_no_message),
        cmocka_unit_test(telemetry_slows_down_as_asked),
        cmocka_unit_test(with_can_fd_one_frame_says_it_all),
        cmocka_unit_test(can_fd_holds_from_the_next_start_on),
        cmocka_unit_test(the_state_of_the_bus_reaches_the_controller),
        cmocka_unit_test(a_board_says_who_it_is),
        cmocka_unit_test(the_tip_stream_counters_are_reported),
        cmocka_unit_test(parameters_are_read_changed_and_kept),
        cmocka_unit_test(parameters_say_why_they_do_not_change),
        cmocka_unit_test(a_motion_of_the_same_step_counts),
        cmocka_unit_test(nothing_moves_while_parameters_are_saved),
        cmocka_unit_test(a_board_without_storage_says_that_nothing_is_kept),
        cmocka_unit_test(a_new_node_id_holds_from_the_next_start_on),
        cmocka_unit_test(a_table_comes_over_the_bus_and_runs_after_a_reset),
        cmocka_unit_test(a_damaged_table_leaves_the_old_one),
        cmocka_unit_test(transfers_begin_only_while_vented_and_one_at_a_time),
        cmocka_unit_test(a_parameter_image_is_taken_over_and_kept),
        cmocka_unit_test(a_reset_needs_its_key_and_vented_valves),
        cmocka_unit_test(random_frames_are_all_counted),
        cmocka_unit_test(refusals_flags_and_actions_have_words),
    };
    return cmocka_run_group_tests(tests, open_table, close_table);
}
