#include "gap/plan_report.h"

#include <jansson.h>
#include <math.h>
#include <string.h>

#include "gap/report_file.h"

#define DEGREES (180.0 / M_PI)
#define INSEPARABLE                                                                                          \
    0.2 /* expected confusion of a pair above which an experiment says next to nothing of it */

/* Probability that `wrong` is preferred where `right` is the truth. */
static double pair_confusion(const struct plan_verdict *verdict, size_t right, size_t wrong) {
    return 0.5 * erfc(0.5 * verdict->distance[right][wrong] * M_SQRT1_2);
}

/* --- text --- */

/* In the unit that people use. */
static void print_value(double value, const char *unit, FILE *out) {
    static const struct {
        const char *si;
        double factor;
        const char *unit;
    } units[] = {
        {"m", 1e3, "mm"}, {"rad", DEGREES, "deg"}, {"Pa", 1e-3, "kPa"}, {"m3", 1e6, "ml"}, {"kg", 1e3, "g"}};
    for (size_t i = 0; i < sizeof units / sizeof units[0]; i++) {
        if (strcmp(units[i].si, unit) == 0) {
            fprintf(out, " %.3g %s", units[i].factor * value, units[i].unit);
            return;
        }
    }
    fprintf(out, " %.3g%s%s", value, strcmp(unit, "1") == 0 ? "" : " ", strcmp(unit, "1") == 0 ? "" : unit);
}

static void print_candidates(const struct plan_candidates *candidates, FILE *out) {
    fprintf(out, "candidates\n");
    for (size_t i = 0; i < candidates->count; i++) {
        const struct plan_candidate *candidate = &candidates->candidate[i];
        const struct effect *effect = &candidate->model.effect[candidate->model.count - 1];
        const char *before = "";
        fprintf(out, "  %-30s", candidate->label);
        for (size_t p = 0; p < effect->kind->parameter_count; p++) {
            fprintf(out, "%s%s", before, effect->kind->parameter[p].name);
            print_value(effect->parameter[p], effect->kind->parameter[p].unit, out);
            before = ", ";
        }
        fprintf(out, " (%s)\n", candidate->measured ? "as reported" : i == 0 ? "typical" : "made to match");
    }
}

static void print_row(const struct plan_verdict *verdict, const char *remark, FILE *out) {
    fprintf(out, "  %-44s %5.1f s %9.2f %% %10.2f   %s\n", verdict->name, verdict->length_s,
            100.0 * verdict->confusion, verdict->left, remark);
}

static void print_hardest(const struct plan_verdict *verdict, const struct plan_candidates *candidates,
                          FILE *out) {
    size_t right = 0, wrong = 1;
    for (size_t i = 0; i < candidates->count; i++) {
        for (size_t j = 0; j < candidates->count; j++) {
            if (i != j && verdict->distance[i][j] < verdict->distance[right][wrong]) {
                right = i;
                wrong = j;
            }
        }
    }
    const double confusion = pair_confusion(verdict, right, wrong);
    fprintf(out, "hardest   %s, taken for %s in %.2g %% of cases%s\n", candidates->candidate[right].label,
            candidates->candidate[wrong].label, 100.0 * confusion,
            confusion > INSEPARABLE
                ? ": no experiment with pressures alone tells these apart; change what pressures cannot, "
                  "such as the mounting, a known load or the sensor's place"
                : "");
}

static const char *remark_on(const struct plan_search *search, size_t index) {
    const struct plan_trial *trial = search->trial[index];
    if (!trial->safe) {
        return "left out: goes beyond a limit under a candidate";
    }
    return index == 0 ? "<- the plan" : trial->refined ? "" : "at best";
}

void plan_report_text(const struct plan_search *search, const struct plan_candidates *candidates, FILE *out) {
    print_candidates(candidates, out);
    fprintf(out, "experiments up to %.0f deg                          length  confusion  candidates left\n",
            DEGREES * search->bend_rad);
    print_row(&search->before, "(so far)", out);
    print_row(&search->random, "(for comparison)", out);
    for (size_t i = 0; i < search->tried; i++) {
        print_row(&search->trial[i]->verdict, remark_on(search, i), out);
    }
    print_hardest(&search->trial[0]->verdict, candidates, out);
    const struct plan_reach *reach = &search->trial[0]->verdict.reach;
    fprintf(out, "farthest  %.1f deg, %.2f kPa under any candidate\n", DEGREES * reach->bend_rad,
            1e-3 * reach->pressure_pa);
}

/* --- JSON --- */

static json_t *candidate_json(const struct plan_candidate *candidate) {
    const struct effect *effect = &candidate->model.effect[candidate->model.count - 1];
    json_t *parameters = json_object();
    for (size_t p = 0; p < effect->kind->parameter_count; p++) {
        json_object_set_new(
            parameters, effect->kind->parameter[p].name,
            json_pack("{s:f,s:s}", "value", effect->parameter[p], "unit", effect->kind->parameter[p].unit));
    }
    return json_pack("{s:s,s:s,s:i,s:i,s:f,s:b,s:o}", "name", effect->kind->name, "stage",
                     effect_stage_name(effect->kind->stage), "form", (int)effect->form, "chamber",
                     (int)effect->chamber, "probability", candidate->weight, "measured",
                     (int)candidate->measured, "parameters", parameters);
}

static json_t *verdict_json(const struct plan_verdict *verdict) {
    return json_pack("{s:s,s:f,s:f,s:f}", "name", verdict->name, "length_s", verdict->length_s, "confusion",
                     verdict->confusion, "candidates_left", verdict->left);
}

static json_t *trial_json(const struct plan_trial *trial) {
    json_t *object = verdict_json(&trial->verdict);
    if (!trial->safe) {
        json_object_set_new(object, "confusion", json_null()); /* was not judged */
        json_object_set_new(object, "candidates_left", json_null());
    }
    json_object_set_new(object, "safe", json_boolean(trial->safe));
    json_object_set_new(object, "refined", json_boolean(trial->refined));
    json_object_set_new(object, "farthest_bend_rad", json_real(trial->verdict.reach.bend_rad));
    json_object_set_new(object, "farthest_pressure_pa", json_real(trial->verdict.reach.pressure_pa));
    return object;
}

/* Pairs that stay together. */
static json_t *inseparable_json(const struct plan_verdict *verdict,
                                const struct plan_candidates *candidates) {
    json_t *pairs = json_array();
    for (size_t i = 0; i < candidates->count; i++) {
        for (size_t j = i + 1; j < candidates->count; j++) {
            if (fmax(pair_confusion(verdict, i, j), pair_confusion(verdict, j, i)) > INSEPARABLE) {
                json_array_append_new(pairs, json_pack("[s,s]", candidates->candidate[i].label,
                                                       candidates->candidate[j].label));
            }
        }
    }
    return pairs;
}

/* [right][wrong]. */
static json_t *pairs_json(const struct plan_verdict *verdict, size_t count) {
    json_t *rows = json_array();
    for (size_t i = 0; i < count; i++) {
        json_t *row = json_array();
        for (size_t j = 0; j < count; j++) {
            json_array_append_new(row, json_real(i == j ? 0.0 : pair_confusion(verdict, i, j)));
        }
        json_array_append_new(rows, row);
    }
    return rows;
}

static json_t *report_json(const struct plan_search *search, const struct plan_candidates *candidates,
                           const char *plan_path) {
    json_t *list = json_array(), *experiments = json_array();
    for (size_t i = 0; i < candidates->count; i++) {
        json_array_append_new(list, candidate_json(&candidates->candidate[i]));
    }
    for (size_t i = 0; i < search->tried; i++) {
        json_array_append_new(experiments, trial_json(search->trial[i]));
    }
    json_t *after = trial_json(search->trial[0]);
    json_object_set_new(after, "pairs", pairs_json(&search->trial[0]->verdict, candidates->count));
    json_object_set_new(after, "inseparable", inseparable_json(&search->trial[0]->verdict, candidates));
    return json_pack("{s:s,s:o,s:o,s:o,s:o,s:o}", "plan", plan_path, "candidates", list, "before",
                     verdict_json(&search->before), "after", after, "random", verdict_json(&search->random),
                     "experiments", experiments);
}

bool plan_report_json(const struct plan_search *search, const struct plan_candidates *candidates,
                      const char *plan_path, const char *path, char *error, size_t error_bytes) {
    return report_file_write(report_json(search, candidates, plan_path), path, error, error_bytes);
}
