/* The firmware on the board: bind the node to the board, and step it at each tick, for ever. */
#include <stddef.h>

#include "comms/node.h"
#include "control/crc32.h"
#include "stm32g4/board.h"
#include "stm32g4/linker.h"

#define NODE_MASK ((1u << MESSAGE_NODE_BITS) - 1u)
#define BIT_RATE_FALLBACK 1000000u

static struct board board;
static struct node node;
static struct node_setup setup;

/* Tells one build from another, whatever was flashed. */
static uint32_t hash_of_code(void) {
    return crc32_update(0u, linker_code_start, (uintptr_t)linker_code_end - (uintptr_t)linker_code_start);
}

/* A rate that the clock does not have would leave the board out of reach: it then takes the one it came with.
 */
static void join_bus(uint32_t clock_hz) {
    const struct node_parameters *wanted = &node.parameters.node;
    struct can_settings settings = {
        .bit_rate = wanted->bit_rate,
        .data_bit_rate = wanted->data_bit_rate,
        .fd = wanted->can_fd != 0u,
        .filters = 2u,
        .filter = {[0] = {.id = (uint16_t)wanted->node_id, .mask = NODE_MASK},
                   [1] = {.id = MESSAGE_NODE_ALL, .mask = NODE_MASK}},
    };
    board.bus_started = can_start(clock_hz, &settings, &board.bus);
    if (!board.bus_started) {
        settings.bit_rate = BIT_RATE_FALLBACK;
        board.bus_started = can_start(clock_hz, &settings, &board.bus);
    }
}

int main(void) {
    uint32_t clock_hz;
    board_start(&board, &clock_hz);
    setup = (struct node_setup){.hal = &board.hal,
                                .bus = &board.bus,
                                .storage = board.storage_usable ? &board.storage : NULL,
                                /* in slot A, where the store finds it if it has the flash to look in */
                                .table_image = board.storage_usable ? NULL : linker_table_a,
                                .table_bytes =
                                    (uint32_t)((uintptr_t)linker_table_a_end - (uintptr_t)linker_table_a),
                                .firmware = hash_of_code(),
                                .tip_stream = &board.tip_stream.counters};
    node_init(&node, &setup);
    join_bus(clock_hz);
    board_run(&board);
    for (;;) {
        board_wait(&board);
        node_step(&node);
        (void)app_step(&node.app); /* its answer is in the status */
        node_report(&node);
        board_completed(&board, (uint32_t)node.app.controller.status.state);
        if (node.reset_wanted) {
            board_reset();
        }
    }
}
