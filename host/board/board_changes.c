#include "board/board_changes.h"

#include <stdarg.h>
#include <string.h>

#include "comms/codec.h"
#include "safety/supervisor.h"

#define PASSIVE_AT 128u

void board_changes_cause(uint32_t cause, char *text, size_t bytes) {
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
say(const struct board_changes *changes, const struct board *board, const char *format, ...) {
    va_list arguments;
    if (changes->out == NULL) {
        return;
    }
    fprintf(changes->out, "%10.3f s  ", 1e-6 * (double)board_time_us(board));
    va_start(arguments, format);
    vfprintf(changes->out, format, arguments);
    va_end(arguments);
    fputc('\n', changes->out);
    (void)fflush(changes->out); /* also into a file or a pipe: somebody waits for it */
}

/* Notes a flag; true where it changed. */
static bool changed(bool *was, bool is) {
    const bool differs = *was != is;
    *was = is;
    return differs;
}

static void say_status(struct board_changes *changes, const struct message_status *status) {
    char text[512] = "";
    size_t used = 0;
    for (unsigned f = 0; f < (unsigned)FAULT_COUNT && used < sizeof text; f++) {
        if ((status->faults >> f & 1u) != 0) {
            const int wrote = snprintf(text + used, sizeof text - used, "%s%s", used > 0 ? ", " : ": ",
                                       supervisor_fault_describe((enum supervisor_fault)f)->name);
            used += wrote > 0 ? (size_t)wrote : 0u;
        }
    }
    say(changes, changes->board, "state: %s%s", supervisor_state_name((enum supervisor_state)status->state),
        text);
}

static void hear(void *context, const struct can_bus_frame *frame) {
    struct board_changes *changes = context;
    struct message_status status;
    struct message_trouble trouble = {0};
    enum message_id id;
    if (frame->frame.extended || !message_find(frame->frame.id >> MESSAGE_NODE_BITS, &id) ||
        id != MESSAGE_STATUS || frame->frame.length != message_row(id)->bytes) {
        return;
    }
    message_unpack(id, frame->frame.data, &status, &trouble);
    if (!changes->state_known || status.state != changes->state || status.faults != changes->faults) {
        changes->state_known = true;
        changes->state = status.state;
        changes->faults = status.faults;
        say_status(changes, &status);
    }
}

void board_changes_listen(struct board_changes *changes, struct board *board) {
    changes->board = board;
    board->fdcan.sent = hear;
    board->fdcan.context = changes;
}

static void look_at_bus(struct board_changes *changes, const struct board *board) {
    const struct can_bus_node *node = &board->fdcan.node;
    const bool passive = node->transmit_errors >= PASSIVE_AT || node->receive_errors >= PASSIVE_AT;
    if (changed(&changes->passive, passive && !node->bus_off)) {
        say(changes, board, "CAN: error %s, transmit errors %u, receive errors %u",
            changes->passive ? "passive" : "active", node->transmit_errors, node->receive_errors);
    }
    if (changed(&changes->bus_off, node->bus_off)) {
        say(changes, board, "CAN: %s", node->bus_off ? "bus-off" : "back on the bus");
    }
}

void board_changes_look(struct board_changes *changes, const struct board *board) {
    char cause[64];
    if (!changes->started || changes->resets != board->resets) {
        board_changes_cause(board->last_cause, cause, sizeof cause);
        say(changes, board, "started: %s", cause);
        changes->started = true;
        changes->resets = board->resets;
    }
    if (changes->core_hz != board->rcc.core_hz) {
        changes->core_hz = board->rcc.core_hz;
        say(changes, board, "clock: %.0f MHz", 1e-6 * (double)changes->core_hz);
    }
    if (changed(&changes->driven, board->wiring.coils_driven)) {
        say(changes, board, "valves: %s", changes->driven ? "driven" : "off");
    }
    if (changed(&changes->supply_open, board->wiring.supply_open)) {
        say(changes, board, "shut-off valve: %s", changes->supply_open ? "open" : "shut");
    }
    if (changed(&changes->locked_up, board->core.locked_up)) {
        say(changes, board, "core: %s", changes->locked_up ? "locked up" : "runs again");
    }
    look_at_bus(changes, board);
}
