#include "cli/report_json.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#define HASH_BYTES 17

static json_t *real(float value) {
    return isfinite(value) ? json_real((double)value) : json_null();
}

static json_t *reals(const float *value, size_t count) {
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++) {
        (void)json_array_append_new(array, real(value[i]));
    }
    return array;
}

json_t *report_faults_json(uint32_t faults) {
    json_t *array = json_array();
    for (uint32_t f = 0; f < (uint32_t)FAULT_COUNT; f++) {
        if ((faults & 1u << f) != 0u) {
            (void)json_array_append_new(
                array, json_string(supervisor_fault_describe((enum supervisor_fault)f)->name));
        }
    }
    return array;
}

static json_t *warnings_json(uint32_t warnings) {
    json_t *array = json_array();
    for (uint32_t w = 0; w < (uint32_t)WARNING_COUNT; w++) {
        if ((warnings & 1u << w) != 0u) {
            (void)json_array_append_new(array,
                                        json_string(supervisor_warning_text((enum supervisor_warning)w)));
        }
    }
    return array;
}

static json_t *tip_json(const struct link_report *report) {
    json_t *tip = json_object();
    (void)json_object_set_new(tip, "position_m", reals(report->tip_position_m, 3));
    (void)json_object_set_new(tip, "quaternion", reals(report->tip_quaternion, 4));
    (void)json_object_set_new(tip, "quality", json_integer(report->tip_quality));
    (void)json_object_set_new(tip, "status", json_integer(report->tip_status));
    (void)json_object_set_new(tip, "samples", json_integer(report->status.tip_samples));
    (void)json_object_set_new(tip, "rejected", json_integer(report->status.tip_rejected));
    return tip;
}

static json_t *gap_json(const struct gap_monitor_report *gap) {
    json_t *object = json_object();
    (void)json_object_set_new(object, "stage", json_string(gap_monitor_stage_text(gap->stage)));
    (void)json_object_set_new(object, "chamber", json_integer(gap->chamber));
    (void)json_object_set_new(object, "bend_gap_rad", real(gap->bend_gap_rad));
    (void)json_object_set_new(object, "bend_threshold_rad", real(gap->bend_threshold_rad));
    (void)json_object_set_new(object, "position_gap_m", real(gap->position_gap_m));
    (void)json_object_set_new(object, "position_threshold_m", real(gap->position_threshold_m));
    return object;
}

static json_t *counters_json(struct can_link *can) {
    struct can_link_counters counters;
    json_t *object = json_object();
    can_link_count(can, &counters);
#define SET_COUNTER(name, text)                                                                              \
    (void)json_object_set_new(object, #name, json_integer((json_int_t)counters.name));
    CAN_LINK_COUNTERS(SET_COUNTER)
#undef SET_COUNTER
    return object;
}

static void set_board(json_t *object, struct bus *bus) {
    char hash[HASH_BYTES];
    (void)snprintf(hash, sizeof hash, "%016" PRIx64, bus->table_hash);
    (void)json_object_set_new(object, "module", json_string(bus->module_name));
    (void)json_object_set_new(object, "table", json_string(hash));
    if (bus->can != NULL) {
        (void)json_object_set_new(object, "node", json_integer(bus->can->node));
        (void)json_object_set_new(object, "protocol", json_integer(bus->identity.protocol));
        (void)json_object_set_new(object, "firmware", json_integer(bus->identity.firmware));
        (void)json_object_set_new(object, "silence_s", json_real(1e-6 * (double)can_link_silence_us(bus->can)));
        (void)json_object_set_new(object, "counters", counters_json(bus->can));
    }
}

json_t *report_json(struct bus *bus, const struct link_report *report) {
    const struct controller_status *status = &report->status;
    json_t *object = json_object();
    (void)json_object_set_new(object, "time_s", json_real(1e-6 * (double)report->time_us));
    (void)json_object_set_new(object, "state", json_string(supervisor_state_name(status->state)));
    (void)json_object_set_new(object, "faults", report_faults_json(status->faults));
    (void)json_object_set_new(object, "warnings", warnings_json(status->warnings));
    (void)json_object_set_new(object, "pressure_pa", reals(report->pressure_pa, 3));
    (void)json_object_set_new(object, "pressure_target_pa", reals(status->pressure_target_pa, 3));
    (void)json_object_set_new(object, "pressure_estimate_pa", reals(status->pressure_estimate_pa, 3));
    (void)json_object_set_new(object, "supply_pa", real(report->supply_pa));
    (void)json_object_set_new(object, "duty", reals(report->duty, 3));
    (void)json_object_set_new(object, "bend_rad", real(status->bend_rad));
    (void)json_object_set_new(object, "direction_rad", real(status->direction_rad));
    (void)json_object_set_new(object, "bend_is_measured", json_boolean(status->bend_is_measured));
    (void)json_object_set_new(object, "commands_refused", json_integer(status->commands_refused));
    (void)json_object_set_new(object, "tip", tip_json(report));
    (void)json_object_set_new(object, "gap", gap_json(&status->gap));
    set_board(object, bus);
    return object;
}

/* --- how a command was followed */

static json_t *command_json(const struct run_outcome *outcome) {
    const struct controller_command *command = &outcome->summary->command;
    json_t *object = json_object();
    if (outcome->plan != NULL) {
        (void)json_object_set_new(object, "kind", json_string("plan"));
        (void)json_object_set_new(object, "plan", json_string(outcome->plan));
    } else if (command->kind == COMMAND_BEND) {
        (void)json_object_set_new(object, "kind", json_string("bend"));
        (void)json_object_set_new(object, "bend_rad", real(command->bend_rad));
        (void)json_object_set_new(object, "direction_rad", real(command->direction_rad));
        (void)json_object_set_new(object, "co_contraction_pa", real(command->co_contraction_pa));
    } else {
        (void)json_object_set_new(object, "kind", json_string("pressure"));
        (void)json_object_set_new(object, "pressure_pa", reals(command->pressure_pa, 3));
    }
    return object;
}

static void set_bend(json_t *object, const struct run_summary *summary) {
    const double n = (double)summary->samples;
    const double bend_rad = summary->bend_sum_rad / n, turn_rad = summary->direction_sum_rad / n;
    (void)json_object_set_new(object, "bend_rad", json_real(bend_rad));
    (void)json_object_set_new(object, "bend_error_rad", json_real(bend_rad - (double)summary->command.bend_rad));
    (void)json_object_set_new(object, "bend_rms_error_rad", json_real(sqrt(summary->bend_square_rad2 / n)));
    if (summary->command.bend_rad > 0.0f) {
        (void)json_object_set_new(object, "direction_rad",
                                  json_real((double)summary->command.direction_rad + turn_rad));
        (void)json_object_set_new(object, "direction_error_rad", json_real(turn_rad));
        (void)json_object_set_new(object, "direction_rms_error_rad",
                                  json_real(sqrt(summary->direction_square_rad2 / n)));
    }
}

static void set_pressures(json_t *object, const struct run_summary *summary) {
    const double n = (double)summary->pressure_samples;
    json_t *mean = json_array(), *rms = json_array();
    for (size_t c = 0; c < 3; c++) {
        (void)json_array_append_new(mean, json_real(summary->pressure_sum_pa[c] / n));
        (void)json_array_append_new(rms, json_real(sqrt(summary->pressure_square_pa2[c] / n)));
    }
    (void)json_object_set_new(object, "pressure_pa", mean);
    (void)json_object_set_new(object, "pressure_rms_error_pa", rms);
}

/* Over the last second; null for a plan, whose command changes. */
static json_t *followed_json(const struct run_outcome *outcome) {
    const struct run_summary *summary = outcome->summary;
    const double settled_s = run_summary_settling_s(summary);
    if (outcome->plan != NULL || summary->pressure_samples == 0) {
        return json_null();
    }
    json_t *object = json_object();
    if (summary->command.kind == COMMAND_BEND && summary->samples > 0) {
        set_bend(object, summary);
    }
    set_pressures(object, summary);
    (void)json_object_set_new(object, "settled_s", settled_s >= 0.0 ? json_real(settled_s) : json_null());
    return object;
}

json_t *run_outcome_json(struct bus *bus, const struct run_outcome *outcome) {
    json_t *object = report_json(bus, outcome->last);
    (void)json_object_set_new(object, "command", command_json(outcome));
    (void)json_object_set_new(object, "followed", followed_json(outcome));
    (void)json_object_set_new(object, "followed_s", json_real(outcome->followed_s));
    (void)json_object_set_new(object, "vented_s",
                              outcome->vented_s >= 0.0 ? json_real(outcome->vented_s) : json_null());
    (void)json_object_set_new(object, "interrupted", json_boolean(outcome->interrupted));
    (void)json_object_set_new(object, "record",
                              outcome->record != NULL ? json_string(outcome->record) : json_null());
    return object;
}

int report_json_print(json_t *object) {
    const int failed = json_dumpf(object, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(object);
    printf("\n");
    return failed == 0 ? EXIT_OK : program_fail(EXIT_OUTPUT, "cannot write to standard output");
}
