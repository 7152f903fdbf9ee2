/* Frames into the node, with a controller behind it and a module whose pressures go where they should. An
 * input is a series of
 *
 *     control byte c, then:  c < 128: a frame: identifier (2 bytes, low first), length (1), that many bytes
 *                            else: c - 127 control steps
 *
 * on a board that has been through its self-test; one that begins with a byte 3, on a board that is just
 * switched on.
 *
 * Held: every frame is counted once; no report is over its table's length; nothing moves while something is
 * stored; valves are on in ACTIVE and HOLD alone; the limits of the parameters agree. */
#include "fuzz.h"

#include <string.h>

#include "comms/node.h"
#include "support/sim_storage.h"
#include "support/tiny_table.h"

#define STEPS_MOST 1200u
#define SWITCHED_ON 3u /* as first byte */

/* All that a step changes. */
struct world {
    struct sim_storage storage;
    struct node node;
    struct hal_can_frame next;
    bool waits;
    int64_t time_us;
    float pressure_pa[3];
    uint32_t noise;
    struct hal_outputs outputs;
};

static struct world world;
static struct node_setup setup;
static struct tiny_table tiny;

static int64_t now(void *context) {
    (void)context;
    return world.time_us;
}

/* They follow their targets, with noise enough to pass for a sensor. */
static bool read_pressures(void *context, struct hal_pressures *pressures) {
    (void)context;
    *pressures =
        (struct hal_pressures){.supply_pa = 40000.0f, .chamber_ok = {true, true, true}, .supply_ok = true};
    for (uint32_t c = 0; c < 3u; c++) {
        world.noise = world.noise * 1664525u + 1013904223u;
        world.pressure_pa[c] +=
            0.01f * (world.node.app.controller.status.pressure_target_pa[c] - world.pressure_pa[c]);
        pressures->chamber_pa[c] = world.pressure_pa[c] + (float)(world.noise >> 24);
    }
    return true;
}

static bool read_tip(void *context, struct hal_tip_sample *sample) {
    (void)context;
    *sample =
        (struct hal_tip_sample){.measured_us = world.time_us - 10000, .quaternion = {1.0f, 0.0f, 0.0f, 0.0f}};
    return world.time_us % 10000 == 0;
}

static bool write_outputs(void *context, const struct hal_outputs *written) {
    (void)context;
    world.outputs = *written;
    return true;
}

static bool receive(void *context, struct hal_can_frame *frame) {
    (void)context;
    *frame = world.next;
    const bool was_waiting = world.waits;
    world.waits = false;
    return was_waiting;
}

static bool send(void *context, const struct hal_can_frame *frame) {
    enum message_id id;
    (void)context;
    fuzz_assert(message_find(frame->id >> MESSAGE_NODE_BITS, &id));
    fuzz_assert(message_row(id)->direction == MESSAGE_TO_HOST);
    fuzz_assert(frame->length == message_row(id)->bytes && !frame->extended);
    return true;
}

static void state(void *context, struct hal_can_state *bus_state) {
    (void)context;
    *bus_state = (struct hal_can_state){.transmit_errors = 0u};
}

static const struct hal hal = {
    .time_us = now, .read_pressures = read_pressures, .read_tip = read_tip, .write_outputs = write_outputs};
static const struct hal_bus bus = {.receive = receive, .send = send, .state = state};

static void step(void) {
    const bool stores = !store_is_idle(&world.node.store);
    node_step(&world.node);
    (void)app_step(&world.node.app);
    node_report(&world.node);
    world.time_us += CONTROLLER_STEP_US;
    const enum supervisor_state supervisor = world.node.app.controller.status.state;
    const bool on = supervisor == SUPERVISOR_ACTIVE || supervisor == SUPERVISOR_HOLD;
    fuzz_assert(world.outputs.valves_enabled == on);
    fuzz_assert(!(stores && on));
    fuzz_assert(parameters_agree(&world.node.parameters, &tiny.table));
}

static void check_counts(uint32_t given) {
    uint32_t refused = 0u;
    for (uint32_t r = 0; r < (uint32_t)NODE_REFUSAL_COUNT; r++) {
        refused += world.node.refused[r].count;
    }
    fuzz_assert(refused == world.node.counters.refused);
    fuzz_assert(world.node.counters.accepted + world.node.counters.foreign + refused == given);
    fuzz_assert(world.storage.misuses == 0u);
}

static void switch_on(void) {
    memset(&world, 0, sizeof world);
    world.noise = 1u;
    tiny_table_make(&tiny);
    sim_storage_init(&world.storage, 32u * SIM_STORAGE_PAGE);
    setup = (struct node_setup){.hal = &hal,
                                .bus = &bus,
                                .storage = &world.storage.hal,
                                .table_image = tiny.image,
                                .table_bytes = tiny.bytes};
    node_init(&world.node, &setup);
}

/* As it is at the end of the self-test, which takes longer than most inputs: kept from the first time. */
static void be_safe(void) {
    static struct world safe;
    static bool kept;
    if (!kept) {
        switch_on();
        while (world.node.app.controller.status.state != SUPERVISOR_SAFE) {
            step();
        }
        safe = world;
        kept = true;
    }
    world = safe;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    uint32_t given = 0u, steps = 0u;
    const bool starts = size > 0u && bytes[0] == SWITCHED_ON;
    if (starts) {
        switch_on();
    } else {
        be_safe();
    }
    for (size_t at = starts ? 1u : 0u; at < size && steps < STEPS_MOST;) {
        const uint8_t control = bytes[at++];
        if (control >= 128u) {
            for (uint32_t i = 127u; i < control; i++, steps++) {
                step();
            }
        } else if (size - at >= 3u) {
            const uint8_t length = (uint8_t)(bytes[at + 2u] % (HAL_CAN_DATA_BYTES + 1u));
            world.next = (struct hal_can_frame){.id = (uint32_t)bytes[at] | (uint32_t)bytes[at + 1u] << 8u,
                                                .extended = control == 1u,
                                                .fd = control == 2u,
                                                .length = length};
            at += 3u;
            const size_t there = size - at < length ? size - at : length;
            memcpy(world.next.data, bytes + at, there);
            at += there;
            world.waits = true;
            given++;
            steps++;
            step();
        } else {
            break;
        }
    }
    check_counts(given);
    return 0;
}
