/* The board as hal.h has it: its peripherals started in order, and the functions that the firmware calls. */
#ifndef TRIBEND_STM32G4_BOARD_H
#define TRIBEND_STM32G4_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "comms/tip_stream.h"
#include "hal.h"
#include "stm32g4/can.h"
#include "stm32g4/crash_record.h"

struct board {
    struct hal hal;
    struct hal_bus bus;
    struct hal_storage storage;
    int64_t time_us; /* of the step that runs, a multiple of the step */
    uint32_t tick;
    uint32_t steps_late;
    uint32_t steps_stalled; /* missed while the core's own flash bank was erased or written */
    uint32_t pressures_missed;
    struct hal_pressures pressures; /* the last that were read */
    bool pressures_old;             /* a step has used them again, or there are none */
    struct tip_stream tip_stream;
    bool outputs_set; /* in the step that runs: what feeds the watchdog */
    bool watchdog_reset;
    bool brown_out_reset;
    bool crashed;
    struct crash_record crash; /* meaningful with crashed */
    bool bus_started;
    bool storage_usable;
    bool brown_out_low; /* the option bytes have the brown-out reset under 2.8 V */
    uint16_t reference_calibration;
};

/* Everything but the bus; valves off. A peripheral that the valves' safety needs and that does not start is a
 * crash. */
void board_start(struct board *board, uint32_t *clock_hz);
/* Time 0. */
void board_run(struct board *board);
/* Sleep until the next step is due; then `board->time_us` is its time. */
void board_wait(struct board *board);
/* The step is complete, in supervisor state `state`. Feeds the watchdog if the step could set its outputs:
 * what cannot be set ends in a reset, which vents. */
void board_completed(struct board *board, uint32_t state);
/* Shut the valves and start again. */
_Noreturn void board_reset(void);

#endif
