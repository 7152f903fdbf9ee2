#include "lcm/bridge_messages.h"

#include <math.h>
#include <string.h>

#include "comms/node.h"
#include "comms/parameters.h"
#include "tribend_bridge_t.h"
#include "tribend_command_t.h"
#include "tribend_gap_t.h"
#include "tribend_parameter_t.h"
#include "tribend_status_t.h"
#include "tribend_tip_t.h"

#define MICRO 1e6
#define NANO 1e9

static int32_t whole(float value, double per_unit) {
    const double scaled = per_unit * (double)value;
    if (isnan(scaled)) {
        return BRIDGE_LACKS;
    }
    return scaled > INT32_MAX ? INT32_MAX : scaled < -INT32_MAX ? -INT32_MAX : (int32_t)lround(scaled);
}

static void wholes(const float *value, double per_unit, int32_t *out, size_t count) {
    for (size_t i = 0; i < count; i++) {
        out[i] = whole(value[i], per_unit);
    }
}

int bridge_encode_status(const struct link_report *report, int64_t utime_us,
                         uint8_t data[BRIDGE_MESSAGE_BYTES]) {
    const struct controller_status *status = &report->status;
    tribend_status_t message = {.utime = utime_us,
                                .supply_pa = whole(report->supply_pa, 1.0),
                                .state = (int8_t)status->state,
                                .faults = (int32_t)status->faults,
                                .warnings = (int32_t)status->warnings,
                                .bend_urad = whole(status->bend_rad, MICRO),
                                .direction_urad = whole(status->direction_rad, MICRO),
                                .bend_is_measured = status->bend_is_measured};
    wholes(report->pressure_pa, 1.0, message.pressure_pa, 3);
    wholes(status->pressure_target_pa, 1.0, message.pressure_target_pa, 3);
    wholes(report->duty, MICRO, message.duty_ppm, 3);
    return tribend_status_t_encode(data, 0, BRIDGE_MESSAGE_BYTES, &message);
}

int bridge_encode_tip(const struct link_report *report, int64_t utime_us, int64_t measured_us,
                      uint8_t data[BRIDGE_MESSAGE_BYTES]) {
    tribend_tip_t message = {.utime = utime_us,
                             .measured_utime = measured_us,
                             .quality = report->tip_quality,
                             .status = report->tip_status};
    wholes(report->tip_position_m, MICRO, message.position_um, 3);
    wholes(report->tip_quaternion, NANO, message.quaternion_nano, 4);
    return tribend_tip_t_encode(data, 0, BRIDGE_MESSAGE_BYTES, &message);
}

int bridge_encode_gap(const struct gap_monitor_report *gap, int64_t utime_us,
                      uint8_t data[BRIDGE_MESSAGE_BYTES]) {
    tribend_gap_t message = {.utime = utime_us,
                             .stage = (int8_t)gap->stage,
                             .chamber = (int8_t)gap->chamber,
                             .bend_gap_urad = whole(gap->bend_gap_rad, MICRO),
                             .bend_threshold_urad = whole(gap->bend_threshold_rad, MICRO),
                             .position_gap_um = whole(gap->position_gap_m, MICRO),
                             .position_threshold_um = whole(gap->position_threshold_m, MICRO),
                             .vented_threshold_pa = whole(gap->vented_threshold_pa, 1.0)};
    wholes(gap->pressure_gap_pa, 1.0, message.pressure_gap_pa, 3);
    wholes(gap->pressure_threshold_pa, 1.0, message.pressure_threshold_pa, 3);
    wholes(gap->vented_pa, 1.0, message.vented_pa, 3);
    return tribend_gap_t_encode(data, 0, BRIDGE_MESSAGE_BYTES, &message);
}

static bool is_float(uint32_t number) {
    enum parameter_index index;
    return parameter_find(number, &index) && parameter_row(index)->type == PARAMETER_TYPE_REAL;
}

int bridge_encode_parameter(int request, const struct message_parameter_value *value, int status,
                            int64_t utime_us, uint8_t data[BRIDGE_MESSAGE_BYTES]) {
    const tribend_parameter_t message = {.utime = utime_us,
                                         .request = (int8_t)request,
                                         .parameter = value->parameter,
                                         .value = (int32_t)value->value,
                                         .is_float = is_float(value->parameter),
                                         .status = (int8_t)status};
    return tribend_parameter_t_encode(data, 0, BRIDGE_MESSAGE_BYTES, &message);
}

int bridge_encode_bridge(const struct bridge *bridge, int64_t utime_us, uint8_t data[BRIDGE_MESSAGE_BYTES]) {
    const struct clock_map *clock = &bridge->clock;
    const int64_t board_us = bridge->assembly.report.time_us;
    int64_t host_us = board_us;
    (void)clock_map_host_us(clock, board_us, &host_us);
    tribend_bridge_t message = {.utime = utime_us,
                                .clock_offset_us = host_us - board_us + bridge->assembly.offset_us,
                                .clock_drift_ppb = whole((float)clock->drift, NANO),
                                .clock_windows = (int32_t)clock->windows,
                                .board_is_heard = bridge->board_is_heard,
                                .gate_is_open = bridge->gate.is_open,
                                .latency_median_us = (int32_t)latency_of(&bridge->latency, 0.5),
                                .latency_p99_us = (int32_t)latency_of(&bridge->latency, 0.99)};
#define BRIDGE_COUNTER(name, text) message.name = (int64_t)bridge->counters.name;
    BRIDGE_COUNTERS(BRIDGE_COUNTER)
#undef BRIDGE_COUNTER
    return tribend_bridge_t_encode(data, 0, BRIDGE_MESSAGE_BYTES, &message);
}

/* --- in --- */

/* Whether its CAN message can carry the command as it is. */
static bool fits(const struct controller_command *command) {
    struct message_trouble trouble = {.out_of_range = 0};
    struct hal_can_frame frame;
    union message message;
    const enum message_id id = bridge_command_message(command, 0, 0, &message);
    message_frame(id, 1, &message, &frame, &trouble);
    return trouble.out_of_range == 0;
}

bool bridge_decode_command(const void *data, uint32_t bytes, struct controller_command *command,
                           int64_t *sent_us) {
    tribend_command_t message;
    if (tribend_command_t_decode(data, 0, (int)bytes, &message) != (int)bytes ||
        message.kind < (int)COMMAND_NONE || message.kind > (int)COMMAND_CLEAR) {
        return false;
    }
    *sent_us = message.utime;
    *command = (struct controller_command){.kind = (enum controller_command_kind)message.kind,
                                           .pressure_pa = {(float)message.pressure_pa[0],
                                                           (float)message.pressure_pa[1],
                                                           (float)message.pressure_pa[2]},
                                           .bend_rad = (float)(message.bend_urad / MICRO),
                                           .direction_rad = (float)(message.direction_urad / MICRO),
                                           .co_contraction_pa = (float)message.co_contraction_pa};
    return command->kind == COMMAND_NONE || fits(command);
}

bool bridge_decode_parameter(const void *data, uint32_t bytes, int *request, uint32_t *parameter,
                             uint32_t *value) {
    tribend_parameter_t message;
    if (tribend_parameter_t_decode(data, 0, (int)bytes, &message) != (int)bytes) {
        return false;
    }
    *request = message.request < 0 ? -1 : message.request;
    *parameter = (uint32_t)message.parameter;
    *value = (uint32_t)message.value;
    return true;
}

enum message_id bridge_command_message(const struct controller_command *command, uint32_t faults,
                                       uint8_t sequence, union message *message) {
    const uint8_t protocol = MESSAGE_PROTOCOL;
    switch (command->kind) {
    case COMMAND_PRESSURE:
        message->pressure_command = (struct message_pressure_command){
            sequence, protocol, command->pressure_pa[0], command->pressure_pa[1], command->pressure_pa[2]};
        return MESSAGE_PRESSURE_COMMAND;
    case COMMAND_BEND:
        message->bend_command = (struct message_bend_command){
            sequence, protocol, command->bend_rad, command->direction_rad, command->co_contraction_pa};
        return MESSAGE_BEND_COMMAND;
    case COMMAND_HOLD:
        message->hold = (struct message_hold){sequence, protocol};
        return MESSAGE_HOLD;
    case COMMAND_CLEAR:
        message->clear = (struct message_clear){sequence, protocol, MESSAGE_CLEAR_KEY, faults};
        return MESSAGE_CLEAR;
    case COMMAND_NONE:
    case COMMAND_VENT:
    default:
        message->vent = (struct message_vent){sequence, protocol};
        return MESSAGE_VENT;
    }
}

enum message_id bridge_request_message(int request, uint32_t parameter, uint32_t value,
                                       union message *message) {
    const uint8_t protocol = MESSAGE_PROTOCOL;
    if (request == (int)BRIDGE_PARAMETER_GET) {
        message->parameter_get = (struct message_parameter_get){0, protocol, (uint16_t)parameter};
        return MESSAGE_PARAMETER_GET;
    }
    if (request == (int)BRIDGE_PARAMETER_SET) {
        message->parameter_set = (struct message_parameter_set){0, protocol, (uint16_t)parameter, value};
        return MESSAGE_PARAMETER_SET;
    }
    const uint8_t action = request == (int)BRIDGE_PARAMETER_SAVE ? NODE_ACTION_SAVE : NODE_ACTION_DEFAULTS;
    message->parameter_action = (struct message_parameter_action){0, protocol, action};
    return MESSAGE_PARAMETER_ACTION;
}
