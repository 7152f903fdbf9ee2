/* The firmware on the board: bind the app to the board's hal, and step it at each tick, for ever. */
#include <stddef.h>

#include "app.h"
#include "stm32g4/board.h"
#include "stm32g4/linker.h"

static struct board board;
static struct bend_table table;
static struct app app;

/* The first slot that holds a sound table; NULL: none does, and pressures are all that can be commanded. */
static const struct bend_table *open_table(void) {
    const enum hal_storage_area slots[2] = {HAL_STORAGE_TABLE_A, HAL_STORAGE_TABLE_B};
    for (uint32_t i = 0; i < 2u; i++) {
        uint32_t bytes = 0u;
        const uint8_t *image = board.storage.map(board.storage.context, slots[i], &bytes);
        if (bend_table_open(&table, image, bytes, NULL) == BEND_TABLE_OK) {
            return &table;
        }
    }
    return NULL;
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
