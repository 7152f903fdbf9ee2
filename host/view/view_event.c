#include "view/view_event.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "safety/gap_monitor.h"
#include "sim/body.h"

#define DEGREES (180.0 / M_PI)
#define WORDS_BYTES 512
#define JSON_STYLE (JSON_COMPACT | JSON_REAL_PRECISION(6))

/* JSON has no NaN. */
static json_t *number(double value) {
    return isfinite(value) ? json_real(value) : json_null();
}

static json_t *numbers(const float *value, size_t count, double scale) {
    json_t *array = json_array();
    for (size_t i = 0; i < count; i++) {
        (void)json_array_append_new(array, number(scale * (double)value[i]));
    }
    return array;
}

char *view_event_module(const struct bend_table *table, const char *bus,
                        const struct view_arm_parameters *parameters) {
    const struct bend_table_module *module = &table->module;
    json_t *root = json_pack("{ss ss so so so so so so so so}", "module", module->name, "bus", bus,
                             "outer_diameter_mm", number(1e3 * (double)module->outer_diameter_m),
                             "chamber_length_mm", number(1e3 * (double)module->chamber_length_m),
                             "cap_proximal_mm", number(1e3 * (double)module->cap_proximal_m), "cap_distal_mm",
                             number(1e3 * (double)module->cap_distal_m), "working_pressure_kpa",
                             number(1e-3 * (double)module->working_pressure_pa), "bend_limit_deg",
                             number(DEGREES * (double)module->bend_limit_rad), "lease_ms",
                             number(1e-3 * (double)parameters->lease_us), "idle_s",
                             number(1e-6 * (double)parameters->idle_us));
    char *text = root != NULL ? json_dumps(root, JSON_STYLE) : NULL;
    json_decref(root);
    return text;
}

static json_t *shape_of(const struct bend_table *table, const struct controller_status *status) {
    double pressure_pa[3];
    struct body_shape shape;
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = fmax((double)status->pressure_estimate_pa[c], 0.0);
    }
    body_shape_at(table, pressure_pa, &shape);
    return json_pack("{so so so}", "bend_deg", number(DEGREES * hypot(shape.bend_x_rad, shape.bend_y_rad)),
                     "direction_deg", number(DEGREES * atan2(shape.bend_y_rad, shape.bend_x_rad)), "stretch",
                     number(shape.stretch));
}

static json_t *command_of(const struct view_arm *arm) {
    const struct controller_command *wanted = &arm->wanted;
    if (!arm->armed || wanted->kind != COMMAND_BEND) {
        return json_null();
    }
    return json_pack("{so so so}", "bend_deg", number(DEGREES * (double)wanted->bend_rad), "direction_deg",
                     number(DEGREES * (double)wanted->direction_rad), "co_contraction_kpa",
                     number(1e-3 * (double)wanted->co_contraction_pa));
}

static json_t *gap_of(const struct gap_monitor_report *gap) {
    return json_pack("{ss si so so so so so so}", "stage", gap_monitor_stage_text(gap->stage), "chamber",
                     (int)gap->chamber, "pressure_pa", numbers(gap->pressure_gap_pa, 3, 1.0),
                     "pressure_threshold_pa", numbers(gap->pressure_threshold_pa, 3, 1.0), "bend_deg",
                     number(DEGREES * (double)gap->bend_gap_rad), "bend_threshold_deg",
                     number(DEGREES * (double)gap->bend_threshold_rad), "position_mm",
                     number(1e3 * (double)gap->position_gap_m), "position_threshold_mm",
                     number(1e3 * (double)gap->position_threshold_m));
}

static json_t *arm_of(const struct view_arm *arm) {
    return json_pack("{sb ss ss}", "armed", (int)arm->armed, "page", arm->armed ? arm->page : "", "why",
                     arm->armed ? "" : view_arm_end_text(arm->end));
}

static json_t *report_of(const struct bend_table *table, const struct view_words *words,
                         const struct link_report *report, const struct view_arm *arm) {
    const struct controller_status *status = &report->status;
    char faults[WORDS_BYTES], warnings[WORDS_BYTES];
    words->faults(status->faults, faults, sizeof faults);
    words->warnings(status, warnings, sizeof warnings);
    return json_pack(
        "{so ss ss ss so so so so so so sb so so sI sI sI so so so so}", "time_s",
        number(1e-6 * (double)report->time_us), "state", supervisor_state_name(status->state), "faults",
        faults, "warnings", warnings, "pressure_kpa", numbers(status->pressure_estimate_pa, 3, 1e-3),
        "target_kpa", numbers(status->pressure_target_pa, 3, 1e-3), "duty", numbers(report->duty, 3, 1.0),
        "supply_kpa", number(1e-3 * (double)report->supply_pa), "bend_deg",
        number(DEGREES * (double)status->bend_rad), "direction_deg",
        number(DEGREES * (double)status->direction_rad), "measured", (int)status->bend_is_measured, "tip_mm",
        numbers(report->tip_position_m, 3, 1e3), "tip_quaternion", numbers(report->tip_quaternion, 4, 1.0),
        "tip_samples", (json_int_t)status->tip_samples, "tip_rejected", (json_int_t)status->tip_rejected,
        "commands_refused", (json_int_t)status->commands_refused, "shape", shape_of(table, status), "command",
        command_of(arm), "gap", gap_of(&status->gap), "arm", arm_of(arm));
}

size_t view_event_report(const struct bend_table *table, const struct view_words *words,
                         const struct link_report *report, const struct view_arm *arm,
                         char text[VIEW_EVENT_BYTES]) {
    static const char head[] = "data: ", foot[] = "\n\n";
    const size_t room = VIEW_EVENT_BYTES - sizeof head - sizeof foot;
    json_t *root = report_of(table, words, report, arm);
    if (root == NULL) {
        return 0;
    }
    const size_t length = json_dumpb(root, text + sizeof head - 1, room, JSON_STYLE);
    json_decref(root);
    if (length == 0 || length > room) {
        return 0;
    }
    memcpy(text, head, sizeof head - 1);
    memcpy(text + sizeof head - 1 + length, foot, sizeof foot);
    return sizeof head - 1 + length + sizeof foot - 1;
}
