/* Tables sent to the board one after another: the first goes to the slot of the other flash bank, the next to the one beside the
 * firmware, where the core stands still while flash is erased and written. And words of flash that do not read: what a torn
 * write leaves in the storage is passed over, in the firmware itself it is a crash. */
#include "hil/update.h"

#define STORAGE_WORD 8u

static uint32_t nmis;

static void count_nmi(void *context, struct core *core) {
    (void)context;
    (void)core;
    nmis++;
}

/* Whole, to its new start; the valves stay off. The longest time that the core stood still, in ms. */
static double send_table(uint64_t hash) {
    const struct message_transfer_state *at = &hil.last[MESSAGE_TRANSFER_STATE].transfer_state;
    int64_t longest_ticks = 0;
    update_make(hash);
    update_begin();
    for (int i = 0; i < UPDATE_MOST_MS && at->state != TRANSFER_DONE && at->state != TRANSFER_FAILED; i++) {
        const struct core *core = &hil.board.core;
        update_send_more();
        hil_run(1);
        longest_ticks = core->stalled_ticks - core->now_ticks > longest_ticks ? core->stalled_ticks - core->now_ticks
                                                                             : longest_ticks;
        assert_false(hil.board.wiring.coils_driven);
    }
    free(update.image);
    if (at->state != TRANSFER_DONE) {
        fail_msg("transfer at %u of %u: %s", at->offset, update.bytes, transfer_error_text((enum transfer_error)at->error));
    }
    return 1e3 * (double)longest_ticks / (double)TICKS_PER_SECOND;
}

static void restart(void) {
    assert_true(board_power_cycle(&hil.board));
    hil_run(HIL_BOOT_MS);
    hil_assert_state(SUPERVISOR_SAFE);
}

/* Nobody's motion command starts anything while flash is at work. */
static void a_table_beside_the_firmware_is_updated_too(void **state) {
    (void)state;
    hil_start(1);
    const uint64_t hash = update_running_table();
    hil_bend(40.0, 0.0);
    assert_under(send_table(hash + 1u), 0.1); /* the other bank: no standstill */
    hil_silence();
    restart();
    assert_true(update_running_table() == hash + 1u);
    const uint32_t resets = hil.board.resets;
    hil_bend(40.0, 0.0);
    const double still_ms = send_table(hash + 2u);
    print_message("the core stood still for up to %.0f ms\n", still_ms);
    assert_true(still_ms > 15.0); /* or it was not slot A */
    assert_int_equal(hil.board.resets, resets);
    assert_int_equal(hil.last[MESSAGE_STATUS].status.faults, 0);
    assert_int_equal(hil.last[MESSAGE_HEALTH].health.storage_errors, 0);
    hil_silence();
    restart();
    assert_true(update_running_table() == hash + 2u);
    hil_bend(40.0, 0.0);
    hil_run(2500);
    hil_assert_state(SUPERVISOR_ACTIVE);
    assert_close(hil_true_bend_deg(), 40.0, 1.5);
    hil_off();
}

/* Two updates, the second of which is cut while a page beside the firmware is erased. */
static void a_cut_beside_the_firmware_leaves_the_other_table(void **state) {
    static const uint32_t operations[] = {1u, 7u, 150u};
    (void)state;
    for (size_t i = 0; i < sizeof operations / sizeof operations[0]; i++) {
        hil_start(2 + i);
        const uint64_t hash = update_running_table();
        (void)send_table(hash + 1u);
        restart();
        update_make(hash + 2u);
        update_begin();
        board_cut_power(&hil.board, operations[i], 5u + i);
        for (int ms = 0; ms < UPDATE_MOST_MS && !hil.board.power_lost; ms++) {
            update_send_more();
            hil_run(1);
        }
        free(update.image);
        assert_true(hil.board.power_lost);
        restart();
        assert_true(update_running_table() == hash + 1u);
        hil_off();
    }
}

/* The words from one address to another have two wrong bits each, or are sound again. */
static void break_words(uint32_t from, uint32_t to, bool broken) {
    struct flash *flash = &hil.board.flash;
    memset(flash->broken + (from - CORE_FLASH) / STORAGE_WORD, broken ? 1 : 0, (to - from) / STORAGE_WORD);
    flash->broken_count = broken ? (to - from) / STORAGE_WORD : 0u;
    assert_true(core_watch_flash(&hil.board.core));
}

/* Torn parameters: the non-maskable interrupt comes as they are read, and the firmware's own are used. */
static void a_torn_word_of_the_storage_is_passed_over(void **state) {
    uint32_t address = 0;
    (void)state;
    hil_start(6);
    nmis = 0;
    assert_true(board_symbol(&hil.board, "linker_parameters_a", &address));
    assert_true(board_probe(&hil.board, "handler_nmi", count_nmi, NULL));
    break_words(address, address + STORAGE_WORD, true);
    restart();
    assert_true(nmis > 0);
    assert_int_equal(hil.last[MESSAGE_STATUS].status.faults, 0);
    hil_bend(40.0, 0.0);
    hil_run(2000);
    hil_assert_state(SUPERVISOR_ACTIVE);
    hil_off();
}

/* Words of the firmware that do not read any more: vented at once, started anew, and latched. */
static void torn_words_of_the_firmware_vent(void **state) {
    uint32_t from = 0, to = 0;
    (void)state;
    hil_start(7);
    hil_bend(50.0, 45.0);
    hil_run(2000);
    hil_assert_state(SUPERVISOR_ACTIVE);
    hil_silence();
    nmis = 0;
    assert_true(board_probe(&hil.board, "handler_nmi", count_nmi, NULL));
    assert_true(board_symbol(&hil.board, "linker_code_start", &from));
    assert_true(board_symbol(&hil.board, "linker_code_end", &to));
    break_words(from, to, true);
    assert_in_range(hil_until_shut(5), 0, 3);
    assert_true(nmis > 0);
    assert_false(hil.board.wiring.supply_open);
    assert_true(hil.board.resets > 0);
    break_words(from, to, false);
    hil_run(1000);
    assert_true(hil.last[MESSAGE_HEALTH].health.crashed);
    hil_assert_state(SUPERVISOR_FAULT);
    assert_true(hil_has(FAULT_WATCHDOG_RESET));
    hil_off();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_table_beside_the_firmware_is_updated_too),
        cmocka_unit_test(a_cut_beside_the_firmware_leaves_the_other_table),
        cmocka_unit_test(a_torn_word_of_the_storage_is_passed_over),
        cmocka_unit_test(torn_words_of_the_firmware_vent),
    };
    return cmocka_run_group_tests(tests, hil_open_table, hil_close_table);
}
