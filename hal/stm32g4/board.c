#include "stm32g4/board.h"

#include <stddef.h>

#include "stm32g4/clock.h"
#include "stm32g4/conversions.h"
#include "stm32g4/core.h"
#include "stm32g4/faults.h"
#include "stm32g4/flash.h"
#include "stm32g4/pins.h"
#include "stm32g4/pressure_adc.h"
#include "stm32g4/registers.h"
#include "stm32g4/supply_monitor.h"
#include "stm32g4/time_base.h"
#include "stm32g4/tip_uart.h"
#include "stm32g4/valves.h"
#include "stm32g4/watchdog.h"

#define TIP_BYTES_A_CALL 64u  /* 5.5 ms of them, */
#define TIP_BYTES_AT_ONCE 16u /* by a step's worth and some */

/* The order of start; a crash record's address says which part did not. */
enum part { PART_VALVES = 1, PART_TIME, PART_CONVERTER };

static int64_t board_time_us(void *context) {
    const struct board *board = context;
    return board->time_us;
}

/* A step that was late leaves the next one too little time for readings of its own: it takes those of the
 * late one. Two without are a converter that fails. */
static bool board_read_pressures(void *context, struct hal_pressures *pressures) {
    struct board *board = context;
    uint16_t raw[RAW_CHANNEL_COUNT];
    if (pressure_adc_take(raw)) {
        conversions_pressures(raw, board->reference_calibration, &board->pressures);
        board->pressures_old = false;
    } else {
        board->pressures_missed++;
        if (board->pressures_old) {
            return false;
        }
        board->pressures_old = true;
    }
    *pressures = board->pressures;
    return true;
}

/* Bytes that wait, on the clock of the steps. */
static void feed_tip_stream(struct board *board) {
    struct tip_uart_byte bytes[TIP_BYTES_AT_ONCE];
    uint32_t count = TIP_BYTES_AT_ONCE;
    for (uint32_t fed = 0; fed < TIP_BYTES_A_CALL && count == TIP_BYTES_AT_ONCE; fed += count) {
        count = tip_uart_take(bytes, TIP_BYTES_AT_ONCE);
        for (uint32_t i = 0; i < count; i++) {
            const int32_t since_us = (int32_t)(bytes[i].arrived_us - (uint32_t)board->time_us);
            tip_stream_byte(&board->tip_stream, bytes[i].byte, board->time_us + since_us);
        }
    }
}

static bool board_read_tip(void *context, struct hal_tip_sample *sample) {
    struct board *board = context;
    feed_tip_stream(board);
    return tip_stream_read(&board->tip_stream, sample);
}

static bool board_write_outputs(void *context, const struct hal_outputs *outputs) {
    struct board *board = context;
    board->outputs_set = valves_write(outputs);
    return board->outputs_set;
}

static void board_read_health(void *context, struct hal_health *health) {
    const struct board *board = context;
    *health = (struct hal_health){.clock_failed = clock_crystal_failed(),
                                  .watchdog_reset = board->watchdog_reset,
                                  .brown_out_reset = board->brown_out_reset,
                                  .crashed = board->crashed,
                                  .brown_out_low = board->brown_out_low,
                                  .steps_late = board->steps_late};
}

static void need(bool started, enum part part) {
    if (!started) {
        faults_stop(CRASH_SETUP, (uint32_t)part);
    }
}

/* A core that a debugger halts stops the valves' timer, which then drives its outputs low, and the watchdog.
 */
static void let_debugger_halt(void) {
    DBGMCU->apb1fzr1 = DBGMCU_APB1FZR1_TIM2 | DBGMCU_APB1FZR1_TIM3 | DBGMCU_APB1FZR1_IWDG;
    DBGMCU->apb2fz = DBGMCU_APB2FZ_TIM1;
}

static void take_reset_cause(struct board *board) {
    struct faults_start start;
    faults_begin(&start);
    board->watchdog_reset = start.watchdog;
    board->brown_out_reset = start.brown_out;
    board->crashed = start.crashed;
    board->crash = start.record;
}

void board_start(struct board *board, uint32_t *clock_hz) {
    *board = (struct board){.hal = {.context = board,
                                    .time_us = board_time_us,
                                    .read_pressures = board_read_pressures,
                                    .read_tip = board_read_tip,
                                    .write_outputs = board_write_outputs,
                                    .read_health = board_read_health},
                            .pressures_old = true};
    let_debugger_halt();
    watchdog_start();
    take_reset_cause(board);
    pins_start();
    *clock_hz = clock_start();
    need(valves_start(*clock_hz), PART_VALVES);
    supply_monitor_start();
    need(time_base_start(*clock_hz), PART_TIME);
    need(pressure_adc_start(), PART_CONVERTER);
    board->reference_calibration = pressure_adc_calibration();
    tip_stream_init(&board->tip_stream, TIP_STREAM_AGE_US);
    tip_uart_start(*clock_hz);
    board->storage_usable = flash_start(&board->storage);
    board->brown_out_low = !supply_monitor_brown_out_is_set();
}

void board_run(struct board *board) {
    board->time_us = 0;
    board->tick = 0u;
    time_base_run();
}

/* Ticks without a step are late ones, or, after the core stood still for its own flash bank, stalled ones. */
void board_wait(struct board *board) {
    const uint32_t tick = time_base_wait(board->tick);
    const uint32_t passed = tick - board->tick;
    const bool stalled = flash_take_stall();
    board->steps_stalled += stalled ? passed - 1u : 0u;
    board->steps_late += stalled ? 0u : passed - 1u;
    board->time_us += (int64_t)passed * (int64_t)TIME_BASE_STEP_US;
    board->tick = tick;
    board->outputs_set = false;
    can_step(board->time_us);
}

void board_completed(struct board *board, uint32_t state) {
    faults_mark_step(board->tick, state);
    time_base_completed(board->tick);
    if (board->outputs_set) {
        watchdog_feed(valves_enabled());
    }
}

_Noreturn void board_reset(void) {
    valves_shut();
    core_reset();
}
