#include "campaign/emulated.h"

#include <stdlib.h>
#include <string.h>

#include "comms/tip_stream.h"

#define NODE 1u
#define UNDEFINED 0xde00u
#define SAFE_WITHIN_MS 2000
#define BUS_BAD_MS 1000
#define SUPPLY_LOW_MS 50
#define SUPPLY_LOW_V 2.5
#define SUPPLY_V 3.3
#define TOLD_MS 4 /* a change of state is heard within */
#define MISSED_MS 1 /* beside the steps that are to be missing: the tick stands anywhere in a millisecond */

const char *emulated_left_out(const struct injection *injection) {
    static const char *const reasons[][2] = {
        {"parameter bit flips", "where the firmware keeps them is known to its own build alone"},
        {"stored parameters bad", "power cuts have a test of their own"},
        {"clock stands", "the emulated timer has no such fault"},
    };
    for (size_t i = 0; i < sizeof reasons / sizeof reasons[0]; i++) {
        if (strcmp(injection->name, reasons[i][0]) == 0) {
            return reasons[i][1];
        }
    }
    return NULL;
}

/* --- the bus */

static void send(struct emulated *emulated, enum message_id id, const void *values, size_t bytes) {
    struct message_trouble trouble = {.out_of_range = 0u};
    union message message;
    struct hal_can_frame frame;
    memset(&message, 0, sizeof message);
    memcpy(&message, values, bytes);
    memcpy(&message, &emulated->sequence, 1);
    emulated->sequence++;
    message_frame(id, NODE, &message, &frame, &trouble);
    (void)board_send(&emulated->board, &frame);
}

static void command(struct emulated *emulated, const struct controller_command *given) {
    const struct message_vent vent = {.protocol = MESSAGE_PROTOCOL};
    const struct message_hold hold = {.protocol = MESSAGE_PROTOCOL};
    const struct message_clear clear = {
        .protocol = MESSAGE_PROTOCOL, .key = MESSAGE_CLEAR_KEY, .faults = emulated->status.faults};
    const struct message_pressure_command pressure = {.protocol = MESSAGE_PROTOCOL,
                                                      .pressure_1 = given->pressure_pa[0],
                                                      .pressure_2 = given->pressure_pa[1],
                                                      .pressure_3 = given->pressure_pa[2]};
    const struct message_bend_command bend = {.protocol = MESSAGE_PROTOCOL,
                                              .bend = given->bend_rad,
                                              .direction = given->direction_rad,
                                              .co_contraction = given->co_contraction_pa};
    switch (given->kind) {
    case COMMAND_VENT:
        send(emulated, MESSAGE_VENT, &vent, sizeof vent);
        break;
    case COMMAND_HOLD:
        send(emulated, MESSAGE_HOLD, &hold, sizeof hold);
        break;
    case COMMAND_CLEAR:
        send(emulated, MESSAGE_CLEAR, &clear, sizeof clear);
        break;
    case COMMAND_PRESSURE:
        send(emulated, MESSAGE_PRESSURE_COMMAND, &pressure, sizeof pressure);
        break;
    case COMMAND_BEND:
        send(emulated, MESSAGE_BEND_COMMAND, &bend, sizeof bend);
        break;
    case COMMAND_NONE:
    default:
        break;
    }
}

static void listen(struct emulated *emulated) {
    const uint32_t id = message_identifier(MESSAGE_STATUS, NODE);
    struct message_trouble trouble = {.out_of_range = 0u};
    struct can_host_heard heard;
    while (board_receive(&emulated->board, &heard)) {
        if (!heard.frame.extended && heard.frame.id == id &&
            heard.frame.length == message_row(MESSAGE_STATUS)->bytes) {
            message_unpack(MESSAGE_STATUS, heard.frame.data, &emulated->status, &trouble);
        }
    }
}

/* --- faults */

static void patch(struct emulated *emulated, const char *function, uint16_t code) {
    uint32_t address = 0;
    if (!board_symbol(&emulated->board, function, &address) ||
        !core_patch(&emulated->board.core, address, &code, sizeof code)) {
        abort();
    }
}

/* The program as it was flashed. */
static void mend_program(struct emulated *emulated) {
    char error[CORE_ERROR_BYTES];
    struct core *core = &emulated->board.core;
    if (!core_load_elf(core, emulated->elf, error, sizeof error)) {
        abort();
    }
    (void)uc_ctl_remove_cache(core->engine, (uint64_t)CORE_FLASH, (uint64_t)CORE_FLASH + CORE_FLASH_BYTES);
    core_forget_code(core);
}

static void copy_sensors(struct wiring_faults *to, const struct sim_faults *from) {
    *to = (struct wiring_faults){.pressure_bus_fails = from->pressure_bus_fails,
                                 .readings_exchanged = from->readings_exchanged,
                                 .supply_unknown = from->supply_unknown,
                                 .tip_stops = from->tip_stops,
                                 .tip_stands = from->tip_stands,
                                 .tip_scatters = from->tip_scatters,
                                 .tip_status = from->tip_status,
                                 .tip_away_m = from->tip_away_m,
                                 .outputs_fail = from->outputs_fail};
    for (size_t c = 0; c < 3; c++) {
        to->channel_fails[c] = from->channel_fails[c];
        to->reading_replaced[c] = from->reading_replaced[c];
        to->reading_pa[c] = from->reading_pa[c];
        to->reading_stands[c] = from->reading_stands[c];
        to->reading_drift_paps[c] = from->reading_drift_paps[c];
        to->reading_gain[c] = from->reading_gain[c];
        to->noise_added_pa[c] = from->noise_added_pa[c];
    }
}

static void copy_plant(struct emulated *emulated) {
    struct wiring *wiring = &emulated->board.wiring;
    struct sim *sim = &emulated->shadow.sim;
    wiring_follow(wiring);
    wiring->plant.faults = sim->plant.faults;
    wiring->plant.faults.clock_slow = 0.0; /* time is the board's own */
    for (size_t c = 0; c < 3; c++) {
        wiring->plant.valve[c].stuck = sim->plant.valve[c].stuck;
        wiring->drifted_pa[c] += sim->drifted_pa[c]; /* a jump, once */
        sim->drifted_pa[c] = 0.0;
    }
}

static void stall(struct emulated *emulated, int64_t milliseconds) {
    struct core *core = &emulated->board.core;
    core_stall(core, core->now_ticks + 1000 * milliseconds * TICKS_PER_US);
}

static void hinder_steps(struct emulated *emulated) {
    struct bench *shadow = &emulated->shadow;
    if (shadow->steps_left_out == UINT32_MAX) {
        (void)board_hang(&emulated->board, "node_step");
    } else if (shadow->steps_left_out > 0u) {
        stall(emulated, (int64_t)shadow->steps_left_out + MISSED_MS);
    }
    shadow->steps_left_out = 0u;
    emulated->late_every = shadow->leave_out_every;
}

static void break_board(struct emulated *emulated) {
    struct bench *shadow = &emulated->shadow;
    struct board *board = &emulated->board;
    if (shadow->app.error_passive && emulated->bus_ms < 0) {
        can_bus_set_wire(&board->bus, shadow->app.bus_off ? CAN_BUS_SHORTED : CAN_BUS_OPEN);
        emulated->bus_ms = emulated->ms + BUS_BAD_MS;
        shadow->commands_stop = false; /* they do not arrive, or do once the wire is mended */
    }
    if (shadow->sim.faults.health.clock_failed) {
        board_crystal(board, false);
    }
    if (shadow->sim.faults.health.crashed && !emulated->crashes) {
        patch(emulated, "node_report", UNDEFINED);
        emulated->crashes = true;
    }
    if (shadow->sim.faults.health.brown_out_reset && emulated->supply_ms < 0) {
        board_supply(board, SUPPLY_LOW_V);
        emulated->supply_ms = emulated->ms + SUPPLY_LOW_MS;
    }
}

static void flip_table(struct emulated *emulated) {
    uint32_t address = 0;
    uint8_t byte = 0;
    if (!board_symbol(&emulated->board, "linker_table_a", &address)) {
        abort();
    }
    address += (uint32_t)emulated->shadow.flipped_byte;
    (void)core_read(&emulated->board.core, address, &byte, 1u);
    byte = (uint8_t)(byte ^ emulated->shadow.flipped_bits);
    (void)core_patch(&emulated->board.core, address, &byte, 1u);
}

static void inject(void *context, const struct injection *injection, size_t chamber, struct random_stream *random) {
    struct emulated *emulated = context;
    struct bench *shadow = &emulated->shadow;
    const bool was_flipped = shadow->flipped_byte < shadow->table->image_bytes;
    injection->apply(shadow, chamber, random);
    copy_sensors(&emulated->board.wiring.faults, &shadow->sim.faults);
    copy_plant(emulated);
    hinder_steps(emulated);
    break_board(emulated);
    if (!was_flipped && shadow->flipped_byte < shadow->table->image_bytes) {
        flip_table(emulated);
    }
}

/* What passes by itself, or with the reset that it led to. */
static void mend(struct emulated *emulated) {
    struct board *board = &emulated->board;
    if (emulated->ms == emulated->bus_ms) {
        can_bus_set_wire(&board->bus, CAN_BUS_SOUND);
    }
    if (emulated->ms == emulated->supply_ms) {
        board_supply(board, SUPPLY_V);
    }
    if (board->resets != emulated->resets) {
        emulated->resets = board->resets;
        emulated->late_every = 0u;
        board->wiring.faults.outputs_fail = emulated->shadow.sim.faults.outputs_fail = false;
        mend_program(emulated);
    }
}

/* --- flight */

static void step(void *context, const struct controller_command *given) {
    struct emulated *emulated = context;
    const struct wiring *wiring = &emulated->board.wiring;
    mend(emulated);
    if (given != NULL && !emulated->shadow.commands_stop) {
        command(emulated, given);
    }
    if (emulated->late_every > 0u && emulated->ms % (emulated->late_every + MISSED_MS) == 0) {
        stall(emulated, 1 + MISSED_MS);
    }
    board_run(&emulated->board, CONTROLLER_STEP_US);
    listen(emulated);
    emulated->ms++;
    emulated->open_ms = wiring->coils_driven || wiring->supply_open ? emulated->open_ms + 1 : 0;
}

/* As long as a change of state needs to be heard, a fault that is told may have been cleared. */
static void sample(void *context, struct oracle_sample *seen) {
    struct emulated *emulated = context;
    *seen = (struct oracle_sample){.time_us = board_time_us(&emulated->board),
                                   .faults = emulated->status.faults,
                                   .warnings = emulated->status.warnings,
                                   .air_may_flow = emulated->open_ms > TOLD_MS,
                                   .moves = emulated->board.wiring.coils_driven};
    board_pressures(&emulated->board, seen->pressure_pa);
}

static size_t encode(const struct hal_tip_sample *tip, uint8_t bytes[WIRING_RECORD_BYTES]) {
    tip_stream_encode(tip, bytes);
    return TIP_STREAM_RECORD_BYTES;
}

static bool power_on(struct emulated *emulated, const struct plant_parameters *plant, uint64_t seed, char *error,
                     size_t error_bytes) {
    struct board_setup setup;
    board_default_setup(&setup, emulated->elf, emulated->plant_table);
    setup.wiring.plant = *plant;
    setup.encode = encode;
    setup.seed = seed;
    return board_open(&emulated->board, &setup, error, error_bytes);
}

static int64_t start(void *context, const struct plant_parameters *plant, uint64_t seed) {
    struct emulated *emulated = context;
    char error[CORE_ERROR_BYTES];
    const struct bench *shadow = &emulated->shadow;
    bench_init(&emulated->shadow, emulated->plant_table, shadow->table, shadow->image, plant, seed);
    if (!power_on(emulated, plant, seed, error, sizeof error)) {
        abort(); /* it could be opened before */
    }
    emulated->status = (struct message_status){.state = SUPERVISOR_BOOT};
    emulated->sequence = 0u;
    emulated->resets = emulated->late_every = 0u;
    emulated->crashes = false;
    emulated->ms = emulated->open_ms = 0;
    emulated->bus_ms = emulated->supply_ms = -1;
    while (emulated->status.state != SUPERVISOR_SAFE && emulated->ms < SAFE_WITHIN_MS) {
        step(emulated, NULL);
    }
    return board_time_us(&emulated->board);
}

static void finish(void *context) {
    struct emulated *emulated = context;
    bench_finish(&emulated->shadow);
    board_close(&emulated->board);
}

bool emulated_open(struct emulated *emulated, const char *elf, const struct bend_table *plant_table,
                   const struct bend_table *table, uint8_t *image, char *error, size_t error_bytes) {
    struct plant_parameters plant;
    memset(emulated, 0, sizeof *emulated);
    emulated->elf = elf;
    emulated->plant_table = plant_table;
    emulated->shadow.table = table;
    emulated->shadow.image = image;
    plant_default_parameters(&plant);
    if (!power_on(emulated, &plant, 1u, error, error_bytes)) {
        return false;
    }
    board_close(&emulated->board);
    return true;
}

void emulated_vehicle(struct emulated *emulated, struct vehicle *vehicle) {
    *vehicle = (struct vehicle){.context = emulated,
                                .start = start,
                                .inject = inject,
                                .step = step,
                                .sample = sample,
                                .finish = finish};
}
