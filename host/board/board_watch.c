#include "board/board_watch.h"

#include <stdarg.h>
#include <string.h>

#define PASSIVE_AT 128u

void board_watch_cause(uint32_t cause, char *text, size_t bytes) {
    const char *words = "reset line";
    if ((cause & RCC_RESET_WATCHDOG) != 0) {
        words = "watchdog";
    } else if ((cause & RCC_RESET_SOFTWARE) != 0) {
        words = "software";
    } else if ((cause & RCC_RESET_BROWN_OUT) != 0) {
        words = "brown-out or power-on";
    }
    (void)snprintf(text, bytes, "%s", words);
}

static void __attribute__((format(printf, 3, 4)))
say(const struct board_watch *watch, const struct board *board, const char *format, ...) {
    va_list arguments;
    if (watch->out == NULL) {
        return;
    }
    fprintf(watch->out, "%10.3f s  ", 1e-6 * (double)board_time_us(board));
    va_start(arguments, format);
    vfprintf(watch->out, format, arguments);
    va_end(arguments);
    fputc('\n', watch->out);
}

/* Notes a flag; true where it changed. */
static bool changed(bool *was, bool is) {
    const bool differs = *was != is;
    *was = is;
    return differs;
}

static void look_at_bus(struct board_watch *watch, const struct board *board) {
    const struct can_bus_node *node = &board->fdcan.node;
    const bool passive = node->transmit_errors >= PASSIVE_AT || node->receive_errors >= PASSIVE_AT;
    if (changed(&watch->passive, passive && !node->bus_off)) {
        say(watch, board, "CAN: error %s, transmit errors %u, receive errors %u",
            watch->passive ? "passive" : "active", node->transmit_errors, node->receive_errors);
    }
    if (changed(&watch->bus_off, node->bus_off)) {
        say(watch, board, "CAN: %s", node->bus_off ? "bus-off" : "back on the bus");
    }
}

void board_watch_look(struct board_watch *watch, const struct board *board) {
    char cause[64];
    if (!watch->started || watch->resets != board->resets) {
        board_watch_cause(board->last_cause, cause, sizeof cause);
        say(watch, board, "started: %s", cause);
        watch->started = true;
        watch->resets = board->resets;
    }
    if (watch->core_hz != board->rcc.core_hz) {
        watch->core_hz = board->rcc.core_hz;
        say(watch, board, "clock: %.0f MHz", 1e-6 * (double)watch->core_hz);
    }
    if (changed(&watch->driven, board->wiring.coils_driven)) {
        say(watch, board, "valves: %s", watch->driven ? "driven" : "off");
    }
    if (changed(&watch->supply_open, board->wiring.supply_open)) {
        say(watch, board, "shut-off valve: %s", watch->supply_open ? "open" : "shut");
    }
    if (changed(&watch->locked_up, board->core.locked_up)) {
        say(watch, board, "core: %s", watch->locked_up ? "locked up" : "runs again");
    }
    look_at_bus(watch, board);
}
