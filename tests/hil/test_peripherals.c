/* The emulated peripherals through their registers, without a program: what RM0440 says they do, and above
 * all what they refuse. */
#include <stdlib.h>

#include "emulator/board.h"
#include "program/table_file.h"
#include "support/test.h"

#define US TICKS_PER_US
#define FLASH_KEYR 0x08u
#define FLASH_SR 0x10u
#define FLASH_CR 0x14u
#define FLASH_ECCR 0x18u
#define SR_BSY (1u << 16)
#define SR_PROGERR 0x08u
#define SR_PGAERR 0x20u
#define SR_SIZERR 0x40u
#define SR_PGSERR 0x80u
#define CR_PG 1u
#define CR_PER 2u
#define CR_BKER (1u << 11)
#define CR_STRT (1u << 16)
#define CR_LOCK (1u << 31)
#define BANK_2 0x40000u
#define SPARE (BANK_2 + 0x3f000u) /* a page of bank 2 that holds no code */

static struct table_file file;
static struct board board;

static int open_table(void **state) {
    (void)state;
    return table_file_open(&file, "tables/paper-semicircle.tbt", NULL);
}

static int close_table(void **state) {
    (void)state;
    table_file_close(&file);
    return 0;
}

/* A board with the self-test program, which is never run: the core is held. */
static int begin(void **state) {
    const char *build = getenv("TRIBEND_BUILD");
    struct board_setup setup;
    char elf[512], error[CORE_ERROR_BYTES];
    (void)state;
    (void)snprintf(elf, sizeof elf, "%s/tests/hil/selftest.elf", build != NULL ? build : "build");
    board_default_setup(&setup, elf, &file.table);
    if (!board_open(&board, &setup, error, sizeof error)) {
        print_error("%s\n", error);
        return -1;
    }
    board.core.held = true;
    return 0;
}

static int end(void **state) {
    (void)state;
    board_close(&board);
    return 0;
}

static uint32_t get(bool (*read)(void *, uint32_t, uint32_t *), void *part, uint32_t offset) {
    uint32_t value = 0;
    assert_true(read(part, offset, &value));
    return value;
}

/* --- flash --- */

static uint32_t flash_get(uint32_t offset) {
    return get(flash_read, &board.flash, offset);
}

static void flash_set(uint32_t offset, uint32_t value) {
    assert_true(flash_write(&board.flash, offset, value));
}

static void unlock(void) {
    flash_set(FLASH_KEYR, 0x45670123u);
    flash_set(FLASH_KEYR, 0xcdef89abu);
    assert_int_equal(flash_get(FLASH_CR) & CR_LOCK, 0);
}

static void erase(uint32_t offset) {
    const uint32_t page = offset % BANK_2 / FLASH_PAGE_BYTES;
    flash_set(FLASH_CR, CR_PER | page << 3 | (offset >= BANK_2 ? CR_BKER : 0u));
    flash_set(FLASH_CR, flash_get(FLASH_CR) | CR_STRT);
}

static void program(uint32_t offset, uint32_t low, uint32_t high) {
    flash_set(FLASH_CR, CR_PG);
    flash_store(&board.flash, CORE_FLASH + offset, low, 4);
    flash_store(&board.flash, CORE_FLASH + offset + 4u, high, 4);
}

static uint64_t word_at(uint32_t offset) {
    uint64_t word;
    memcpy(&word, board.core.flash + offset, sizeof word);
    return word;
}

static void flash_programs_and_erases_in_its_time(void **state) {
    (void)state;
    unlock();
    program(SPARE, 0x11223344u, 0x55667788u);
    assert_int_equal(flash_get(FLASH_SR) & SR_BSY, SR_BSY);
    assert_true(word_at(SPARE) == UINT64_MAX);
    board_run(&board, 81);
    assert_int_equal(flash_get(FLASH_SR) & SR_BSY, SR_BSY);
    board_run(&board, 2);
    assert_int_equal(flash_get(FLASH_SR), 1); /* end of operation */
    assert_true(word_at(SPARE) == UINT64_C(0x5566778811223344));
    erase(SPARE);
    board_run(&board, 22000);
    assert_int_equal(flash_get(FLASH_SR) & SR_BSY, SR_BSY);
    board_run(&board, 30);
    assert_true(word_at(SPARE) == UINT64_MAX);
    assert_int_equal(board.flash.erasures, 1);
}

static void flash_refuses_what_breaks_its_rules(void **state) {
    (void)state;
    program(SPARE, 1u, 2u); /* locked: PG could not even be set */
    assert_int_equal(flash_get(FLASH_SR), SR_PGSERR);
    flash_set(FLASH_SR, SR_PGSERR);
    unlock();
    flash_set(FLASH_CR, CR_PG);
    flash_store(&board.flash, CORE_FLASH + SPARE, 1u, 2);
    assert_int_equal(flash_get(FLASH_SR), SR_SIZERR);
    flash_set(FLASH_SR, SR_SIZERR);
    flash_store(&board.flash, CORE_FLASH + SPARE + 4u, 1u, 4);
    assert_int_equal(flash_get(FLASH_SR), SR_PGAERR);
    flash_set(FLASH_SR, SR_PGAERR);
    program(SPARE, 1u, 2u);
    board_run(&board, 100);
    program(SPARE, 3u, 4u); /* not erased */
    assert_int_equal(flash_get(FLASH_SR), SR_PROGERR | 1u);
    assert_true(word_at(SPARE) == (UINT64_C(2) << 32 | 1u));
    assert_int_equal(board.flash.refused, 5); /* both halves of the first */
}

static void a_wrong_key_locks_until_reset(void **state) {
    (void)state;
    flash_set(FLASH_KEYR, 0x45670123u);
    flash_set(FLASH_KEYR, 0x45670123u);
    flash_set(FLASH_KEYR, 0x45670123u);
    flash_set(FLASH_KEYR, 0xcdef89abu);
    assert_int_equal(flash_get(FLASH_CR) & CR_LOCK, CR_LOCK);
    board_press_reset(&board);
    board_run(&board, 1);
    unlock();
}

static void a_cut_leaves_a_word_that_is_neither_old_nor_new(void **state) {
    uint32_t broken = 0, torn = 0;
    (void)state;
    for (uint32_t i = 0; i < 40; i++) {
        unlock();
        board_cut_power(&board, 1, i);
        program(SPARE + 8u * i, 0x12345678u, 0x9abcdef0u);
        board_run(&board, 1000);
        assert_true(board.power_lost);
        const uint64_t left = word_at(SPARE + 8u * i);
        torn += left != UINT64_MAX && left != UINT64_C(0x9abcdef012345678) ? 1u : 0u;
        broken += board.flash.broken[(SPARE + 8u * i) / 8u];
        assert_true(board_power_cycle(&board));
        board.core.held = true;
    }
    assert_in_range(torn, 30, 40);
    assert_in_range(broken, 8, 32); /* of those, half have two wrong bits */
}

static void a_broken_word_raises_the_nmi_when_it_is_read(void **state) {
    (void)state;
    board.flash.broken[SPARE / 8u] = 1;
    flash_read_broken(&board.flash, CORE_FLASH + SPARE + 8u);
    assert_int_equal(flash_get(FLASH_ECCR), 0);
    flash_read_broken(&board.flash, CORE_FLASH + SPARE + 5u);
    assert_int_equal(flash_get(FLASH_ECCR), 1u << 31 | 1u << 21 | (SPARE - BANK_2));
    assert_true(board.core.nvic.pending[EXCEPTION_NMI]);
    flash_set(FLASH_ECCR, 1u << 31);
    assert_false(board.core.nvic.line[EXCEPTION_NMI]);
}

static void the_core_stands_still_for_its_own_bank_only(void **state) {
    (void)state;
    board.core.block_end = CORE_FLASH + 0x100u;
    unlock();
    erase(SPARE);
    assert_true(board.core.stalled_ticks <= board.core.now_ticks);
    board_run(&board, 23000);
    erase(0x3f000u);
    assert_in_range((board.core.stalled_ticks - board.core.now_ticks) / US, 22000, 22100);
}

/* --- clocks --- */

static void start_crystal_and_pll(void) {
    struct rcc *rcc = &board.rcc;
    assert_true(flash_write(&board.flash, 0u, 4u));
    assert_true(power_write(&board.power, 0x80u, 0u));
    assert_true(rcc_write(rcc, 0u, 1u << 8 | 1u << 16));
    board_run(&board, 2100);
    assert_true((get(rcc_read, rcc, 0u) & 1u << 17) != 0);
    assert_true(rcc_write(rcc, 0x0cu, 3u | 5u << 4 | 85u << 8 | 1u << 24));
    assert_true(rcc_write(rcc, 0u, 1u << 8 | 1u << 16 | 1u << 24));
    assert_true(rcc_write(rcc, 0x08u, 3u));
    assert_int_equal(rcc->core_hz, 16000000); /* the PLL has not locked: no switch */
    board_run(&board, 60);
    assert_true(rcc_write(rcc, 0x08u, 3u));
    assert_int_equal(rcc->core_hz, 170000000);
    assert_true(rcc_write(rcc, 0u, 1u << 8 | 1u << 16 | 1u << 19 | 1u << 24));
}

static void a_crystal_that_stops_falls_back_with_an_nmi(void **state) {
    (void)state;
    start_crystal_and_pll();
    assert_int_equal(board.rcc.violations, 0);
    board_crystal(&board, false);
    assert_int_equal(board.rcc.core_hz, 16000000);
    assert_true(board.core.nvic.pending[EXCEPTION_NMI]);
    assert_int_equal(get(rcc_read, &board.rcc, 0u) & (1u << 24 | 1u << 16), 0); /* PLL and crystal are off */
    assert_true(rcc_write(&board.rcc, 0u, 1u << 8 | 1u << 16));
    board_run(&board, 10000);
    assert_int_equal(get(rcc_read, &board.rcc, 0u) & 1u << 17, 0); /* and the crystal does not start again */
}

static void a_clock_too_fast_for_the_flash_is_noted(void **state) {
    (void)state;
    assert_true(rcc_write(&board.rcc, 0x0cu, 2u | 3u << 4 | 85u << 8 | 1u << 24));
    assert_true(rcc_write(&board.rcc, 0u, 1u << 8 | 1u << 24));
    board_run(&board, 60);
    assert_true(rcc_write(&board.rcc, 0x08u, 3u));
    assert_int_equal(board.rcc.core_hz, 170000000);
    assert_true(board.rcc.violations > 0);
}

/* --- timers --- */

static void time_set(struct timer *timer, uint32_t offset, uint32_t value) {
    assert_true(timer_write(timer, offset, value));
}

static void a_timer_keeps_its_count_when_the_clock_changes(void **state) {
    (void)state;
    struct timer *timer = &board.microseconds;
    time_set(timer, 0x28u, 15u);
    time_set(timer, 0x14u, 1u);
    time_set(timer, 0x00u, 1u);
    board_run(&board, 1000);
    assert_int_equal(timer_count(timer), 1000);
    timer_before_clock(timer);
    timer_after_clock(timer, 160000000u); /* ten times as fast, the prescaler left as it was */
    board_run(&board, 100);
    assert_in_range(timer_count(timer), 1999, 2000);
}

static void compare_values_wait_for_the_update_where_preloaded(void **state) {
    struct timer *timer = &board.valves_timer;
    (void)state;
    board.gpio[0].mode = (board.gpio[0].mode & ~(3u << 16)) | 2u << 16;
    board.gpio[0].alternate[1] = 6u;
    time_set(timer, 0x28u, 15u); /* 1 us a count */
    time_set(timer, 0x2cu, 9999u);
    time_set(timer, 0x18u, 0x6868u);
    time_set(timer, 0x20u, 1u);
    time_set(timer, 0x34u, 2500u);
    time_set(timer, 0x14u, 1u);
    time_set(timer, 0x44u, 1u << 15);
    time_set(timer, 0x00u, 0x81u);
    assert_close(timer_duty(timer, 1u), 0.25, 1e-12);
    time_set(timer, 0x34u, 5000u);
    board_run(&board, 9000);
    assert_close(timer_duty(timer, 1u), 0.25, 1e-12);
    board_run(&board, 1100);
    assert_close(timer_duty(timer, 1u), 0.5, 1e-12);
    assert_true(wiring_fills(&board.wiring) == false); /* the valve opens 1.5 ms later */
    board_run(&board, 1500);
    assert_true(wiring_fills(&board.wiring));
    time_set(timer, 0x44u, 1u << 12); /* MOE off */
    assert_close(timer_duty(timer, 1u), 0.0, 0.0);
    board_run(&board, 1100);
    assert_false(wiring_fills(&board.wiring));
    time_set(timer, 0x18u, 0x6860u); /* without preload */
    time_set(timer, 0x34u, 0u);
    time_set(timer, 0x44u, 1u << 15);
    assert_close(timer_duty(timer, 1u), 0.0, 0.0);
}

static void a_supply_that_dips_breaks_the_outputs(void **state) {
    struct timer *timer = &board.valves_timer;
    (void)state;
    assert_true(power_syscfg_write(&board.power, 0x1cu, 5u));
    assert_true(power_write(&board.power, 4u, 6u << 1 | 1u));
    assert_true(power_exti_write(&board.power, 0x08u, 1u << 16));
    assert_true(power_exti_write(&board.power, 0x00u, 1u << 16));
    time_set(timer, 0x44u, 1u << 12 | 1u << 15);
    board_supply(&board, 2.95);
    assert_true((timer->dead_time & 1u << 15) != 0);
    board_supply(&board, 2.85);
    assert_int_equal(timer->dead_time & 1u << 15, 0);
    assert_true(board.core.nvic.line[16 + 1]);
    board_supply(&board, 2.7);
    board_run(&board, 5000);
    assert_true(board.core.held);
    board_supply(&board, 3.3);
    board_run(&board, 1);
    assert_false(board.core.held);
    assert_int_equal(get(rcc_read, &board.rcc, 0x94u) & (RCC_RESET_BROWN_OUT | RCC_RESET_WATCHDOG),
                     RCC_RESET_BROWN_OUT);
}

/* --- serial line, watchdog --- */

static void unread_bytes_overrun_and_wrong_rates_are_misread(void **state) {
    struct usart *usart = &board.usart;
    const uint8_t bytes[3] = {0x11, 0x22, 0x33};
    (void)state;
    assert_true(usart_write(usart, 0x0cu, 139u)); /* 16 MHz / 115200 */
    assert_true(usart_write(usart, 0x00u, 0x25u));
    wiring_send_bytes(&board.wiring, bytes, 3);
    board_run(&board, 86);
    assert_int_equal(get(usart_read, usart, 0x1cu) & 0x2fu, 0);
    board_run(&board, 2);
    assert_int_equal(get(usart_read, usart, 0x1cu) & 0x2fu, 0x20);
    board_run(&board, 200);
    assert_int_equal(get(usart_read, usart, 0x1cu) & 0x2fu, 0x28); /* overrun */
    assert_int_equal(get(usart_read, usart, 0x24u), 0x11);
    assert_int_equal(usart->overruns, 2);
    assert_true(usart_write(usart, 0x20u, 8u));
    assert_true(usart_write(usart, 0x0cu, 150u)); /* 7 % off */
    wiring_send_bytes(&board.wiring, bytes, 1);
    board_run(&board, 100);
    assert_int_equal(get(usart_read, usart, 0x1cu) & 0x2fu, 0x22); /* framing error */
}

static void the_watchdog_bites_when_it_is_not_fed(void **state) {
    struct watchdog *watchdog = &board.watchdog;
    (void)state;
    assert_true(watchdog_write(watchdog, 0u, 0xccccu));
    assert_true(watchdog_write(watchdog, 0u, 0x5555u));
    assert_true(watchdog_write(watchdog, 4u, 0u));
    assert_true(watchdog_write(watchdog, 8u, 159u));
    assert_int_equal(get(watchdog_read, watchdog, 0x0cu), 3); /* being taken over */
    board_run(&board, 200);
    assert_int_equal(get(watchdog_read, watchdog, 0x0cu), 0);
    for (int i = 0; i < 10; i++) {
        assert_true(watchdog_write(watchdog, 0u, 0xaaaau));
        board_run(&board, 19000);
    }
    assert_int_equal(board.resets, 0);
    board_run(&board, 1100);
    assert_int_equal(board.resets, 1);
    assert_true((get(rcc_read, &board.rcc, 0x94u) & RCC_RESET_WATCHDOG) != 0);
    assert_true(rcc_write(&board.rcc, 0x94u, 1u << 23));
    assert_int_equal(get(rcc_read, &board.rcc, 0x94u), 0);
    board.core.held = true;
}

int main(void) {
#define ON_A_BOARD(test) cmocka_unit_test_setup_teardown(test, begin, end)
    const struct CMUnitTest tests[] = {
        ON_A_BOARD(flash_programs_and_erases_in_its_time),
        ON_A_BOARD(flash_refuses_what_breaks_its_rules),
        ON_A_BOARD(a_wrong_key_locks_until_reset),
        ON_A_BOARD(a_cut_leaves_a_word_that_is_neither_old_nor_new),
        ON_A_BOARD(a_broken_word_raises_the_nmi_when_it_is_read),
        ON_A_BOARD(the_core_stands_still_for_its_own_bank_only),
        ON_A_BOARD(a_crystal_that_stops_falls_back_with_an_nmi),
        ON_A_BOARD(a_clock_too_fast_for_the_flash_is_noted),
        ON_A_BOARD(a_timer_keeps_its_count_when_the_clock_changes),
        ON_A_BOARD(compare_values_wait_for_the_update_where_preloaded),
        ON_A_BOARD(a_supply_that_dips_breaks_the_outputs),
        ON_A_BOARD(unread_bytes_overrun_and_wrong_rates_are_misread),
        ON_A_BOARD(the_watchdog_bites_when_it_is_not_fed),
    };
    return cmocka_run_group_tests(tests, open_table, close_table);
}
