/* Faults of the board, put into the emulated one while the flashed ELF drives the module: what the pins and
 * the plant do is the oracle. */
#include "hil/hil.h"
#include "stm32g4/crash_record.h"

#define BENT_DEG 60.0
#define VENTED_PA 500.0
#define CPSID 0xb672u
#define JUMP_TO_ITSELF 0xe7feu
#define UNDEFINED 0xde00u

/* Bent, in ACTIVE. */
static void start_bent(uint64_t seed) {
    hil_start(seed);
    hil_bend(BENT_DEG, 45.0);
    hil_run(2500);
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_true(hil.board.wiring.coils_driven && hil.board.wiring.supply_open);
    hil_watch();
}

/* The function's first instructions from now on. */
static void patch(const char *function, const uint16_t *code, size_t halves) {
    uint32_t address;
    assert_true(board_symbol(&hil.board, function, &address));
    assert_true(core_patch(&hil.board.core, address, code, halves * sizeof code[0]));
}

/* After a reset that a fault brought: vented, in SAFE, and nobody moves it by going on with old commands. */
static void assert_restarted_vented(void) {
    assert_int_equal(hil.board.resets, 1);
    hil_run(400);
    assert_true(hil_is_vented(20000.0));
    assert_false(hil.board.wiring.coils_driven);
}

/* A reset of its own making is a latched fault: it says so, and moves only once somebody has cleared it. */
static void assert_latched_and_clear(enum supervisor_fault fault) {
    hil_assert_state(SUPERVISOR_FAULT);
    if (!hil_has(fault)) {
        fail_msg("faults 0x%x", hil.last[MESSAGE_STATUS].status.faults);
    }
    const struct message_clear clear = {.protocol = MESSAGE_PROTOCOL,
                                        .key = MESSAGE_CLEAR_KEY,
                                        .faults = hil.last[MESSAGE_STATUS].status.faults};
    hil_send(MESSAGE_CLEAR, &clear, sizeof clear);
    hil_run(800);
    hil_assert_state(SUPERVISOR_SAFE);
    assert_false(hil.board.wiring.coils_driven);
}

static void unpatch(void) {
    char error[CORE_ERROR_BYTES];
    assert_true(core_load_elf(&hil.board.core, hil_elf(), error, sizeof error));
    (void)uc_ctl_remove_cache(hil.board.core.engine, (uint64_t)CORE_FLASH,
                              (uint64_t)CORE_FLASH + CORE_FLASH_BYTES);
}

static void a_hung_step_shuts_the_valves_and_is_reset(void **state) {
    (void)state;
    start_bent(1);
    hil_silence();
    assert_true(board_hang(&hil.board, "node_step"));
    const int shut_ms = hil_until_shut(30);
    assert_in_range(shut_ms, 0, 8); /* the tick's own watch, and the valve's delay */
    assert_false(hil.board.wiring.supply_open);
    assert_int_equal(hil.board.resets, 0);
    hil_run(30 - shut_ms);
    assert_int_equal(hil.board.resets, 1);
    assert_int_equal(hil.board.last_cause & RCC_RESET_WATCHDOG, RCC_RESET_WATCHDOG);
    unpatch();
    board_press_reset(&hil.board);
    hil_off();
}

/* Interrupts masked: only the independent watchdog is left. */
static void a_deaf_loop_is_reset_within_the_watchdogs_time(void **state) {
    static const uint16_t deaf[2] = {CPSID, JUMP_TO_ITSELF};
    (void)state;
    start_bent(2);
    hil_silence();
    patch("node_step", deaf, 2);
    const int shut_ms = hil_until_shut(60);
    assert_in_range(shut_ms, 15, 24);
    assert_int_equal(hil.board.last_cause & RCC_RESET_WATCHDOG, RCC_RESET_WATCHDOG);
    assert_under(hil.most_pa[0] + hil.most_pa[1] + hil.most_pa[2], 3.0 * 20000.0);
    unpatch();
    hil_run(1200);
    assert_restarted_vented();
    assert_true(hil.last[MESSAGE_HEALTH].health.watchdog_reset);
    hil_run(4000);
    assert_true(hil_is_vented(VENTED_PA));
    assert_latched_and_clear(FAULT_WATCHDOG_RESET);
    hil_off();
}

static struct crash_record kept_record(void) {
    struct crash_record record;
    uint32_t address;
    assert_true(board_symbol(&hil.board, "kept_record", &address));
    assert_true(core_read(&hil.board.core, address, &record, sizeof record));
    return record;
}

/* The record is taken at the next start; here it is read from RAM before. */
static void look_at_record(void *context, struct core *core) {
    struct crash_record *record = context;
    (void)core;
    *record = kept_record();
}

static void a_crash_vents_first_and_is_remembered(void **state) {
    static const uint16_t undefined[1] = {UNDEFINED};
    static struct crash_record record;
    uint32_t address;
    (void)state;
    start_bent(3);
    hil_silence();
    assert_true(board_probe(&hil.board, "faults_begin", look_at_record, &record));
    assert_true(board_symbol(&hil.board, "node_report", &address));
    patch("node_report", undefined, 1);
    hil_run(2);
    assert_int_equal(hil_until_shut(3) >= 0, true);
    assert_int_equal(hil.board.resets, 1);
    unpatch();
    hil_run(5);
    assert_int_equal(record.cause, CRASH_USAGE_FAULT);
    assert_int_equal(record.cfsr, CFSR_UNDEFINSTR);
    assert_int_equal(record.pc, address);
    assert_int_equal(record.state, SUPERVISOR_ACTIVE);
    hil_run(1200);
    assert_restarted_vented();
    assert_true(hil.last[MESSAGE_HEALTH].health.crashed);
    assert_false(hil.last[MESSAGE_HEALTH].health.watchdog_reset);
    hil_off();
}

static void a_wild_pointer_is_a_bus_fault_with_its_address(void **state) {
    /* movw r0, #0; movt r0, #0x3000; ldr r0, [r0] */
    static const uint16_t wild[5] = {0xf240u, 0x0000u, 0xf2c3u, 0x0000u, 0x6800u};
    static struct crash_record record;
    (void)state;
    start_bent(4);
    hil_silence();
    assert_true(board_probe(&hil.board, "faults_begin", look_at_record, &record));
    patch("node_report", wild, 5);
    hil_run(4);
    unpatch();
    hil_run(5);
    assert_int_equal(record.cause, CRASH_BUS_FAULT);
    assert_int_equal(record.cfsr, CFSR_PRECISERR | CFSR_BFARVALID);
    assert_int_equal(record.address, 0x30000000u);
    hil_run(4000);
    assert_true(hil_is_vented(VENTED_PA));
    hil_off();
}

/* Frames of a host that saw nothing of it go on: they must not start the module. */
static void a_restart_under_flying_commands_moves_nothing(void **state) {
    (void)state;
    start_bent(17);
    board_press_reset(&hil.board);
    hil_run(10);
    assert_int_equal(hil.board.resets, 1);
    for (int i = 0; i < 6000; i++) { /* the self-test waits for empty chambers */
        hil_run(1);
        assert_false(hil.board.wiring.coils_driven);
    }
    hil_assert_state(SUPERVISOR_SAFE);
    assert_true(hil.last[MESSAGE_REFUSALS].refusals.total > 50u);
    hil_silence();
    hil_run(550);
    hil_bend(BENT_DEG, 45.0);
    hil_run(2500);
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_close(hil_true_bend_deg(), BENT_DEG, 2.0);
    hil_off();
}

static void a_brown_out_vents_and_is_said(void **state) {
    (void)state;
    start_bent(5);
    hil_silence();
    board_supply(&hil.board, 2.5);
    hil_run(2);
    assert_int_equal(hil_until_shut(3) >= 0, true);
    assert_false(hil.board.wiring.supply_open);
    assert_true(hil.board.core.held);
    board_supply(&hil.board, 3.3);
    hil_run(6000); /* the self-test waits for empty chambers */
    assert_true(hil.last[MESSAGE_HEALTH].health.brown_out_reset);
    assert_latched_and_clear(FAULT_BROWN_OUT);
    hil_off();
}

/* Under the detector's level, over the brown-out's: the pins drop without software, which then starts anew.
 */
static void a_dip_of_the_supply_breaks_the_valves(void **state) {
    (void)state;
    start_bent(6);
    hil_silence();
    board_supply(&hil.board, 2.85);
    assert_false(hil.board.wiring.coils_driven); /* before an instruction has run */
    hil_run(3);
    assert_false(hil.board.wiring.supply_open);
    assert_false(hil.board.wiring.coils_driven);
    board_supply(&hil.board, 3.3);
    hil_run(6000); /* the self-test waits for empty chambers */
    assert_true(hil.last[MESSAGE_HEALTH].health.brown_out_reset);
    assert_latched_and_clear(FAULT_BROWN_OUT);
    hil_off();
}

static void a_crystal_that_stops_is_survived_and_said(void **state) {
    (void)state;
    start_bent(7);
    const uint32_t heard = hil.heard[MESSAGE_PRESSURES];
    board_crystal(&hil.board, false);
    hil_run(1500);
    assert_int_equal(hil.board.rcc.core_hz, 170000000);
    assert_int_equal(hil.board.resets, 0);
    assert_true(hil.last[MESSAGE_HEALTH].health.clock_failed);
    assert_true(hil.heard[MESSAGE_PRESSURES] > heard + 200); /* the bus has its bit rate again */
    assert_int_equal(hil.board.fdcan.node.bus_off, false);
    assert_under(hil.most_pa[0], 20000.0);
    hil_silence();
    hil_run(5000);
    assert_true(hil_is_vented(VENTED_PA));
    hil_off();
}

static void it_starts_without_a_crystal(void **state) {
    (void)state;
    hil_power_on(8);
    board_crystal(&hil.board, false);
    hil_run(1200);
    assert_int_equal(hil.board.rcc.core_hz, 170000000);
    assert_int_equal(hil.board.resets, 0);
    assert_true(hil.last[MESSAGE_HEALTH].health.clock_failed);
    assert_true(hil.heard[MESSAGE_STATUS] > 10);
    hil_off();
}

static void a_board_without_any_pll_runs_on_at_16_mhz_or_stays_vented(void **state) {
    (void)state;
    hil_power_on(9);
    hil.board.rcc.pll_locks = false;
    hil_run(1500);
    assert_int_equal(hil.board.rcc.core_hz, 16000000);
    assert_false(hil.board.wiring.coils_driven);
    assert_true(hil_is_vented(1.0));
    hil_off();
}

/* --- sensors --- */

static void assert_faulted_within(enum supervisor_fault fault, int milliseconds) {
    int taken = 0;
    while (hil.board.wiring.coils_driven && taken < milliseconds) {
        hil_run(1);
        taken++;
    }
    assert_under(taken, milliseconds);
    assert_false(hil.board.wiring.supply_open);
    hil_run(60);
    hil_assert_state(SUPERVISOR_FAULT);
    if (!hil_has(fault)) {
        fail_msg("faults 0x%x", hil.last[MESSAGE_STATUS].status.faults);
    }
    hil_run(5000);
    assert_true(hil_is_vented(VENTED_PA));
}

static void a_broken_sensor_wire_vents(void **state) {
    (void)state;
    start_bent(10);
    hil.board.wiring.faults.channel_fails[1] = true;
    assert_faulted_within(FAULT_SENSOR_RANGE, 5);
    hil_off();
}

static void a_reading_over_the_limit_vents(void **state) {
    (void)state;
    start_bent(11);
    hil.board.wiring.faults.reading_replaced[0] = true;
    hil.board.wiring.faults.reading_pa[0] = 30000.0f;
    assert_faulted_within(FAULT_OVERPRESSURE, 5);
    hil_off();
}

static void a_dead_converter_vents(void **state) {
    (void)state;
    start_bent(12);
    hil.board.wiring.faults.pressure_bus_fails = true;
    assert_faulted_within(FAULT_SENSOR_RANGE, 10);
    hil_off();
}

/* A reference under 3 V would make every ratiometric reading a guess. */
static void a_low_reference_vents(void **state) {
    (void)state;
    start_bent(13);
    board_supply(&hil.board, 2.98);
    assert_faulted_within(FAULT_SENSOR_RANGE, 5);
    hil_off();
}

static void outputs_that_cannot_be_driven_are_no_danger(void **state) {
    (void)state;
    start_bent(14);
    hil.board.wiring.faults.outputs_fail = true;
    hil_run(5000);
    assert_true(hil_is_vented(VENTED_PA));
    hil_off();
}

static void without_the_tip_sensor_it_goes_on_open_loop(void **state) {
    (void)state;
    start_bent(15);
    hil.board.wiring.faults.tip_stops = true;
    hil_run(1500);
    assert_true(hil_warns(WARNING_TIP_LOST));
    assert_true((hil.last[MESSAGE_BEND].bend.flags & 2u) != 0);
    assert_close(hil_true_bend_deg(), BENT_DEG, 3.0);
    hil.board.wiring.faults.tip_stops = false;
    hil_run(500);
    assert_false(hil_warns(WARNING_TIP_LOST));
    hil_off();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_hung_step_shuts_the_valves_and_is_reset),
        cmocka_unit_test(a_deaf_loop_is_reset_within_the_watchdogs_time),
        cmocka_unit_test(a_crash_vents_first_and_is_remembered),
        cmocka_unit_test(a_wild_pointer_is_a_bus_fault_with_its_address),
        cmocka_unit_test(a_restart_under_flying_commands_moves_nothing),
        cmocka_unit_test(a_brown_out_vents_and_is_said),
        cmocka_unit_test(a_dip_of_the_supply_breaks_the_valves),
        cmocka_unit_test(a_crystal_that_stops_is_survived_and_said),
        cmocka_unit_test(it_starts_without_a_crystal),
        cmocka_unit_test(a_board_without_any_pll_runs_on_at_16_mhz_or_stays_vented),
        cmocka_unit_test(a_broken_sensor_wire_vents),
        cmocka_unit_test(a_reading_over_the_limit_vents),
        cmocka_unit_test(a_dead_converter_vents),
        cmocka_unit_test(a_low_reference_vents),
        cmocka_unit_test(outputs_that_cannot_be_driven_are_no_danger),
        cmocka_unit_test(without_the_tip_sensor_it_goes_on_open_loop),
    };
    return cmocka_run_group_tests(tests, hil_open_table, hil_close_table);
}
