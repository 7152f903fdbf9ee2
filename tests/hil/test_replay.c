/* Same inputs, same bits: over a minute of mission every raw input of the emulated ELF's control steps
 * (converter words, serial bytes with their times, CAN frames) is taken at the door of the shared code,
 * handed to the same code built for the host, and what both make of it is compared at every step: outputs,
 * compare registers, pins, and each CAN frame sent. */
#include "comms/node.h"
#include "hil/hil.h"
#include "sim/random.h"
#include "stm32g4/conversions.h"

#define MISSION_MS 62000
#define STEPS_LEAST 61000u
#define EVENTS_MOST 512u
#define FRAMES_MOST 32u
#define SENT_MOST 4096u
#define SLOT_A 0x12000u /* hal/stm32g4/README.md, flash map */
#define SLOT_B 0x40000u
#define SLOT_BYTES 0x2e000u
#define PARAMETERS_A 0x7f000u
#define PARAMETERS_BYTES 0x800u

/* What one step saw, in the order in which it asked. */
struct step_input {
    bool pressures_read;
    uint16_t raw[RAW_CHANNEL_COUNT];
    uint16_t calibration;
    struct tip_event {
        bool is_read; /* a sample was asked for; else a byte */
        uint8_t byte;
        int64_t arrived_us;
    } tip[EVENTS_MOST];
    size_t tip_count, tip_taken;
    struct hal_can_frame frame[FRAMES_MOST];
    size_t frame_count, frame_taken;
};

static struct step_input input;
static struct hal_outputs board_outputs; /* of the step under way on the board */
static bool board_wrote;

static struct host_side {
    struct node node;
    struct node_setup setup;
    struct hal hal;
    struct hal_bus bus;
    struct hal_storage storage;
    struct tip_stream tip_stream;
    struct hal_outputs outputs;
    int64_t time_us;
    uint8_t flash[CORE_FLASH_BYTES];
    struct frame_queue {
        struct hal_can_frame frame[SENT_MOST];
        size_t first, count;
    } sent; /* and not yet seen on the board's bus */
} host;

static struct frame_queue board_sent; /* that the host has not sent yet: of the step under way */

static uint32_t steps_compared, frames_compared, bytes_replayed, commands_replayed;

/* --- the host's hal: the board's inputs again --- */

static int64_t host_time_us(void *context) {
    (void)context;
    return host.time_us;
}

static bool host_read_pressures(void *context, struct hal_pressures *pressures) {
    (void)context;
    if (input.pressures_read) {
        conversions_pressures(input.raw, input.calibration, pressures);
    }
    return input.pressures_read;
}

static bool host_read_tip(void *context, struct hal_tip_sample *sample) {
    (void)context;
    while (input.tip_taken < input.tip_count && !input.tip[input.tip_taken].is_read) {
        const struct tip_event *event = &input.tip[input.tip_taken++];
        tip_stream_byte(&host.tip_stream, event->byte, event->arrived_us);
        bytes_replayed++;
    }
    assert_true(input.tip_taken < input.tip_count); /* the board asked just as often */
    input.tip_taken++;
    return tip_stream_read(&host.tip_stream, sample);
}

static bool host_write_outputs(void *context, const struct hal_outputs *outputs) {
    (void)context;
    host.outputs = *outputs;
    return true;
}

static void host_read_health(void *context, struct hal_health *health) {
    (void)context;
    memset(health, 0, sizeof *health);
}

static bool host_receive(void *context, struct hal_can_frame *frame) {
    (void)context;
    if (input.frame_taken == input.frame_count) {
        return false;
    }
    *frame = input.frame[input.frame_taken++];
    commands_replayed++;
    return true;
}

static void put(struct frame_queue *queue, const struct hal_can_frame *frame) {
    assert_true(queue->count < SENT_MOST);
    queue->frame[(queue->first + queue->count++) % SENT_MOST] = *frame;
}

static const struct hal_can_frame *get(struct frame_queue *queue) {
    const struct hal_can_frame *frame = &queue->frame[queue->first];
    queue->first = (queue->first + 1u) % SENT_MOST;
    queue->count--;
    return frame;
}

static void compare_frames(void) {
    while (host.sent.count > 0 && board_sent.count > 0) {
        const struct hal_can_frame *own = get(&host.sent), *theirs = get(&board_sent);
        assert_int_equal(theirs->id, own->id);
        assert_int_equal(theirs->fd, own->fd);
        assert_int_equal(theirs->length, own->length);
        assert_memory_equal(theirs->data, own->data, own->length);
        frames_compared++;
    }
}

static bool host_send(void *context, const struct hal_can_frame *frame) {
    (void)context;
    put(&host.sent, frame);
    return true;
}

static void host_state(void *context, struct hal_can_state *state) {
    (void)context;
    memset(state, 0, sizeof *state); /* of a bus without errors: checked at the end */
}

static const uint8_t *host_map(void *context, enum hal_storage_area area, uint32_t *bytes) {
    static const struct {
        uint32_t offset, bytes;
    } place[HAL_STORAGE_AREA_COUNT] = {
        [HAL_STORAGE_PARAMETERS_A] = {PARAMETERS_A, PARAMETERS_BYTES},
        [HAL_STORAGE_PARAMETERS_B] = {PARAMETERS_A + PARAMETERS_BYTES, PARAMETERS_BYTES},
        [HAL_STORAGE_TABLE_A] = {SLOT_A, SLOT_BYTES},
        [HAL_STORAGE_TABLE_B] = {SLOT_B, SLOT_BYTES}};
    (void)context;
    *bytes = place[area].bytes;
    return host.flash + place[area].offset;
}

static bool host_erase(void *context, enum hal_storage_area area, uint32_t offset) {
    (void)context;
    (void)area;
    (void)offset;
    return false; /* the mission saves nothing */
}

static bool host_program(void *context, enum hal_storage_area area, uint32_t offset,
                         const uint8_t word[HAL_STORAGE_WORD_BYTES]) {
    (void)context;
    (void)area;
    (void)offset;
    (void)word;
    return false;
}

static enum hal_storage_status host_status(void *context) {
    (void)context;
    return HAL_STORAGE_IDLE;
}

static void start_host(void) {
    memset(&host, 0, sizeof host);
    memset(&board_sent, 0, sizeof board_sent);
    memcpy(host.flash, hil.board.core.flash, sizeof host.flash);
    host.hal = (struct hal){.time_us = host_time_us,
                            .read_pressures = host_read_pressures,
                            .read_tip = host_read_tip,
                            .write_outputs = host_write_outputs,
                            .read_health = host_read_health};
    host.bus = (struct hal_bus){.receive = host_receive, .send = host_send, .state = host_state};
    host.storage = (struct hal_storage){.map = host_map,
                                        .erase_page = host_erase,
                                        .program = host_program,
                                        .status = host_status,
                                        .page_bytes = FLASH_PAGE_BYTES};
    host.setup = (struct node_setup){.hal = &host.hal,
                                     .bus = &host.bus,
                                     .storage = &host.storage,
                                     .tip_stream = &host.tip_stream.counters};
    tip_stream_init(&host.tip_stream, TIP_STREAM_AGE_US);
    node_init(&host.node, &host.setup);
}

/* --- at the doors of the board's code --- */

static void take_pressures(void *context, struct core *core) {
    (void)context;
    input.pressures_read = true;
    input.calibration = (uint16_t)core_register(core, UC_ARM_REG_R1);
    assert_true(core_read(core, core_register(core, UC_ARM_REG_R0), input.raw, sizeof input.raw));
}

static struct tip_event *next_tip_event(void) {
    assert_true(input.tip_count < EVENTS_MOST);
    return &input.tip[input.tip_count++];
}

static void take_byte(void *context, struct core *core) {
    (void)context;
    const uint64_t low = core_register(core, UC_ARM_REG_R2), high = core_register(core, UC_ARM_REG_R3);
    *next_tip_event() = (struct tip_event){.byte = (uint8_t)core_register(core, UC_ARM_REG_R1),
                                           .arrived_us = (int64_t)(high << 32 | low)};
}

static void take_tip_read(void *context, struct core *core) {
    (void)context;
    (void)core;
    *next_tip_event() = (struct tip_event){.is_read = true};
}

static void take_frame(void *context, struct core *core) {
    (void)context;
    assert_true(input.frame_count < FRAMES_MOST);
    assert_true(core_read(core, core_register(core, UC_ARM_REG_R1), &input.frame[input.frame_count++],
                          sizeof input.frame[0]));
}

static void take_outputs(void *context, struct core *core) {
    (void)context;
    board_wrote = core_read(core, core_register(core, UC_ARM_REG_R0), &board_outputs, sizeof board_outputs);
}

static void compare_registers(void) {
    const struct timer *timer = &hil.board.valves_timer;
    const bool enabled = (timer->dead_time & 1u << 15) != 0;
    assert_int_equal(enabled, host.outputs.valves_enabled);
    assert_int_equal(gpio_output_high(&hil.board.gpio[1], 5u), host.outputs.supply_enabled);
    for (size_t c = 0; c < 3; c++) {
        const uint32_t expected =
            enabled ? conversions_compare(host.outputs.duty[c], timer->reload + 1u) : 0u;
        assert_int_equal(timer->compare[c], expected);
    }
}

/* The step that the board has just ended, on the host, and what both made of it. */
static void replay_step(void) {
    host.time_us += CONTROLLER_STEP_US;
    node_step(&host.node);
    (void)app_step(&host.node.app);
    node_report(&host.node);
    for (size_t c = 0; c < 3; c++) {
        if (memcmp(&board_outputs.duty[c], &host.outputs.duty[c], sizeof host.outputs.duty[c]) != 0) {
            fail_msg("step %u: duty %zu is %.9g on the board, %.9g on the host", steps_compared, c + 1,
                     (double)board_outputs.duty[c], (double)host.outputs.duty[c]);
        }
    }
    assert_int_equal(board_outputs.valves_enabled, host.outputs.valves_enabled);
    assert_int_equal(board_outputs.supply_enabled, host.outputs.supply_enabled);
    assert_int_equal(input.frame_taken, input.frame_count);
    assert_int_equal(input.tip_taken, input.tip_count);
    compare_registers();
    compare_frames();
    steps_compared++;
}

/* A step begins on the board: the one before is whole. */
static void begin_step(void *context, struct core *core) {
    (void)context;
    (void)core;
    if (board_wrote) {
        replay_step();
    }
    memset(&input, 0, sizeof input);
    board_wrote = false;
}

static void see_sent(void *context, const struct can_bus_frame *frame) {
    (void)context;
    put(&board_sent, &frame->frame);
    compare_frames();
}

/* --- the mission --- */

static struct random_stream chance;

static double random_to(double most) {
    return most * random_uniform(&chance);
}

/* Frames that the node must refuse or leave: garbage to its own identifiers, others' frames, an FD frame. */
static void send_nonsense(void) {
    struct hal_can_frame frame = {.id = ((uint32_t)random_to(128.0) << 4 | HIL_NODE) & 0x7ffu,
                                  .length = (uint8_t)random_to(9.0)};
    for (size_t i = 0; i < frame.length; i++) {
        frame.data[i] = (uint8_t)random_to(256.0);
    }
    const uint32_t number = frame.id >> 4;
    if (number != 66u && number != 67u && number != 69u && number != 70u) { /* save, transfers, reset */
        assert_true(board_send(&hil.board, &frame));
    }
}

static void change_course(void) {
    const struct message_vent vent = {.protocol = MESSAGE_PROTOCOL};
    const double kind = random_uniform(&chance);
    if (kind < 0.6) {
        hil_bend(random_to(110.0), random_to(360.0) - 180.0);
    } else if (kind < 0.9) {
        hil_pressure(random_to(8000.0), random_to(8000.0), random_to(8000.0));
    } else {
        hil_send(MESSAGE_VENT, &vent, sizeof vent);
        hil_silence();
    }
}

static void clear_faults(void) {
    const struct message_clear clear = {.protocol = MESSAGE_PROTOCOL,
                                        .key = MESSAGE_CLEAR_KEY,
                                        .faults = hil.last[MESSAGE_STATUS].status.faults};
    if (hil_state() == SUPERVISOR_FAULT) {
        hil_silence();
        hil_send(MESSAGE_CLEAR, &clear, sizeof clear);
    }
}

static void watch_doors(void) {
    assert_true(board_probe(&hil.board, "node_step", begin_step, NULL));
    assert_true(board_probe(&hil.board, "conversions_pressures", take_pressures, NULL));
    assert_true(board_probe(&hil.board, "tip_stream_byte", take_byte, NULL));
    assert_true(board_probe(&hil.board, "tip_stream_read", take_tip_read, NULL));
    assert_true(board_probe(&hil.board, "node_take", take_frame, NULL));
    assert_true(board_probe(&hil.board, "valves_write", take_outputs, NULL));
    hil.board.fdcan.sent = see_sent;
}

static void a_minute_of_mission_gives_the_same_bits(void **state) {
    uint32_t active_ms = 0;
    (void)state;
    random_seed(&chance, 2014, 1);
    hil_power_on(11);
    watch_doors();
    start_host();
    for (int ms = 0; ms < MISSION_MS; ms++) {
        if (ms % 700 == 200) {
            change_course();
        }
        if (ms % 90 == 7) {
            send_nonsense();
        }
        if (ms % 2500 == 2400) {
            clear_faults();
        }
        hil_run(1);
        active_ms += hil_state() == SUPERVISOR_ACTIVE ? 1u : 0u;
    }
    print_message("%u steps, %u CAN frames sent, %u received, %u serial bytes, %u ms in ACTIVE\n",
                  steps_compared, frames_compared, commands_replayed, bytes_replayed, active_ms);
    assert_true(steps_compared >= STEPS_LEAST);
    assert_true(active_ms > MISSION_MS / 2);
    assert_true(frames_compared > 20000u && commands_replayed > 1000u && bytes_replayed > 100000u);
    assert_int_equal(hil.board.fdcan.node.error_frames, 0);
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.steps_late, 0);
    hil_off();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_minute_of_mission_gives_the_same_bits),
    };
    return cmocka_run_group_tests(tests, hil_open_table, hil_close_table);
}
