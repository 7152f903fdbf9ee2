/* The flashed ELF on the emulated board, spoken to over its CAN bus, for tests in virtual time. Header only.
 * The oracle is the plant's truth and the pins, not what the firmware believes. */
#ifndef TRIBEND_HIL_H
#define TRIBEND_HIL_H

#include <stdlib.h>

#include "comms/codec.h"
#include "comms/tip_stream.h"
#include "emulator/board.h"
#include "program/table_file.h"
#include "safety/supervisor.h"
#include "support/test.h"

#define HIL_TABLE "tables/paper-semicircle.tbt"
#define HIL_NODE 1u
#define HIL_REPEAT_MS 50
#define HIL_BOOT_MS 650

struct hil {
    struct board board;
    union message last[MESSAGE_COUNT]; /* newest of each telemetry message */
    uint32_t heard[MESSAGE_COUNT];
    struct hal_can_frame command; /* repeated every HIL_REPEAT_MS with a sequence of its own */
    enum message_id command_id;
    union message command_values;
    bool repeats;
    uint8_t sequence;
    int64_t ms;
    struct message_trouble trouble;
    double most_pa[3]; /* greatest true pressures since hil_watch() */
    uint32_t steps_seen;
};

static struct table_file hil_file;
static struct hil hil; /* the one board of a test */

static inline int hil_open_table(void **state) {
    (void)state;
    return table_file_open(&hil_file, HIL_TABLE, NULL);
}

static inline int hil_close_table(void **state) {
    (void)state;
    table_file_close(&hil_file);
    return 0;
}

static inline const char *hil_elf(void) {
    static char path[512];
    const char *build = getenv("TRIBEND_BUILD");
    (void)snprintf(path, sizeof path, "%s/firmware/tribend.elf", build != NULL ? build : "build");
    return path;
}

static inline size_t hil_encode(const struct hal_tip_sample *sample, uint8_t bytes[WIRING_RECORD_BYTES]) {
    tip_stream_encode(sample, bytes);
    return TIP_STREAM_RECORD_BYTES;
}

/* Powered on at time 0; nothing has run yet. */
static inline void hil_power_on(uint64_t seed) {
    struct board_setup setup;
    char error[CORE_ERROR_BYTES];
    uint32_t step;
    memset(&hil, 0, sizeof hil);
    board_default_setup(&setup, hil_elf(), &hil_file.table);
    setup.encode = hil_encode;
    setup.seed = seed;
    if (!board_open(&hil.board, &setup, error, sizeof error)) {
        fail_msg("%s", error);
    }
    assert_true(board_symbol(&hil.board, "node_step", &step));
    assert_true(core_mark_step(&hil.board.core, step));
}

static inline void hil_off(void) {
    char text[1024];
    if (board_describe_oddities(&hil.board, text, sizeof text)) {
        print_message("odd: %s\n", text);
    }
    board_close(&hil.board);
}

static inline void hil_listen(void) {
    struct can_host_heard heard;
    while (board_receive(&hil.board, &heard)) {
        enum message_id id;
        if (!heard.frame.extended && (heard.frame.id & 15u) == HIL_NODE &&
            message_find(heard.frame.id >> 4, &id) && message_row(id)->direction == MESSAGE_TO_HOST &&
            message_row(id)->bytes == heard.frame.length) {
            message_unpack(id, heard.frame.data, &hil.last[id], &hil.trouble);
            hil.heard[id]++;
        }
    }
}

/* `values` points to the struct of `id`. */
static inline void hil_send_as_is(enum message_id id, const void *values) {
    struct hal_can_frame frame;
    message_frame(id, HIL_NODE, values, &frame, &hil.trouble);
    assert_true(board_send(&hil.board, &frame));
}

/* The same with the next sequence, the first byte of every command. */
static inline void hil_send(enum message_id id, const void *values, size_t bytes) {
    union message message;
    memset(&message, 0, sizeof message);
    memcpy(&message, values, bytes);
    memcpy(&message, &hil.sequence, 1);
    hil.sequence++;
    hil_send_as_is(id, &message);
}

static inline void hil_repeat(enum message_id id, const void *values, size_t bytes) {
    memset(&hil.command_values, 0, sizeof hil.command_values);
    memcpy(&hil.command_values, values, bytes);
    hil.command_id = id;
    hil.repeats = true;
}

static inline void hil_bend(double bend_deg, double direction_deg) {
    const struct message_bend_command bend = {.protocol = MESSAGE_PROTOCOL,
                                              .bend = (float)(bend_deg * M_PI / 180.0),
                                              .direction = (float)(direction_deg * M_PI / 180.0)};
    hil_repeat(MESSAGE_BEND_COMMAND, &bend, sizeof bend);
}

static inline void hil_pressure(double p1_pa, double p2_pa, double p3_pa) {
    const struct message_pressure_command pressure = {.protocol = MESSAGE_PROTOCOL,
                                                      .pressure_1 = (float)p1_pa,
                                                      .pressure_2 = (float)p2_pa,
                                                      .pressure_3 = (float)p3_pa};
    hil_repeat(MESSAGE_PRESSURE_COMMAND, &pressure, sizeof pressure);
}

static inline void hil_silence(void) {
    hil.repeats = false;
}

static inline void hil_watch(void) {
    memset(hil.most_pa, 0, sizeof hil.most_pa);
}

static inline void hil_run(int milliseconds) {
    for (int i = 0; i < milliseconds && !hil.board.power_lost; i++) {
        double pressure_pa[3];
        if (hil.repeats && hil.ms % HIL_REPEAT_MS == 0) {
            hil_send(hil.command_id, &hil.command_values, sizeof hil.command_values);
        }
        board_run(&hil.board, 1000);
        hil_listen();
        board_pressures(&hil.board, pressure_pa);
        for (size_t c = 0; c < 3; c++) {
            hil.most_pa[c] = fmax(hil.most_pa[c], pressure_pa[c]);
        }
        hil.ms++;
    }
}

static inline enum supervisor_state hil_state(void) {
    return (enum supervisor_state)hil.last[MESSAGE_STATUS].status.state;
}

static inline bool hil_has(enum supervisor_fault fault) {
    return (hil.last[MESSAGE_STATUS].status.faults >> (unsigned)fault & 1u) != 0;
}

static inline bool hil_warns(enum supervisor_warning warning) {
    return ((uint32_t)hil.last[MESSAGE_STATUS].status.warnings >> (unsigned)warning & 1u) != 0;
}

#define hil_assert_state(expected)                                                                           \
    do {                                                                                                     \
        if (hil_state() != (expected)) {                                                                     \
            fail_msg("state %s, expected %s; faults 0x%x", supervisor_state_name(hil_state()),               \
                     supervisor_state_name(expected), hil.last[MESSAGE_STATUS].status.faults);               \
        }                                                                                                    \
    } while (0)

/* Powered on, through the self-test, in SAFE. */
static inline void hil_start(uint64_t seed) {
    hil_power_on(seed);
    hil_run(HIL_BOOT_MS);
    hil_assert_state(SUPERVISOR_SAFE);
}

/* True bend of the tip, degrees. */
static inline double hil_true_bend_deg(void) {
    const double *q = hil.board.wiring.plant.pose.quaternion;
    return acos(1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])) * 180.0 / M_PI;
}

/* Coils off, and every chamber on its way down or empty. */
static inline bool hil_is_vented(double under_pa) {
    double pressure_pa[3];
    board_pressures(&hil.board, pressure_pa);
    return !wiring_fills(&hil.board.wiring) && pressure_pa[0] < under_pa && pressure_pa[1] < under_pa &&
           pressure_pa[2] < under_pa;
}

/* Milliseconds until no valve lets air in; -1: not within `most_ms`. */
static inline int hil_until_shut(int most_ms) {
    for (int i = 0; i < most_ms; i++) {
        if (!hil.board.wiring.coils_driven && !wiring_fills(&hil.board.wiring)) {
            return i;
        }
        hil_run(1);
    }
    return -1;
}

#endif
