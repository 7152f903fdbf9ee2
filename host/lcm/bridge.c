#include "lcm/bridge.h"

#include <string.h>

#include "comms/parameters.h"
#include "lcm/bridge_messages.h"

#define IN_MOTION_US 2000000 /* so long after the last command the board may still follow it */

const char *bridge_channel_name(enum bridge_channel channel) {
    static const char *const names[] = {
#define BRIDGE_CHANNEL_TEXT(NAME, text) text,
        BRIDGE_CHANNELS(BRIDGE_CHANNEL_TEXT)
#undef BRIDGE_CHANNEL_TEXT
    };
    return names[channel];
}

void bridge_init(struct bridge *bridge, uint32_t node, const struct bridge_out *out,
                 const struct bridge_now *now) {
    memset(bridge, 0, sizeof *bridge);
    bridge->node = node;
    bridge->out = *out;
    bridge->status_us = now->monotonic_us + BRIDGE_STATUS_US;
    can_assembly_init(&bridge->assembly);
    clock_map_init(&bridge->clock);
    command_gate_shut(&bridge->gate, now->monotonic_us);
}

/* --- out --- */

static void publish(struct bridge *bridge, enum bridge_channel channel, const uint8_t *data, int bytes) {
    if (bytes > 0 && bridge->out.publish(bridge->out.context, channel, data, (uint32_t)bytes)) {
        bridge->counters.published++;
    } else {
        bridge->counters.unpublished++;
    }
}

static bool send_message(struct bridge *bridge, enum message_id id, const void *message) {
    struct message_trouble trouble = {.out_of_range = 0};
    struct hal_can_frame frame;
    message_frame(id, bridge->node, message, &frame, &trouble);
    if (!bridge->out.send(bridge->out.context, &frame)) {
        bridge->counters.frames_unsent++;
        return false;
    }
    bridge->counters.frames_sent++;
    return true;
}

int64_t bridge_host_time(const struct bridge *bridge, int64_t board_us, const struct bridge_now *now) {
    int64_t host_us = 0;
    return clock_map_host_us(&bridge->clock, board_us, &host_us) ? host_us : now->host_us;
}

/* Mapped times of reports rise, also where the mapping has moved a little. */
static int64_t next_utime(struct bridge *bridge, int64_t board_us, const struct bridge_now *now) {
    const int64_t host_us = bridge_host_time(bridge, board_us, now);
    bridge->utime_us = host_us > bridge->utime_us ? host_us : bridge->utime_us + 1;
    return bridge->utime_us;
}

/* --- telemetry --- */

static void publish_report(struct bridge *bridge, const struct bridge_now *now) {
    const struct link_report *report = &bridge->assembly.report;
    uint8_t data[BRIDGE_MESSAGE_BYTES];
    const int64_t utime_us = next_utime(bridge, report->time_us, now);
    publish(bridge, BRIDGE_CHANNEL_STATUS, data, bridge_encode_status(report, utime_us, data));
    if (report->tip_new) {
        const int64_t measured_us = bridge_host_time(bridge, report->tip_measured_us, now);
        publish(bridge, BRIDGE_CHANNEL_TIP, data, bridge_encode_tip(report, utime_us, measured_us, data));
    }
    bridge->report_is_new = true;
}

static void publish_gap(struct bridge *bridge, const struct bridge_now *now) {
    uint8_t data[BRIDGE_MESSAGE_BYTES];
    const int bytes = bridge_encode_gap(&bridge->assembly.report.status.gap, now->host_us, data);
    publish(bridge, BRIDGE_CHANNEL_GAP, data, bytes);
}

static void answer_request(struct bridge *bridge, const struct message_parameter_value *value, int status,
                           const struct bridge_now *now) {
    const struct bridge_request *request = &bridge->request[bridge->first_request];
    uint8_t data[BRIDGE_MESSAGE_BYTES];
    const int bytes = bridge_encode_parameter((int)request->kind, value, status, now->host_us, data);
    publish(bridge, BRIDGE_CHANNEL_PARAMETER, data, bytes);
    bridge->first_request = (bridge->first_request + 1) % BRIDGE_REQUESTS_MOST;
    bridge->requests--;
    bridge->asked = false;
}

static void take_value(struct bridge *bridge, const struct message_parameter_value *value,
                       const struct bridge_now *now) {
    if (!bridge->asked) {
        return; /* another host asked */
    }
    const struct bridge_request *request = &bridge->request[bridge->first_request];
    const bool of_all = request->kind >= BRIDGE_PARAMETER_SAVE;
    if (of_all ? value->action != 0 : value->action == 0 && value->parameter == request->parameter) {
        answer_request(bridge, value, value->status, now);
    }
}

static void take_refusals(struct bridge *bridge, uint16_t total) {
    const uint16_t more = (uint16_t)(total - (uint16_t)bridge->refusals_seen);
    bridge->counters.refused_by_board += more;
    bridge->refusals_seen += more;
}

static void start_anew(struct bridge *bridge, const struct bridge_now *now) {
    bridge->refusals_seen = 0;
    command_gate_shut(&bridge->gate, now->monotonic_us);
    clock_map_restart(&bridge->clock);
}

static void take_report(struct bridge *bridge, const struct transport_frame *frame,
                        const struct bridge_now *now) {
    const struct can_assembly *assembly = &bridge->assembly;
    if (bridge->counters.board_restarts != assembly->restarts) {
        start_anew(bridge, now);
    }
    bridge->counters.board_restarts = assembly->restarts;
    bridge->counters.reports_missing = assembly->missing;
    clock_map_take(&bridge->clock, assembly->report.time_us, frame->time_us);
    publish_report(bridge, now);
}

static void take_message(struct bridge *bridge, enum message_id id, const union message *message,
                         const struct transport_frame *frame, const struct bridge_now *now) {
    if (can_assembly_take(&bridge->assembly, id, message)) {
        take_report(bridge, frame, now);
    } else if (id == MESSAGE_GAP) {
        publish_gap(bridge, now);
    } else if (id == MESSAGE_PARAMETER_VALUE) {
        take_value(bridge, &message->parameter_value, now);
    } else if (id == MESSAGE_STATUS) {
        bridge->protocol = message->status.protocol;
    } else if (id == MESSAGE_REFUSALS) {
        take_refusals(bridge, message->refusals.total);
    }
}

static void hear(struct bridge *bridge, const struct bridge_now *now) {
    if (!bridge->board_is_heard) {
        command_gate_shut(&bridge->gate, now->monotonic_us);
    }
    bridge->board_is_heard = true;
    bridge->heard_us = now->monotonic_us;
}

static bool is_of_board(const struct bridge *bridge, const struct hal_can_frame *frame, enum message_id *id) {
    return !frame->extended && (frame->id & MESSAGE_NODE_MOST) == bridge->node &&
           message_find(frame->id >> MESSAGE_NODE_BITS, id) && message_row(*id)->direction == MESSAGE_TO_HOST;
}

void bridge_take_frame(struct bridge *bridge, const struct transport_frame *frame,
                       const struct bridge_now *now) {
    struct message_trouble trouble = {.out_of_range = 0};
    union message message;
    enum message_id id;
    if (frame->is_error) {
        bridge->counters.error_frames++;
        return;
    }
    bridge->counters.frames_received++;
    if (!is_of_board(bridge, &frame->frame, &id)) {
        bridge->counters.frames_foreign++;
        return;
    }
    if (frame->frame.length != message_row(id)->bytes) {
        bridge->counters.frames_undecodable++;
        return;
    }
    message_unpack(id, frame->frame.data, &message, &trouble);
    bridge->counters.frames_undecodable += trouble.out_of_range > 0 ? 1 : 0;
    hear(bridge, now);
    if (trouble.out_of_range == 0) {
        take_message(bridge, id, &message, frame, now);
    }
}

/* --- commands --- */

static void judge(struct bridge *bridge, const struct controller_command *command, int64_t sent_us,
                  const struct bridge_now *now) {
    switch (command_gate_judge(&bridge->gate, command->kind, sent_us, now->monotonic_us)) {
    case GATE_PASS:
        bridge->counters.commands_superseded += bridge->waiting.kind != COMMAND_NONE ? 1 : 0;
        bridge->waiting = *command;
        return;
    case GATE_FLYING:
        bridge->counters.commands_flying++;
        return;
    case GATE_LATE:
        bridge->counters.commands_late++;
        return;
    case GATE_ARM:
    default:
        return;
    }
}

static void take_command(struct bridge *bridge, const void *data, uint32_t bytes,
                         const struct bridge_now *now) {
    struct controller_command command;
    int64_t sent_us = 0;
    bridge->counters.commands_received++;
    if (!bridge_decode_command(data, bytes, &command, &sent_us)) {
        bridge->counters.commands_malformed++;
        return;
    }
    judge(bridge, &command, sent_us, now);
}

static void take_request(struct bridge *bridge, const void *data, uint32_t bytes) {
    int kind = 0;
    uint32_t parameter = 0, value = 0;
    bridge->counters.requests_received++;
    if (bridge->requests == BRIDGE_REQUESTS_MOST ||
        !bridge_decode_parameter(data, bytes, &kind, &parameter, &value) || kind < 0 ||
        kind >= (int)BRIDGE_PARAMETER_REQUESTS || parameter > UINT16_MAX) {
        bridge->counters.requests_dropped++;
        return;
    }
    bridge->request[(bridge->first_request + bridge->requests) % BRIDGE_REQUESTS_MOST] =
        (struct bridge_request){(enum bridge_parameter_request)kind, parameter, value};
    bridge->requests++;
}

void bridge_take_message(struct bridge *bridge, enum bridge_channel channel, const void *data, uint32_t bytes,
                         const struct bridge_now *now) {
    if (channel == BRIDGE_CHANNEL_COMMAND) {
        take_command(bridge, data, bytes, now);
    } else if (channel == BRIDGE_CHANNEL_PARAMETER_REQUEST) {
        take_request(bridge, data, bytes);
    }
}

static bool send_command(struct bridge *bridge, const struct controller_command *command) {
    union message message;
    const enum message_id id =
        bridge_command_message(command, bridge->assembly.report.status.faults, bridge->sequence, &message);
    bridge->sequence++;
    return send_message(bridge, id, &message);
}

static void send_waiting(struct bridge *bridge, const struct bridge_now *now) {
    if (bridge->waiting.kind == COMMAND_NONE) {
        return;
    }
    if (send_command(bridge, &bridge->waiting)) {
        bridge->counters.commands_forwarded++;
        bridge->followed = bridge->waiting;
        bridge->followed_us = now->monotonic_us;
    } else {
        bridge->counters.commands_unsent++;
    }
    bridge->waiting.kind = COMMAND_NONE;
}

static void ask(struct bridge *bridge, const struct bridge_now *now) {
    const struct bridge_request *request = &bridge->request[bridge->first_request];
    const struct message_parameter_value none = {.parameter = (uint16_t)request->parameter};
    if (bridge->asked && now->monotonic_us - bridge->asked_us >= BRIDGE_ANSWER_US) {
        bridge->counters.requests_unanswered++;
        answer_request(bridge, &none, -1, now);
    }
    if (bridge->requests > 0 && !bridge->asked) {
        union message message;
        request = &bridge->request[bridge->first_request];
        const enum message_id id =
            bridge_request_message((int)request->kind, request->parameter, request->value, &message);
        bridge->asked = true; /* also where it could not be sent: the time limit tells */
        bridge->asked_us = now->monotonic_us;
        (void)send_message(bridge, id, &message);
    }
}

/* --- the course of time --- */

static void look_for_silence(struct bridge *bridge, const struct bridge_now *now) {
    if (bridge->board_is_heard && now->monotonic_us - bridge->heard_us >= BRIDGE_SILENT_US) {
        bridge->counters.board_silences++;
        bridge->board_is_heard = false;
        command_gate_shut(&bridge->gate, now->monotonic_us);
    }
}

/* A board behind a Unix socket answers whoever spoke last, so it must be spoken to. */
static void call_board(struct bridge *bridge, const struct bridge_now *now) {
    const struct message_identify identify = {.protocol = MESSAGE_PROTOCOL};
    if (!bridge->board_is_heard && now->monotonic_us >= bridge->call_us) {
        bridge->call_us = now->monotonic_us + BRIDGE_CALL_US;
        (void)send_message(bridge, MESSAGE_IDENTIFY, &identify);
    }
}

static void publish_own_status(struct bridge *bridge, const struct bridge_now *now) {
    uint8_t data[BRIDGE_MESSAGE_BYTES];
    if (now->monotonic_us < bridge->status_us) {
        return;
    }
    bridge->status_us = now->monotonic_us + BRIDGE_STATUS_US;
    bridge->counters.clock_resets = bridge->clock.resets;
    publish(bridge, BRIDGE_CHANNEL_BRIDGE, data, bridge_encode_bridge(bridge, now->host_us, data));
}

void bridge_step(struct bridge *bridge, const struct bridge_now *now) {
    look_for_silence(bridge, now);
    call_board(bridge, now);
    send_waiting(bridge, now);
    ask(bridge, now);
    publish_own_status(bridge, now);
}

void bridge_lose_bus(struct bridge *bridge, const struct bridge_now *now) {
    bridge->counters.commands_unsent += bridge->waiting.kind != COMMAND_NONE ? 1 : 0;
    bridge->waiting.kind = COMMAND_NONE;
    command_gate_shut(&bridge->gate, now->monotonic_us);
}

void bridge_vent(struct bridge *bridge, const struct bridge_now *now) {
    const struct controller_command vent = {.kind = COMMAND_VENT};
    const enum controller_command_kind kind = bridge->followed.kind;
    const bool moves = kind == COMMAND_PRESSURE || kind == COMMAND_BEND || kind == COMMAND_HOLD;
    if (moves && now->monotonic_us - bridge->followed_us < IN_MOTION_US) {
        (void)send_command(bridge, &vent);
    }
}
