#include "gap/plan_candidates.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define ANY_CHAMBER 4
#define WEIGHT_LEAST 0.02 /* what a diagnosis hardly believes is still worth an experiment */

void plan_candidates_init(struct plan_candidates *candidates) {
    memset(candidates, 0, sizeof *candidates);
    candidates->base.stiffness_scale = 1.0;
    candidates->base.supply_scale = 1.0;
}

struct effect *plan_candidate_effect(struct plan_candidate *candidate) {
    return &candidate->model.effect[candidate->model.count - 1];
}

static void name_candidate(struct plan_candidate *candidate) {
    const struct effect *effect = plan_candidate_effect(candidate);
    char form[32] = "", chamber[32] = "";
    if (effect->kind->forms > 1 && effect->form > 0) {
        (void)snprintf(form, sizeof form, " form %zu", effect->form);
    }
    if (effect->chamber > 0) {
        (void)snprintf(chamber, sizeof chamber, ", chamber %zu", effect->chamber);
    }
    (void)snprintf(candidate->label, sizeof candidate->label, "%s%s%s", effect->kind->name, form, chamber);
}

static bool add(struct plan_candidates *candidates, const struct effect *effect, double weight, bool measured,
                char *error, size_t error_bytes) {
    if (candidates->count == PLAN_CANDIDATES_MAX || candidates->base.count == GAP_EFFECTS_MAX) {
        (void)snprintf(error, error_bytes, "at most %d candidates, on top of %d effects that are sure",
                       PLAN_CANDIDATES_MAX, GAP_EFFECTS_MAX - 1);
        return false;
    }
    struct plan_candidate *candidate = &candidates->candidate[candidates->count++];
    *candidate = (struct plan_candidate){.model = candidates->base, .weight = weight, .measured = measured};
    candidate->model.effect[candidate->model.count++] = *effect;
    name_candidate(candidate);
    return true;
}

bool plan_candidates_add(struct plan_candidates *candidates, const char *text, char *error,
                         size_t error_bytes) {
    struct effect effect;
    return effect_parse(text, &effect, error, error_bytes) &&
           add(candidates, &effect, 1.0, false, error, error_bytes);
}

/* --- from a report --- */

static const char *text_of(const json_t *object, const char *key) {
    const char *text = json_string_value(json_object_get(object, key));
    return text != NULL ? text : "";
}

static double number_of(const json_t *object, const char *key, double otherwise) {
    const json_t *value = json_object_get(object, key);
    return json_is_number(value) ? json_number_value(value) : otherwise;
}

static double value_of(const json_t *object, const char *key, double otherwise) {
    return number_of(json_object_get(object, key), "value", otherwise);
}

/* An entry of `effects` or `alternatives`. False: no effect of ours. */
static bool take_effect(const json_t *entry, struct effect *effect) {
    const struct effect_kind *kind = effect_kind_find(text_of(entry, "name"));
    const json_t *parameters = json_object_get(entry, "parameters");
    if (kind == NULL) {
        return false;
    }
    effect_init(effect, kind);
    const double chamber = number_of(entry, "chamber", (double)effect->chamber),
                 form = number_of(entry, "form", 0.0);
    effect->chamber = chamber >= 0.0 && chamber <= 3.0 ? (size_t)lround(chamber) : effect->chamber;
    effect->form = form >= 0.0 && form < (double)kind->forms ? (size_t)lround(form) : 0;
    effect->onset_s = 0.0; /* an onset is of the run that showed it */
    for (size_t i = 0; i < kind->parameter_count; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        const double value = value_of(parameters, parameter->name, parameter->typical);
        effect->parameter[i] = fmin(fmax(value, parameter->least), parameter->most);
    }
    return true;
}

static bool is_in_group(const json_t *group, const char *name) {
    for (size_t i = 0; i < json_array_size(group); i++) {
        const char *other = json_string_value(json_array_get(group, i));
        if (other != NULL && strcmp(other, name) == 0) {
            return true;
        }
    }
    return false;
}

/* Where the report has the effect with its parameters: among the effects, then the alternatives. A name that
 * a group has several times (on other chambers, in other forms) means one entry after the other; `before`
 * says how many are taken. */
static const json_t *entry_of(const json_t *report, const char *name, size_t before) {
    static const char *const lists[2] = {"effects", "alternatives"};
    for (size_t l = 0; l < 2; l++) {
        const json_t *list = json_object_get(report, lists[l]);
        for (size_t i = 0; i < json_array_size(list); i++) {
            if (strcmp(text_of(json_array_get(list, i), "name"), name) == 0 && before-- == 0) {
                return json_array_get(list, i);
            }
        }
    }
    return NULL;
}

static size_t taken(const struct plan_candidates *candidates, const char *name, size_t chamber) {
    size_t count = 0;
    for (size_t i = 0; i < candidates->count; i++) {
        const struct gap_model *model = &candidates->candidate[i].model;
        const struct effect *effect = &model->effect[model->count - 1];
        count +=
            strcmp(effect->kind->name, name) == 0 && (chamber == ANY_CHAMBER || effect->chamber == chamber);
    }
    return count;
}

/* The effect that is in question where there is no group: the one that is believed least. */
static size_t least_believed(const json_t *effects) {
    size_t least = 0;
    for (size_t i = 1; i < json_array_size(effects); i++) {
        const double mine = number_of(json_array_get(effects, i), "probability", 1.0);
        least = mine < number_of(json_array_get(effects, least), "probability", 1.0) ? i : least;
    }
    return least;
}

static bool is_in_question(const json_t *group, const json_t *effects, size_t index) {
    return json_array_size(group) > 0 ? is_in_group(group, text_of(json_array_get(effects, index), "name"))
                                      : index == least_believed(effects);
}

/* Effects that are found and not in question belong to every candidate. */
static void take_base(struct plan_candidates *candidates, const json_t *report) {
    const json_t *nominal = json_object_get(report, "nominal"), *effects = json_object_get(report, "effects");
    const json_t *group = json_object_get(report, "group");
    struct gap_model *base = &candidates->base;
    base->stiffness_scale = value_of(nominal, "stiffness_scale", 1.0);
    base->supply_scale = value_of(nominal, "supply_scale", 1.0);
    for (size_t i = 0; i < json_array_size(effects); i++) {
        const bool room = base->count + 1 < GAP_EFFECTS_MAX;
        if (room && !is_in_question(group, effects, i) &&
            take_effect(json_array_get(effects, i), &base->effect[base->count])) {
            base->count++;
        }
    }
}

/* Of a name without an entry: on the chamber that the gap is in, and the second time on all of them. False:
 * neither is left. */
static bool guess_effect(const struct plan_candidates *candidates, const struct effect_kind *kind,
                         size_t chamber, struct effect *effect) {
    effect_init(effect, kind);
    if (kind->scope != EFFECT_GLOBAL && chamber > 0 && taken(candidates, kind->name, chamber) == 0) {
        effect->chamber = chamber;
    }
    return taken(candidates, kind->name, effect->chamber) == 0;
}

static bool take_name(struct plan_candidates *candidates, const json_t *report, const char *name,
                      size_t chamber, char *error, size_t error_bytes) {
    const struct effect_kind *kind = effect_kind_find(name);
    const json_t *entry = entry_of(report, name, taken(candidates, name, ANY_CHAMBER));
    struct effect effect;
    if (kind == NULL) {
        (void)snprintf(error, error_bytes, "there is no effect '%s' (see tribend effects)", name);
        return false;
    }
    if (entry == NULL ? !guess_effect(candidates, kind, chamber, &effect) : !take_effect(entry, &effect)) {
        return true; /* the report says no more of it than that it is there */
    }
    return add(candidates, &effect, fmax(number_of(entry, "probability", WEIGHT_LEAST), WEIGHT_LEAST),
               entry != NULL, error, error_bytes);
}

/* A report that names one chamber means it for those of its group of which it says no more. */
static size_t only_chamber(const json_t *report) {
    const json_t *chambers = json_object_get(json_object_get(report, "locus"), "chambers");
    const double chamber =
        json_array_size(chambers) == 1 ? json_number_value(json_array_get(chambers, 0)) : 0.0;
    return chamber >= 1.0 && chamber <= 3.0 ? (size_t)lround(chamber) : 0;
}

static bool take_group(struct plan_candidates *candidates, const json_t *report, char *error,
                       size_t error_bytes) {
    const json_t *group = json_object_get(report, "group");
    const size_t chamber = only_chamber(report);
    bool sound = true;
    for (size_t i = 0; i < json_array_size(group) && sound; i++) {
        const char *name = json_string_value(json_array_get(group, i));
        sound = take_name(candidates, report, name != NULL ? name : "", chamber, error, error_bytes);
    }
    return sound;
}

/* Without a group: the effect in question and its alternatives. */
static bool take_alternatives(struct plan_candidates *candidates, const json_t *report, char *error,
                              size_t error_bytes) {
    const json_t *effects = json_object_get(report, "effects"),
                 *list = json_object_get(report, "alternatives");
    const char *first = text_of(json_array_get(effects, least_believed(effects)), "name");
    bool sound = json_array_size(effects) == 0 || take_name(candidates, report, first, 0, error, error_bytes);
    for (size_t i = 0; i < json_array_size(list) && sound; i++) {
        sound =
            take_name(candidates, report, text_of(json_array_get(list, i), "name"), 0, error, error_bytes);
    }
    return sound;
}

static bool take_names(struct plan_candidates *candidates, const json_t *report, char *error,
                       size_t error_bytes) {
    return json_array_size(json_object_get(report, "group")) > 0
               ? take_group(candidates, report, error, error_bytes)
               : take_alternatives(candidates, report, error, error_bytes);
}

bool plan_candidates_read(struct plan_candidates *candidates, const char *path, char *module, char *error,
                          size_t error_bytes) {
    json_error_t why;
    char text[256];
    json_t *report = json_load_file(path, 0, &why);
    if (report == NULL) {
        char line[32] = "";
        if (why.line > 0) {
            (void)snprintf(line, sizeof line, ":%d", why.line);
        }
        (void)snprintf(error, error_bytes, "%s%s: %s; give what tribend gap diagnose --json wrote", path,
                       line, why.text);
        return false;
    }
    if (!json_is_string(json_object_get(report, "verdict"))) {
        (void)snprintf(error, error_bytes,
                       "%s: verdict: missing; give what tribend gap diagnose --json wrote", path);
        json_decref(report);
        return false;
    }
    (void)snprintf(module, PLAN_LABEL_BYTES, "%s", text_of(report, "module"));
    take_base(candidates, report);
    const bool sound = take_names(candidates, report, text, sizeof text);
    if (!sound) {
        (void)snprintf(error, error_bytes, "%s: group: %s", path, text);
    }
    json_decref(report);
    return sound;
}

/* --- all of them --- */

bool plan_candidates_finish(struct plan_candidates *candidates, char *error, size_t error_bytes) {
    double sum = 0.0;
    if (candidates->count < 2) {
        (void)snprintf(
            error, error_bytes,
            "%s: there is nothing to tell apart; name candidates with --group NAME,NAME or --candidate NAME",
            candidates->count == 0 ? "no candidate" : "one candidate only");
        return false;
    }
    for (size_t i = 0; i < candidates->count; i++) {
        sum += candidates->candidate[i].weight;
        for (size_t j = 0; j < i; j++) {
            if (strcmp(candidates->candidate[i].label, candidates->candidate[j].label) == 0) {
                (void)snprintf(error, error_bytes, "%s is named twice: give each candidate once",
                               candidates->candidate[i].label);
                return false;
            }
        }
    }
    for (size_t i = 0; i < candidates->count; i++) {
        candidates->candidate[i].weight /= sum;
    }
    return true;
}

size_t plan_candidates_lead(const struct plan_candidates *candidates) {
    size_t lead = 0;
    for (size_t i = 0; i < candidates->count; i++) {
        const struct gap_model *model = &candidates->candidate[i].model;
        const size_t chamber = model->effect[model->count - 1].chamber;
        if (chamber > 0 && lead > 0 && chamber != lead) {
            return 1;
        }
        lead = chamber > 0 ? chamber : lead;
    }
    return lead > 0 ? lead : 1;
}

void plan_candidate_scale(struct plan_candidate *candidate, double factor) {
    struct effect *effect = plan_candidate_effect(candidate);
    for (size_t i = 0; i < effect->kind->parameter_count; i++) {
        const struct effect_parameter *kind = &effect->kind->parameter[i];
        if (!isnan(kind->none)) {
            const double wanted = kind->none + factor * (effect->parameter[i] - kind->none);
            effect->parameter[i] = fmin(fmax(wanted, kind->least), kind->most);
        }
    }
}
