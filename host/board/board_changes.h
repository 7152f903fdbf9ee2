/* Says what changes on the emulated board, a line each: resets, clocks, valves, supply, the bus, and the
 * supervisor's state and faults as the board itself reports them. */
#ifndef TRIBEND_BOARD_CHANGES_H
#define TRIBEND_BOARD_CHANGES_H

#include <stdio.h>

#include "emulator/board.h"

struct board_changes {
    FILE *out; /* NULL: silent */
    uint32_t resets, core_hz;
    bool driven, supply_open, bus_off, passive, locked_up;
    bool started;
    const struct board *board;
    uint8_t state;
    uint32_t faults;
    bool state_known;
};

/* From now on listen to what the board sends, too. */
void board_changes_listen(struct board_changes *changes, struct board *board);

void board_changes_look(struct board_changes *changes, const struct board *board);
/* Words for the bits of a reset cause. */
void board_changes_cause(uint32_t cause, char *text, size_t bytes);

#endif
