/* Frames become commands in node_step(), a few a step. Reports are a table: each has a bit in `pending`,
 * which a period, an event or a request sets; node_report() sends at most two a step, in turn, built from the
 * controller's state when they go. State that lives here: the last motion command (for heartbeats), the
 * sender's sequence, what is owed to whom. */
#include "comms/node.h"

#include <stddef.h>
#include <string.h>

#define SEQUENCE_AHEAD 128u
#define ALL_PARAMETERS 65535u
#define HEADER_BYTES 2u
#define PROTOCOL_MASK 15u
#define NAME_PIECES 5u
#define NAME_PIECE_BYTES 7u
#define TIP_TIME_SHIFT 6u /* units of 64 us */
#define AGE_MOST 0x7fffffffu
#define FIELDS_A_STEP 11u /* a third of TELEMETRY's */

_Static_assert((uint32_t)FAULT_COUNT <= 32u, "STATUS.faults has 32 bits");
_Static_assert((uint32_t)WARNING_COUNT <= 16u, "STATUS.warnings has 16 bits");
_Static_assert((uint32_t)SUPERVISOR_STATE_COUNT <= 16u, "STATUS.state has 4 bits");
_Static_assert((uint32_t)GAP_MONITOR_STAGE_COUNT <= 16u, "GAP.stage has 4 bits");
_Static_assert(NAME_PIECES *NAME_PIECE_BYTES >= BEND_TABLE_NAME_BYTES, "IDENTITY_NAME holds the name");

/* --- what the controller says, into messages */

static uint16_t step_of(const struct node *node) {
    return (uint16_t)node->app.controller.step;
}

static float not_a_number(void) {
    const uint32_t bits = 0x7fc00000u;
    float value = 0.0f;
    (void)memcpy(&value, &bits, sizeof value);
    return value;
}

static float pressure_of(const struct node *node, uint32_t chamber) {
    const struct controller_input *input = &node->app.input;
    return input->pressure_ok[chamber] ? input->pressure_pa[chamber] : not_a_number();
}

static float supply_of(const struct node *node) {
    return node->app.input.supply_ok ? node->app.input.supply_pa : not_a_number();
}

static uint8_t bend_flags_of(const struct controller_status *status) {
    const bool tip_lost = (status->warnings & 1u << WARNING_TIP_LOST) != 0u;
    const bool limited = (status->warnings & 1u << WARNING_COMMAND_LIMITED) != 0u;
    return (uint8_t)((status->bend_is_measured ? 1u << NODE_BEND_MEASURED : 0u) |
                     (tip_lost ? 1u << NODE_BEND_TIP_LOST : 0u) | (limited ? 1u << NODE_BEND_LIMITED : 0u));
}

static void fill_status(struct node *node, union message *message) {
    const struct controller_status *status = &node->app.controller.status;
    message->status = (struct message_status){.state = (uint8_t)status->state,
                                              .protocol = MESSAGE_PROTOCOL,
                                              .warnings = (uint16_t)status->warnings,
                                              .faults = status->faults,
                                              .step = (uint8_t)step_of(node)};
    node->state_reported = status->state;
    node->faults_reported = status->faults;
}

static void fill_pressures(struct node *node, union message *message) {
    message->pressures = (struct message_pressures){.pressure_1 = pressure_of(node, 0u),
                                                    .pressure_2 = pressure_of(node, 1u),
                                                    .pressure_3 = pressure_of(node, 2u),
                                                    .step = step_of(node)};
}

static void fill_targets(struct node *node, union message *message) {
    const float *target_pa = node->app.controller.status.pressure_target_pa;
    message->targets = (struct message_targets){
        .target_1 = target_pa[0], .target_2 = target_pa[1], .target_3 = target_pa[2], .step = step_of(node)};
}

static void fill_estimates(struct node *node, union message *message) {
    const float *estimate_pa = node->app.controller.status.pressure_estimate_pa;
    message->estimates = (struct message_estimates){.estimate_1 = estimate_pa[0],
                                                    .estimate_2 = estimate_pa[1],
                                                    .estimate_3 = estimate_pa[2],
                                                    .step = step_of(node)};
}

static void fill_duties(struct node *node, union message *message) {
    const struct controller_output *output = &node->app.output;
    message->duties = (struct message_duties){.duty_1 = output->duty[0],
                                              .duty_2 = output->duty[1],
                                              .duty_3 = output->duty[2],
                                              .supply = supply_of(node),
                                              .valves_enabled = output->valves_enabled,
                                              .supply_enabled = output->supply_enabled,
                                              .step = (uint8_t)(step_of(node) & 15u)};
}

static void fill_tip_position(struct node *node, union message *message) {
    message->tip_position = node->tip_position;
}

static void fill_tip_orientation(struct node *node, union message *message) {
    message->tip_orientation = node->tip_orientation;
}

static void fill_bend(struct node *node, union message *message) {
    const struct controller_status *status = &node->app.controller.status;
    message->bend = (struct message_bend){.bend = status->bend_rad,
                                          .direction = status->direction_rad,
                                          .tip_status = node->tip_status,
                                          .flags = bend_flags_of(status),
                                          .step = (uint8_t)step_of(node)};
}

static void fill_time(struct node *node, union message *message) {
    message->time =
        (struct message_time){.time_us = (uint64_t)node->app.input.time_us, .step = step_of(node)};
}

static void fill_tip_state(struct node *node, union message *message) {
    const struct controller_status *status = &node->app.controller.status;
    message->tip_state = (struct message_tip_state){.quality = node->tip_quality,
                                                    .samples = (uint16_t)status->tip_samples,
                                                    .rejected = (uint16_t)status->tip_rejected,
                                                    .lost = (uint16_t)status->tip_lost_count};
}

static void fill_tip_stream(struct node *node, union message *message) {
    const struct tip_stream_counters *counters = node->setup->tip_stream;
    message->tip_stream = (struct message_tip_stream){.bad_phasing = 0u};
    if (counters != NULL) {
        message->tip_stream = (struct message_tip_stream){.bad_phasing = (uint16_t)counters->bad_phasing,
                                                          .short_records = (uint16_t)counters->short_records,
                                                          .out_of_range = (uint16_t)counters->out_of_range,
                                                          .overflow = (uint16_t)counters->overflow};
    }
}

static void fill_gap(struct node *node, union message *message) {
    const struct gap_monitor_report *gap = &node->app.controller.status.gap;
    message->gap = (struct message_gap){.stage = (uint8_t)gap->stage,
                                        .chamber = (uint8_t)gap->chamber,
                                        .bend_gap = gap->bend_gap_rad,
                                        .bend_threshold = gap->bend_threshold_rad,
                                        .position_gap = gap->position_gap_m,
                                        .position_threshold = gap->position_threshold_m};
}

static void fill_gap_pressures(struct node *node, union message *message) {
    const struct gap_monitor_report *gap = &node->app.controller.status.gap;
    message->gap_pressures = (struct message_gap_pressures){.gap_1 = gap->pressure_gap_pa[0],
                                                            .gap_2 = gap->pressure_gap_pa[1],
                                                            .gap_3 = gap->pressure_gap_pa[2],
                                                            .vented_threshold = gap->vented_threshold_pa};
}

static void fill_gap_thresholds(struct node *node, union message *message) {
    const struct gap_monitor_report *gap = &node->app.controller.status.gap;
    message->gap_thresholds = (struct message_gap_thresholds){.threshold_1 = gap->pressure_threshold_pa[0],
                                                              .threshold_2 = gap->pressure_threshold_pa[1],
                                                              .threshold_3 = gap->pressure_threshold_pa[2]};
}

static void fill_gap_vented(struct node *node, union message *message) {
    const struct gap_monitor_report *gap = &node->app.controller.status.gap;
    message->gap_vented = (struct message_gap_vented){
        .vented_1 = gap->vented_pa[0], .vented_2 = gap->vented_pa[1], .vented_3 = gap->vented_pa[2]};
}

static uint32_t parameters_limited(const struct node *node) {
    const uint32_t limited = node->parameters_report.unknown + node->parameters_report.refused +
                             node->app.controller.status.calibration_limited;
    return limited < 7u ? limited : 7u;
}

static void fill_health(struct node *node, union message *message) {
    const struct hal *hal = node->app.hal;
    struct hal_health health = {.steps_late = 0u};
    if (hal->read_health != NULL) {
        hal->read_health(hal->context, &health);
    }
    message->health =
        (struct message_health){.steps_late = (uint16_t)health.steps_late,
                                .hal_errors = (uint16_t)node->app.hal_errors,
                                .commands_refused = (uint16_t)node->app.controller.status.commands_refused,
                                .clock_failed = health.clock_failed,
                                .watchdog_reset = health.watchdog_reset,
                                .brown_out_reset = health.brown_out_reset,
                                .brown_out_low = health.brown_out_low,
                                .crashed = health.crashed,
                                .parameters_limited = (uint8_t)parameters_limited(node),
                                .parameters_found = node->store.parameters_found,
                                .table_found = node->store.table_found,
                                .storage_errors = (uint8_t)(node->store.errors & 63u)};
}

static void fill_can_counters(struct node *node, union message *message) {
    const struct hal_can_state *state = &node->bus_state;
    message->can_counters = (struct message_can_counters){.transmit_errors = state->transmit_errors,
                                                          .receive_errors = state->receive_errors,
                                                          .receive_lost = (uint16_t)state->receive_lost,
                                                          .transmit_lost = (uint16_t)state->transmit_lost,
                                                          .bus_off_count = (uint8_t)state->bus_off_count,
                                                          .error_passive = state->error_passive,
                                                          .bus_off = state->bus_off};
}

static void fill_node_counters(struct node *node, union message *message) {
    const struct node_counters *counters = &node->counters;
    message->node_counters =
        (struct message_node_counters){.accepted = (uint16_t)counters->accepted,
                                       .foreign = (uint16_t)counters->foreign,
                                       .reports_dropped = (uint16_t)counters->reports_dropped,
                                       .sequence_lost = (uint8_t)counters->sequence_lost,
                                       .saturated = (uint8_t)counters->reported.out_of_range};
}

static void fill_refusals(struct node *node, union message *message) {
    const uint32_t reason = node->refusal_next;
    const struct node_refused *refused = &node->refused[reason];
    message->refusals = (struct message_refusals){.reason = (uint8_t)reason,
                                                  .message = refused->message,
                                                  .count = (uint16_t)refused->count,
                                                  .total = (uint16_t)node->counters.refused,
                                                  .step = (uint16_t)refused->step};
}

static void fill_telemetry_pressures(const struct node *node, struct message_telemetry *telemetry) {
    const struct controller_status *status = &node->app.controller.status;
    telemetry->pressure_1 = pressure_of(node, 0u);
    telemetry->pressure_2 = pressure_of(node, 1u);
    telemetry->pressure_3 = pressure_of(node, 2u);
    telemetry->supply = supply_of(node);
    telemetry->target_1 = status->pressure_target_pa[0];
    telemetry->target_2 = status->pressure_target_pa[1];
    telemetry->target_3 = status->pressure_target_pa[2];
    telemetry->estimate_1 = status->pressure_estimate_pa[0];
    telemetry->estimate_2 = status->pressure_estimate_pa[1];
    telemetry->estimate_3 = status->pressure_estimate_pa[2];
}

static void fill_telemetry_tip(const struct node *node, struct message_telemetry *telemetry) {
    const struct controller_status *status = &node->app.controller.status;
    telemetry->tip_x = node->tip_position.x;
    telemetry->tip_y = node->tip_position.y;
    telemetry->tip_z = node->tip_position.z;
    telemetry->tip_qw = node->tip_orientation.w;
    telemetry->tip_qx = node->tip_orientation.x;
    telemetry->tip_qy = node->tip_orientation.y;
    telemetry->tip_qz = node->tip_orientation.z;
    telemetry->tip_measured = node->tip_position.measured;
    telemetry->tip_status = node->tip_status;
    telemetry->bend = status->bend_rad;
    telemetry->direction = status->direction_rad;
    telemetry->flags = bend_flags_of(status);
}

static void fill_telemetry(struct node *node, union message *message) {
    const struct controller_status *status = &node->app.controller.status;
    const struct controller_output *output = &node->app.output;
    struct message_telemetry *telemetry = &message->telemetry;
    telemetry->time_us = (uint64_t)node->app.input.time_us;
    telemetry->step = step_of(node);
    telemetry->duty_1 = output->duty[0];
    telemetry->duty_2 = output->duty[1];
    telemetry->duty_3 = output->duty[2];
    telemetry->valves_enabled = output->valves_enabled;
    telemetry->supply_enabled = output->supply_enabled;
    telemetry->state = (uint8_t)status->state;
    telemetry->faults = status->faults;
    telemetry->warnings = (uint16_t)status->warnings;
    telemetry->protocol = MESSAGE_PROTOCOL;
    fill_telemetry_pressures(node, telemetry);
    fill_telemetry_tip(node, telemetry);
}

/* --- answers */

static void fill_parameter_value(struct node *node, union message *message) {
    message->parameter_value = node->answer;
}

static void fill_transfer_state(struct node *node, union message *message) {
    const struct store_transfer *transfer = &node->store.transfer;
    const bool refused = node->begin_error != TRANSFER_ERROR_NONE;
    message->transfer_state =
        (struct message_transfer_state){.state = (uint8_t)transfer->state,
                                        .kind = (uint8_t)transfer->kind,
                                        .error = (uint8_t)(refused ? node->begin_error : transfer->error),
                                        .room = (uint16_t)store_room(&node->store),
                                        .offset = transfer->received};
}

static void fill_identity(struct node *node, union message *message) {
    message->identity = (struct message_identity){.protocol = MESSAGE_PROTOCOL,
                                                  .parameters_version = PARAMETERS_VERSION,
                                                  .parameters = (uint16_t)PARAMETER_COUNT,
                                                  .firmware = node->setup->firmware};
}

static void fill_identity_table(struct node *node, union message *message) {
    message->identity_table.table_hash = node->has_table ? node->table.module.inputs_hash : 0u;
}

/* One piece a message. */
static void fill_identity_name(struct node *node, union message *message) {
    const uint32_t from = node->name_piece * NAME_PIECE_BYTES;
    uint64_t text = 0u;
    for (uint32_t i = 0; i < NAME_PIECE_BYTES && from + i < BEND_TABLE_NAME_BYTES && node->has_table; i++) {
        text |= (uint64_t)(uint8_t)node->table.module.name[from + i] << (8u * i);
    }
    message->identity_name = (struct message_identity_name){.piece = (uint8_t)node->name_piece, .text = text};
}

/* --- the reports */

struct report {
    enum message_id id;
    bool bundled; /* with CAN FD it goes in TELEMETRY */
    void (*fill)(struct node *node, union message *message);
};

enum report_index {
    REPORT_STATUS = 0,
    REPORT_PRESSURES,
    REPORT_TARGETS,
    REPORT_ESTIMATES,
    REPORT_DUTIES,
    REPORT_TIP_POSITION,
    REPORT_TIP_ORIENTATION,
    REPORT_BEND,
    REPORT_TIME,
    REPORT_TIP_STATE,
    REPORT_TIP_STREAM,
    REPORT_GAP,
    REPORT_GAP_PRESSURES,
    REPORT_GAP_THRESHOLDS,
    REPORT_GAP_VENTED,
    REPORT_HEALTH,
    REPORT_CAN_COUNTERS,
    REPORT_NODE_COUNTERS,
    REPORT_REFUSALS,
    REPORT_TELEMETRY,
    REPORT_PARAMETER_VALUE,
    REPORT_TRANSFER_STATE,
    REPORT_IDENTITY,
    REPORT_IDENTITY_TABLE,
    REPORT_IDENTITY_NAME,
    REPORT_COUNT
};
_Static_assert((uint32_t)REPORT_COUNT == NODE_REPORT_COUNT && NODE_REPORT_COUNT <= 32u,
               "a bit and a count of turns each");

static const struct report reports[REPORT_COUNT] = {
    [REPORT_STATUS] = {MESSAGE_STATUS, false, fill_status},
    [REPORT_PRESSURES] = {MESSAGE_PRESSURES, true, fill_pressures},
    [REPORT_TARGETS] = {MESSAGE_TARGETS, true, fill_targets},
    [REPORT_ESTIMATES] = {MESSAGE_ESTIMATES, true, fill_estimates},
    [REPORT_DUTIES] = {MESSAGE_DUTIES, true, fill_duties},
    [REPORT_TIP_POSITION] = {MESSAGE_TIP_POSITION, true, fill_tip_position},
    [REPORT_TIP_ORIENTATION] = {MESSAGE_TIP_ORIENTATION, true, fill_tip_orientation},
    [REPORT_BEND] = {MESSAGE_BEND, true, fill_bend},
    [REPORT_TIME] = {MESSAGE_TIME, true, fill_time},
    [REPORT_TIP_STATE] = {MESSAGE_TIP_STATE, false, fill_tip_state},
    [REPORT_TIP_STREAM] = {MESSAGE_TIP_STREAM, false, fill_tip_stream},
    [REPORT_GAP] = {MESSAGE_GAP, false, fill_gap},
    [REPORT_GAP_PRESSURES] = {MESSAGE_GAP_PRESSURES, false, fill_gap_pressures},
    [REPORT_GAP_THRESHOLDS] = {MESSAGE_GAP_THRESHOLDS, false, fill_gap_thresholds},
    [REPORT_GAP_VENTED] = {MESSAGE_GAP_VENTED, false, fill_gap_vented},
    [REPORT_HEALTH] = {MESSAGE_HEALTH, false, fill_health},
    [REPORT_CAN_COUNTERS] = {MESSAGE_CAN_COUNTERS, false, fill_can_counters},
    [REPORT_NODE_COUNTERS] = {MESSAGE_NODE_COUNTERS, false, fill_node_counters},
    [REPORT_REFUSALS] = {MESSAGE_REFUSALS, false, fill_refusals},
    [REPORT_TELEMETRY] = {MESSAGE_TELEMETRY, false, fill_telemetry},
    [REPORT_PARAMETER_VALUE] = {MESSAGE_PARAMETER_VALUE, false, fill_parameter_value},
    [REPORT_TRANSFER_STATE] = {MESSAGE_TRANSFER_STATE, false, fill_transfer_state},
    [REPORT_IDENTITY] = {MESSAGE_IDENTITY, false, fill_identity},
    [REPORT_IDENTITY_TABLE] = {MESSAGE_IDENTITY_TABLE, false, fill_identity_table},
    [REPORT_IDENTITY_NAME] = {MESSAGE_IDENTITY_NAME, false, fill_identity_name},
};

static void want(struct node *node, enum report_index report) {
    node->pending |= 1u << report;
}

static bool is_pending(const struct node *node, enum report_index report) {
    return (node->pending & 1u << report) != 0u;
}

/* In FD mode TELEMETRY stands for the bundled ones, else it is not sent. The bus as it is decides, not the
 * parameter, which holds from the next start on. */
static bool is_used(const struct node *node, enum report_index report) {
    const bool fd = node->setup->bus != NULL && node->setup->bus->fd;
    return report == REPORT_TELEMETRY ? fd : !(fd && reports[report].bundled);
}

/* One that is still unsent when it is due again has lost a turn; one that waits because something changed has
 * not. */
static void fall_due(struct node *node, enum report_index report) {
    if (!is_used(node, report)) {
        return;
    }
    node->counters.reports_dropped += node->due >> report & 1u;
    node->due |= 1u << report;
    want(node, report);
}

/* --- refusals */

static bool refuse(struct node *node, enum message_id id, enum node_refusal reason) {
    struct node_refused *refused = &node->refused[reason];
    refused->count++;
    refused->step = node->app.controller.step;
    refused->message = message_row(id)->number;
    node->counters.refused++;
    node->refusal_next = (uint32_t)reason;
    want(node, REPORT_REFUSALS);
    return false;
}

/* What was handed over counts as accepted unless the controller says no. */
static void note_refusal(struct node *node) {
    const uint32_t refused = node->app.controller.status.commands_refused;
    if (node->given != MESSAGE_COUNT && refused != node->refused_before) {
        node->counters.accepted--;
        (void)refuse(node, node->given, NODE_REFUSED_CONTROLLER);
    }
    node->given = MESSAGE_COUNT;
    node->refused_before = refused;
}

#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment)                          \
    _Static_assert((period_ms) % NODE_TURNS == 0u, #NAME " has its turn every NODE_TURNS steps");
#include "comms/messages.def"

/* A report can fall due in its turns alone, so that a step looks at few of them. */
static void set_turns(struct node *node) {
    for (uint32_t r = 0; r < (uint32_t)REPORT_COUNT; r++) {
        const struct message_row *row = message_row(reports[r].id);
        if (row->period_ms > 0u) {
            node->in_turn[row->phase_ms % NODE_TURNS] |= 1u << r;
            node->turns_left[r] = row->phase_ms / NODE_TURNS + 1u;
        }
    }
}

static void count_down(struct node *node) {
    uint32_t in_turn = node->in_turn[node->turn];
    node->turn = node->turn + 1u < NODE_TURNS ? node->turn + 1u : 0u;
    while (in_turn != 0u) {
        const uint32_t r = (uint32_t)__builtin_ctz(in_turn);
        in_turn &= in_turn - 1u;
        node->turns_left[r]--;
        if (node->turns_left[r] == 0u) {
            const uint32_t period_ms = message_row(reports[r].id)->period_ms;
            node->turns_left[r] = period_ms / NODE_TURNS * node->parameters.node.telemetry_slowdown;
            fall_due(node, (enum report_index)r);
        }
    }
}

static void note_tip(struct node *node) {
    const struct controller_input *input = &node->app.input;
    if (!input->tip_new) {
        return;
    }
    node->tip_position = (struct message_tip_position){
        .x = input->tip_position_m[0],
        .y = input->tip_position_m[1],
        .z = input->tip_position_m[2],
        .measured = (uint16_t)((uint64_t)input->tip_measured_us >> TIP_TIME_SHIFT)};
    node->tip_orientation = (struct message_tip_orientation){.w = input->tip_quaternion[0],
                                                             .x = input->tip_quaternion[1],
                                                             .y = input->tip_quaternion[2],
                                                             .z = input->tip_quaternion[3]};
    node->tip_quality = input->tip_quality;
    node->tip_status = input->tip_status;
    fall_due(node, REPORT_TIP_POSITION);
    fall_due(node, REPORT_TIP_ORIENTATION);
}

static void note_changes(struct node *node) {
    const struct controller_status *status = &node->app.controller.status;
    if (status->state != node->state_reported || status->faults != node->faults_reported) {
        want(node, REPORT_STATUS);
    }
    if (node->store.transfer.report_due) {
        node->store.transfer.report_due = false;
        want(node, REPORT_TRANSFER_STATE);
    }
}

/* After a report went: some have more to say, or say another thing next time. */
static void note_sent(struct node *node, enum report_index report) {
    node->pending &= ~(1u << report);
    node->due &= ~(1u << report);
    if (report == REPORT_REFUSALS) {
        node->refusal_next = (node->refusal_next + 1u) % (uint32_t)NODE_REFUSAL_COUNT;
    } else if (report == REPORT_TRANSFER_STATE) {
        node->begin_error = TRANSFER_ERROR_NONE;
    } else if (report == REPORT_IDENTITY_NAME) {
        node->name_piece++;
        node->pending |= node->name_piece < NAME_PIECES ? 1u << report : 0u;
    }
}

/* Its share of this step; it stays pending until its last part is sent. False: no room on the bus, it begins anew. */
static bool send_part(struct node *node, enum report_index report) {
    const struct hal_bus *bus = node->setup->bus;
    const enum message_id id = reports[report].id;
    struct node_long_report *part = &node->long_report;
    struct hal_can_frame frame;
    if (!part->begun) {
        reports[report].fill(node, &part->message);
        message_pack_begin(id, &part->packing);
    }
    part->begun = !message_pack_some(id, &part->message, FIELDS_A_STEP, &part->packing, &node->counters.reported);
    if (part->begun) {
        return true;
    }
    message_pack_end(id, &part->packing, node->node_id, &frame);
    if (!bus->send(bus->context, &frame)) {
        return false;
    }
    note_sent(node, report);
    return true;
}

/* False: no room on the bus; it stays pending. */
static bool send_whole(struct node *node, enum report_index report) {
    const struct hal_bus *bus = node->setup->bus;
    struct hal_can_frame frame;
    union message message;
    reports[report].fill(node, &message);
    message_frame(reports[report].id, node->node_id, &message, &frame, &node->counters.reported);
    if (!bus->send(bus->context, &frame)) {
        return false;
    }
    note_sent(node, report);
    return true;
}

/* The next one in turn from `from` on. */
static uint32_t next_pending(uint32_t pending, uint32_t from) {
    const uint32_t later = pending & ~((1u << from) - 1u);
    return (uint32_t)__builtin_ctz(later != 0u ? later : pending);
}

/* A step that took commands or read the tip sensor has done its share of work; a part of a long frame is a share, too. */
static void send_reports(struct node *node) {
    uint32_t sent = node->took_commands || node->app.input.tip_new ? 1u : 0u;
    while (sent < NODE_REPORTS_A_STEP && node->pending != 0u) {
        const uint32_t next = next_pending(node->pending, node->next_report);
        const enum report_index report = (enum report_index)next;
        const bool is_long = report == REPORT_TELEMETRY;
        node->next_report = next;
        if (!(is_long ? send_part(node, report) : send_whole(node, report))) {
            return;
        }
        sent += is_long ? NODE_REPORTS_A_STEP : 1u;
        if (!node->long_report.begun) {
            node->next_report = next + 1u < (uint32_t)REPORT_COUNT ? next + 1u : 0u;
        }
    }
}

void node_report(struct node *node) {
    note_refusal(node);
    count_down(node);
    note_tip(node);
    note_changes(node);
    if (node->setup->bus != NULL) {
        send_reports(node);
    }
}

/* --- motion */

static bool is_vented(const struct node *node) {
    const enum controller_command_kind kind = node->app.pending.kind;
    return !supervisor_valves_enabled(&node->app.controller.supervisor) && kind != COMMAND_PRESSURE &&
           kind != COMMAND_BEND;
}

/* The sequence of commands must go on: by one, or by some where frames were lost. After a pause any will do:
 * a host that was started anew. A sender that is frozen makes no pause. */
static bool sequence_goes_on(struct node *node, enum message_id id, uint8_t sequence) {
    const uint8_t ahead = (uint8_t)(sequence - node->sequence);
    const bool paused = node->sequence_age >= node->timeout_steps;
    node->sequence_age = 0u;
    if (node->sequence_known && !paused) {
        if (ahead == 0u || ahead >= SEQUENCE_AHEAD) {
            return refuse(node, id, NODE_REFUSED_STALE);
        }
        node->counters.sequence_lost += (uint32_t)ahead - 1u;
    }
    node->sequence_known = true;
    node->sequence = sequence;
    return true;
}

/* VENT and CLEAR that came in this step are not to be lost. */
static bool may_command(struct node *node, enum message_id id) {
    const enum controller_command_kind kind = node->app.pending.kind;
    if (!store_is_idle(&node->store) || kind == COMMAND_CLEAR) {
        return refuse(node, id, NODE_REFUSED_BUSY);
    }
    return kind == COMMAND_VENT ? refuse(node, id, NODE_REFUSED_STATE) : true;
}

static void command(struct node *node, enum message_id id, const struct controller_command *given) {
    app_command(&node->app, given);
    node->given = id;
    node->counters.accepted++;
}

static void take_vent(struct node *node) {
    const struct controller_command vent = {.kind = COMMAND_VENT};
    command(node, MESSAGE_VENT, &vent);
}

/* The supervisor is to know of a stream of commands that goes on while nothing may move: it must pause before
 * it is obeyed again. Said again, a command starts nothing. */
static bool refuse_by_state(struct node *node, enum message_id id, const struct controller_command *given) {
    struct controller_command seen = *given;
    seen.said_again = true;
    if (node->app.pending.kind == COMMAND_NONE && given->kind != COMMAND_HOLD) {
        app_command(&node->app, &seen);
    }
    return refuse(node, id, NODE_REFUSED_STATE);
}

static bool move(struct node *node, enum message_id id, uint8_t sequence,
                 const struct controller_command *given) {
    const enum supervisor_state state = node->app.controller.supervisor.state;
    const bool runs = supervisor_valves_enabled(&node->app.controller.supervisor);
    if (!may_command(node, id) || !sequence_goes_on(node, id, sequence)) {
        return false;
    }
    if (!runs && !(state == SUPERVISOR_SAFE && given->kind != COMMAND_HOLD)) {
        return refuse_by_state(node, id, given);
    }
    node->last = *given;
    node->last.said_again = true;
    command(node, id, given);
    return true;
}

static bool take_pressure(struct node *node, const struct message_pressure_command *message) {
    const struct controller_command given = {
        .kind = COMMAND_PRESSURE,
        .pressure_pa = {message->pressure_1, message->pressure_2, message->pressure_3}};
    return move(node, MESSAGE_PRESSURE_COMMAND, message->sequence, &given);
}

static bool take_bend(struct node *node, const struct message_bend_command *message) {
    const struct controller_command given = {.kind = COMMAND_BEND,
                                             .bend_rad = message->bend,
                                             .direction_rad = message->direction,
                                             .co_contraction_pa = message->co_contraction};
    if (!node->has_table) {
        return refuse(node, MESSAGE_BEND_COMMAND, NODE_REFUSED_NO_TABLE);
    }
    return move(node, MESSAGE_BEND_COMMAND, message->sequence, &given);
}

static bool take_hold(struct node *node, const struct message_hold *message) {
    const struct controller_command given = {.kind = COMMAND_HOLD};
    return move(node, MESSAGE_HOLD, message->sequence, &given);
}

/* Says the last command again while that moves or holds; never starts anything. */
static bool take_heartbeat(struct node *node, const struct message_host_heartbeat *message) {
    if (!sequence_goes_on(node, MESSAGE_HOST_HEARTBEAT, message->sequence)) {
        return false;
    }
    const bool runs = supervisor_valves_enabled(&node->app.controller.supervisor);
    if (runs && node->last.kind != COMMAND_NONE && node->app.pending.kind == COMMAND_NONE) {
        app_command(&node->app, &node->last);
    }
    node->counters.accepted++;
    return true;
}

/* Only what its sender has seen is cleared. */
static bool take_clear(struct node *node, const struct message_clear *message) {
    const struct controller_command clear = {.kind = COMMAND_CLEAR};
    if (message->key != MESSAGE_CLEAR_KEY) {
        return refuse(node, MESSAGE_CLEAR, NODE_REFUSED_KEY);
    }
    if (message->faults != node->app.controller.status.faults) {
        return refuse(node, MESSAGE_CLEAR, NODE_REFUSED_UNSEEN_FAULT);
    }
    if (!may_command(node, MESSAGE_CLEAR) || !sequence_goes_on(node, MESSAGE_CLEAR, message->sequence)) {
        return false;
    }
    command(node, MESSAGE_CLEAR, &clear);
    return true;
}

/* --- parameters */

static const struct bend_table *table_of(const struct node *node) {
    return node->has_table ? &node->table : NULL;
}

static void use_parameters(struct node *node) {
    controller_set_parameters(&node->app.controller, &node->parameters.controller);
    node->timeout_steps =
        (uint32_t)node->parameters.controller.command_timeout_us / (uint32_t)CONTROLLER_STEP_US;
}

static void answer(struct node *node, uint32_t parameter, enum parameter_status status,
                   enum node_action action, uint32_t value) {
    node->answer = (struct message_parameter_value){.parameter = (uint16_t)parameter,
                                                    .status = (uint8_t)status,
                                                    .action = (uint8_t)action,
                                                    .value = value};
    want(node, REPORT_PARAMETER_VALUE);
}

/* The last answer must have gone before the next request. */
static bool may_answer(struct node *node, enum message_id id) {
    return is_pending(node, REPORT_PARAMETER_VALUE) ? refuse(node, id, NODE_REFUSED_BUSY) : true;
}

static bool take_parameter_get(struct node *node, const struct message_parameter_get *message) {
    uint32_t value = 0u;
    if (!may_answer(node, MESSAGE_PARAMETER_GET)) {
        return false;
    }
    const enum parameter_status status = parameter_get(&node->parameters, message->parameter, &value);
    answer(node, message->parameter, status, NODE_ACTION_NONE, value);
    node->counters.accepted++;
    return true;
}

static bool take_parameter_set(struct node *node, const struct message_parameter_set *message) {
    uint32_t value = message->value;
    enum parameter_status status = PARAMETER_BUSY;
    if (!may_answer(node, MESSAGE_PARAMETER_SET)) {
        return false;
    }
    if (store_is_idle(&node->store)) {
        status = parameter_set(&node->parameters, message->parameter, value, is_vented(node), table_of(node));
    }
    if (status == PARAMETER_OK) {
        use_parameters(node);
    }
    (void)parameter_get(&node->parameters, message->parameter, &value);
    answer(node, message->parameter, status, NODE_ACTION_NONE, value);
    node->counters.accepted++;
    return true;
}

static enum parameter_status act(struct node *node, enum node_action action) {
    if (!is_vented(node)) {
        return PARAMETER_NOT_NOW;
    }
    if (!store_is_idle(&node->store)) {
        return PARAMETER_BUSY;
    }
    if (action == NODE_ACTION_DEFAULTS) {
        parameters_default(&node->parameters, table_of(node));
        use_parameters(node);
        return PARAMETER_OK;
    }
    node->saving = store_save(&node->store, &node->parameters);
    return node->saving ? PARAMETER_OK : PARAMETER_NOT_STORED;
}

static bool take_parameter_action(struct node *node, const struct message_parameter_action *message) {
    const enum node_action action = (enum node_action)message->action;
    if (action != NODE_ACTION_SAVE && action != NODE_ACTION_DEFAULTS) {
        return refuse(node, MESSAGE_PARAMETER_ACTION, NODE_REFUSED_RANGE);
    }
    if (!may_answer(node, MESSAGE_PARAMETER_ACTION)) {
        return false;
    }
    const enum parameter_status status = act(node, action);
    if (!node->saving || status != PARAMETER_OK) { /* a save that goes on answers at its end */
        answer(node, ALL_PARAMETERS, status, action, 0u);
    }
    node->counters.accepted++;
    return true;
}

/* --- transfers and the rest */

static bool take_transfer_begin(struct node *node, const struct message_transfer_begin *message) {
    if (message->kind == (uint8_t)TRANSFER_KIND_NONE || message->kind >= (uint8_t)TRANSFER_KIND_COUNT) {
        return refuse(node, MESSAGE_TRANSFER_BEGIN, NODE_REFUSED_RANGE);
    }
    node->begin_error = TRANSFER_ERROR_NOT_NOW;
    if (is_vented(node)) {
        node->begin_error =
            store_begin(&node->store, (enum transfer_kind)message->kind, message->bytes, message->any_module,
                        node->parameters.controller.limits.sensor_most_pa);
    }
    want(node, REPORT_TRANSFER_STATE);
    node->counters.accepted++;
    return true;
}

static bool take_transfer_data(struct node *node, const struct message_transfer_data *message) {
    store_data(&node->store, message->chunk, message->data);
    node->counters.accepted++;
    return true;
}

static bool take_transfer_end(struct node *node, const struct message_transfer_end *message) {
    store_end(&node->store, message->crc);
    node->counters.accepted++;
    return true;
}

static bool take_reset(struct node *node, const struct message_reset *message) {
    if (message->key != MESSAGE_RESET_KEY) {
        return refuse(node, MESSAGE_RESET, NODE_REFUSED_KEY);
    }
    if (!is_vented(node)) {
        return refuse(node, MESSAGE_RESET, NODE_REFUSED_STATE);
    }
    if (!store_is_idle(&node->store)) {
        return refuse(node, MESSAGE_RESET, NODE_REFUSED_BUSY);
    }
    node->reset_wanted = true;
    node->counters.accepted++;
    return true;
}

static bool take_identify(struct node *node) {
    want(node, REPORT_IDENTITY);
    want(node, REPORT_IDENTITY_TABLE);
    want(node, REPORT_IDENTITY_NAME);
    node->name_piece = 0u;
    node->counters.accepted++;
    return true;
}

/* --- frames */

static bool take_message(struct node *node, enum message_id id, const union message *message) {
    switch (id) {
    case MESSAGE_HOLD:
        return take_hold(node, &message->hold);
    case MESSAGE_CLEAR:
        return take_clear(node, &message->clear);
    case MESSAGE_PRESSURE_COMMAND:
        return take_pressure(node, &message->pressure_command);
    case MESSAGE_BEND_COMMAND:
        return take_bend(node, &message->bend_command);
    case MESSAGE_HOST_HEARTBEAT:
        return take_heartbeat(node, &message->host_heartbeat);
    case MESSAGE_PARAMETER_GET:
        return take_parameter_get(node, &message->parameter_get);
    case MESSAGE_PARAMETER_SET:
        return take_parameter_set(node, &message->parameter_set);
    case MESSAGE_PARAMETER_ACTION:
        return take_parameter_action(node, &message->parameter_action);
    case MESSAGE_TRANSFER_BEGIN:
        return take_transfer_begin(node, &message->transfer_begin);
    case MESSAGE_TRANSFER_DATA:
        return take_transfer_data(node, &message->transfer_data);
    case MESSAGE_TRANSFER_END:
        return take_transfer_end(node, &message->transfer_end);
    case MESSAGE_RESET:
        return take_reset(node, &message->reset);
    case MESSAGE_IDENTIFY:
        return take_identify(node);
    default:
        return false; /* VENT was taken before; the others go to hosts */
    }
}

static bool speaks_otherwise(enum message_id id, const uint8_t *data) {
    const bool any = id == MESSAGE_TRANSFER_DATA || id == MESSAGE_RESET || id == MESSAGE_IDENTIFY;
    return !any && (data[1] & PROTOCOL_MASK) != MESSAGE_PROTOCOL;
}

static void take_own(struct node *node, enum message_id id, uint32_t address,
                     const struct hal_can_frame *frame) {
    struct message_trouble trouble = {.out_of_range = 0u};
    union message message;
    if (id == MESSAGE_VENT) {
        take_vent(node);
    } else if (address == MESSAGE_NODE_ALL && id != MESSAGE_IDENTIFY) {
        (void)refuse(node, id, NODE_REFUSED_BROADCAST);
    } else if (frame->length != message_row(id)->bytes) {
        (void)refuse(node, id, NODE_REFUSED_LENGTH);
    } else if (speaks_otherwise(id, frame->data)) {
        (void)refuse(node, id, NODE_REFUSED_VERSION);
    } else {
        message_unpack(id, frame->data, &message, &trouble);
        if (trouble.out_of_range + trouble.lacking > 0u) {
            (void)refuse(node, id, NODE_REFUSED_RANGE);
        } else {
            (void)take_message(node, id, &message);
        }
    }
}

bool node_take(struct node *node, const struct hal_can_frame *frame) {
    const uint32_t address = frame->id & MESSAGE_NODE_MOST;
    enum message_id id;
    if (frame->extended || (address != node->node_id && address != MESSAGE_NODE_ALL) ||
        !message_find(frame->id >> MESSAGE_NODE_BITS, &id)) {
        node->counters.foreign++;
        return false;
    }
    if (message_row(id)->direction == MESSAGE_TO_HOST) {
        if (address == MESSAGE_NODE_ALL) {
            node->counters.foreign++;
            return false;
        }
        (void)refuse(node, id, NODE_REFUSED_DUPLICATE_NODE);
        return true;
    }
    take_own(node, id, address, frame);
    return true;
}

static void take_frames(struct node *node) {
    const struct hal_bus *bus = node->setup->bus;
    struct hal_can_frame frame;
    uint32_t own = 0u;
    for (uint32_t i = 0; i < NODE_FRAMES_A_STEP && own < NODE_COMMANDS_A_STEP; i++) {
        if (!bus->receive(bus->context, &frame)) {
            return;
        }
        own += node_take(node, &frame) ? 1u : 0u;
        node->took_commands = own > 0u;
    }
}

/* --- the storage */

static void step_store(struct node *node) {
    store_step(&node->store);
    if (store_take_parameters(&node->store, &node->parameters)) {
        use_parameters(node);
    }
    if (node->saving && store_is_idle(&node->store)) {
        node->saving = false;
        answer(node, ALL_PARAMETERS, node->store.save_failed ? PARAMETER_NOT_STORED : PARAMETER_OK,
               NODE_ACTION_SAVE, 0u);
    }
}

void node_step(struct node *node) {
    const struct hal_bus *bus = node->setup->bus;
    node->sequence_age += node->sequence_age < AGE_MOST ? 1u : 0u;
    node->took_commands = false;
    if (bus != NULL) {
        bus->state(bus->context, &node->bus_state);
        node->app.bus_off = node->bus_state.bus_off;
        node->app.error_passive = node->bus_state.error_passive;
        take_frames(node);
    }
    step_store(node);
}

/* --- start */

static void find_table(struct node *node) {
    const uint8_t *image = NULL;
    uint32_t bytes = 0u;
    node->has_table = store_table(&node->store, &image, &bytes) &&
                      bend_table_open(&node->table, image, bytes, NULL) == BEND_TABLE_OK;
    if (!node->has_table) {
        const struct node_setup *setup = node->setup;
        node->has_table =
            setup->table_image != NULL &&
            bend_table_open(&node->table, setup->table_image, setup->table_bytes, NULL) == BEND_TABLE_OK;
    }
}

void node_init(struct node *node, const struct node_setup *setup) {
    (void)memset(node, 0, sizeof *node);
    node->setup = setup;
    store_init(&node->store, setup->storage);
    find_table(node);
    store_set_running(&node->store, table_of(node));
    (void)store_parameters(&node->store, table_of(node), &node->parameters, &node->parameters_report);
    node->node_id = node->parameters.node.node_id;
    app_init(&node->app, setup->hal, table_of(node), &node->parameters.controller);
    node->app.parameters_corrupt = store_parameters_lost(&node->store);
    use_parameters(node);
    set_turns(node);
    const struct message_tip_position nowhere = {not_a_number(), not_a_number(), not_a_number(), 0u};
    node->tip_position = nowhere;
    const struct message_tip_orientation nohow = {not_a_number(), not_a_number(), not_a_number(),
                                                  not_a_number()};
    node->tip_orientation = nohow;
    node->state_reported = SUPERVISOR_STATE_COUNT;
    node->given = MESSAGE_COUNT;
}

/* --- words */

const char *node_refusal_text(enum node_refusal refusal) {
#define NODE_REFUSAL_TEXT(NAME, text) text,
    static const char *const texts[NODE_REFUSAL_COUNT] = {NODE_REFUSALS(NODE_REFUSAL_TEXT)};
#undef NODE_REFUSAL_TEXT
    return (uint32_t)refusal < (uint32_t)NODE_REFUSAL_COUNT ? texts[refusal] : "unknown";
}

const char *node_bend_flag_text(enum node_bend_flag flag) {
#define NODE_BEND_FLAG_TEXT(NAME, text) text,
    static const char *const texts[NODE_BEND_FLAG_COUNT] = {NODE_BEND_FLAGS(NODE_BEND_FLAG_TEXT)};
#undef NODE_BEND_FLAG_TEXT
    return (uint32_t)flag < (uint32_t)NODE_BEND_FLAG_COUNT ? texts[flag] : "unknown";
}

const char *node_action_text(enum node_action action) {
#define NODE_ACTION_TEXT(NAME, text) text,
    static const char *const texts[NODE_ACTION_COUNT] = {NODE_ACTIONS(NODE_ACTION_TEXT)};
#undef NODE_ACTION_TEXT
    return (uint32_t)action < (uint32_t)NODE_ACTION_COUNT ? texts[action] : "unknown";
}
