/* Which commands that come over LCM may pass: no motion that was already under way when the bridge started or
 * the board came back, and never an older command after a fresher one.
 *
 * Motion commands (pressure, bend, hold) pass once they have paused for GATE_PAUSE_US, or after an arm (kind
 * 0). A vent passes always and shuts the gate, so that it holds against a sender that goes on. Not here: what
 * the board lets pass. */
#ifndef TRIBEND_COMMAND_GATE_H
#define TRIBEND_COMMAND_GATE_H

#include <stdbool.h>
#include <stdint.h>

#include "control/controller.h"

#define GATE_PAUSE_US                                                                                        \
    1000000 /* longer than the board's command timeout, so that what flew has been vented                    \
             */

struct command_gate {
    bool is_open;
    int64_t motion_us; /* when a motion command last came, passed or not */
    int64_t sent_us;   /* of the freshest command, its sender's clock */
    bool sent_known;
};

enum gate_verdict { GATE_PASS = 0, GATE_ARM, GATE_FLYING, GATE_LATE };

/* Shut: at the start, and whenever the board was away. `now_us` is monotonic. */
void command_gate_shut(struct command_gate *gate, int64_t now_us);
enum gate_verdict command_gate_judge(struct command_gate *gate, enum controller_command_kind kind,
                                     int64_t sent_us, int64_t now_us);

#endif
