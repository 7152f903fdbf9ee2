#include "link/can_assembly.h"

#include <math.h>
#include <string.h>

#include "comms/node.h"

#define TIP_TIME_US 64
#define REPORT_US 5000
#define RESTART_US 50000 /* a clock that went back by more is another start's */
#define STEPS_AHEAD 300  /* of the last TIME, at most: TIME comes every 100 ms */

void can_assembly_init(struct can_assembly *assembly) {
    memset(assembly, 0, sizeof *assembly);
    assembly->telemetry_slowdown = 1;
    struct link_report *report = &assembly->report;
    for (size_t i = 0; i < 3; i++) {
        report->duty[i] = report->pressure_pa[i] = report->tip_position_m[i] = NAN;
        report->status.pressure_target_pa[i] = report->status.pressure_estimate_pa[i] = NAN;
    }
    report->supply_pa = report->status.bend_rad = report->status.direction_rad = NAN;
}

/* --- time */

/* The board's clock when the low bits of its control step were these. Steps that are far from the last TIME's
 * are those of another start, or come after a silence: the next TIME tells. */
static uint64_t time_of(struct can_assembly *assembly, uint16_t step) {
    const int16_t ahead = (int16_t)(uint16_t)(step - assembly->step);
    const int32_t most = (int32_t)(STEPS_AHEAD * assembly->telemetry_slowdown);
    if (ahead > most || ahead < -most) {
        assembly->time_known = false;
    }
    return (uint64_t)((int64_t)assembly->time_us + (int64_t)ahead * CONTROLLER_STEP_US);
}

static void take_time(struct can_assembly *assembly, uint64_t time_us, uint16_t step) {
    if (assembly->reported && time_us + RESTART_US < assembly->reported_us) {
        assembly->restarts++;
        assembly->offset_us += (int64_t)assembly->reported_us - (int64_t)time_us + CONTROLLER_STEP_US;
        assembly->reported = false;
        assembly->tip_waits = false;
    }
    assembly->time_known = true;
    assembly->time_us = time_us;
    assembly->step = step;
}

/* When a pose was true, out of 16 bits: the latest such time that is not ahead of the report. */
static int64_t tip_time_of(uint64_t now_us, uint16_t measured) {
    const uint16_t now = (uint16_t)(now_us / TIP_TIME_US);
    const uint64_t units = now_us / TIP_TIME_US - (uint16_t)(now - measured);
    return (int64_t)(units * TIP_TIME_US);
}

/* --- one message into the report */

static void take_status(struct can_assembly *assembly, uint32_t state, uint32_t faults, uint32_t warnings) {
    struct link_report *report = &assembly->report;
    assembly->status_known = true;
    report->status.state = (enum supervisor_state)state;
    report->status.faults = faults;
    report->status.warnings = warnings;
}

static void take_tip_position(struct can_assembly *assembly, const struct message_tip_position *tip) {
    assembly->report.tip_position_m[0] = tip->x;
    assembly->report.tip_position_m[1] = tip->y;
    assembly->report.tip_position_m[2] = tip->z;
    assembly->tip_measured = tip->measured;
    assembly->position_waits = true;
}

static void take_tip_orientation(struct can_assembly *assembly, const struct message_tip_orientation *tip) {
    assembly->report.tip_quaternion[0] = tip->w;
    assembly->report.tip_quaternion[1] = tip->x;
    assembly->report.tip_quaternion[2] = tip->y;
    assembly->report.tip_quaternion[3] = tip->z;
    assembly->tip_waits =
        assembly->position_waits; /* of the same sample, but where one of the two was lost */
    assembly->position_waits = false;
}

static void take_bend(struct link_report *report, float bend_rad, float direction_rad, uint32_t flags,
                      uint32_t tip_status) {
    report->status.bend_rad = bend_rad;
    report->status.direction_rad = direction_rad;
    report->status.bend_is_measured = (flags & 1u << NODE_BEND_MEASURED) != 0;
    report->tip_status = (uint16_t)tip_status;
}

static void take_gap(struct gap_monitor_report *gap, const struct message_gap *message) {
    gap->stage = (enum gap_monitor_stage)message->stage;
    gap->chamber = message->chamber;
    gap->bend_gap_rad = message->bend_gap;
    gap->bend_threshold_rad = message->bend_threshold;
    gap->position_gap_m = message->position_gap;
    gap->position_threshold_m = message->position_threshold;
}

static void take_telemetry(struct can_assembly *assembly, const struct message_telemetry *all) {
    struct link_report *report = &assembly->report;
    struct controller_status *status = &report->status;
    const uint16_t measured_before = assembly->tip_measured;
    const struct message_tip_position position = {all->tip_x, all->tip_y, all->tip_z, all->tip_measured};
    const struct message_tip_orientation orientation = {all->tip_qw, all->tip_qx, all->tip_qy, all->tip_qz};
    take_time(assembly, all->time_us, all->step);
    take_status(assembly, all->state, all->faults, all->warnings);
    memcpy(report->pressure_pa, (const float[3]){all->pressure_1, all->pressure_2, all->pressure_3},
           sizeof report->pressure_pa);
    memcpy(status->pressure_target_pa, (const float[3]){all->target_1, all->target_2, all->target_3},
           sizeof status->pressure_target_pa);
    memcpy(status->pressure_estimate_pa, (const float[3]){all->estimate_1, all->estimate_2, all->estimate_3},
           sizeof status->pressure_estimate_pa);
    memcpy(report->duty, (const float[3]){all->duty_1, all->duty_2, all->duty_3}, sizeof report->duty);
    report->supply_pa = all->supply;
    take_tip_position(assembly, &position);
    take_tip_orientation(assembly, &orientation);
    assembly->tip_waits = all->tip_measured != measured_before && !isnan(all->tip_x);
    take_bend(report, all->bend, all->direction, all->flags, all->tip_status);
}

/* --- whole reports */

static bool finish(struct can_assembly *assembly, uint64_t now_us) {
    struct link_report *report = &assembly->report;
    const uint64_t period_us = (uint64_t)REPORT_US * assembly->telemetry_slowdown;
    if (!assembly->time_known || !assembly->status_known ||
        (assembly->reported && now_us <= assembly->reported_us)) {
        return false;
    }
    if (assembly->reported) {
        const uint64_t periods = (now_us - assembly->reported_us + CONTROLLER_STEP_US) / period_us;
        assembly->missing += periods > 1 ? periods - 1 : 0;
    }
    assembly->reported = true;
    assembly->reported_us = now_us;
    report->time_us = (int64_t)now_us + assembly->offset_us;
    report->tip_new = assembly->tip_waits;
    report->tip_measured_us = tip_time_of(now_us, assembly->tip_measured) + assembly->offset_us;
    assembly->tip_waits = false;
    return true;
}

bool can_assembly_take(struct can_assembly *assembly, enum message_id id, const union message *message) {
    struct link_report *report = &assembly->report;
    struct controller_status *status = &report->status;
    switch (id) {
    case MESSAGE_STATUS:
        take_status(assembly, message->status.state, message->status.faults, message->status.warnings);
        return false;
    case MESSAGE_PRESSURES:
        memcpy(report->pressure_pa, &message->pressures, sizeof report->pressure_pa);
        return finish(assembly, time_of(assembly, message->pressures.step));
    case MESSAGE_TARGETS:
        memcpy(status->pressure_target_pa, &message->targets, sizeof status->pressure_target_pa);
        return false;
    case MESSAGE_ESTIMATES:
        memcpy(status->pressure_estimate_pa, &message->estimates, sizeof status->pressure_estimate_pa);
        return false;
    case MESSAGE_DUTIES:
        memcpy(report->duty, &message->duties, sizeof report->duty);
        report->supply_pa = message->duties.supply;
        return false;
    case MESSAGE_TIP_POSITION:
        take_tip_position(assembly, &message->tip_position);
        return false;
    case MESSAGE_TIP_ORIENTATION:
        take_tip_orientation(assembly, &message->tip_orientation);
        return false;
    case MESSAGE_BEND:
        take_bend(report, message->bend.bend, message->bend.direction, message->bend.flags,
                  message->bend.tip_status);
        return false;
    case MESSAGE_TIME:
        take_time(assembly, message->time.time_us, message->time.step);
        return false;
    case MESSAGE_TIP_STATE:
        report->tip_quality = message->tip_state.quality;
        status->tip_samples = message->tip_state.samples;
        status->tip_rejected = message->tip_state.rejected;
        status->tip_lost_count = message->tip_state.lost;
        return false;
    case MESSAGE_GAP:
        take_gap(&status->gap, &message->gap);
        return false;
    case MESSAGE_GAP_PRESSURES:
        memcpy(status->gap.pressure_gap_pa, &message->gap_pressures, sizeof status->gap.pressure_gap_pa);
        status->gap.vented_threshold_pa = message->gap_pressures.vented_threshold;
        return false;
    case MESSAGE_GAP_THRESHOLDS:
        memcpy(status->gap.pressure_threshold_pa, &message->gap_thresholds,
               sizeof status->gap.pressure_threshold_pa);
        return false;
    case MESSAGE_GAP_VENTED:
        memcpy(status->gap.vented_pa, &message->gap_vented, sizeof status->gap.vented_pa);
        return false;
    case MESSAGE_HEALTH:
        status->commands_refused = message->health.commands_refused;
        return false;
    case MESSAGE_TELEMETRY:
        take_telemetry(assembly, &message->telemetry);
        return finish(assembly, assembly->time_us);
    default:
        return false; /* counters and answers: can_link.h */
    }
}
