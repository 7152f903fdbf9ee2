/* Frames into the node, with a controller behind it and a module whose pressures go where they should. An
 * input is a series of
 *
 *     control byte c, then:  c < 128: a frame: identifier (2 bytes, low first), length (1), that many bytes
 *                            else: c - 127 control steps
 *
 * on a board that has been through its self-test; one that begins with a byte 3, on a board that is just switched on.
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

static struct sim_storage storage, storage_safe;
static struct node node, node_safe;
static struct node_setup setup;
static struct tiny_table tiny;
static struct hal_can_frame next;
static bool waits;
static int64_t time_us;
static float pressure_pa[3];
static uint32_t noise;
static struct hal_outputs outputs;

static int64_t now(void *context) {
    (void)context;
    return time_us;
}

/* They follow their targets, with noise enough to pass for a sensor. */
static bool read_pressures(void *context, struct hal_pressures *pressures) {
    (void)context;
    *pressures =
        (struct hal_pressures){.supply_pa = 40000.0f, .chamber_ok = {true, true, true}, .supply_ok = true};
    for (uint32_t c = 0; c < 3u; c++) {
        noise = noise * 1664525u + 1013904223u;
        pressure_pa[c] += 0.01f * (node.app.controller.status.pressure_target_pa[c] - pressure_pa[c]);
        pressures->chamber_pa[c] = pressure_pa[c] + (float)(noise >> 24);
    }
    return true;
}

static bool read_tip(void *context, struct hal_tip_sample *sample) {
    (void)context;
    *sample = (struct hal_tip_sample){.measured_us = time_us - 10000, .quaternion = {1.0f, 0.0f, 0.0f, 0.0f}};
    return time_us % 10000 == 0;
}

static bool write_outputs(void *context, const struct hal_outputs *written) {
    (void)context;
    outputs = *written;
    return true;
}

static bool receive(void *context, struct hal_can_frame *frame) {
    (void)context;
    *frame = next;
    const bool was_waiting = waits;
    waits = false;
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
    const bool stores = !store_is_idle(&node.store);
    node_step(&node);
    (void)app_step(&node.app);
    node_report(&node);
    time_us += CONTROLLER_STEP_US;
    const enum supervisor_state supervisor = node.app.controller.status.state;
    const bool on = supervisor == SUPERVISOR_ACTIVE || supervisor == SUPERVISOR_HOLD;
    fuzz_assert(outputs.valves_enabled == on);
    fuzz_assert(!(stores && on));
    fuzz_assert(parameters_agree(&node.parameters, &tiny.table));
}

static void check_counts(uint32_t given) {
    uint32_t refused = 0u;
    for (uint32_t r = 0; r < (uint32_t)NODE_REFUSAL_COUNT; r++) {
        refused += node.refused[r].count;
    }
    fuzz_assert(refused == node.counters.refused);
    fuzz_assert(node.counters.accepted + node.counters.foreign + refused == given);
    fuzz_assert(storage.misuses == 0u);
}

static void switch_on(void) {
    time_us = 0;
    noise = 1u;
    memset(pressure_pa, 0, sizeof pressure_pa);
    waits = false;
    tiny_table_make(&tiny);
    sim_storage_init(&storage, 32u * SIM_STORAGE_PAGE);
    setup = (struct node_setup){.hal = &hal,
                                .bus = &bus,
                                .storage = &storage.hal,
                                .table_image = tiny.image,
                                .table_bytes = tiny.bytes};
    node_init(&node, &setup);
}

/* As it is at the end of the self-test, which takes longer than most inputs: kept from the first time. */
static void be_safe(void) {
    static float pressure_safe_pa[3];
    static struct hal_outputs outputs_safe;
    static uint32_t noise_safe;
    static int64_t time_safe_us;
    if (time_safe_us == 0) {
        switch_on();
        while (node.app.controller.status.state != SUPERVISOR_SAFE) {
            step();
        }
        node_safe = node;
        storage_safe = storage;
        memcpy(pressure_safe_pa, pressure_pa, sizeof pressure_pa);
        outputs_safe = outputs;
        noise_safe = noise;
        time_safe_us = time_us;
    }
    node = node_safe;
    storage = storage_safe;
    memcpy(pressure_pa, pressure_safe_pa, sizeof pressure_pa);
    outputs = outputs_safe;
    noise = noise_safe;
    time_us = time_safe_us;
    waits = false;
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
            next = (struct hal_can_frame){.id = (uint32_t)bytes[at] | (uint32_t)bytes[at + 1u] << 8u,
                                          .extended = control == 1u,
                                          .fd = control == 2u,
                                          .length = length};
            at += 3u;
            const size_t there = size - at < length ? size - at : length;
            memcpy(next.data, bytes + at, there);
            at += there;
            waits = true;
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
