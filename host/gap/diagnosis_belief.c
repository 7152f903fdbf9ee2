#include "gap/diagnosis_parts.h"

#include <math.h>
#include <string.h>

#define NINETY_PERCENT 1.645
/* What forms that only nearly fit do to a parameter, as a share of the effect's size: this much, and in
 * proportion to what is left of the gap, as an amplitude. Seen against effects of other forms. */
#define FORM_SHARE 0.006
#define FORM_BY_REST 0.8
#define FACTOR_MOST 3.0 /* of an interval, as a logarithm */
#define BY_CHANCE_SURE 0.95 /* repeats are seen as such */
#define GROUP_LEAST 0.15    /* belief that puts a name into the group */
#define SLUGGISH_SHARE 0.7
/* How often names that had no rival left were right, on data of another plant's causes; and, where an entry of the same
 * stage, or another delay, was left out, as likely as one that nobody tried. */
#define LISTED_SHARE 0.97
#define UNTRIED_SHARE 0.5

static void add_name(struct diagnosis *diagnosis, const char *name, double probability) {
    size_t at = diagnosis->group;
    for (size_t i = 0; i < diagnosis->group; i++) {
        if (strcmp(diagnosis->group_name[i], name) == 0) {
            return;
        }
    }
    if (at == DIAGNOSIS_NAMES_MAX) {
        return;
    }
    diagnosis->group++;
    for (; at > 0 && diagnosis->group_probability[at - 1] < probability; at--) {
        diagnosis->group_name[at] = diagnosis->group_name[at - 1];
        diagnosis->group_probability[at] = diagnosis->group_probability[at - 1];
    }
    diagnosis->group_name[at] = name;
    diagnosis->group_probability[at] = probability;
}

static void name_group(struct diagnosis *diagnosis, const struct rivals *rivals) {
    for (size_t i = 0; i < rivals->count; i++) {
        if (rivals->rival[i].belief >= GROUP_LEAST) {
            add_name(diagnosis, rivals->rival[i].kind->name, rivals->rival[i].belief);
        }
    }
}

/* Residuals' dependence in time makes the fit's own covariance too small by this. */
static double inflation(const struct search *search) {
    const struct fit *fit = &search->best;
    const double mean2 = fit_mean_square(&fit->sums, 1);
    return fmax(mean2, 0.3) * 1.5;
}

/* `form`: what the form of the effect may be off by, one standard deviation. */
static double spread_of(const struct search *search, size_t index, double form) {
    const double variance = fmax(search->everything.covariance[index][index], 0.0);
    return NINETY_PERCENT * sqrt(variance * inflation(search) + form * form);
}

static struct diagnosis_interval interval_of(const struct search *search, size_t index, double value,
                                             double form) {
    const double spread = spread_of(search, index, form);
    return (struct diagnosis_interval){value, value - spread, value + spread};
}

/* How far the forms are seen to be off, by what they leave of the gap as an amplitude, and how far this one may be off
 * unseen: another law with other parameters can fit as well. */
static double form_share(const struct diagnosis *diagnosis, double doubt) {
    const double left = fmax(diagnosis->structure[2], 0.0), all = fmax(diagnosis->structure[1], 1e-9);
    return hypot(FORM_SHARE + FORM_BY_REST * fmin(sqrt(left / all), 1.0), doubt);
}

/* A share of repeated samples is counted, not fitted. */
static struct diagnosis_interval interval_of_share(const struct search *search, double share) {
    const struct gap_repeats repeats = gap_data_repeats(search->data);
    /* repeats come in runs: of lengths spread as widely as their mean is long */
    const double alone = fmax(repeats.samples, 1.0) / (2.0 * repeats.run_samples - 1.0);
    const double spread = NINETY_PERCENT * sqrt(share * (1.0 - share) / alone);
    return (struct diagnosis_interval){share, fmax(share - spread, 0.0), fmin(share + spread, 1.0)};
}

/* A parameter that moves nothing in this recording (a rate per kelvin where the temperature stands still) may
 * be anything. */
static struct diagnosis_interval interval_of_parameter(const struct diagnosis *diagnosis,
                                                       const struct search *search,
                                                       const struct effect *effect, size_t i, size_t index) {
    const struct effect_parameter *parameter = &effect->kind->parameter[i];
    const double value = effect->parameter[i];
    const bool within = value > parameter->least && value < parameter->most;
    if (within && !(search->everything.covariance[index][index] > 0.0)) {
        return (struct diagnosis_interval){isnan(parameter->none) ? value : parameter->none, parameter->least,
                                           parameter->most};
    }
    const bool turns = gap_parameter_turns(parameter);
    const double none = isnan(parameter->none) ? 0.0 : parameter->none;
    const double size = turns ? 1.0 : value - none; /* a bearing has no size: the radian */
    const double spread = spread_of(search, index, form_share(diagnosis, effect->kind->doubt[i]) * size);
    if (turns || parameter->least < none || !(size > 0.0)) {
        return (struct diagnosis_interval){value, value - spread, value + spread};
    }
    /* what has one sign is doubted by a factor: as far down as up */
    const double factor = exp(fmin(spread / size, FACTOR_MOST));
    return (struct diagnosis_interval){value, none + size / factor, none + size * factor};
}

void diagnosis_take_effects(struct diagnosis *diagnosis, const struct search *search) {
    const struct gap_model *model = &search->everything.model;
    size_t index = 2;
    diagnosis->stiffness_scale = interval_of(search, 0, model->stiffness_scale, 5e-4);
    diagnosis->supply_scale = interval_of(search, 1, model->supply_scale, 5e-4);
    if (search->data->from_simulator) { /* its supply is in its pressures: there is nothing to fit */
        diagnosis->supply_scale = (struct diagnosis_interval){1.0, 1.0, 1.0};
    }
    /* without duties nothing shows the supply: the interval is then all that was allowed */
    struct gap_model bounded = *model;
    struct gap_parameter bounds[GAP_PARAMETERS_MAX];
    (void)gap_model_parameters(&bounded, bounds);
    diagnosis->supply_scale.low = fmax(diagnosis->supply_scale.low, bounds[1].least);
    diagnosis->supply_scale.high = fmin(diagnosis->supply_scale.high, bounds[1].most);
    for (size_t e = 0; e < model->count; e++) {
        const struct effect *effect = &model->effect[e];
        struct diagnosis_effect part = {.kind = effect->kind};
        struct diagnosis_effect *out =
            gap_model_is_part(model, e) ? &part : &diagnosis->effect[diagnosis->effects++];
        *out = (struct diagnosis_effect){.kind = effect->kind,
                                         .form = effect->form,
                                         .place = e,
                                         .chamber = effect->chamber,
                                         .onset_s = effect->onset_s,
                                         .latent = effect->latent && effect->onset_s > 0.0};
        for (size_t i = 0; i < effect->kind->parameter_count; i++) {
            const bool counted = effect->kind->by_chance && i == 0;
            out->parameter[i] = counted ? interval_of_share(search, effect->parameter[i])
                                        : interval_of_parameter(diagnosis, search, effect, i, index);
            index += !counted;
        }
    }
}

/* Each kind alone, by its best. */
static void list_single_trials(struct diagnosis *diagnosis, const struct search *search) {
    for (size_t t = 0; t < search->trials; t++) {
        const struct fit *fit = &search->trial[t].fit;
        if (search->trial[t].step != 0 || !fit->sound || gap_model_kinds(&fit->model) != 1) {
            continue;
        }
        struct diagnosis_alternative *list = diagnosis->alternative;
        const struct diagnosis_alternative entry = {&fit->model.effect[0], 0.0, fit_structure(&fit->sums, 1)};
        size_t at = 0;
        while (at < diagnosis->alternatives && list[at].effect->kind != entry.effect->kind) {
            at++;
        }
        const bool fresh = at == diagnosis->alternatives, full = at == DIAGNOSIS_NAMES_MAX;
        at -= full;
        if ((!fresh || full) && list[at].structure <= entry.structure) {
            continue;
        }
        diagnosis->alternatives += fresh && !full;
        for (; at > 0 && list[at - 1].structure > entry.structure; at--) {
            list[at] = list[at - 1];
        }
        list[at] = entry;
    }
}

static void list_rivals(struct diagnosis *diagnosis, const struct rivals *rivals) {
    diagnosis->alternatives = 0;
    for (size_t i = 0; i < rivals->count && i < DIAGNOSIS_NAMES_MAX; i++) {
        const struct rival *rival = &rivals->rival[i];
        diagnosis->alternative[diagnosis->alternatives++] =
            (struct diagnosis_alternative){&rival->effect, rival->belief, fit_structure(&rival->fit.sums, 1)};
    }
}

/* By how much the pressure of a chamber moves, at most in one run. */
double diagnosis_moves_pa(const struct gap_data *data, size_t chamber) {
    double moves_pa = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        const struct gap_run *run = &data->run[i];
        const double *value = run->has_reading      ? run->reading_pa
                              : run->sim_pa != NULL ? run->sim_pa
                                                    : run->command_pa;
        double least = INFINITY, most = -INFINITY;
        for (size_t row = 0; row < run->rows; row++) {
            least = fmin(least, value[3 * row + chamber]); /* a NaN changes neither */
            most = fmax(most, value[3 * row + chamber]);
        }
        moves_pa = fmax(moves_pa, most - least);
    }
    return moves_pa;
}

static bool one_chamber_moves(const struct gap_data *data) {
    size_t moving = 0;
    for (size_t c = 0; c < 3; c++) {
        moving += diagnosis_moves_pa(data, c) > MOVES_LEAST_PA;
    }
    return moving == 1;
}

/* On one chamber a narrow line does just what a sluggish valve does. Where the others flow freely the valve
 * is the likelier; where no other flows, neither is. */
static void share_with_twin(struct diagnosis *diagnosis, struct diagnosis_effect *effect,
                            const struct search *search) {
    const bool valve = strcmp(effect->kind->name, "valve_sluggish") == 0;
    const bool line = strcmp(effect->kind->name, "line_resistance") == 0,
               alone = one_chamber_moves(search->data);
    if (search_leaves_out(search, valve ? "line_resistance" : "valve_sluggish")) {
        return;
    }
    if (!valve && !(line && (alone || effect->chamber > 0))) {
        return;
    }
    const double valve_share = effect->probability * (alone ? 0.5 : SLUGGISH_SHARE);
    add_name(diagnosis, "valve_sluggish", valve_share);
    add_name(diagnosis, "line_resistance", effect->probability - valve_share);
    effect->probability = valve ? valve_share : effect->probability - valve_share;
}

static void believe_effect(struct diagnosis *diagnosis, struct diagnosis_effect *effect,
                           const struct rivals *rivals, const struct search *search) {
    effect->probability = 0.0;
    for (size_t i = 0; i < rivals->count; i++) {
        if (rivals->rival[i].kind == effect->kind) {
            effect->probability = effect->kind->by_chance ? BY_CHANCE_SURE : rivals->rival[i].belief;
        }
    }
    if (effect->probability < SURE) {
        name_group(diagnosis, rivals);
        /* two that each speak for the other under their own weights: neither is left out */
        add_name(diagnosis, effect->kind->name, effect->probability);
    }
    share_with_twin(diagnosis, effect, search);
    list_rivals(diagnosis, rivals);
}

void diagnosis_believe(struct diagnosis *diagnosis, const struct search *search) {
    if (diagnosis->effects == 0) {
        list_single_trials(diagnosis, search);
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        for (size_t r = 0; r < search->rivals_count; r++) {
            if (search->rivals[r].place == diagnosis->effect[e].place) {
                believe_effect(diagnosis, &diagnosis->effect[e], &search->rivals[r], search);
            }
        }
    }
    diagnosis->group = diagnosis->group > 1 ? diagnosis->group : 0;
}

static bool was_left_out(const struct search *search, const struct effect_kind *kind) {
    bool left_out = false;
    for (size_t k = 0; k < effect_kind_count(); k++) {
        const struct effect_kind *other = effect_kind_at(k);
        const bool near = other->stage == kind->stage || (other->delays && kind->delays);
        left_out = left_out || (near && search_leaves_out(search, other->name));
    }
    return left_out;
}

/* The share of a belief among rivals that is left once the cause may be none of them: something that no entry of the
 * catalogue is and that looks like one, or an entry beside it that was not to be tried. */
static double share_of_listed(const struct search *search, const struct effect_kind *kind) {
    return was_left_out(search, kind) ? UNTRIED_SHARE : LISTED_SHARE;
}

void diagnosis_temper(struct diagnosis *diagnosis, const struct search *search) {
    for (size_t e = 0; e < diagnosis->effects; e++) {
        diagnosis->effect[e].probability *= share_of_listed(search, diagnosis->effect[e].kind);
    }
    for (size_t i = 0; i < diagnosis->group; i++) {
        diagnosis->group_probability[i] *= share_of_listed(search, effect_kind_find(diagnosis->group_name[i]));
    }
    for (size_t i = 0; i < diagnosis->alternatives; i++) {
        diagnosis->alternative[i].probability *= share_of_listed(search, diagnosis->alternative[i].effect->kind);
    }
}
