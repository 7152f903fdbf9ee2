/* Loads under which the steps of the flashed ELF are counted: the whole of what thread mode does between two waits, control
 * step, CAN and telemetry. Header only, on the board of hil.h. */
#ifndef TRIBEND_BOARD_LOAD_H
#define TRIBEND_BOARD_LOAD_H

#include "comms/node.h"
#include "hil/hil.h"
#include "sim/random.h"

#define BOARD_LOAD_CHANGE_MS 500 /* from one bend to the next, of a host that repeats it every HIL_REPEAT_MS */

struct board_load {
    const char *name;
    bool can_fd;
    int tip_hz;
    int commands_a_ms; /* each another bend; 0: as a host has them */
};

static const struct board_load board_loads[] = {
    {"tip at 100 Hz, commands at 20 Hz", false, 100, 0},
    {"the same with CAN FD", true, 100, 0},
    {"CAN FD, commands at 1 kHz", true, 100, 1},
    {"commands at 2 kHz", false, 100, 2},
    {"tip at 255 Hz, commands at 1 kHz", false, 255, 1},
};
#define BOARD_LOADS (sizeof board_loads / sizeof board_loads[0])

static inline void board_load_set_fd(void) {
    const struct message_parameter_set set = {
        .protocol = MESSAGE_PROTOCOL, .parameter = parameter_row(PARAMETER_can_fd)->id, .value = 1u};
    const struct message_parameter_action save = {.protocol = MESSAGE_PROTOCOL, .action = NODE_ACTION_SAVE};
    const struct message_reset reset = {.protocol = MESSAGE_PROTOCOL, .key = MESSAGE_RESET_KEY};
    hil_send(MESSAGE_PARAMETER_SET, &set, sizeof set);
    hil_run(50);
    hil_send(MESSAGE_PARAMETER_ACTION, &save, sizeof save);
    hil_run(500);
    hil_send(MESSAGE_RESET, &reset, sizeof reset);
    hil_run(HIL_BOOT_MS);
}

/* Through its self-test: commands before its end are refused. Steps are counted from here on. */
static inline void board_load_start(const struct board_load *load, uint64_t seed) {
    hil_power_on(seed);
    hil.board.wiring.parameters.sensor.tip_period_us = 1000000 / load->tip_hz;
    hil_run(HIL_BOOT_MS);
    if (load->can_fd) {
        board_load_set_fd();
    }
    hil.board.core.step = (struct core_count){.entries = 0};
}

static inline void board_load_fly(const struct board_load *load, int milliseconds, uint64_t seed) {
    struct random_stream chance;
    random_seed(&chance, seed, 5);
    for (int ms = 0; ms < milliseconds; ms++) {
        if (load->commands_a_ms == 0 && ms % BOARD_LOAD_CHANGE_MS == 200) {
            hil_bend(110.0 * random_uniform(&chance), 360.0 * random_uniform(&chance) - 180.0);
        }
        for (int i = 0; i < load->commands_a_ms; i++) {
            const struct message_bend_command bend = {.protocol = MESSAGE_PROTOCOL,
                                                      .bend = (float)(1.9 * random_uniform(&chance)),
                                                      .direction = (float)(2.0 * M_PI * random_uniform(&chance) - M_PI)};
            hil_send(MESSAGE_BEND_COMMAND, &bend, sizeof bend);
        }
        hil_run(1);
    }
}

#endif
