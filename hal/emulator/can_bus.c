#include "emulator/can_bus.h"

#include <string.h>

#define BITS_MOST 1024u
#define INTERMISSION_BITS 3
#define RECESSIVE_RUN_BITS 11
#define RECOVERY_RUNS 128u
#define SUSPEND_BITS 8
#define ERROR_FRAME_BITS 17 /* flag of 6, its echo of up to 3 more, delimiter of 8 */
#define TAIL_BITS 10        /* CRC delimiter, acknowledge slot and its delimiter, 7 of the frame's end */
#define PASSIVE_AT 128u
#define OFF_AFTER_DOMINANT_BITS (14 + 31 * 8)
#define OFF_AT 256u
#define BACK_FROM_PASSIVE 119u
#define ERROR_STUFF 1
#define ERROR_FORM 2
#define ERROR_ACK 3
#define ERROR_BIT_0 5
#define ERROR_CRC 6
#define NO_ERROR 0
#define CRC15 0x4599u

/* --- bits of a frame --- */

struct bit_row {
    uint8_t bit[BITS_MOST];
    uint32_t count;
};

static void put(struct bit_row *row, uint32_t value, uint32_t bits) {
    for (uint32_t i = bits; i-- > 0u;) {
        row->bit[row->count++] = (uint8_t)(value >> i & 1u);
    }
}

static uint32_t crc15(const struct bit_row *row) {
    uint32_t crc = 0;
    for (uint32_t i = 0; i < row->count; i++) {
        const uint32_t feed = (uint32_t)row->bit[i] ^ (crc >> 14 & 1u);
        crc = crc << 1 & 0x7fffu;
        crc ^= feed != 0u ? CRC15 : 0u;
    }
    return crc;
}

/* Stuff bits that five equal bits in a row bring, within [from, to) of a row that starts at 0. */
static uint32_t stuffed(const struct bit_row *row, uint32_t from, uint32_t to) {
    uint32_t run = 0, stuff = 0;
    uint8_t last = 2;
    for (uint32_t i = 0; i < to; i++) {
        run = row->bit[i] == last ? run + 1u : 1u;
        last = row->bit[i];
        if (run == 5u) {
            stuff += i >= from ? 1u : 0u;
            last ^= 1u;
            run = 1u;
        }
    }
    return stuff;
}

static uint32_t length_code(uint32_t length) {
    static const uint8_t length_of[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    uint32_t code = 0;
    while (code < 15u && length_of[code] < length) {
        code++;
    }
    return code;
}

static void put_identifier(struct bit_row *row, const struct can_bus_frame *frame) {
    const struct hal_can_frame *can = &frame->frame;
    put(row, 0u, 1); /* start of frame */
    if (can->extended) {
        put(row, can->id >> 18, 11);
        put(row, 3u, 2); /* SRR, IDE */
        put(row, can->id & 0x3ffffu, 18);
        put(row, frame->remote ? 1u : 0u, 1);
    } else {
        put(row, can->id, 11);
        put(row, frame->remote ? 2u : 0u, 2); /* RTR, IDE */
    }
}

static void put_data(struct bit_row *row, const struct can_bus_frame *frame) {
    for (uint32_t i = 0; !frame->remote && i < frame->frame.length; i++) {
        put(row, frame->frame.data[i], 8);
    }
}

static int64_t classic_ticks(const struct can_bus_frame *frame, int64_t bit_ticks) {
    struct bit_row row = {.count = 0};
    put_identifier(&row, frame);
    put(&row, 0u, frame->frame.extended ? 2 : 1); /* reserved */
    put(&row, frame->frame.length, 4);
    put_data(&row, frame);
    put(&row, crc15(&row), 15);
    return (int64_t)(row.count + stuffed(&row, 0u, row.count) + TAIL_BITS) * bit_ticks;
}

/* The CRC of FD frames has fixed stuff bits, one before it and one after each four bits, and a stuff count of
 * 4 bits. */
static int64_t fd_ticks(const struct can_bus_frame *frame, int64_t bit_ticks, int64_t data_bit_ticks) {
    struct bit_row row = {.count = 0};
    put_identifier(&row, frame);
    put(&row, 2u, 2);                           /* FDF, reserved */
    put(&row, frame->rate_switch ? 1u : 0u, 1); /* the rate changes at this bit's sample point */
    const uint32_t switched = row.count;
    put(&row, 0u, 1); /* ESI */
    put(&row, length_code(frame->frame.length), 4);
    put_data(&row, frame);
    const uint32_t crc = frame->frame.length > 16u ? 21u : 17u;
    const int64_t before = switched + stuffed(&row, 0u, switched);
    const int64_t after =
        row.count - switched + stuffed(&row, switched, row.count) + 4u + crc + 1u + (4u + crc) / 4u;
    return (before + TAIL_BITS) * bit_ticks + after * (frame->rate_switch ? data_bit_ticks : bit_ticks);
}

int64_t can_bus_frame_ticks(const struct can_bus_frame *frame, int64_t bit_ticks, int64_t data_bit_ticks) {
    return frame->frame.fd ? fd_ticks(frame, bit_ticks, data_bit_ticks) : classic_ticks(frame, bit_ticks);
}

/* --- error counters, ISO 11898-1, 12.1.4 --- */

static bool is_passive(const struct can_bus_node *node) {
    return node->transmit_errors >= PASSIVE_AT || node->receive_errors >= PASSIVE_AT;
}

static void tell(struct can_bus_node *node, uint8_t error) {
    node->last_error = error;
    if (node->changed != NULL) {
        node->changed(node->context);
    }
}

static void fail_sender(struct can_bus *bus, struct can_bus_node *node, uint8_t error) {
    /* An error-passive node that is alone with its frame keeps its count (exception 1 of rule c). */
    node->transmit_errors += error == ERROR_ACK && is_passive(node) ? 0u : 8u;
    node->error_frames++;
    node->not_before_ticks = *bus->now_ticks + (is_passive(node) ? SUSPEND_BITS * node->bit_ticks : 0);
    if (node->transmit_errors >= OFF_AT) {
        node->bus_off = true;
        node->online = false;
        node->recovery = 0u;
    }
    tell(node, error);
}

/* After an error flag each further eight dominant bits count as an error: 31 times, and a sender is off the
 * bus. */
static void fail_for_good(struct can_bus_node *node) {
    node->transmit_errors = OFF_AT;
    node->error_frames++;
    node->bus_off = true;
    node->online = false;
    node->recovery = 0u;
    tell(node, ERROR_FORM);
}

static void fail_receiver(struct can_bus_node *node, uint32_t by, uint8_t error) {
    node->receive_errors = node->receive_errors + by > 135u ? 135u : node->receive_errors + by;
    node->error_frames++;
    tell(node, error);
}

static void succeed(struct can_bus *bus, struct can_bus_node *node, bool sender) {
    uint32_t *count = sender ? &node->transmit_errors : &node->receive_errors;
    const bool was_passive = is_passive(node);
    if (!sender && *count > PASSIVE_AT - 1u) {
        *count = BACK_FROM_PASSIVE;
    } else if (*count > 0u) {
        (*count)--;
    }
    if (sender && is_passive(node)) {
        node->not_before_ticks = *bus->now_ticks + SUSPEND_BITS * node->bit_ticks;
    }
    if (was_passive != is_passive(node) || node->last_error != NO_ERROR) {
        tell(node, NO_ERROR);
    }
}

/* --- the wire --- */

static bool hears(const struct can_bus *bus, const struct can_bus_node *a, const struct can_bus_node *b) {
    return bus->wire == CAN_BUS_SOUND ||
           (bus->wire == CAN_BUS_OPEN && (a == bus->node[0]) == (b == bus->node[0]));
}

/* Lower wins: 11 bits of the identifier, then standard before extended. */
static uint64_t rank(const struct can_bus_frame *frame) {
    const uint64_t id = frame->frame.id;
    const uint64_t base = frame->frame.extended ? id >> 18 : id;
    return base << 32 | (frame->frame.extended ? 1u : 0u) << 31 |
           (frame->frame.extended ? id & 0x3ffffu : 0u) << 1 | (frame->remote ? 1u : 0u);
}

static bool choose(struct can_bus *bus) {
    bus->sender = NULL;
    for (size_t i = 0; i < bus->nodes && bus->wire != CAN_BUS_DOMINANT; i++) {
        struct can_bus_node *node = bus->node[i];
        struct can_bus_frame frame;
        if ((bus->wire == CAN_BUS_OPEN && i > 0) || !node->online || node->listens_only ||
            node->recovery > 0u || node->not_before_ticks > *bus->now_ticks ||
            !node->wants(node->context, &frame)) {
            continue;
        }
        if (bus->sender == NULL || rank(&frame) < rank(&bus->frame)) {
            bus->sender = node;
            bus->frame = frame;
        }
    }
    return bus->sender != NULL;
}

static bool same_rate(const struct can_bus_node *a, const struct can_bus_node *b,
                      const struct can_bus_frame *frame) {
    const int64_t off =
        a->bit_ticks > b->bit_ticks ? a->bit_ticks - b->bit_ticks : b->bit_ticks - a->bit_ticks;
    const int64_t data_off = a->data_bit_ticks > b->data_bit_ticks ? a->data_bit_ticks - b->data_bit_ticks
                                                                   : b->data_bit_ticks - a->data_bit_ticks;
    return off * 100 <= a->bit_ticks &&
           (!frame->frame.fd || !frame->rate_switch || data_off * 100 <= a->data_bit_ticks);
}

static void start(struct can_bus *bus) {
    const struct can_bus_node *sender = bus->sender;
    const int64_t length = can_bus_frame_ticks(&bus->frame, sender->bit_ticks, sender->data_bit_ticks);
    bus->started_ticks = *bus->now_ticks;
    /* On shorted wires the very first dominant bit reads recessive. */
    schedule_set(bus->schedule, bus->slot,
                 *bus->now_ticks + (bus->wire == CAN_BUS_SHORTED ? sender->bit_ticks : length));
}

/* When a node that has to wait may go on. */
static int64_t next_wait(const struct can_bus *bus) {
    int64_t next = SCHEDULE_NEVER;
    for (size_t i = 0; i < bus->nodes; i++) {
        const struct can_bus_node *node = bus->node[i];
        int64_t at = SCHEDULE_NEVER;
        if (node->recovery > 0u && bus->wire != CAN_BUS_DOMINANT) {
            at = bus->idle_ticks + RECESSIVE_RUN_BITS * node->bit_ticks;
        } else if (node->online && node->not_before_ticks > *bus->now_ticks) {
            at = node->not_before_ticks;
        }
        next = at > *bus->now_ticks && at < next ? at : next;
    }
    return next;
}

void can_bus_attend(struct can_bus *bus) {
    if (bus->sender != NULL) {
        return;
    }
    if (*bus->now_ticks >= bus->idle_ticks && choose(bus)) {
        schedule_set(bus->schedule, bus->idle_slot, SCHEDULE_NEVER);
        start(bus);
        return;
    }
    schedule_set(bus->schedule, bus->idle_slot,
                 *bus->now_ticks < bus->idle_ticks ? bus->idle_ticks : next_wait(bus));
}

/* Eleven recessive bits have gone by, at the end of a frame or in an idle bus. */
static void recessive_run(struct can_bus *bus) {
    for (size_t i = 0; i < bus->nodes && bus->wire != CAN_BUS_DOMINANT; i++) {
        struct can_bus_node *node = bus->node[i];
        if (node->recovery > 0u && --node->recovery == 0u) {
            const bool was_off = node->bus_off;
            node->bus_off = false;
            node->online = true;
            if (was_off) {
                node->transmit_errors = node->receive_errors = 0u;
            }
            tell(node, NO_ERROR);
        }
    }
}

static void on_idle(void *context, int64_t at_ticks) {
    struct can_bus *bus = context;
    bool waits = false;
    for (size_t i = 0; i < bus->nodes; i++) {
        waits = waits || (bus->node[i]->recovery > 0u &&
                          at_ticks - bus->idle_ticks >= RECESSIVE_RUN_BITS * bus->node[i]->bit_ticks);
    }
    if (waits) {
        bus->idle_ticks = at_ticks; /* the next run starts here */
        recessive_run(bus);
    }
    can_bus_attend(bus);
}

/* The frame came to nothing: everybody has seen an error frame. */
static void fail(struct can_bus *bus, struct can_bus_node *sender, uint8_t error) {
    bus->errors++;
    for (size_t i = 0; i < bus->nodes; i++) {
        struct can_bus_node *node = bus->node[i];
        struct can_bus_frame frame;
        if (node != sender && node->online && bus->wire == CAN_BUS_SHORTED &&
            node->wants(node->context, &frame)) {
            fail_sender(bus, node, error); /* it has tried at the same time, and seen nobody */
        } else if (node != sender && node->online && hears(bus, sender, node) && error != ERROR_ACK) {
            fail_receiver(node, 1u, error == ERROR_BIT_0 ? ERROR_STUFF : ERROR_CRC);
        }
    }
    fail_sender(bus, sender, error);
}

/* What goes wrong with the frame on the wire; NO_ERROR: nothing. */
static uint8_t judge(struct can_bus *bus, const struct can_bus_node *sender) {
    bool acknowledged = false;
    if (bus->wire == CAN_BUS_SHORTED) {
        return ERROR_BIT_0;
    }
    for (size_t i = 0; i < bus->nodes; i++) {
        const struct can_bus_node *node = bus->node[i];
        if (node == sender || !node->online || !hears(bus, sender, node)) {
            continue;
        }
        if (!same_rate(sender, node, &bus->frame)) {
            return ERROR_FORM;
        }
        acknowledged = acknowledged || !node->listens_only;
    }
    if (bus->corrupt_next > 0u) {
        bus->corrupt_next--;
        return ERROR_FORM;
    }
    if (acknowledged && bus->lose_ack_next > 0u) {
        bus->lose_ack_next--;
        acknowledged = false;
    }
    return acknowledged ? NO_ERROR : ERROR_ACK;
}

static void deliver(struct can_bus *bus, struct can_bus_node *sender) {
    bus->frames++;
    for (size_t i = 0; i < bus->nodes; i++) {
        struct can_bus_node *node = bus->node[i];
        if (node != sender && node->online && hears(bus, sender, node)) {
            node->received_frames++;
            succeed(bus, node, false);
            node->received(node->context, &bus->frame);
        }
    }
    sender->sent_frames++;
    succeed(bus, sender, true);
    sender->sent(sender->context);
}

static void fail_dominant(struct can_bus *bus, struct can_bus_node *sender) {
    bus->sender = NULL;
    bus->errors++;
    fail_for_good(sender);
    for (size_t i = 0; i < bus->nodes; i++) {
        if (bus->node[i] != sender && bus->node[i]->online) {
            fail_receiver(bus->node[i], PASSIVE_AT, ERROR_STUFF);
        }
    }
}

static void on_end(void *context, int64_t at_ticks) {
    struct can_bus *bus = context;
    struct can_bus_node *sender = bus->sender;
    if (!sender->online) { /* was switched off in the middle of its frame */
        bus->sender = NULL;
        bus->idle_ticks = at_ticks + INTERMISSION_BITS * sender->bit_ticks;
        can_bus_attend(bus);
        return;
    }
    if (bus->wire == CAN_BUS_DOMINANT) {
        fail_dominant(bus, sender);
        return;
    }
    const uint8_t error = judge(bus, sender);
    const int64_t tail = (error == NO_ERROR ? 0 : ERROR_FRAME_BITS) + INTERMISSION_BITS;
    bus->sender = NULL;
    bus->idle_ticks = at_ticks + tail * sender->bit_ticks;
    bus->busy_ticks += bus->idle_ticks - bus->started_ticks;
    if (error == NO_ERROR) {
        deliver(bus, sender);
    } else {
        fail(bus, sender, error);
    }
    recessive_run(bus); /* the frame's end and the intermission are such a run */
    can_bus_attend(bus);
}

void can_bus_init(struct can_bus *bus, struct schedule *schedule, const int64_t *now_ticks) {
    memset(bus, 0, sizeof *bus);
    bus->schedule = schedule;
    bus->now_ticks = now_ticks;
    bus->slot = schedule_add(schedule, on_end, bus);
    bus->idle_slot = schedule_add(schedule, on_idle, bus);
}

bool can_bus_join(struct can_bus *bus, struct can_bus_node *node) {
    if (bus->nodes == CAN_BUS_NODES) {
        return false;
    }
    bus->node[bus->nodes++] = node;
    return true;
}

void can_bus_set_wire(struct can_bus *bus, enum can_bus_wire wire) {
    bus->wire = wire;
    if (bus->sender != NULL && wire == CAN_BUS_SHORTED) {
        schedule_set(bus->schedule, bus->slot, *bus->now_ticks + bus->sender->bit_ticks);
    } else if (bus->sender != NULL && wire == CAN_BUS_DOMINANT) {
        schedule_set(bus->schedule, bus->slot,
                     *bus->now_ticks + OFF_AFTER_DOMINANT_BITS * bus->sender->bit_ticks);
    }
    bus->idle_ticks = bus->sender == NULL ? *bus->now_ticks : bus->idle_ticks;
    can_bus_attend(bus);
}

void can_bus_start_node(struct can_bus *bus, struct can_bus_node *node) {
    node->recovery = node->bus_off ? RECOVERY_RUNS : 1u;
    if (bus->sender == NULL && bus->idle_ticks < *bus->now_ticks) {
        bus->idle_ticks = *bus->now_ticks; /* its eleven bits are counted from now */
    }
    can_bus_attend(bus);
}
