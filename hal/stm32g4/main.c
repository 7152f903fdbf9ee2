/* The firmware on the board: bind the app to the board's hal, and step it at each tick, for ever. */
#include <stddef.h>

#include "app.h"
#include "stm32g4/board.h"
#include "stm32g4/linker.h"

static struct board board;
static struct bend_table table;
static struct app app;

/* NULL: what was flashed is no sound table, and pressures are all that can be commanded. */
static const struct bend_table *open_table(void) {
    const uint32_t bytes = (uint32_t)((uintptr_t)linker_table_a_end - (uintptr_t)linker_table_a);
    return bend_table_open(&table, linker_table_a, bytes, NULL) == BEND_TABLE_OK ? &table : NULL;
}

int main(void) {
    uint32_t clock_hz;
    board_start(&board, &clock_hz);
    const struct bend_table *opened = open_table();
    struct controller_parameters parameters;
    controller_default_parameters(&parameters, opened);
    app_init(&app, &board.hal, opened, &parameters);
    const struct can_settings settings = {.bit_rate = 1000000u,
                                          .data_bit_rate = 5000000u,
                                          .fd = true,
                                          .filters = 2u,
                                          .filter = {{.id = 1u, .mask = 0xfu}, {.id = 0u, .mask = 0xfu}}};
    board.bus_started = can_start(clock_hz, &settings, &board.bus);
    board_run(&board);
    for (;;) {
        board_wait(&board);
        (void)app_step(&app); /* its answer is in the status */
        board_completed(&board, (uint32_t)app.controller.status.state);
    }
}
