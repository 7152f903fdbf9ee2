/* The flashed ELF, emulated: it starts, goes where it is told, vents when nobody talks to it, and keeps its
 * schedule. */
#include "hil/hil.h"

static void it_starts_vented_and_uses_nothing_that_is_not_there(void **state) {
    char text[1024];
    (void)state;
    hil_start(1);
    assert_false(hil.board.wiring.coils_driven);
    assert_true(hil_is_vented(1.0));
    assert_int_equal(hil.last[MESSAGE_STATUS].status.faults, 0);
    assert_int_equal(hil.board.rcc.core_hz, 170000000);
    assert_int_equal(hil.board.resets, 0);
    if (board_describe_oddities(&hil.board, text, sizeof text)) {
        fail_msg("%s", text);
    }
    hil_off();
}

static void mean_pressures(double mean_pa[3], int milliseconds) {
    memset(mean_pa, 0, 3 * sizeof mean_pa[0]);
    for (int i = 0; i < milliseconds; i++) {
        double pressure_pa[3];
        hil_run(1);
        board_pressures(&hil.board, pressure_pa);
        for (size_t c = 0; c < 3; c++) {
            mean_pa[c] += pressure_pa[c] / milliseconds;
        }
    }
}

static void commanded_pressures_are_the_true_ones(void **state) {
    const double wanted_pa[3] = {6000.0, 4500.0, 3000.0};
    double mean_pa[3];
    (void)state;
    hil_start(2);
    hil_pressure(wanted_pa[0], wanted_pa[1], wanted_pa[2]);
    hil_run(2000);
    mean_pressures(mean_pa, 500);
    hil_assert_state(SUPERVISOR_ACTIVE);
    for (size_t c = 0; c < 3; c++) {
        assert_close(mean_pa[c], wanted_pa[c], 60.0); /* the valves' period alone moves it by 70 Pa */
    }
    assert_close((double)hil.last[MESSAGE_TARGETS].targets.target_1, wanted_pa[0], 1.0);
    hil_off();
}

static void a_commanded_bend_is_the_true_one(void **state) {
    (void)state;
    hil_start(3);
    hil_bend(60.0, 30.0);
    hil_run(4000);
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_close(hil_true_bend_deg(), 60.0, 1.0);
    const double x = hil.board.wiring.plant.pose.position_m[0], y = hil.board.wiring.plant.pose.position_m[1];
    assert_close(atan2(y, x) * 180.0 / M_PI, 30.0, 1.0);
    const struct message_bend *bend = &hil.last[MESSAGE_BEND].bend;
    assert_close((double)bend->bend * 180.0 / M_PI, 60.0, 1.0);
    assert_true((bend->flags & 1u) != 0); /* measured, by the tip sensor over its serial line */
    hil_off();
}

static void silence_vents(void **state) {
    (void)state;
    hil_start(4);
    hil_bend(60.0, -90.0);
    hil_run(3000);
    hil_assert_state(SUPERVISOR_ACTIVE);
    hil_silence();
    hil_run(1000);
    assert_int_equal(hil_until_shut(1), 0);
    assert_true(hil_has(FAULT_COMMAND_TIMEOUT));
    hil_run(4000);
    assert_true(hil_is_vented(500.0));
    hil_off();
}

static void vent_is_obeyed(void **state) {
    const struct message_vent vent = {.protocol = MESSAGE_PROTOCOL};
    (void)state;
    hil_start(5);
    hil_bend(60.0, 120.0);
    hil_run(2000);
    hil_silence();
    hil_send(MESSAGE_VENT, &vent, sizeof vent);
    hil_run(5);
    assert_int_equal(hil_until_shut(1), 0);
    hil_run(100);
    hil_assert_state(SUPERVISOR_SAFE);
    hil_off();
}

/* Every millisecond of half a minute had its step, and nothing was lost or odd. */
static void no_step_is_late_over_a_long_run(void **state) {
    char text[1024];
    (void)state;
    hil_start(6);
    for (int i = 0; i < 10; i++) {
        hil_bend(20.0 + 5.0 * i, 36.0 * i - 180.0);
        hil_run(2000);
    }
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.steps_late, 0);
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.hal_errors, 0);
    assert_int_equal(hil.last[MESSAGE_CAN_COUNTERS].can_counters.transmit_lost, 0);
    assert_in_range(hil.board.core.step.entries, hil.ms - 50, hil.ms);
    assert_int_equal(hil.board.usart.overruns + hil.board.usart.misread, 0);
    assert_int_equal(hil.board.adc.missed, 0);
    assert_int_equal(hil.trouble.out_of_range, 0);
    if (board_describe_oddities(&hil.board, text, sizeof text)) {
        fail_msg("%s", text);
    }
    hil_off();
}

static void same_seed_same_bits(void **state) {
    static uint8_t ram[2][CORE_RAM_BYTES];
    int64_t ticks[2];
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        hil_start(7);
        hil_bend(45.0, 10.0);
        hil_run(1500);
        memcpy(ram[i], hil.board.core.ram, sizeof ram[i]);
        ticks[i] = hil.board.core.now_ticks;
        hil_off();
    }
    assert_int_equal(ticks[0], ticks[1]);
    assert_memory_equal(ram[0], ram[1], sizeof ram[0]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_starts_vented_and_uses_nothing_that_is_not_there),
        cmocka_unit_test(commanded_pressures_are_the_true_ones),
        cmocka_unit_test(a_commanded_bend_is_the_true_one),
        cmocka_unit_test(silence_vents),
        cmocka_unit_test(vent_is_obeyed),
        cmocka_unit_test(no_step_is_late_over_a_long_run),
        cmocka_unit_test(same_seed_same_bits),
    };
    return cmocka_run_group_tests(tests, hil_open_table, hil_close_table);
}
