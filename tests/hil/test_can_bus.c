/* The virtual CAN bus and the FDCAN in front of it, driven through their registers without a program: frame
 * lengths, arbitration, acknowledgement, error counters, bus-off and recovery, filters and FIFOs. */
#include "emulator/can_host.h"
#include "emulator/fdcan.h"
#include "support/test.h"

#define BIT (TICKS_PER_SECOND / 1000000)
#define CCCR 0x018u
#define NBTP 0x01cu
#define DBTP 0x00cu
#define ECR 0x040u
#define PSR 0x044u
#define IR 0x050u
#define RXGFC 0x080u
#define RXF0S 0x090u
#define RXF0A 0x094u
#define TXFQS 0x0c4u
#define TXBRP 0x0c8u
#define TXBAR 0x0ccu
#define TXBCR 0x0d0u
#define RECEIVE 0x0b0u
#define TRANSMIT 0x278u
#define ELEMENT_BYTES 72u
#define PSR_EP (1u << 5)
#define PSR_BO (1u << 7)

static struct core core;
static struct can_bus bus;
static struct fdcan fdcan;
static struct can_host host, other;

static int open_core(void **state) {
    const struct core_peripherals none = {.context = NULL};
    char error[CORE_ERROR_BYTES];
    (void)state;
    return core_open(&core, &none, error, sizeof error) ? 0 : -1;
}

static int close_core(void **state) {
    (void)state;
    core_close(&core);
    return 0;
}

static void pass(int64_t ticks) {
    const int64_t until = core.now_ticks + ticks;
    while (core.schedule.next_ticks <= until) {
        core.now_ticks =
            core.schedule.next_ticks > core.now_ticks ? core.schedule.next_ticks : core.now_ticks;
        schedule_run(&core.schedule, core.now_ticks);
    }
    core.now_ticks = until;
}

static uint32_t get(uint32_t offset) {
    uint32_t value = 0;
    assert_true(fdcan_read(&fdcan, offset, &value));
    return value;
}

static void set(uint32_t offset, uint32_t value) {
    assert_true(fdcan_write(&fdcan, offset, value));
}

/* 170 MHz, 1 Mbit/s in 170 quanta, 5 Mbit/s in 34; filter 0 takes identifiers xx1. */
static void start(void) {
    set(CCCR, 1u);
    set(CCCR, 3u);
    set(NBTP, 33u << 25 | 134u << 8 | 33u);
    set(DBTP, 25u << 8 | 6u << 4);
    assert_true(fdcan_memory_write(&fdcan, 0u, 2u << 30 | 1u << 27 | 1u << 16 | 0xfu));
    set(RXGFC, 1u << 16 | 2u << 4 | 2u << 2 | 3u);
    set(CCCR, 0x303u);
    set(CCCR, 0x300u);
    pass(11 * BIT);
}

static int begin(void **state) {
    (void)state;
    core.now_ticks = 0;
    schedule_init(&core.schedule, &core.deadline_ticks);
    can_bus_init(&bus, &core.schedule, &core.now_ticks);
    fdcan_init(&fdcan, &core, &bus);
    fdcan_reset(&fdcan, 170000000u);
    start();
    return 0;
}

static struct hal_can_frame frame_of(uint32_t id, uint8_t length) {
    return (struct hal_can_frame){.id = id, .length = length};
}

/* Into the buffer that TXFQS names; returns which. */
static uint32_t transmit(uint32_t id, uint32_t word) {
    const uint32_t put = get(TXFQS) >> 16 & 3u;
    assert_true(fdcan_memory_write(&fdcan, TRANSMIT + put * ELEMENT_BYTES, id << 18));
    assert_true(fdcan_memory_write(&fdcan, TRANSMIT + put * ELEMENT_BYTES + 4u, 4u << 16));
    assert_true(fdcan_memory_write(&fdcan, TRANSMIT + put * ELEMENT_BYTES + 8u, word));
    set(TXBAR, 1u << put);
    return put;
}

/* --- lengths, by hand --- */

static void frames_are_as_long_as_iso_has_them(void **state) {
    struct can_bus_frame frame = {.frame = {.id = 0, .length = 0}};
    (void)state;
    /* 34 dominant bits with their CRC, 6 stuff bits, 10 of the tail */
    assert_int_equal(can_bus_frame_ticks(&frame, BIT, BIT) / BIT, 50);
    frame.frame.fd = true;
    /* 14 dominant bits, FDF, 7 dominant: 22 and 3 stuff bits; stuff count 4, CRC 17, 6 fixed stuff bits; 10
     * of the tail */
    assert_int_equal(can_bus_frame_ticks(&frame, BIT, BIT) / BIT, 62);
    frame.rate_switch = true;
    /* from ESI on at five times the rate: 5 bits with their stuff bit, and the CRC's 27 */
    assert_int_equal(can_bus_frame_ticks(&frame, 5 * BIT, BIT) / BIT, (17 + 2 + 10) * 5 + 5 + 1 + 27);
}

static void no_frame_is_longer_than_its_worst_case(void **state) {
    int64_t longest = 0, shortest = INT64_MAX;
    (void)state;
    for (uint32_t i = 0; i < 2000; i++) {
        struct can_bus_frame frame = {.frame = {.id = i % 0x800u, .length = 8}};
        for (uint32_t k = 0; k < 8; k++) {
            frame.frame.data[k] = (uint8_t)(i % 2u == 0 ? i / 256u * 0xffu : i * 2654435761u >> (3u * k));
        }
        const int64_t bits = can_bus_frame_ticks(&frame, 1, 1);
        longest = bits > longest ? bits : longest;
        shortest = bits < shortest ? bits : shortest;
    }
    assert_in_range(longest, 118, 132); /* 108 bits and at most 24 stuff bits (Davis et al. 2007) */
    assert_in_range(shortest, 108, 112);
}

/* --- sending and receiving --- */

static void a_frame_arrives_when_its_bits_have_passed(void **state) {
    struct can_host_heard heard;
    (void)state;
    assert_true(can_host_join(&host, &bus));
    const int64_t from = core.now_ticks;
    (void)transmit(0, 0);
    pass(1);
    assert_int_equal(get(TXBRP), 1);
    pass(200 * BIT);
    assert_int_equal(get(TXBRP), 0);
    assert_true(can_host_receive(&host, &heard));
    assert_int_equal(heard.frame.length, 4);
    assert_in_range(heard.at_us - from / TICKS_PER_US, 80, 95);
    assert_false(can_host_receive(&host, &heard));
    assert_int_equal(get(ECR) & 0xffu, 0);
}

static void the_lower_identifier_wins(void **state) {
    struct can_host_heard heard;
    (void)state;
    assert_true(can_host_join(&host, &bus) && can_host_join(&other, &bus));
    const struct hal_can_frame busy = frame_of(0x7ff, 8), low = frame_of(0x100, 1);
    assert_true(can_host_send(&other, &busy)); /* occupies the bus meanwhile */
    (void)transmit(0x200, 2);
    const struct hal_can_frame extended = {.id = 0x100u << 18, .extended = true, .length = 1};
    assert_true(can_host_send(&other, &extended));
    assert_true(can_host_send(&other, &low));
    pass(1000 * BIT);
    const uint32_t order[] = {0x7ff, 0x100u << 18, 0x100, 0x200};
    for (size_t i = 0; i < 4; i++) {
        assert_true(can_host_receive(&host, &heard));
        assert_int_equal(heard.frame.id, order[i]);
    }
}

static void filters_choose_and_a_full_fifo_loses(void **state) {
    (void)state;
    assert_true(can_host_join(&host, &bus));
    for (uint32_t i = 0; i < 8; i++) {
        const struct hal_can_frame frame = frame_of(0x100u + i, 2);
        assert_true(can_host_send(&host, &frame));
    }
    for (uint32_t i = 0; i < 4; i++) {
        const struct hal_can_frame frame = frame_of(0x201u + 0x10u * i, 3);
        assert_true(can_host_send(&host, &frame));
    }
    pass(2000 * BIT);
    assert_int_equal(fdcan.filtered, 7);
    assert_int_equal(get(RXF0S) & 0xfu, 3);
    assert_int_equal(get(IR) & 0x7u, 7); /* new, full, lost */
    assert_int_equal(fdcan.lost, 2);
    uint32_t id = 0;
    assert_true(fdcan_memory_read(&fdcan, RECEIVE + (get(RXF0S) >> 8 & 3u) * ELEMENT_BYTES, &id));
    assert_int_equal(id >> 18 & 0x7ffu, 0x101);
    set(RXF0A, get(RXF0S) >> 8 & 3u);
    assert_int_equal(get(RXF0S) & 0xfu, 2);
    assert_true(fdcan_memory_read(&fdcan, RECEIVE + (get(RXF0S) >> 8 & 3u) * ELEMENT_BYTES, &id));
    assert_int_equal(id >> 18 & 0x7ffu, 0x201);
}

static void buffers_go_first_in_first_out(void **state) {
    struct can_host_heard heard;
    (void)state;
    assert_true(can_host_join(&host, &bus));
    for (uint32_t round = 0; round < 3; round++) {
        for (uint32_t i = 0; i < 3; i++) {
            (void)transmit(0x300u - i, 10u * round + i);
        }
        assert_int_equal(get(TXFQS) & 7u, 0);
        assert_true((get(TXFQS) & 1u << 21) != 0);
        pass(400 * BIT);
        for (uint32_t i = 0; i < 3; i++) {
            assert_true(can_host_receive(&host, &heard));
            assert_int_equal(heard.frame.id, 0x300u - i);
            assert_int_equal(heard.frame.data[0], 10u * round + i);
        }
    }
}

static void what_waits_can_be_cancelled(void **state) {
    struct can_host_heard heard;
    (void)state;
    assert_true(can_host_join(&host, &bus));
    (void)transmit(0x10, 1);
    const uint32_t second = transmit(0x11, 2);
    set(TXBCR, 7u);
    assert_int_equal(get(TXBRP), 1); /* the first is on the wire */
    assert_int_equal(second, 1);
    pass(300 * BIT);
    assert_true(can_host_receive(&host, &heard));
    assert_false(can_host_receive(&host, &heard));
    (void)transmit(0x12, 3);
    pass(300 * BIT);
    assert_true(can_host_receive(&host, &heard));
    assert_int_equal(heard.frame.id, 0x12);
}

/* --- errors --- */

static void alone_on_the_bus_it_becomes_passive_and_no_more(void **state) {
    struct can_host_heard heard;
    (void)state;
    (void)transmit(0x123, 0);
    pass(100000 * BIT);
    assert_int_equal(get(ECR) & 0xffu, 128);
    assert_int_equal(get(PSR) & (PSR_EP | PSR_BO), PSR_EP);
    assert_true(can_host_join(&host, &bus));
    pass(400 * BIT);
    assert_true(can_host_receive(&host, &heard));
    assert_int_equal(get(ECR) & 0xffu, 127);
    assert_int_equal(get(PSR) & PSR_EP, 0);
}

static void a_hit_frame_is_sent_again_and_counted(void **state) {
    struct can_host_heard heard;
    (void)state;
    assert_true(can_host_join(&host, &bus));
    bus.corrupt_next = 3;
    (void)transmit(0x123, 0);
    pass(1000 * BIT);
    assert_true(can_host_receive(&host, &heard));
    assert_false(can_host_receive(&host, &heard));
    assert_int_equal(get(ECR) & 0xffu, 3 * 8 - 1);
    bus.corrupt_next = 2;
    const struct hal_can_frame frame = frame_of(0x201, 1);
    assert_true(can_host_send(&host, &frame));
    pass(1000 * BIT);
    assert_int_equal(get(ECR) >> 8 & 0x7fu, 2 - 1);
    assert_int_equal(get(RXF0S) & 0xfu, 1);
}

static void a_lost_acknowledgement_is_a_transmit_error(void **state) {
    (void)state;
    assert_true(can_host_join(&host, &bus));
    bus.lose_ack_next = 2;
    (void)transmit(0x123, 0);
    pass(100 * BIT);
    assert_int_equal(get(PSR) & 7u, 3); /* acknowledge error */
    pass(1000 * BIT);
    assert_int_equal(get(ECR) & 0xffu, 15);
}

static void shorted_wires_drive_it_off_again_and_again(void **state) {
    struct can_host_heard heard;
    (void)state;
    assert_true(can_host_join(&host, &bus));
    can_bus_set_wire(&bus, CAN_BUS_SHORTED);
    (void)transmit(0x123, 0);
    pass(1000 * BIT);
    assert_int_equal(fdcan.node.error_frames, 32); /* 32 x 8 = 256 */
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO);
    assert_int_equal(get(CCCR) & 1u, 1);
    assert_true((get(IR) & 1u << 19) != 0);
    set(CCCR, get(CCCR) & ~1u);
    pass((128 * 11 - 1) * BIT); /* the bus reads recessive all the time */
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO);
    pass(2 * BIT);
    assert_int_equal(get(PSR) & PSR_BO, 0);
    assert_in_range(get(ECR) & 0xffu, 0, 8);
    pass(1000 * BIT); /* the request had stayed */
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO);
    can_bus_set_wire(&bus, CAN_BUS_SOUND);
    set(CCCR, get(CCCR) & ~1u);
    pass((128 * 11 + 200) * BIT);
    assert_int_equal(get(ECR) & 0x7fffu, 0);
    assert_true(can_host_receive(&host, &heard));
}

static void a_dominant_bus_keeps_it_off(void **state) {
    (void)state;
    assert_true(can_host_join(&host, &bus));
    (void)transmit(0x123, 0);
    pass(20 * BIT);
    can_bus_set_wire(&bus, CAN_BUS_DOMINANT);
    pass(261 * BIT);
    assert_int_equal(get(PSR) & PSR_BO, 0);
    pass(2 * BIT);
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO);
    set(CCCR, get(CCCR) & ~1u);
    pass(100000 * BIT);
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO); /* no recessive bit to be seen */
    can_bus_set_wire(&bus, CAN_BUS_SOUND);
    pass((128 * 11 + 200) * BIT);
    assert_int_equal(get(PSR) & PSR_BO, 0);
    assert_int_equal(host.heard_count, 1);
}

/* Every frame's end is a run of recessive bits, so that a busy bus does not keep a node off. */
static void it_comes_back_on_a_busy_bus(void **state) {
    (void)state;
    assert_true(can_host_join(&host, &bus) && can_host_join(&other, &bus));
    can_bus_set_wire(&bus, CAN_BUS_SHORTED);
    (void)transmit(0x123, 0);
    pass(1000 * BIT);
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO);
    can_bus_set_wire(&bus, CAN_BUS_SOUND);
    const struct hal_can_frame flood = frame_of(0x010, 8);
    can_host_flood(&other, &flood);
    set(CCCR, get(CCCR) & ~1u);
    pass(120 * 111 * BIT);
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO);
    pass(40 * 130 * BIT);
    assert_int_equal(get(PSR) & PSR_BO, 0);
}

static void another_bit_rate_is_understood_by_nobody(void **state) {
    (void)state;
    assert_true(can_host_join(&host, &bus));
    fdcan_clock(&fdcan, 16000000u); /* the clock failed and nobody has set the timing anew */
    (void)transmit(0x123, 0);
    pass(100000 * BIT);
    assert_int_equal(host.heard_count, 0);
    assert_int_equal(get(PSR) & PSR_BO, PSR_BO);
}

static void a_flooded_bus_is_full(void **state) {
    (void)state;
    assert_true(can_host_join(&host, &bus) && can_host_join(&other, &bus));
    const struct hal_can_frame flood = frame_of(0x7f0, 8);
    can_host_flood(&other, &flood);
    const int64_t from = bus.busy_ticks;
    pass(100000 * BIT);
    assert_in_range((bus.busy_ticks - from) / BIT, 99800, 100000);
    const uint64_t before = fdcan.node.sent_frames;
    (void)transmit(0x123, 0); /* a lower identifier gets through all the same */
    pass(400 * BIT);
    assert_int_equal(fdcan.node.sent_frames, before + 1);
}

int main(void) {
#define IN_ORDER(test) cmocka_unit_test_setup(test, begin)
    const struct CMUnitTest tests[] = {
        IN_ORDER(frames_are_as_long_as_iso_has_them),
        IN_ORDER(no_frame_is_longer_than_its_worst_case),
        IN_ORDER(a_frame_arrives_when_its_bits_have_passed),
        IN_ORDER(the_lower_identifier_wins),
        IN_ORDER(filters_choose_and_a_full_fifo_loses),
        IN_ORDER(buffers_go_first_in_first_out),
        IN_ORDER(what_waits_can_be_cancelled),
        IN_ORDER(alone_on_the_bus_it_becomes_passive_and_no_more),
        IN_ORDER(a_hit_frame_is_sent_again_and_counted),
        IN_ORDER(a_lost_acknowledgement_is_a_transmit_error),
        IN_ORDER(shorted_wires_drive_it_off_again_and_again),
        IN_ORDER(a_dominant_bus_keeps_it_off),
        IN_ORDER(it_comes_back_on_a_busy_bus),
        IN_ORDER(another_bit_rate_is_understood_by_nobody),
        IN_ORDER(a_flooded_bus_is_full),
    };
    return cmocka_run_group_tests(tests, open_core, close_core);
}
