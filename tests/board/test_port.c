/* The port's own promises, kept by the ELF that is flashed on the emulated board: time, clock, faults,
 * resets, flash. */
#include <stdlib.h>

#include "comms/codec.h"
#include "emulator/board.h"
#include "program/table_file.h"
#include "stm32g4/crash_record.h"
#include "support/test.h"

#define START_US 1200000 /* more than start-up takes */
#define NODE 1u

static struct table_file file;
static struct board board;
static uint8_t sequence;

static int open_table(void **state) {
    (void)state;
    return table_file_open(&file, "tables/paper-semicircle.tbt", NULL);
}

static int close_table(void **state) {
    (void)state;
    table_file_close(&file);
    return 0;
}

static int begin(void **state) {
    const char *build = getenv("TRIBEND_BUILD");
    struct board_setup setup;
    char elf[512], error[CORE_ERROR_BYTES];
    (void)state;
    (void)snprintf(elf, sizeof elf, "%s/firmware/tribend.elf", build != NULL ? build : "build");
    board_default_setup(&setup, elf, &file.table);
    sequence = 0;
    if (!board_open(&board, &setup, error, sizeof error)) {
        print_error("%s\n", error);
        return -1;
    }
    return 0;
}

static int end(void **state) {
    (void)state;
    board_close(&board);
    return 0;
}

/* --- the firmware's variables, by their symbols --- */

static void look(const char *symbol, void *value, size_t size) {
    uint32_t address;
    assert_true(board_symbol(&board, symbol, &address));
    assert_true(core_read(&board.core, address, value, size));
}

static uint32_t look_u32(const char *symbol) {
    uint32_t value;
    look(symbol, &value, sizeof value);
    return value;
}

static struct crash_record look_record(void) {
    struct crash_record record;
    look("kept_record", &record, sizeof record);
    return record;
}

/* --- steps --- */

struct steps {
    int64_t last_us, shortest_us, longest_us;
    uint32_t count;
};

static void see_step(void *context, struct core *core) {
    struct steps *steps = context;
    (void)core;
    const int64_t now_us = board_time_us(&board);
    if (steps->count++ > 0) {
        const int64_t apart_us = now_us - steps->last_us;
        steps->shortest_us = apart_us < steps->shortest_us ? apart_us : steps->shortest_us;
        steps->longest_us = apart_us > steps->longest_us ? apart_us : steps->longest_us;
    }
    steps->last_us = now_us;
}

static struct steps watched_steps;

static void watch_steps(void) {
    watched_steps = (struct steps){.shortest_us = INT64_MAX};
    assert_true(board_probe(&board, "app_step", see_step, &watched_steps));
}

static void no_oddities(void) {
    char text[256];
    if (board_describe_oddities(&board, text, sizeof text)) {
        fail_msg("%s", text);
    }
}

/* --- commands --- */

static void send_pressures(float pressure_pa) {
    const struct message_pressure_command command = {.sequence = ++sequence,
                                                     .protocol = MESSAGE_PROTOCOL,
                                                     .pressure_1 = pressure_pa,
                                                     .pressure_2 = pressure_pa,
                                                     .pressure_3 = pressure_pa};
    struct message_trouble trouble = {0};
    struct hal_can_frame frame;
    message_frame(MESSAGE_PRESSURE_COMMAND, NODE, &command, &frame, &trouble);
    assert_true(board_send(&board, &frame));
}

/* The next HEALTH that the board sends. */
static struct message_health health(void) {
    struct message_health message = {0};
    struct can_host_heard heard;
    struct message_trouble trouble = {0};
    while (board_receive(&board, &heard)) {
    }
    for (int i = 0; i < 2000; i++) {
        board_run(&board, 1000);
        while (board_receive(&board, &heard)) {
            if (heard.frame.id == message_identifier(MESSAGE_HEALTH, NODE)) {
                message_unpack(MESSAGE_HEALTH, heard.frame.data, &message, &trouble);
                return message;
            }
        }
    }
    fail_msg("no HEALTH in two seconds");
    return message;
}

/* Started, and every chamber at some kilopascals, its valve being driven. */
static void move(void) {
    board_run(&board, START_US);
    for (int i = 0; i < 10; i++) {
        send_pressures(6000.0f);
        board_run(&board, 100000);
    }
    double pressure_pa[3];
    board_pressures(&board, pressure_pa);
    assert_close(pressure_pa[0], 6000.0, 600.0);
    assert_true(board.wiring.coils_driven);
    assert_true(board.wiring.supply_open);
}

/* Until it holds, at most so long; returns how long it took. */
static int64_t run_until(bool (*holds)(void), int64_t most_us) {
    const int64_t from_us = board_time_us(&board);
    while (!holds() && board_time_us(&board) - from_us < most_us) {
        board_run(&board, 100);
    }
    assert_true(holds());
    return board_time_us(&board) - from_us;
}

static bool shut(void) {
    return !board.wiring.coils_driven && !board.wiring.supply_open;
}

static bool was_reset(void) {
    return board.resets > 0;
}

/* --- tests --- */

static void a_step_begins_every_millisecond(void **state) {
    (void)state;
    board_run(&board, START_US);
    watch_steps();
    board_run(&board, 1000000);
    assert_in_range(watched_steps.count, 999, 1001);
    assert_in_range(watched_steps.shortest_us, 990, 1000);
    assert_in_range(watched_steps.longest_us, 1000, 1010);
    assert_int_equal(board.resets, 0);
    no_oddities();
    const struct message_health reported = health();
    assert_false(reported.clock_failed || reported.watchdog_reset || reported.brown_out_reset ||
                 reported.crashed);
    assert_true(reported.table_found);
    assert_int_equal(reported.steps_late, 0);
}

static void outputs_stay_off_until_a_command_comes(void **state) {
    (void)state;
    for (int i = 0; i < 500; i++) {
        board_run(&board, 1000);
        assert_false(board.wiring.coils_driven);
    }
}

static void without_a_crystal_the_internal_oscillator_takes_over(void **state) {
    (void)state;
    board_crystal(&board, false);
    board_press_reset(&board);
    board_run(&board, START_US);
    assert_true(health().clock_failed);
    watch_steps();
    board_run(&board, 500000);
    assert_in_range(watched_steps.count, 499, 501);
}

static void a_crystal_that_stops_later_costs_less_than_a_step(void **state) {
    (void)state;
    board_run(&board, START_US);
    watch_steps();
    board_run(&board, 100000);
    board_crystal(&board, false);
    board_run(&board, 400000);
    assert_in_range(watched_steps.count, 498, 501);
    assert_in_range(watched_steps.longest_us, 1000, 2000);
    assert_true(health().clock_failed);
    assert_int_equal(board.resets, 0);
}

static void a_step_that_hangs_shuts_the_valves_then_resets(void **state) {
    (void)state;
    uint32_t address;
    uint16_t code;
    move();
    assert_true(board_symbol(&board, "controller_step", &address));
    assert_true(core_read(&board.core, address & ~1u, &code, sizeof code));
    assert_true(board_hang(&board, "controller_step"));
    const int64_t shut_us = run_until(shut, 50000);
    assert_in_range(shut_us, 1000, 7000);
    assert_int_equal(look_u32("hung_count"), 1);
    assert_in_range(shut_us + run_until(was_reset, 50000), 10000, 24000);
    assert_true(core_patch(&board.core, address & ~1u, &code, sizeof code));
    const struct message_health reported = health();
    assert_true(reported.watchdog_reset);
    assert_false(reported.crashed || reported.brown_out_reset);
}

static void a_bus_fault_shuts_the_valves_and_leaves_a_record(void **state) {
    (void)state;
    move();
    uint32_t address;
    const uint32_t nowhere = 0x60000000u; /* no memory there */
    assert_true(board_symbol(&board, "setup", &address));
    const uint32_t steps = look_u32("completed");
    assert_true(core_write(&board.core, address, &nowhere, sizeof nowhere)); /* setup.hal */
    uint32_t app_step;
    assert_true(board_symbol(&board, "node", &address));
    assert_true(board_symbol(&board, "app_step", &app_step));
    for (uint32_t offset = 0; offset < 8192u; offset += 4u) { /* app.hal, wherever it is in the node */
        uint32_t value, hal;
        assert_true(board_symbol(&board, "board", &hal));
        if (core_read(&board.core, address + offset, &value, sizeof value) && value == hal) {
            assert_true(core_write(&board.core, address + offset, &nowhere, sizeof nowhere));
            break;
        }
    }
    assert_in_range(run_until(shut, 5000), 0, 2000);
    (void)run_until(was_reset, 5000);
    struct crash_record record = look_record();
    assert_int_equal(record.cause, CRASH_BUS_FAULT);
    assert_in_range(record.pc, app_step & ~1u, (app_step & ~1u) + 0x400u);
    assert_in_range(record.step, steps, steps + 3u);
    board_run(&board, START_US); /* it runs again, and has taken the record */
    assert_int_equal(board.resets, 1);
    record = look_record();
    assert_false(crash_record_is_sound(&record));
    assert_true(health().crashed);
    assert_false(board.wiring.coils_driven);
}

static void a_dip_of_the_electronics_supply_shuts_everything(void **state) {
    (void)state;
    move();
    board_supply(&board, 2.85);
    assert_in_range(run_until(shut, 5000), 0, 200);
    board_supply(&board, 3.3);
    board_run(&board, START_US);
    assert_true(board.resets >= 1);
    assert_true(health().brown_out_reset);
    assert_false(board.wiring.coils_driven);
}

static void a_brown_out_reset_that_is_set_too_low_is_said(void **state) {
    (void)state;
    board_run(&board, START_US);
    assert_false(health().brown_out_low);
    board.flash.options &= ~(7u << 8); /* 1.7 V, as chips are delivered */
    board_press_reset(&board);
    assert_true(health().brown_out_low);
}

static void outputs_that_cannot_be_set_end_in_a_reset(void **state) {
    (void)state;
    move();
    const uint8_t return_false[] = {0x00, 0x20, 0x70, 0x47}; /* movs r0, #0; bx lr */
    uint32_t address;
    assert_true(board_symbol(&board, "valves_write", &address));
    assert_true(core_patch(&board.core, address & ~1u, return_false, sizeof return_false));
    (void)run_until(was_reset, 25000);
    assert_false(board.wiring.coils_driven);
}

static void a_full_bus_of_foreign_frames_costs_the_step_nothing(void **state) {
    (void)state;
    const struct hal_can_frame foreign = {.id = 0x0f7u,
                                          .length = 0u}; /* node 7's, and ahead of our telemetry */
    move();
    watch_steps();
    can_host_flood(&board.host, &foreign);
    for (int i = 0; i < 5; i++) {
        board_run(&board, 100000);
    }
    assert_in_range(watched_steps.count, 499, 501);
    assert_in_range(watched_steps.longest_us, 1000, 1010);
    can_host_flood(&board.host, NULL);
    board_run(&board, 50000);
    assert_int_equal(health().steps_late, 0);
}

static bool is_off(void) {
    return board.fdcan.node.bus_off;
}

static bool is_back(void) {
    return !board.fdcan.node.bus_off;
}

static void bus_off_ends_a_tenth_of_a_second_after_it_began(void **state) {
    (void)state;
    board_run(&board, START_US);
    can_bus_set_wire(&board.bus, CAN_BUS_SHORTED);
    (void)run_until(is_off, 1000000);
    can_bus_set_wire(&board.bus, CAN_BUS_SOUND);
    assert_in_range(run_until(is_back, 300000), 95000, 110000); /* 100 ms, and 129 x 11 bits */
    assert_int_equal(look_u32("bus_off_count"), 1);
    assert_int_equal(health().steps_late, 0); /* telemetry is back, too */
}

static void the_stack_is_as_deep_as_the_build_says_at_most(void **state) {
    (void)state;
    move();
    uint32_t bottom, top, unused = 0, word = 0x57ac4b1du;
    assert_true(board_symbol(&board, "linker_stack_bottom", &bottom));
    assert_true(board_symbol(&board, "linker_stack_top", &top));
    while (bottom + unused < top && word == 0x57ac4b1du) {
        assert_true(core_read(&board.core, bottom + unused, &word, sizeof word));
        unused += 4u;
    }
    const uint32_t used = top - bottom - (unused - 4u);
    FILE *said = NULL;
    unsigned worst = 0;
    char name[512];
    const char *build = getenv("TRIBEND_BUILD");
    (void)snprintf(name, sizeof name, "%s/firmware/tribend.stack", build != NULL ? build : "build");
    said = fopen(name, "r");
    assert_non_null(said);
    assert_int_equal(fscanf(said, "main %u", &worst), 1);
    (void)fclose(said);
    print_message("stack: %u bytes used of a worst case of %u\n", used, worst);
    assert_in_range(used, 600, worst);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_step_begins_every_millisecond, begin, end),
        cmocka_unit_test_setup_teardown(outputs_stay_off_until_a_command_comes, begin, end),
        cmocka_unit_test_setup_teardown(without_a_crystal_the_internal_oscillator_takes_over, begin, end),
        cmocka_unit_test_setup_teardown(a_crystal_that_stops_later_costs_less_than_a_step, begin, end),
        cmocka_unit_test_setup_teardown(a_step_that_hangs_shuts_the_valves_then_resets, begin, end),
        cmocka_unit_test_setup_teardown(a_bus_fault_shuts_the_valves_and_leaves_a_record, begin, end),
        cmocka_unit_test_setup_teardown(a_dip_of_the_electronics_supply_shuts_everything, begin, end),
        cmocka_unit_test_setup_teardown(a_brown_out_reset_that_is_set_too_low_is_said, begin, end),
        cmocka_unit_test_setup_teardown(outputs_that_cannot_be_set_end_in_a_reset, begin, end),
        cmocka_unit_test_setup_teardown(a_full_bus_of_foreign_frames_costs_the_step_nothing, begin, end),
        cmocka_unit_test_setup_teardown(bus_off_ends_a_tenth_of_a_second_after_it_began, begin, end),
        cmocka_unit_test_setup_teardown(the_stack_is_as_deep_as_the_build_says_at_most, begin, end),
    };
    return cmocka_run_group_tests(tests, open_table, close_table);
}
