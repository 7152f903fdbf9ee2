#include "lcm/command_gate.h"

void command_gate_shut(struct command_gate *gate, int64_t now_us) {
    *gate = (struct command_gate){.motion_us = now_us};
}

/* Older than, or the same as, one that came before. After a pause it may be another sender, with another
 * clock. */
static bool is_late(struct command_gate *gate, int64_t sent_us) {
    if (gate->sent_known && sent_us <= gate->sent_us) {
        return true;
    }
    gate->sent_us = sent_us;
    gate->sent_known = true;
    return false;
}

static enum gate_verdict judge_motion(struct command_gate *gate, int64_t sent_us, int64_t now_us) {
    if (now_us - gate->motion_us >= GATE_PAUSE_US) {
        gate->is_open = true;
        gate->sent_known = false;
    }
    gate->motion_us = now_us;
    if (is_late(gate, sent_us)) {
        return GATE_LATE;
    }
    return gate->is_open ? GATE_PASS : GATE_FLYING;
}

enum gate_verdict command_gate_judge(struct command_gate *gate, enum controller_command_kind kind,
                                     int64_t sent_us, int64_t now_us) {
    switch (kind) {
    case COMMAND_VENT:
        gate->is_open = false;
        return GATE_PASS;
    case COMMAND_NONE:
        gate->is_open = true;
        gate->sent_known = false;
        return GATE_ARM;
    case COMMAND_CLEAR:
        return is_late(gate, sent_us) ? GATE_LATE : GATE_PASS;
    default:
        return judge_motion(gate, sent_us, now_us);
    }
}
