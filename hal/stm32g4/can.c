#include "stm32g4/can.h"

#include <stddef.h>
#include <string.h>

#include "stm32g4/conversions.h"
#include "stm32g4/core.h"
#include "stm32g4/handlers.h"
#include "stm32g4/pins.h"
#include "stm32g4/registers.h"

#define PIN_RECEIVE 11u
#define PIN_SEND 12u
#define FUNCTION 9u
#define PRIORITY 3u
#define RING 32u /* frames each way; a power of two */
#define NOMINAL_SAMPLE_PERMILLE 800u
#define DATA_SAMPLE_PERMILLE 760u
#define POLLS 10000u
#define CLASSIC_BYTES 8u
#define STANDARD_ID_MOST 0x7ffu
#define EXTENDED_ID_MOST 0x1fffffffu

/* Filled on one side, emptied on the other. */
struct frame_ring {
    struct hal_can_frame frame[RING];
    volatile uint32_t written;
    volatile uint32_t taken;
};

static struct frame_ring received; /* interrupt to control step */
static struct frame_ring waiting;  /* control step to interrupt */
static volatile uint32_t receive_lost;
static volatile uint32_t transmit_lost;
static volatile uint32_t bus_off_count;
static bool fd_enabled;
static bool off_seen; /* bus-off, and since when */
static int64_t off_us;

static bool is_full(const struct frame_ring *ring) {
    return ring->written - ring->taken >= RING;
}

/* --- frames and message memory: words of the bus are little-endian, as the core's --- */

static void read_element(const struct fdcan_element *element, struct hal_can_frame *frame) {
    const uint32_t id = element->id, control = element->control;
    frame->extended = (id & FDCAN_ID_EXTENDED) != 0u;
    frame->id = frame->extended ? id & EXTENDED_ID_MOST : (id >> FDCAN_ID_STANDARD_SHIFT) & STANDARD_ID_MOST;
    frame->fd = (control & FDCAN_CONTROL_FD) != 0u;
    const uint8_t length =
        conversions_can_length((control >> FDCAN_CONTROL_LENGTH_SHIFT) & FDCAN_CONTROL_LENGTH_MASK);
    frame->length = !frame->fd && length > CLASSIC_BYTES ? CLASSIC_BYTES : length;
    for (uint32_t i = 0; i < frame->length; i += 4u) {
        const uint32_t word = element->data[i / 4u];
        (void)memcpy(&frame->data[i], &word, sizeof word);
    }
}

static void write_element(struct fdcan_element *element, const struct hal_can_frame *frame) {
    uint32_t code = 0u;
    (void)conversions_can_code(frame->length, &code); /* can_send() has seen that there is one */
    element->id = frame->extended ? FDCAN_ID_EXTENDED | frame->id : frame->id << FDCAN_ID_STANDARD_SHIFT;
    element->control = (code << FDCAN_CONTROL_LENGTH_SHIFT) |
                       (frame->fd ? FDCAN_CONTROL_FD | FDCAN_CONTROL_RATE_SWITCH : 0u);
    for (uint32_t i = 0; i < frame->length; i += 4u) {
        uint32_t word;
        (void)memcpy(&word, &frame->data[i], sizeof word);
        element->data[i / 4u] = word;
    }
}

/* --- interrupt --- */

static void take_received(void) {
    for (uint32_t i = 0; i < RING && (FDCAN1->rxf0s & FDCAN_RXF0S_FILL_MASK) != 0u; i++) {
        const uint32_t index = (FDCAN1->rxf0s >> FDCAN_RXF0S_GET_SHIFT) & FDCAN_INDEX_MASK;
        const struct fdcan_element *element = &FDCAN1_MEMORY->receive[0][index];
        if (is_full(&received)) {
            receive_lost = receive_lost + 1u;
        } else if ((element->id & FDCAN_ID_REMOTE) == 0u) {
            read_element(element, &received.frame[received.written % RING]);
            received.written = received.written + 1u;
        } else {
            /* a remote frame asks for data that nobody here has */
        }
        FDCAN1->rxf0a = index;
    }
}

/* From the ring into free buffers. From the interrupt, or with it masked. */
static void hand_over(void) {
    for (uint32_t i = 0; i < FDCAN_BUFFERS; i++) {
        const uint32_t state = FDCAN1->txfqs;
        if ((state & FDCAN_TXFQS_FREE_MASK) == 0u || waiting.taken == waiting.written) {
            return;
        }
        const uint32_t index = (state >> FDCAN_TXFQS_PUT_SHIFT) & FDCAN_INDEX_MASK;
        write_element(&FDCAN1_MEMORY->transmit[index], &waiting.frame[waiting.taken % RING]);
        FDCAN1->txbar = 1u << index;
        waiting.taken = waiting.taken + 1u;
    }
}

void handler_fdcan1(void) {
    const uint32_t flags = FDCAN1->ir;
    FDCAN1->ir = flags;
    receive_lost = receive_lost + ((flags & FDCAN_IR_RF0L) != 0u ? 1u : 0u);
    if ((flags & FDCAN_IR_BO) != 0u && (FDCAN1->psr & FDCAN_PSR_BO) != 0u) {
        bus_off_count = bus_off_count + 1u;
    }
    take_received();
    if ((FDCAN1->cccr & FDCAN_CCCR_INIT) == 0u) {
        hand_over();
    }
}

/* --- struct hal_bus --- */

/* Mostly 8 of the 64 bytes that a frame has room for. */
static void copy_frame(struct hal_can_frame *to, const struct hal_can_frame *from) {
    (void)memcpy(to, from, offsetof(struct hal_can_frame, data) + from->length);
}

static bool can_receive(void *context, struct hal_can_frame *frame) {
    (void)context;
    if (received.taken == received.written) {
        return false;
    }
    copy_frame(frame, &received.frame[received.taken % RING]);
    received.taken = received.taken + 1u;
    return true;
}

static bool can_carry(const struct hal_can_frame *frame) {
    uint32_t code;
    return conversions_can_code(frame->length, &code) &&
           frame->id <= (frame->extended ? EXTENDED_ID_MOST : STANDARD_ID_MOST) &&
           (frame->fd ? fd_enabled : frame->length <= CLASSIC_BYTES);
}

static bool can_send(void *context, const struct hal_can_frame *frame) {
    (void)context;
    if (!can_carry(frame)) {
        return false;
    }
    if (is_full(&waiting)) {
        transmit_lost = transmit_lost + 1u;
        return false;
    }
    copy_frame(&waiting.frame[waiting.written % RING], frame);
    const uint32_t mask = core_mask();
    waiting.written = waiting.written + 1u;
    if ((FDCAN1->cccr & FDCAN_CCCR_INIT) == 0u) {
        hand_over();
    }
    core_unmask(mask);
    return true;
}

static void can_state(void *context, struct hal_can_state *state_now) {
    (void)context;
    const uint32_t protocol = FDCAN1->psr, counters = FDCAN1->ecr;
    *state_now = (struct hal_can_state){
        .transmit_errors = (uint8_t)(counters & FDCAN_ECR_TEC_MASK),
        .receive_errors = (uint8_t)((counters >> FDCAN_ECR_REC_SHIFT) & FDCAN_ECR_REC_MASK),
        .error_passive = (protocol & FDCAN_PSR_EP) != 0u,
        .bus_off = (protocol & FDCAN_PSR_BO) != 0u,
        .bus_off_count = bus_off_count,
        .receive_lost = receive_lost,
        .transmit_lost = transmit_lost,
    };
}

/* --- bus-off --- */

/* What waited is old news by the time the bus is back. */
static void drop_waiting(void) {
    const uint32_t mask = core_mask();
    const uint32_t pending = FDCAN1->txbrp;
    for (uint32_t i = 0; i < FDCAN_BUFFERS; i++) {
        transmit_lost = transmit_lost + ((pending >> i) & 1u);
    }
    FDCAN1->txbcr = pending;
    transmit_lost = transmit_lost + (waiting.written - waiting.taken);
    waiting.taken = waiting.written;
    core_unmask(mask);
}

void can_step(int64_t time_us) {
    const bool off = (FDCAN1->psr & FDCAN_PSR_BO) != 0u && (FDCAN1->cccr & FDCAN_CCCR_INIT) != 0u;
    if (!off) {
        off_seen = false;
    } else if (!off_seen) {
        off_seen = true;
        off_us = time_us;
    } else if (time_us - off_us >= CAN_RECOVERY_US) {
        drop_waiting();
        FDCAN1->cccr &= ~FDCAN_CCCR_INIT; /* then 129 x 11 recessive bits, by the controller itself */
        off_seen = false;
    } else {
        /* not yet */
    }
}

/* --- start --- */

static bool set_nominal_timing(uint32_t clock_hz, uint32_t rate) {
    struct can_timing timing;
    if (!conversions_can_timing(clock_hz, rate, NOMINAL_SAMPLE_PERMILLE, &can_nominal_limits, &timing)) {
        return false;
    }
    FDCAN1->nbtp = ((timing.jump - 1u) << FDCAN_NBTP_NSJW_SHIFT) |
                   ((timing.prescaler - 1u) << FDCAN_NBTP_NBRP_SHIFT) |
                   ((timing.segment_1 - 1u) << FDCAN_NBTP_NTSEG1_SHIFT) | (timing.segment_2 - 1u);
    return true;
}

/* The second sample point, for the delay of the own transceiver, is where the first one is. */
static bool set_data_timing(uint32_t clock_hz, uint32_t rate) {
    struct can_timing timing;
    if (!conversions_can_timing(clock_hz, rate, DATA_SAMPLE_PERMILLE, &can_data_limits, &timing)) {
        return false;
    }
    FDCAN1->dbtp = FDCAN_DBTP_TDC | ((timing.prescaler - 1u) << FDCAN_DBTP_DBRP_SHIFT) |
                   ((timing.segment_1 - 1u) << FDCAN_DBTP_DTSEG1_SHIFT) |
                   ((timing.segment_2 - 1u) << FDCAN_DBTP_DTSEG2_SHIFT) | (timing.jump - 1u);
    FDCAN1->tdcr = ((timing.segment_1 + 1u) * timing.prescaler) << FDCAN_TDCR_TDCO_SHIFT;
    return true;
}

static void clear_memory(void) {
    reg32 *word = (reg32 *)FDCAN1_MEMORY_ADDRESS;
    for (uint32_t i = 0; i < sizeof(struct fdcan_memory) / 4u; i++) {
        word[i] = 0u;
    }
}

static void set_filters(const struct can_settings *settings) {
    const uint32_t count = settings->filters < CAN_FILTERS_MOST ? settings->filters : CAN_FILTERS_MOST;
    for (uint32_t i = 0; i < count; i++) {
        FDCAN1_MEMORY->standard_filter[i] = FDCAN_FILTER_CLASSIC | FDCAN_FILTER_TO_FIFO0 |
                                            ((uint32_t)settings->filter[i].id << FDCAN_FILTER_ID_SHIFT) |
                                            settings->filter[i].mask;
    }
    FDCAN1->rxgfc = (count << FDCAN_RXGFC_LSS_SHIFT) | FDCAN_RXGFC_ANFS_REJECT | FDCAN_RXGFC_ANFE_REJECT |
                    FDCAN_RXGFC_RRFS | FDCAN_RXGFC_RRFE;
}

static void set_interrupts(void) {
    FDCAN1->ir = FDCAN_IR_ALL;
    FDCAN1->ie = FDCAN_IR_RF0N | FDCAN_IR_RF0L | FDCAN_IR_TC | FDCAN_IR_BO;
    FDCAN1->txbtie = (1u << FDCAN_BUFFERS) - 1u;
    FDCAN1->ils = 0u;
    FDCAN1->ile = FDCAN_ILE_EINT0;
    core_enable_interrupt(IRQ_FDCAN1_IT0, PRIORITY);
}

bool can_start(uint32_t clock_hz, const struct can_settings *settings, struct hal_bus *bus) {
    *bus = (struct hal_bus){.context = NULL, .receive = can_receive, .send = can_send, .state = can_state};
    RCC->ccipr = (RCC->ccipr & ~RCC_CCIPR_FDCANSEL_MASK) | RCC_CCIPR_FDCANSEL_PCLK1;
    RCC->apb1enr1 |= RCC_APB1ENR1_FDCAN;
    (void)RCC->apb1enr1;
    FDCAN1->cccr = FDCAN_CCCR_INIT;
    if (!core_await(&FDCAN1->cccr, FDCAN_CCCR_INIT, FDCAN_CCCR_INIT, POLLS)) {
        return false;
    }
    FDCAN1->cccr = FDCAN_CCCR_INIT | FDCAN_CCCR_CCE;
    if (!set_nominal_timing(clock_hz, settings->bit_rate)) {
        return false;
    }
    fd_enabled = settings->fd && set_data_timing(clock_hz, settings->data_bit_rate);
    bus->fd = fd_enabled;
    clear_memory();
    set_filters(settings);
    FDCAN1->txbc = 0u; /* first in, first out */
    pins_alternate(GPIOA, PIN_RECEIVE, FUNCTION, GPIO_PULL_UP);
    pins_alternate(GPIOA, PIN_SEND, FUNCTION, GPIO_PULL_UP);
    set_interrupts();
    FDCAN1->cccr = FDCAN_CCCR_INIT | FDCAN_CCCR_CCE | (fd_enabled ? FDCAN_CCCR_FDOE | FDCAN_CCCR_BRSE : 0u);
    FDCAN1->cccr &= ~FDCAN_CCCR_INIT;
    return core_await(&FDCAN1->cccr, FDCAN_CCCR_INIT, 0u, POLLS);
}
