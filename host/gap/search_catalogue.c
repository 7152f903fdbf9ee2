#include "gap/search_parts.h"

#include <math.h>
#include <string.h>

#include "gap/baseline.h"

#define STARTS_MAX 4
#define THRESHOLD_STARTS 6
#define AGE_STARTS 6
#define STARTS_CHEAP 8     /* where no gas need be replayed */
#define SMALL_SHARE 0.25   /* of the typical size */
#define REPEATS_LEAST 0.02 /* share of repeated samples below which none is frozen */

bool search_leaves_out(const struct search *search, const char *name) {
    for (size_t i = 0; i < search->options.without_count; i++) {
        if (strcmp(search->options.without[i], name) == 0) {
            return true;
        }
    }
    return false;
}

static bool has_everywhere(const struct gap_data *data, size_t offset_of_flag) {
    bool all = true;
    for (size_t i = 0; i < data->runs; i++) {
        all = all && *(const bool *)((const char *)&data->run[i] + offset_of_flag);
    }
    return all;
}

bool search_all_have_duties(const struct gap_data *data) {
    return has_everywhere(data, offsetof(struct gap_run, has_duty)) && data->run[0].tips > 0;
}

/* Can the data tell anything of this effect at all? */
static bool can_show(const struct gap_data *data, const struct effect_kind *kind) {
    const bool duties = has_everywhere(data, offsetof(struct gap_run, has_duty));
    const bool readings = has_everywhere(data, offsetof(struct gap_run, has_reading));
    const bool tips = data->run[0].tips > 0;
    if (data->from_simulator && gap_baseline_why_not(data, kind) != NULL) {
        return false;
    }
    if (kind->by_chance) {
        return gap_data_repeats(data).share > REPEATS_LEAST;
    }
    if (gap_effect_downstream(kind)) {
        return tips;
    }
    if (kind->stage == EFFECT_STAGE_PRESSURE_SENSOR) {
        return readings && (duties || tips);
    }
    return duties && (readings || tips);
}

size_t search_list_candidates(const struct search *search, struct search_candidate *list) {
    size_t count = 0;
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        if (search_leaves_out(search, kind->name) || !can_show(search->data, kind)) {
            continue;
        }
        const bool twin =
            strcmp(kind->name, "line_resistance") == 0 && !search_leaves_out(search, "valve_sluggish");
        const size_t first = kind->scope == EFFECT_ONE_CHAMBER ? 1 : 0,
                     last = kind->scope == EFFECT_GLOBAL ? 0 : 3;
        const size_t forms = (kind->forms > 1 ? kind->forms : 1) + kind->forms_add;
        for (size_t form = 0; form < forms; form++) {
            for (size_t c = first; c <= last && count < SEARCH_CANDIDATES_MAX; c++) {
                if (!(twin && c > 0 && form == 0)) {
                    list[count++] = (struct search_candidate){kind, c, form};
                }
            }
        }
    }
    return count;
}

/* --- starts --- */

bool search_needs_gas(const struct effect_kind *kind) {
    return effect_has(kind, EFFECT_HOOK_COMMAND) || effect_has(kind, EFFECT_HOOK_GAS);
}

/* Van der Corput's sequence in a base: well spread starts. */
static double spread(size_t index, size_t base) {
    double value = 0.0, share = 1.0 / (double)base;
    for (; index > 0; index /= base, share /= (double)base) {
        value += share * (double)(index % base);
    }
    return value;
}

static double within(const struct effect_parameter *parameter, double share) {
    if (parameter->least > 0.0 && parameter->most / parameter->least > 20.0) {
        return parameter->least * pow(parameter->most / parameter->least, share);
    }
    return parameter->least + share * (parameter->most - parameter->least);
}

size_t search_place_start(const struct effect_kind *kind, size_t k, struct effect *effect) {
    static const size_t bases[EFFECT_PARAMETERS_MAX] = {2, 3, 5};
    bool sign = false;
    size_t secondary = 0;
    for (size_t i = 0; i < kind->parameter_count; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        const double mirrored = 2.0 * parameter->none - parameter->typical;
        sign =
            sign || (!isnan(parameter->none) && mirrored >= parameter->least && mirrored <= parameter->most);
        secondary += isnan(parameter->none) ? 1 : 0;
    }
    for (size_t i = 0; i < kind->parameter_count && k > 0; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        const double mirrored = 2.0 * parameter->none - parameter->typical;
        const bool mirrors =
            !isnan(parameter->none) && mirrored >= parameter->least && mirrored <= parameter->most;
        if (mirrors && k % 2 == 1) {
            effect->parameter[i] = mirrored;
        } else if (isnan(parameter->none)) {
            effect->parameter[i] = within(parameter, 0.1 + 0.8 * spread(k, bases[i]));
        }
    }
    if (k == 1 && !sign && secondary == 0) { /* a small one: some are felt only in proportion near none */
        effect->parameter[0] =
            kind->parameter[0].none + SMALL_SHARE * (kind->parameter[0].typical - kind->parameter[0].none);
    }
    if (kind->by_threshold) {
        static const double share[THRESHOLD_STARTS] = {1.0, 0.6, 0.7, 0.8, 0.9, 1.2};
        effect->parameter[0] =
            kind->parameter[0].none + share[k] * (kind->parameter[0].typical - kind->parameter[0].none);
        return THRESHOLD_STARTS;
    }
    if (kind->age_s != NULL) { /* a tip that pulses with its valves looks nearly the same a period later */
        static const double share[AGE_STARTS] = {1.0, 0.2, 0.35, 0.6, 1.7, 3.0};
        effect->parameter[0] = share[k] * kind->parameter[0].typical;
        return AGE_STARTS;
    }
    if (secondary == 0) {
        return 2;
    }
    return search_needs_gas(kind) ? STARTS_MAX : secondary > 1 ? SEARCH_STARTS_PLACED : STARTS_CHEAP;
}
