#include "emulator/fdcan.h"

#include <string.h>

#define IRQ_LINE_0 21u
#define IRQ_LINE_1 22u
#define CCCR_INIT 1u
#define CCCR_CCE 2u
#define CCCR_MON 0x20u
#define CCCR_DAR 0x40u
#define CCCR_FDOE 0x100u
#define CCCR_BRSE 0x200u
#define IR_RF0N 1u
#define IR_RF0F 2u
#define IR_RF0L 4u
#define IR_TC 0x80u
#define IR_TCF 0x100u
#define IR_TFE 0x200u
#define IR_ELO (1u << 16)
#define IR_EP (1u << 17)
#define IR_EW (1u << 18)
#define IR_BO (1u << 19)
#define IR_PEA (1u << 21)
#define IR_PED (1u << 22)
#define PSR_EP (1u << 5)
#define PSR_EW (1u << 6)
#define PSR_BO (1u << 7)
#define LEC_NO_CHANGE 7u
#define PASSIVE_AT 128u
#define WARNING_AT 96u
#define STANDARD_FILTERS 28u
#define EXTENDED_FILTER_WORD 28u
#define EXTENDED_FILTERS 8u
#define RECEIVE_WORD 44u
#define TRANSMIT_WORD 158u
#define ELEMENT_WORDS 18u
#define ID_EXTENDED (1u << 30)
#define ID_REMOTE (1u << 29)
#define CONTROL_FD (1u << 21)
#define CONTROL_RATE (1u << 20)
#define CONTROL_UNMATCHED (1u << 31)
#define TO_FIFO_0 1u
#define TO_FIFO_1 2u
#define REJECTED 3u
#define QUEUE_MODE (1u << 24)

static const uint8_t length_of_code[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static void set_lines(struct fdcan *fdcan) {
    const uint32_t raised = fdcan->interrupts & fdcan->enables;
    /* ILS moves groups of flags to line 1; only the whole of them is told apart here. */
    const bool to_line_1 = fdcan->line_select != 0u;
    core_line(fdcan->core, NVIC_FIRST_IRQ + IRQ_LINE_0,
              raised != 0u && !to_line_1 && (fdcan->lines & 1u) != 0);
    core_line(fdcan->core, NVIC_FIRST_IRQ + IRQ_LINE_1,
              raised != 0u && to_line_1 && (fdcan->lines & 2u) != 0);
}

static void raise(struct fdcan *fdcan, uint32_t flags) {
    fdcan->interrupts |= flags;
    set_lines(fdcan);
}

static int64_t bit_ticks(const struct fdcan *fdcan, uint32_t prescaler, uint32_t quanta) {
    return TICKS_PER_SECOND / fdcan->clock_hz * (int64_t)prescaler * (int64_t)quanta;
}

static void set_rates(struct fdcan *fdcan) {
    const uint32_t n = fdcan->nominal_timing, d = fdcan->data_timing;
    if (fdcan->clock_hz != 0u) {
        fdcan->node.bit_ticks = bit_ticks(fdcan, (n >> 16 & 511u) + 1u, 3u + (n >> 8 & 255u) + (n & 127u));
        fdcan->node.data_bit_ticks =
            bit_ticks(fdcan, (d >> 16 & 31u) + 1u, 3u + (d >> 8 & 31u) + (d >> 4 & 15u));
    }
}

/* --- sending --- */

/* Which buffer goes first: the oldest in FIFO mode, the lowest identifier in queue mode. */
static bool first_request(const struct fdcan *fdcan, uint32_t *which) {
    bool found = false;
    for (uint32_t i = 0; i < FDCAN_FIFO; i++) {
        const uint32_t at =
            (fdcan->transmit_config & QUEUE_MODE) != 0 ? i : (fdcan->sending + i) % FDCAN_FIFO;
        const uint32_t id = fdcan->memory[TRANSMIT_WORD + at * ELEMENT_WORDS] & 0x1fffffffu;
        const bool better =
            !found || ((fdcan->transmit_config & QUEUE_MODE) != 0 &&
                       id < (fdcan->memory[TRANSMIT_WORD + *which * ELEMENT_WORDS] & 0x1fffffffu));
        if ((fdcan->requests >> at & 1u) != 0 && better) {
            *which = at;
            found = true;
        }
    }
    return found;
}

static void element_to_frame(const struct fdcan *fdcan, const uint32_t *element,
                             struct can_bus_frame *frame) {
    const bool extended = (element[0] & ID_EXTENDED) != 0;
    const bool fd = (fdcan->control & CCCR_FDOE) != 0 && (element[1] & CONTROL_FD) != 0;
    const uint8_t length = length_of_code[element[1] >> 16 & 15u];
    memset(frame, 0, sizeof *frame);
    frame->remote = (element[0] & ID_REMOTE) != 0;
    frame->rate_switch = fd && (fdcan->control & CCCR_BRSE) != 0 && (element[1] & CONTROL_RATE) != 0;
    frame->frame.extended = extended;
    frame->frame.id = extended ? element[0] & 0x1fffffffu : element[0] >> 18 & 0x7ffu;
    frame->frame.fd = fd;
    frame->frame.length = !fd && length > 8 ? 8 : length;
    memcpy(frame->frame.data, &element[2], frame->frame.length);
}

static bool node_wants(void *context, struct can_bus_frame *frame) {
    struct fdcan *fdcan = context;
    uint32_t which = 0;
    if (!first_request(fdcan, &which)) {
        return false;
    }
    fdcan->sending = which;
    element_to_frame(fdcan, &fdcan->memory[TRANSMIT_WORD + which * ELEMENT_WORDS], frame);
    return true;
}

static void node_sent(void *context) {
    struct fdcan *fdcan = context;
    const uint32_t bit = 1u << fdcan->sending;
    if (fdcan->sent != NULL) {
        fdcan->sent(fdcan->context, &fdcan->bus->frame);
    }
    fdcan->requests &= ~bit;
    fdcan->transmitted |= bit;
    fdcan->sending = (fdcan->sending + 1u) % FDCAN_FIFO;
    raise(fdcan,
          ((fdcan->transmit_interrupts & bit) != 0 ? IR_TC : 0u) | (fdcan->requests == 0u ? IR_TFE : 0u));
}

/* --- receiving --- */

static bool matches(uint32_t type, uint32_t id, uint32_t first, uint32_t second) {
    switch (type) {
    case 0u:
        return id >= first && id <= second;
    case 1u:
        return id == first || id == second;
    case 2u:
        return (id & second) == (first & second);
    default:
        return false;
    }
}

static uint32_t target_standard(const struct fdcan *fdcan, uint32_t id, uint32_t *filter) {
    const uint32_t count = fdcan->filters >> 16 & 31u;
    for (uint32_t i = 0; i < count && i < STANDARD_FILTERS; i++) {
        const uint32_t word = fdcan->memory[i];
        if ((word >> 27 & 7u) != 0u && matches(word >> 30, id, word >> 16 & 0x7ffu, word & 0x7ffu)) {
            *filter = i;
            return word >> 27 & 7u;
        }
    }
    *filter = UINT32_MAX;
    return (fdcan->filters >> 4 & 3u) + 1u;
}

static uint32_t target_extended(const struct fdcan *fdcan, uint32_t id, uint32_t *filter) {
    const uint32_t count = fdcan->filters >> 24 & 15u;
    for (uint32_t i = 0; i < count && i < EXTENDED_FILTERS; i++) {
        const uint32_t *word = &fdcan->memory[EXTENDED_FILTER_WORD + 2u * i];
        const uint32_t type = word[1] >> 30 == 3u ? 0u : word[1] >> 30;
        if (word[0] >> 29 != 0u && matches(type, id, word[0] & 0x1fffffffu, word[1] & 0x1fffffffu)) {
            *filter = i;
            return word[0] >> 29;
        }
    }
    *filter = UINT32_MAX;
    return (fdcan->filters >> 2 & 3u) + 1u;
}

static uint32_t code_of_length(uint32_t length) {
    uint32_t code = 0;
    while (code < 15u && length_of_code[code] < length) {
        code++;
    }
    return code;
}

static void store(struct fdcan *fdcan, uint32_t fifo, uint32_t filter, const struct can_bus_frame *frame) {
    const uint32_t put = (fdcan->receive_get[fifo] + fdcan->receive_fill[fifo]) % FDCAN_FIFO;
    uint32_t *element = &fdcan->memory[RECEIVE_WORD + (FDCAN_FIFO * fifo + put) * ELEMENT_WORDS];
    const uint32_t shift = 3u * fifo; /* RF1's flags follow RF0's */
    if (fdcan->receive_fill[fifo] == FDCAN_FIFO) {
        fdcan->receive_lost[fifo] = true;
        fdcan->lost++;
        raise(fdcan, IR_RF0L << shift);
        return;
    }
    element[0] = (frame->frame.extended ? ID_EXTENDED | frame->frame.id : frame->frame.id << 18) |
                 (frame->remote ? ID_REMOTE : 0u);
    element[1] = code_of_length(frame->frame.length) << 16 | (frame->frame.fd ? CONTROL_FD : 0u) |
                 (frame->rate_switch ? CONTROL_RATE : 0u) |
                 (filter == UINT32_MAX ? CONTROL_UNMATCHED : filter << 24);
    memcpy(&element[2], frame->frame.data, HAL_CAN_DATA_BYTES);
    fdcan->receive_fill[fifo]++;
    raise(fdcan, (IR_RF0N | (fdcan->receive_fill[fifo] == FDCAN_FIFO ? IR_RF0F : 0u)) << shift);
}

static void node_received(void *context, const struct can_bus_frame *frame) {
    struct fdcan *fdcan = context;
    const bool rejects_remote = (fdcan->filters & (frame->frame.extended ? 1u : 2u)) != 0;
    uint32_t filter = UINT32_MAX;
    const uint32_t target = frame->frame.extended ? target_extended(fdcan, frame->frame.id, &filter)
                                                  : target_standard(fdcan, frame->frame.id, &filter);
    if (fdcan->received != NULL) {
        fdcan->received(fdcan->context, frame);
    }
    if ((frame->remote && rejects_remote) || (target != TO_FIFO_0 && target != TO_FIFO_1)) {
        fdcan->filtered++;
        return;
    }
    store(fdcan, target == TO_FIFO_0 ? 0u : 1u, filter, frame);
}

/* --- states and errors --- */

static bool is_passive(const struct can_bus_node *node) {
    return node->transmit_errors >= PASSIVE_AT || node->receive_errors >= PASSIVE_AT;
}

static bool is_warned(const struct can_bus_node *node) {
    return node->transmit_errors >= WARNING_AT || node->receive_errors >= WARNING_AT;
}

static uint32_t status_bits(const struct fdcan *fdcan) {
    const struct can_bus_node *node = &fdcan->node;
    return (is_passive(node) && !node->bus_off ? PSR_EP : 0u) | (is_warned(node) ? PSR_EW : 0u) |
           (node->bus_off ? PSR_BO : 0u);
}

static void node_changed(void *context) {
    struct fdcan *fdcan = context;
    const uint32_t before = fdcan->plain[1], now = status_bits(fdcan);
    uint32_t flags = (before ^ now) & PSR_EP ? IR_EP : 0u;
    flags |= (before ^ now) & PSR_EW ? IR_EW : 0u;
    flags |= (before ^ now) & PSR_BO ? IR_BO : 0u;
    if (fdcan->node.last_error != 0u) {
        fdcan->last_error = fdcan->node.last_error;
        fdcan->error_log = fdcan->error_log < 255u ? fdcan->error_log + 1u : 255u;
        flags |= IR_PEA;
        if ((fdcan->control & CCCR_DAR) != 0) {
            fdcan->requests = 0u; /* not tried again */
        }
    } else {
        fdcan->last_error = 0u;
    }
    if (fdcan->node.bus_off && (before & PSR_BO) == 0) {
        fdcan->control |= CCCR_INIT;
    }
    fdcan->plain[1] = now;
    raise(fdcan, flags);
}

static void write_control(struct fdcan *fdcan, uint32_t value) {
    const bool was_init = (fdcan->control & CCCR_INIT) != 0, init = (value & CCCR_INIT) != 0;
    uint32_t control = value & (CCCR_INIT | CCCR_MON | CCCR_DAR | CCCR_FDOE | CCCR_BRSE | CCCR_CCE | 0x7090u);
    if (!(was_init && init)) {
        control &= ~CCCR_CCE;
    }
    if ((fdcan->control & CCCR_CCE) == 0) { /* the rest is protected */
        const uint32_t guarded = CCCR_MON | CCCR_DAR | CCCR_FDOE | CCCR_BRSE;
        control = (control & ~guarded) | (fdcan->control & guarded);
    }
    fdcan->control = control;
    fdcan->node.listens_only = (control & CCCR_MON) != 0;
    if (init && !was_init) {
        fdcan->node.online = false;
        fdcan->node.recovery = 0u;
    } else if (!init && was_init) {
        set_rates(fdcan);
        can_bus_start_node(fdcan->bus, &fdcan->node);
    }
}

void fdcan_init(struct fdcan *fdcan, struct core *core, struct can_bus *bus) {
    memset(fdcan, 0, sizeof *fdcan);
    fdcan->core = core;
    fdcan->bus = bus;
    fdcan->node = (struct can_bus_node){.context = fdcan,
                                        .wants = node_wants,
                                        .sent = node_sent,
                                        .received = node_received,
                                        .changed = node_changed};
    (void)can_bus_join(bus, &fdcan->node);
}

void fdcan_reset(struct fdcan *fdcan, uint32_t clock_hz) {
    fdcan->control = CCCR_INIT;
    fdcan->data_timing = 0xa33u;
    fdcan->nominal_timing = 0x06000a03u;
    fdcan->delay = fdcan->interrupts = fdcan->enables = fdcan->line_select = fdcan->lines = fdcan->filters =
        0u;
    fdcan->transmit_config = fdcan->requests = fdcan->transmitted = fdcan->cancelled =
        fdcan->transmit_interrupts = 0u;
    fdcan->put = fdcan->sending = fdcan->error_log = 0u;
    fdcan->last_error = LEC_NO_CHANGE;
    memset(fdcan->receive_fill, 0, sizeof fdcan->receive_fill);
    memset(fdcan->receive_get, 0, sizeof fdcan->receive_get);
    memset(fdcan->receive_lost, 0, sizeof fdcan->receive_lost);
    memset(fdcan->plain, 0, sizeof fdcan->plain);
    fdcan->node.online = fdcan->node.bus_off = fdcan->node.listens_only = false;
    fdcan->node.transmit_errors = fdcan->node.receive_errors = fdcan->node.recovery = 0u;
    fdcan->node.last_error = 0;
    fdcan->node.not_before_ticks = 0;
    fdcan->clock_hz = clock_hz;
    set_rates(fdcan);
    set_lines(fdcan);
}

void fdcan_clock(struct fdcan *fdcan, uint32_t clock_hz) {
    fdcan->clock_hz = clock_hz;
    set_rates(fdcan);
}

/* --- registers --- */

static uint32_t read_protocol_status(struct fdcan *fdcan) {
    const uint32_t activity = fdcan->bus->sender == &fdcan->node ? 3u : fdcan->node.online ? 1u : 0u;
    const uint32_t value = fdcan->last_error | activity << 3 | status_bits(fdcan) | LEC_NO_CHANGE << 8;
    fdcan->last_error = LEC_NO_CHANGE;
    return value;
}

static uint32_t read_error_counters(struct fdcan *fdcan) {
    const struct can_bus_node *node = &fdcan->node;
    const uint32_t transmit = node->transmit_errors > 255u ? 255u : node->transmit_errors;
    const uint32_t receive = node->receive_errors > 127u ? 127u : node->receive_errors;
    const uint32_t value = transmit | receive << 8 | (node->receive_errors >= PASSIVE_AT ? 1u << 15 : 0u) |
                           fdcan->error_log << 16;
    fdcan->error_log = 0u;
    return value;
}

static uint32_t read_fifo_status(const struct fdcan *fdcan, uint32_t fifo) {
    const uint32_t fill = fdcan->receive_fill[fifo], get = fdcan->receive_get[fifo];
    return fill | get << 8 | (get + fill) % FDCAN_FIFO << 16 | (fill == FDCAN_FIFO ? 1u << 24 : 0u) |
           (fdcan->receive_lost[fifo] ? 1u << 25 : 0u);
}

static uint32_t read_transmit_status(const struct fdcan *fdcan) {
    uint32_t free = 0, put = fdcan->put;
    for (uint32_t i = 0; i < FDCAN_FIFO; i++) {
        free += (fdcan->requests >> i & 1u) == 0 ? 1u : 0u;
    }
    if ((fdcan->transmit_config & QUEUE_MODE) != 0) {
        for (put = 0u; put < FDCAN_FIFO - 1u && (fdcan->requests >> put & 1u) != 0; put++) {
        }
    }
    return free | fdcan->sending << 8 | put << 16 | (free == 0u ? 1u << 21 : 0u);
}

static uint32_t *plain(struct fdcan *fdcan, uint32_t offset) {
    switch (offset) {
    case 0x00cu:
        return &fdcan->data_timing;
    case 0x010u:
        return &fdcan->plain[0];
    case 0x01cu:
        return &fdcan->nominal_timing;
    case 0x048u:
        return &fdcan->delay;
    case 0x054u:
        return &fdcan->enables;
    case 0x058u:
        return &fdcan->line_select;
    case 0x05cu:
        return &fdcan->lines;
    case 0x080u:
        return &fdcan->filters;
    case 0x0c0u:
        return &fdcan->transmit_config;
    case 0x0dcu:
        return &fdcan->transmit_interrupts;
    default:
        return NULL;
    }
}

bool fdcan_read(void *context, uint32_t offset, uint32_t *value) {
    struct fdcan *fdcan = context;
    const uint32_t *word = plain(fdcan, offset);
    if (word != NULL) {
        *value = *word;
        return true;
    }
    switch (offset) {
    case 0x000u:
        *value = 0x32141218u; /* core release */
        return true;
    case 0x018u:
        *value = fdcan->control;
        return true;
    case 0x040u:
        *value = read_error_counters(fdcan);
        return true;
    case 0x044u:
        *value = read_protocol_status(fdcan);
        return true;
    case 0x050u:
        *value = fdcan->interrupts;
        return true;
    case 0x090u:
    case 0x098u:
        *value = read_fifo_status(fdcan, offset == 0x090u ? 0u : 1u);
        return true;
    case 0x0c4u:
        *value = read_transmit_status(fdcan);
        return true;
    case 0x0c8u:
        *value = fdcan->requests;
        return true;
    case 0x0d4u:
        *value = fdcan->transmitted;
        return true;
    case 0x0d8u:
        *value = fdcan->cancelled;
        return true;
    default:
        *value = 0u;
        return offset == 0x094u || offset == 0x09cu || offset == 0x0ccu || offset == 0x0d0u;
    }
}

static void acknowledge(struct fdcan *fdcan, uint32_t fifo, uint32_t index) {
    const uint32_t taken = (index + FDCAN_FIFO - fdcan->receive_get[fifo]) % FDCAN_FIFO + 1u;
    if (taken <= fdcan->receive_fill[fifo]) {
        fdcan->receive_fill[fifo] -= taken;
        fdcan->receive_get[fifo] = (index + 1u) % FDCAN_FIFO;
        fdcan->receive_lost[fifo] = false;
    }
}

static void request(struct fdcan *fdcan, uint32_t bits) {
    if ((fdcan->control & CCCR_CCE) != 0) {
        return;
    }
    for (uint32_t i = 0; i < FDCAN_FIFO; i++) {
        if ((bits >> i & 1u) != 0) {
            fdcan->put = (i + 1u) % FDCAN_FIFO;
        }
    }
    if (fdcan->requests == 0u && bits != 0u) { /* an empty FIFO starts where it is filled */
        for (fdcan->sending = 0u; (bits >> fdcan->sending & 1u) == 0; fdcan->sending++) {
        }
    }
    fdcan->requests |= bits;
    fdcan->transmitted &= ~bits;
    fdcan->cancelled &= ~bits;
    can_bus_attend(fdcan->bus);
}

/* A frame on the wire goes on to its end; what waits is dropped at once. */
static void cancel(struct fdcan *fdcan, uint32_t bits) {
    const uint32_t busy = fdcan->bus->sender == &fdcan->node ? 1u << fdcan->sending : 0u;
    const uint32_t dropped = fdcan->requests & bits & ~busy;
    fdcan->requests &= ~dropped;
    fdcan->cancelled |= dropped;
    if (fdcan->requests == 0u) {
        fdcan->sending = fdcan->put;
    }
    raise(fdcan, dropped != 0u ? IR_TCF : 0u);
}

bool fdcan_write(void *context, uint32_t offset, uint32_t value) {
    struct fdcan *fdcan = context;
    uint32_t *word = plain(fdcan, offset);
    const bool guarded =
        offset == 0x00cu || offset == 0x01cu || offset == 0x080u || offset == 0x0c0u || offset == 0x048u;
    if (word != NULL) {
        *word = guarded && (fdcan->control & CCCR_CCE) == 0 ? *word : value;
        set_lines(fdcan);
        return true;
    }
    switch (offset) {
    case 0x018u:
        write_control(fdcan, value);
        return true;
    case 0x050u:
        fdcan->interrupts &= ~value;
        set_lines(fdcan);
        return true;
    case 0x094u:
    case 0x09cu:
        acknowledge(fdcan, offset == 0x094u ? 0u : 1u, value & 3u);
        return true;
    case 0x0ccu:
        request(fdcan, value & 7u);
        return true;
    case 0x0d0u:
        cancel(fdcan, value & 7u);
        return true;
    default:
        return false;
    }
}

bool fdcan_memory_read(void *context, uint32_t offset, uint32_t *value) {
    *value = offset / 4u < FDCAN_MEMORY_WORDS ? ((const struct fdcan *)context)->memory[offset / 4u] : 0u;
    return offset / 4u < FDCAN_MEMORY_WORDS;
}

bool fdcan_memory_write(void *context, uint32_t offset, uint32_t value) {
    if (offset / 4u < FDCAN_MEMORY_WORDS) {
        ((struct fdcan *)context)->memory[offset / 4u] = value;
    }
    return offset / 4u < FDCAN_MEMORY_WORDS;
}
