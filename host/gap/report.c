#include "gap/report.h"

#include <jansson.h>
#include <math.h>
#include <string.h>

#include "gap/baseline.h"
#include "gap/report_file.h"
#include "program/output_file.h"

#define DEGREES (180.0 / M_PI)

/* --- text --- */

/* In the unit that people use: mm, deg, ms, kPa, ml. */
struct shown_unit {
    const char *si;
    double above;
    double factor;
    const char *unit;
};

static void print_value(FILE *out, const struct diagnosis_interval *interval, const char *unit) {
    static const struct shown_unit units[] = {
        {"m", 0.0, 1e3, "mm"}, {"rad", 0.0, 180.0 / M_PI, "deg"}, {"Pa", 0.0, 1e-3, "kPa"}, {"m3", 0.0, 1e6, "ml"},
        {"kg", 0.0, 1e3, "g"}};
    double factor = 1.0;
    const char *name = strcmp(unit, "1") == 0 ? "" : unit;
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        if (strcmp(units[i].si, unit) == 0) {
            factor = units[i].factor;
            name = units[i].unit;
        }
    }
    fprintf(out, "%.3g (%.3g to %.3g)%s%s", factor * interval->value, factor * interval->low, factor * interval->high,
            *name != '\0' ? " " : "", name);
}

static void print_effect(FILE *out, const struct diagnosis_effect *effect) {
    fprintf(out, "which     %s", effect->kind->name);
    if (effect->chamber > 0) {
        fprintf(out, ", chamber %zu", effect->chamber);
    }
    if (effect->onset_s > 0.0) {
        fprintf(out, ", from %.1f s on%s", effect->onset_s, effect->latent ? " (it remembers what was before)" : "");
    }
    fprintf(out, " (probability %.2f): %s\n", effect->probability, effect->kind->what);
    for (size_t i = 0; i < effect->kind->parameter_count; i++) {
        fprintf(out, "            %s ", effect->kind->parameter[i].name);
        print_value(out, &effect->parameter[i], effect->kind->parameter[i].unit);
        fprintf(out, "\n");
    }
}

static void print_verdict(FILE *out, const struct diagnosis *diagnosis) {
    static const char *const meaning[GAP_VERDICT_COUNT] = {
        [GAP_NONE] = "the module does what the model says, within the noise",
        [GAP_RECALIBRATE] = "nominal parameters explain it; nothing is missing from the model",
        [GAP_EFFECT] = "one effect that the model leaves out explains it",
        [GAP_EFFECTS] = "several effects that the model leaves out explain it together",
        [GAP_GROUP] = "several effects explain it equally well; this data cannot tell them apart",
        [GAP_UNKNOWN] = "there is a real gap that no effect of the catalogue explains",
        [GAP_INSUFFICIENT_DATA] = "the data cannot say"};
    fprintf(out, "verdict   %s: %s\n", gap_verdict_name(diagnosis->verdict), meaning[diagnosis->verdict]);
}

static void print_where(FILE *out, const struct diagnosis *diagnosis) {
    if (*diagnosis->stage == '\0') {
        return;
    }
    fprintf(out, "where     %s", diagnosis->stage);
    const bool all = diagnosis->chamber[0] && diagnosis->chamber[1] && diagnosis->chamber[2];
    for (size_t c = 0; c < 3 && !all; c++) {
        if (diagnosis->chamber[c]) {
            fprintf(out, ", chamber %zu", c + 1);
        }
    }
    fprintf(out, ", %s\n", diagnosis->regime);
}

/* What comes nearest to an unknown gap, though it does not explain it. */
static void print_closest(FILE *out, const struct diagnosis *diagnosis) {
    for (size_t i = 0; i < diagnosis->closest; i++) {
        const struct gap_model *model = &diagnosis->closest_model[i].model;
        fprintf(out, "%-10s%3.0f %% closed by", i == 0 ? "closest" : "", 100.0 * diagnosis->closest_model[i].closed);
        for (size_t e = 0; e < model->count; e++) {
            const struct effect *effect = &model->effect[e];
            if (gap_model_is_part(model, e)) {
                continue;
            }
            fprintf(out, "%s%s", e > 0 ? " and " : " ", effect->kind->name);
            if (effect->chamber > 0) {
                fprintf(out, " of chamber %zu", effect->chamber);
            }
            for (size_t p = 0; p < effect->kind->parameter_count; p++) {
                const char *unit = effect->kind->parameter[p].unit;
                fprintf(out, "%s%s %.3g%s%s", p == 0 ? " (" : ", ", effect->kind->parameter[p].name, effect->parameter[p],
                        strcmp(unit, "1") == 0 ? "" : " ", strcmp(unit, "1") == 0 ? "" : unit);
            }
            fprintf(out, ")");
        }
        fprintf(out, "\n");
    }
}

/* "1.04 (0.91 to 1.2)" in a column of its own */
static void print_rms(FILE *out, const struct diagnosis_gap *gap, size_t model, double value) {
    char text[64];
    (void)snprintf(text, sizeof text, "%.3g (%.3g to %.3g)", value, gap->low[model], gap->high[model]);
    fprintf(out, "%-22s ", text);
}

void gap_report_text(const struct diagnosis *diagnosis, const struct gap_data *data, FILE *out) {
    print_verdict(out, diagnosis);
    print_where(out, diagnosis);
    if (diagnosis->verdict == GAP_GROUP) {
        fprintf(out, "which    ");
        for (size_t i = 0; i < diagnosis->group; i++) {
            fprintf(out, " %s (%.2f)", diagnosis->group_name[i], diagnosis->group_probability[i]);
        }
        fprintf(out, "\n");
    }
    if (diagnosis->verdict != GAP_NONE && diagnosis->verdict != GAP_RECALIBRATE) { /* else it is the sensors' own */
        (void)dependence_text(&diagnosis->dependences, false, out);
        (void)dependence_text(&diagnosis->dependences, true, out);
    }
    const bool named = diagnosis->verdict == GAP_EFFECT || diagnosis->verdict == GAP_EFFECTS;
    for (size_t e = 0; e < diagnosis->effects && named; e++) {
        print_effect(out, &diagnosis->effect[e]);
    }
    if (diagnosis->verdict == GAP_UNKNOWN) {
        fprintf(out, "what      %s\n", diagnosis->description);
        print_closest(out, diagnosis);
    }
    if (diagnosis->verdict != GAP_INSUFFICIENT_DATA) {
        fprintf(out, "nominal   stiffness x ");
        print_value(out, &diagnosis->stiffness_scale, "1");
        if (!data->from_simulator) {
            fprintf(out, ", supply x ");
            print_value(out, &diagnosis->supply_scale, "1");
        }
        fprintf(out, "\nhow far   %.0f %% of the gap closed (%.0f to %.0f %%); by recalibration alone %.0f %%\n",
                100.0 * diagnosis->closed.value, 100.0 * diagnosis->closed.low, 100.0 * diagnosis->closed.high,
                100.0 * diagnosis->closed_recalibration.value);
        fprintf(out, "          on held-out data, rms  %-22s %-22s %-22s noise floor\n", "before", "recalibrated", "with effect");
    }
    for (size_t k = 0; k < DIAGNOSIS_RESIDUALS; k++) {
        const struct diagnosis_gap *gap = &diagnosis->gap[k];
        if (gap->measured) {
            fprintf(out, "          %-22s ", gap->name);
            print_rms(out, gap, 0, gap->before);
            print_rms(out, gap, 1, gap->after_recalibration);
            print_rms(out, gap, 2, gap->after_effect);
            fprintf(out, "%.3g %s\n", gap->floor, gap->unit);
        }
    }
    if (*diagnosis->direction.text != '\0') {
        fprintf(out, "direction %s\n", diagnosis->direction.text);
    }
    if (*diagnosis->next_experiment != '\0') {
        fprintf(out, "next      %s\n", diagnosis->next_experiment);
    }
    for (size_t i = 0; i < diagnosis->warnings; i++) {
        fprintf(out, "note      %s\n", diagnosis->warning[i]);
    }
}

/* --- JSON --- */

static json_t *interval_json(const struct diagnosis_interval *interval, const char *unit) {
    json_t *object = json_pack("{s:f,s:f,s:f}", "value", interval->value, "low", interval->low, "high", interval->high);
    if (unit != NULL) {
        json_object_set_new(object, "unit", json_string(unit));
    }
    return object;
}

static json_t *number_or_null(double value) {
    return isfinite(value) ? json_real(value) : json_null();
}

static json_t *effect_json(const struct diagnosis_effect *effect) {
    json_t *parameters = json_object();
    for (size_t i = 0; i < effect->kind->parameter_count; i++) {
        json_object_set_new(parameters, effect->kind->parameter[i].name,
                            interval_json(&effect->parameter[i], effect->kind->parameter[i].unit));
    }
    return json_pack("{s:s,s:s,s:i,s:i,s:f,s:b,s:f,s:o}", "name", effect->kind->name, "stage",
                     effect_stage_name(effect->kind->stage), "form", (int)effect->form, "chamber", (int)effect->chamber, "onset_s",
                     effect->onset_s, "latent", effect->latent, "probability", effect->probability, "parameters", parameters);
}

static json_t *effects_json(const struct diagnosis *diagnosis) {
    json_t *list = json_array();
    const bool named = diagnosis->verdict == GAP_EFFECT || diagnosis->verdict == GAP_EFFECTS ||
                       diagnosis->verdict == GAP_GROUP;
    for (size_t e = 0; e < diagnosis->effects && named; e++) {
        json_array_append_new(list, effect_json(&diagnosis->effect[e]));
    }
    return list;
}

static json_t *alternatives_json(const struct diagnosis *diagnosis) {
    json_t *list = json_array();
    for (size_t i = 0; i < diagnosis->alternatives; i++) {
        const struct diagnosis_alternative *entry = &diagnosis->alternative[i];
        const struct effect *effect = entry->effect;
        json_t *parameters = json_object();
        for (size_t k = 0; k < effect->kind->parameter_count; k++) {
            json_object_set_new(parameters, effect->kind->parameter[k].name,
                                json_pack("{s:f,s:s}", "value", effect->parameter[k], "unit", effect->kind->parameter[k].unit));
        }
        json_array_append_new(list, json_pack("{s:s,s:s,s:i,s:i,s:f,s:b,s:f,s:f,s:o}", "name", effect->kind->name, "stage",
                                              effect_stage_name(effect->kind->stage), "form", (int)effect->form, "chamber",
                                              (int)effect->chamber, "onset_s", effect->onset_s, "latent",
                                              effect->latent && effect->onset_s > 0.0, "probability",
                                              entry->probability, "structure", entry->structure, "parameters", parameters));
    }
    return list;
}

static json_t *range_json(double low, double high) {
    return json_pack("[o,o]", number_or_null(low), number_or_null(high));
}

static json_t *holds_json(const struct direction *direction, const struct gap_data *data) {
    json_t *list = json_array();
    for (size_t i = 0; i < direction->holds; i++) {
        const struct direction_hold *hold = &direction->hold[i];
        json_array_append_new(list, json_pack("{s:s,s:f,s:f,s:o,s:o,s:o,s:o,s:o}", "log", data->run[hold->run].path, "from_s",
                                              hold->from_s, "until_s", hold->until_s, "bend_deg",
                                              number_or_null(DEGREES * hold->bend_rad), "just_after_deg",
                                              number_or_null(DEGREES * hold->just_after_rad), "end_deg",
                                              number_or_null(DEGREES * hold->end_rad), "growth", number_or_null(hold->growth),
                                              "time_constant_s", number_or_null(hold->time_constant_s)));
    }
    return list;
}

/* Measured minus simulated bend over holds; null where the logs have none. */
static json_t *direction_json(const struct direction *direction, const struct gap_data *data) {
    if (direction->holds == 0) {
        return json_null();
    }
    return json_pack("{s:s,s:s,s:f,s:f,s:o,s:{s:o,s:o,s:o,s:s},s:o,s:o}", "text", direction->text, "bend_from",
                     direction->from_orientation ? "orientation" : "position", "just_after_deg",
                     DEGREES * direction->just_after_rad, "end_deg", DEGREES * direction->end_rad, "end_with_effects_deg",
                     number_or_null(DEGREES * direction->end_with_effects_rad), "time_constant", "value",
                     number_or_null(direction->time_constant_s), "low", number_or_null(direction->time_constant_low_s), "high",
                     number_or_null(direction->time_constant_high_s), "unit", "s", "growth",
                     range_json(direction->growth_low, direction->growth_high), "holds", holds_json(direction, data));
}

static json_t *closest_json(const struct diagnosis *diagnosis) {
    json_t *list = json_array();
    for (size_t i = 0; i < diagnosis->closest; i++) {
        const struct gap_model *model = &diagnosis->closest_model[i].model;
        json_t *effects = json_array();
        for (size_t e = 0; e < model->count; e++) {
            const struct effect *effect = &model->effect[e];
            json_t *parameters = json_object();
            for (size_t p = 0; p < effect->kind->parameter_count; p++) {
                json_object_set_new(parameters, effect->kind->parameter[p].name, json_real(effect->parameter[p]));
            }
            json_array_append_new(effects, json_pack("{s:s,s:i,s:i,s:o}", "name", effect->kind->name, "form", (int)effect->form,
                                                     "chamber", (int)effect->chamber, "parameters", parameters));
        }
        json_array_append_new(list, json_pack("{s:f,s:o}", "closed_fraction", diagnosis->closest_model[i].closed, "effects", effects));
    }
    return list;
}

static json_t *gaps_json(const struct diagnosis *diagnosis) {
    json_t *object = json_object();
    for (size_t k = 0; k < DIAGNOSIS_RESIDUALS; k++) {
        const struct diagnosis_gap *gap = &diagnosis->gap[k];
        if (gap->measured) {
            json_object_set_new(object, gap->name,
                                json_pack("{s:o,s:o,s:o,s:o,s:s,s:{s:o,s:o,s:o}}", "before", number_or_null(gap->before),
                                          "after_recalibration", number_or_null(gap->after_recalibration),
                                          "after_effect", number_or_null(gap->after_effect), "floor",
                                          number_or_null(gap->floor), "unit", gap->unit, "interval", "before",
                                          range_json(gap->low[0], gap->high[0]), "after_recalibration",
                                          range_json(gap->low[1], gap->high[1]), "after_effect",
                                          range_json(gap->low[2], gap->high[2])));
        }
    }
    return object;
}

static json_t *dependences_json(const struct dependences *dependences) {
    json_t *list = json_array();
    for (size_t i = 0; i < dependences->count; i++) {
        const struct dependence *one = &dependences->list[i];
        json_array_append_new(list, json_pack("{s:s,s:s,s:s,s:s,s:i,s:f,s:f,s:f,s:f,s:f,s:s,s:f,s:s}", "model",
                                              one->of_best ? "best" : "recalibrated", "residual", one->residual, "channel",
                                              one->channel, "variable", one->variable, "chamber", (int)one->chamber, "share",
                                              one->share, "p", one->p, "q", one->q, "from", one->from, "to", one->to, "unit",
                                              one->unit, "off", one->off, "off_unit", one->off_unit));
    }
    return list;
}

/* What cannot act on the baseline, and why. */
static json_t *untried_json(const struct gap_data *data) {
    json_t *list = json_array();
    for (size_t i = 0; i < effect_kind_count() && data->from_simulator; i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        const char *reason = gap_baseline_why_not(data, kind);
        if (reason != NULL) {
            json_array_append_new(list, json_pack("{s:s,s:s}", "name", kind->name, "reason", reason));
        }
    }
    return list;
}

static json_t *report_json(const struct diagnosis *diagnosis, const struct gap_data *data) {
    json_t *chambers = json_array(), *group = json_array(), *warnings = json_array(), *logs = json_array();
    for (size_t c = 0; c < 3; c++) {
        if (diagnosis->chamber[c]) {
            json_array_append_new(chambers, json_integer((json_int_t)c + 1));
        }
    }
    for (size_t i = 0; i < diagnosis->group && diagnosis->verdict != GAP_UNKNOWN; i++) {
        json_array_append_new(group, json_string(diagnosis->group_name[i]));
    }
    for (size_t i = 0; i < diagnosis->warnings; i++) {
        json_array_append_new(warnings, json_string(diagnosis->warning[i]));
    }
    for (size_t i = 0; i < data->runs; i++) {
        json_array_append_new(logs, json_string(data->run[i].path));
    }
    json_t *closed = interval_json(&diagnosis->closed, NULL);
    json_object_set_new(closed, "recalibration", json_real(diagnosis->closed_recalibration.value));
    return json_pack("{s:s,s:o,s:s,s:{s:s,s:o,s:s},s:o,s:o,s:o,s:o,s:{s:o,s:o},s:o,s:o,s:o,s:o,s:s,s:s,s:o,s:o}", "verdict",
                     gap_verdict_name(diagnosis->verdict), "logs", logs, "module", data->module, "locus", "stage",
                     diagnosis->stage, "chambers", chambers, "regime", diagnosis->regime, "effects",
                     effects_json(diagnosis), "group", group, "dependence", dependences_json(&diagnosis->dependences), "structure",
                     json_pack("[f,f,f]", diagnosis->structure[0], diagnosis->structure[1], diagnosis->structure[2]), "nominal", "stiffness_scale",
                     interval_json(&diagnosis->stiffness_scale, "1"), "supply_scale",
                     interval_json(&diagnosis->supply_scale, "1"), "gap", gaps_json(diagnosis), "closed_fraction",
                     closed, "direction", direction_json(&diagnosis->direction, data), "closest", closest_json(diagnosis),
                     "description", diagnosis->description, "next_experiment", diagnosis->next_experiment,
                     "warnings", warnings, "alternatives", alternatives_json(diagnosis));
}

bool gap_report_json(const struct diagnosis *diagnosis, const struct gap_data *data, const char *path, char *error,
                     size_t error_bytes) {
    json_t *report = report_json(diagnosis, data);
    if (report != NULL) {
        json_object_set_new(report, "baseline", json_string(data->from_simulator ? "simulator" : "table"));
        json_object_set_new(report, "not_tried", untried_json(data));
    }
    return report_file_write(report, path, error, error_bytes);
}

/* --- calibration --- */

static void write_interval(FILE *out, const char *indent, const char *name, const struct diagnosis_interval *interval,
                           const char *unit) {
    fprintf(out, "%s%s: { value: %.8g, low: %.8g, high: %.8g, unit: \"%s\" }\n", indent, name, interval->value,
            interval->low, interval->high, unit);
}

bool gap_report_calibration(const struct diagnosis *diagnosis, const struct gap_data *data, const char *path,
                            char *error, size_t error_bytes) {
    struct output_file file;
    if (!output_file_open(&file, path, error, error_bytes)) {
        return false;
    }
    FILE *out = file.stream;
    const bool named = diagnosis->verdict == GAP_EFFECT || diagnosis->verdict == GAP_EFFECTS;
    fprintf(out, "# tribend calibration: what a diagnosis found; intervals are 90 %%\nmodule: %s\nverdict: %s\nlogs:\n",
            data->module, gap_verdict_name(diagnosis->verdict));
    for (size_t i = 0; i < data->runs; i++) {
        fprintf(out, "  - \"%s\"\n", data->run[i].path);
    }
    write_interval(out, "", "stiffness_scale", &diagnosis->stiffness_scale, "1");
    write_interval(out, "", "supply_scale", &diagnosis->supply_scale, "1");
    fprintf(out, "effects:%s\n", named && diagnosis->effects > 0 ? "" : " []");
    for (size_t e = 0; e < diagnosis->effects && named; e++) {
        const struct diagnosis_effect *effect = &diagnosis->effect[e];
        fprintf(out, "  - name: %s\n    form: %zu\n    chamber: %zu\n    onset_s: %.6g\n%s    parameters:\n", effect->kind->name,
                effect->form, effect->chamber, effect->onset_s, effect->latent ? "    latent: 1\n" : "");
        for (size_t i = 0; i < effect->kind->parameter_count; i++) {
            const struct diagnosis_interval *value = &effect->parameter[i];
            fprintf(out, "      - { name: %s, value: %.8g, low: %.8g, high: %.8g, unit: \"%s\" }\n",
                    effect->kind->parameter[i].name, value->value, value->low, value->high,
                    effect->kind->parameter[i].unit);
        }
    }
    return output_file_commit(&file, error, error_bytes);
}
