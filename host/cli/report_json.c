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

static json_t *faults_json(uint32_t faults) {
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
    (void)json_object_set_new(object, "faults", faults_json(status->faults));
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
