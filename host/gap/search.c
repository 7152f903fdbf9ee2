#include "gap/search.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "gap/baseline.h"

#define STARTS_MAX 4
#define THRESHOLD_STARTS 6
#define STARTS_CHEAP 8        /* where no gas need be replayed */
#define SMALL_SHARE 0.25      /* of the typical size */
#define SCREEN_ROUNDS 1
#define SCREEN_ROUNDS_CHEAP 3
#define REFINE_ROUNDS 6
#define THRESHOLD_ROUNDS 2
#define NOMINAL_ROUNDS 6
#define SETTLED_MAX 5         /* of the refined ones, the best, from a base of their own .. */
#define SETTLE_ROUNDS 4
#define REFINED_GAS_MAX 8     /* of the screened candidates that need gas replayed */
#define REFINED_KIND_MAX 2    /* of each kind */
#define PAIRED_MAX 6          /* the best alone, of which all pairs are tried */
#define GAIN_SHARE 0.03       /* an effect must take off this share of the held-out squares .. */
#define GAIN_SIGMA 40.0       /* .. and so much that noise does not */
#define REPEATS_CERTAIN 0.04  /* share of repeated samples that no noise makes */
#define REPEATS_LEAST 0.02    /* share of repeated samples below which none is frozen */
#define ONSETS 12
#define ONSET_LEAVES 0.5      /* of the structure, at most */
#define ONSET_ROUNDS 4
#define ONSET_FINE_ROUNDS 2
#define UNEXPLAINED_SHARE 0.1 /* of the gap, that an effect without one may leave */
#define LATE_SHARE 0.03       /* of the gap, that an effect with an onset may leave */
#define LAST_PART 0.6         /* of a run: what comes after it is the last part */
#define PLACED_MAX 3          /* of what is found there, of which onsets are sought */
#define ONSET_FINE_S 0.15     /* an onset is not sought closer than that */
#define COMPLETING_SHARE 0.5  /* of what is left, that a further effect must explain */
#define POLISH_SHARE 0.025    /* of the gap, in pressures or at the tip: less than that is left by any form of the right effect */
#define FORM_LEAST 0.0005     /* of the gap: less than that is left by most forms of it, .. */
#define TRACE_LEAST 0.00005   /* .. and less than that by all: no effect is sought for it */
#define MATERIAL_SHARE 0.0003 /* of the whole gap: what is left in one place of a gap that lies in the other is form, .. */
#define ELSEWHERE_SHARE 3e-5  /* .. down to that, if no simple effect explains it whole */
#define WHOLE_SHARE 0.95      /* of such a small rest, that an effect must explain, .. */
#define TRACE_SHARE 0.98      /* .. and of a trace */
#define TRACE_SIGNAL 10.0     /* so many times what is worth explaining at all */
#define STRUCTURE_LEAST 0.2   /* mean square in units of a block's noise that is worth explaining */
#define FAINT_LEFT 0.25        /* of a faint gap: more than that left means that something else was meant */
#define FAINT 1.5             /* mean square below which a first effect, too, must explain most of what there is */
#define PART_COST 0.03        /* an effect more must better the fit by that to go before, ... */
#define FORM_COST 0.003       /* ... a form more of the same by that */
#define REVISIONS 3
#define DISBELIEVED 0.1       /* an effect that its rivals leave so little belief gives way to the best of them */
#define DOUBTED 0.65          /* a further effect that its rivals leave less is left out, if the others .. */
#define EXPLAINED_SHARE 0.03  /* .. leave no more than that of the gap by themselves */
#define SHORTLIST 10          /* of the candidates that act on the gas; the best variant of each kind besides */

struct candidate {
    const struct effect_kind *kind;
    size_t chamber;
    size_t form;
};

/* --- the catalogue --- */

static bool is_without(const struct search_options *options, const char *name) {
    for (size_t i = 0; i < options->without_count; i++) {
        if (strcmp(options->without[i], name) == 0) {
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

/* Can the data tell anything of this effect at all? */
static bool can_show(const struct gap_data *data, const struct effect_kind *kind) {
    const bool duties = has_everywhere(data, offsetof(struct gap_run, has_duty));
    const bool readings = has_everywhere(data, offsetof(struct gap_run, has_reading));
    const bool tips = data->run[0].tips > 0;
    if (data->from_simulator && gap_baseline_why_not(data, kind) != NULL) {
        return false;
    }
    if (kind->by_chance) {
        return gap_data_repeated_share(data) > REPEATS_LEAST;
    }
    if (gap_effect_downstream(kind)) {
        return tips;
    }
    if (kind->stage == EFFECT_STAGE_PRESSURE_SENSOR) {
        return readings && (duties || tips);
    }
    return duties && (readings || tips);
}

static size_t list_candidates(const struct search *search, struct candidate *list) {
    size_t count = 0;
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        if (is_without(&search->options, kind->name) || !can_show(search->data, kind)) {
            continue;
        }
        const bool twin = strcmp(kind->name, "line_resistance") == 0 && !is_without(&search->options, "valve_sluggish");
        const size_t first = kind->scope == EFFECT_ONE_CHAMBER ? 1 : 0, last = kind->scope == EFFECT_GLOBAL ? 0 : 3;
        const size_t forms = (kind->forms > 1 ? kind->forms : 1) + kind->forms_add;
        for (size_t form = 0; form < forms; form++) {
            for (size_t c = first; c <= last && count < SEARCH_CANDIDATES_MAX; c++) {
                if (!(twin && c > 0 && form == 0)) {
                    list[count++] = (struct candidate){kind, c, form};
                }
            }
        }
    }
    return count;
}

static bool needs_gas(const struct effect_kind *kind) {
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

/* The k-th start: typical; the other way round; then secondary parameters spread over their bounds. */
static size_t place_start(const struct effect_kind *kind, size_t k, struct effect *effect) {
    static const size_t bases[EFFECT_PARAMETERS_MAX] = {2, 3, 5};
    bool sign = false, secondary = false;
    for (size_t i = 0; i < kind->parameter_count; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        const double mirrored = 2.0 * parameter->none - parameter->typical;
        sign = sign || (!isnan(parameter->none) && mirrored >= parameter->least && mirrored <= parameter->most);
        secondary = secondary || isnan(parameter->none);
    }
    for (size_t i = 0; i < kind->parameter_count && k > 0; i++) {
        const struct effect_parameter *parameter = &kind->parameter[i];
        const double mirrored = 2.0 * parameter->none - parameter->typical;
        const bool mirrors = !isnan(parameter->none) && mirrored >= parameter->least && mirrored <= parameter->most;
        if (mirrors && k % 2 == 1) {
            effect->parameter[i] = mirrored;
        } else if (isnan(parameter->none)) {
            effect->parameter[i] = within(parameter, 0.1 + 0.8 * spread(k, bases[i]));
        }
    }
    if (k == 1 && !sign && !secondary) { /* a small one: some are felt only in proportion near none */
        effect->parameter[0] = kind->parameter[0].none + SMALL_SHARE * (kind->parameter[0].typical - kind->parameter[0].none);
    }
    if (kind->by_threshold) {
        static const double share[THRESHOLD_STARTS] = {1.0, 0.6, 0.7, 0.8, 0.9, 1.2};
        effect->parameter[0] = kind->parameter[0].none + share[k] * (kind->parameter[0].typical - kind->parameter[0].none);
        return THRESHOLD_STARTS;
    }
    return !secondary ? 2 : needs_gas(kind) ? STARTS_MAX : STARTS_CHEAP;
}

/* --- fits --- */

static double held_out(const struct fit *fit) {
    return fit->sound ? fit_squares(&fit->sums, 1) : INFINITY;
}

/* For an order: of two that explain the same, the one with fewer parts goes first. */
static double rank(const struct fit *fit) {
    return held_out(fit) *
           (1.0 + PART_COST * (double)gap_model_kinds(&fit->model) + FORM_COST * (double)fit->model.count);
}

static double held_out_count(const struct fit *fit) {
    return fit_count(&fit->sums, 1);
}

static void add_effect(struct gap_model *model, const struct effect *effect) {
    model->effect[model->count++] = *effect;
}

static void screen(struct fitter *fitter, const struct search *search, const struct gap_model *onto,
                   const struct candidate *candidate, struct fit *best) {
    size_t starts = 1;
    *best = (struct fit){.sound = false};
    for (size_t k = 0; k < starts; k++) {
        struct fit fit = {.model = *onto};
        struct effect effect;
        effect_init(&effect, candidate->kind);
        effect.chamber = candidate->chamber;
        effect.form = candidate->form;
        effect.onset_s = search->onset_s;
        starts = place_start(candidate->kind, k, &effect);
        if (candidate->kind->by_chance) {
            effect.parameter[0] = gap_data_repeated_share(search->data);
        }
        const bool all_forms = candidate->form > 0 && candidate->form == candidate->kind->forms;
        effect.form = all_forms ? 0 : effect.form;
        add_effect(&fit.model, &effect);
        for (size_t form = 1; all_forms && form < candidate->kind->forms && fit.model.count < GAP_EFFECTS_MAX; form++) {
            effect.form = form;
            add_effect(&fit.model, &effect);
        }
        fitter_run(fitter, &fit, needs_gas(candidate->kind) ? SCREEN_ROUNDS : SCREEN_ROUNDS_CHEAP, true);
        const double mine = fit_squares(&fit.sums, 0), least = fit_squares(&best->sums, 0);
        if (fit.sound && (!best->sound || mine < least)) {
            *best = fit;
        }
    }
}

struct crew {
    struct fitter *fitter;
    int count;
};

static void crew_close(struct crew *crew) {
    for (int i = 0; i < crew->count; i++) {
        fitter_close(&crew->fitter[i]);
    }
    free(crew->fitter);
    *crew = (struct crew){NULL, 0};
}

static bool crew_open(struct crew *crew, const struct search *search, const struct fit_base *base) {
    crew->count = 0;
    const int wanted = search->options.threads > 0 ? search->options.threads : omp_get_max_threads();
    crew->fitter = calloc((size_t)wanted, sizeof *crew->fitter);
    if (crew->fitter == NULL) {
        return false;
    }
    while (crew->count < wanted && fitter_open(&crew->fitter[crew->count], base)) {
        crew->count++;
    }
    return crew->count == wanted;
}

static bool stopped(const struct search *search) {
    return search->options.stop != NULL && *search->options.stop != 0;
}

static void say(const struct search *search, const char *what, size_t done, size_t total) {
    if (search->options.progress != NULL) {
#pragma omp critical(search_progress)
        search->options.progress(search->options.context, what, done, total);
    }
}

static int by_held_out(const void *a, const void *b) {
    const double x = rank(*(const struct fit *const *)a), y = rank(*(const struct fit *const *)b);
    return (x > y) - (x < y);
}

static size_t model_has(const struct gap_model *model, const struct effect_kind *kind, size_t form, size_t chamber) {
    size_t found = 0;
    for (size_t e = 0; e < model->count; e++) {
        const struct effect *effect = &model->effect[e];
        found += effect->kind == kind && effect->form == form && (effect->chamber == chamber || effect->chamber == 0 || chamber == 0);
    }
    return found;
}

/* The gas is dear to replay. One replay of each kind on all chambers tells, to first order, what it could do on each; only
 * the most promising are then tried in earnest. Marks the others as not wanted. */
static void shortlist(struct search *search, struct crew *crew, const struct candidate *list, size_t count, bool *wanted) {
    double gain[SEARCH_CANDIDATES_MAX] = {0.0};
    struct fitter *first = &crew->fitter[0];
    double *base_residual = malloc(search->replay.residuals * sizeof *base_residual);
    for (size_t i = 0; i < count; i++) {
        wanted[i] = true;
    }
    if (base_residual == NULL || !search->data->run[0].has_duty) {
        free(base_residual);
        return;
    }
    fitter_evaluate(first, &search->best.model);
    memcpy(base_residual, first->residual, search->replay.residuals * sizeof *base_residual);
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t i = 0; i < count; i++) {
        const struct effect_kind *kind = list[i].kind;
        const bool on_gas = needs_gas(kind);
        if (!on_gas || (i > 0 && list[i - 1].kind == kind && list[i - 1].form == list[i].form)) {
            continue;
        }
        size_t starts = 1;
        for (size_t k = 0; k < starts && (k < 2 || kind->by_threshold); k++) {
            struct effect effect;
            double mine[4];
            effect_init(&effect, kind);
            effect.chamber = 0;
            effect.form = list[i].form;
            effect.onset_s = search->onset_s;
            starts = place_start(kind, k, &effect);
            fitter_linear(&crew->fitter[omp_get_thread_num()], crew->fitter[0].base, base_residual, &effect, mine);
            for (size_t j = i; j < count && list[j].kind == kind && list[j].form == list[i].form; j++) {
                gain[j] = fmax(gain[j], mine[list[j].chamber]);
            }
        }
    }
    for (size_t i = 0; i < count; i++) {
        const struct effect_kind *kind = list[i].kind;
        size_t above = 0, own_above = 0;
        for (size_t j = 0; j < count; j++) {
            const bool more = gain[j] > gain[i] || (j < i && gain[j] == gain[i]);
            above += more;
            own_above += more && list[j].kind == kind;
        }
        const bool on_gas = needs_gas(kind);
        wanted[i] = !on_gas || above < SHORTLIST || own_above == 0;
    }
    free(base_residual);
}

/* All candidates on top of `onto`, coarsely; `order` gets those that are not hopeless, best first. */
static size_t screen_all(struct search *search, struct crew *crew, const struct gap_model *onto,
                         const struct candidate *list, size_t count, struct fit *fits, struct fit **order) {
    size_t done = 0, kept = 0;
    bool wanted[SEARCH_CANDIDATES_MAX];
    shortlist(search, crew, list, count, wanted);
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t i = 0; i < count; i++) {
        fits[i] = (struct fit){.sound = false};
        if (wanted[i] && !stopped(search) && model_has(onto, list[i].kind, list[i].form, list[i].chamber) == 0) {
            screen(&crew->fitter[omp_get_thread_num()], search, onto, &list[i], &fits[i]);
        }
        size_t now;
#pragma omp atomic capture
        now = ++done;
        say(search, list[i].kind->name, now, count);
    }
    for (size_t i = 0; i < count; i++) {
        if (fits[i].sound) {
            order[kept++] = &fits[i];
        }
    }
    qsort(order, kept, sizeof *order, by_held_out); // NOLINT(bugprone-sizeof-expression): pointers are sorted
    return kept;
}

/* Keeps those worth a closer fit, best first: of each kind a few, and of those that are dear to replay a few. */
static size_t choose(struct fit **order, size_t count) {
    size_t kept = 0, dear = 0;
    for (size_t i = 0; i < count && order[i] != NULL; i++) {
        const struct effect_kind *kind = order[i]->model.effect[order[i]->model.count - 1].kind;
        size_t same = 0;
        for (size_t j = 0; j < kept; j++) {
            same += order[j]->model.effect[order[j]->model.count - 1].kind == kind;
        }
        if (same < REFINED_KIND_MAX && (!needs_gas(kind) || dear < REFINED_GAS_MAX)) {
            dear += needs_gas(kind);
            order[kept++] = order[i];
        }
    }
    return kept;
}

/* A base tells of other stiffnesses and supplies to first order. The best are fitted again from where they stand. */
static void settle(struct search *search, struct crew *crew, struct fit **order, size_t count) {
    const size_t most = count < SETTLED_MAX ? count : SETTLED_MAX;
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t i = 0; i < most; i++) {
        if (!stopped(search)) {
            (void)fit_rebased(&search->replay, &search->coarse, order[i], SETTLE_ROUNDS);
        }
    }
    qsort(order, count, sizeof *order, by_held_out); // NOLINT(bugprone-sizeof-expression): pointers are sorted
}

/* Derivatives do not lead to a threshold: single pulses lie on this side of it or on that. It is stepped to from both sides. */
static void step_to_threshold(struct fitter *fitter, struct fit *fit) {
    static const double steps[] = {0.96, 0.98, 0.99, 1.01, 1.02, 1.04};
    for (size_t e = 0; e < fit->model.count; e++) {
        const struct fit start = *fit;
        for (size_t k = 0; k < sizeof steps / sizeof steps[0] && start.model.effect[e].kind->by_threshold; k++) {
            struct fit trial = start;
            trial.model.effect[e].parameter[0] *= steps[k];
            fitter_run(fitter, &trial, THRESHOLD_ROUNDS, true);
            if (trial.sound && fit_squares(&trial.sums, 0) < fit_squares(&fit->sums, 0)) {
                *fit = trial;
            }
        }
    }
}

static void refine(struct search *search, struct crew *crew, struct fit **order, size_t count, size_t step) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t i = 0; i < count; i++) {
        if (!stopped(search)) {
            fitter_run(&crew->fitter[omp_get_thread_num()], order[i], REFINE_ROUNDS, true);
            step_to_threshold(&crew->fitter[omp_get_thread_num()], order[i]);
        }
    }
    qsort(order, count, sizeof *order, by_held_out); // NOLINT(bugprone-sizeof-expression): pointers are sorted
    settle(search, crew, order, count);
    for (size_t i = 0; i < count && search->trials < SEARCH_TRIED_MAX; i++) {
        search->trial[search->trials++] = (struct search_trial){*order[i], step};
    }
}

/* Mean square of the held-out residuals less what noise alone makes: what is left to explain. */
static double structure(const struct fit *fit) {
    return fmax(fit_structure(&fit->sums, 1), 0.0);
}

/* Does the second explain so much more that its effect may have a place? */
static bool is_better(const struct fit *before, const struct fit *after) {
    const double gain = held_out(before) - held_out(after);
    const double noise = fmax(held_out(after) / held_out_count(after), 0.2);
    const double worth = fmin(GAIN_SHARE * held_out(before), COMPLETING_SHARE * structure(before) * held_out_count(before));
    return gain > worth && gain > GAIN_SIGMA * noise;
}

/* Is there more left, in pressures or at the tip, than the noise, than a share of the gap there and than one of the whole? */
static bool is_left(const struct search *search, const struct fit *fit, enum fit_group group, double share, double of_whole) {
    const double all = fit_structure_of(&search->recalibrated.sums, 1, group);
    const double least = fmax(share * all, of_whole * structure(&search->recalibrated));
    return fit_structure_of(&fit->sums, 1, group) > fmax(STRUCTURE_LEAST, least);
}

static size_t parts_of(const struct fit *fit, const struct effect_kind *kind) {
    size_t parts = 0;
    for (size_t e = 0; e < fit->model.count; e++) {
        parts += fit->model.effect[e].kind == kind;
    }
    return parts;
}

/* What the second has and the first does not: the last such effect; the last of all where it has only more of the same. */
static size_t added(const struct fit *before, const struct fit *after) {
    size_t place = after->model.count - 1;
    while (place > 0 && parts_of(before, after->model.effect[place].kind) > 0) {
        place--;
    }
    return parts_of(before, after->model.effect[place].kind) > 0 ? after->model.count - 1 : place;
}

/* A further effect must be the rest of the explanation, of the pressures or of the tip; not polish on a form that only nearly
 * fits. A small rest may as well be the form: of that, a simple effect must explain nearly all, as no form's error is likely to be
 * just what another effect does. */
static bool completes(const struct search *search, const struct fit *before, const struct fit *after) {
    const struct effect_kind *kind = after->model.effect[added(before, after)].kind;
    const bool simple = parts_of(after, kind) == 1;
    bool any = false;
    for (int g = gap_effect_upstream(kind) ? FIT_PRESSURE : FIT_TIP; g < FIT_GROUPS; g++) {
        const enum fit_group group = (enum fit_group)g;
        const double left = fit_structure_of(&before->sums, 1, group), then = fit_structure_of(&after->sums, 1, group);
        const bool halves = then < (1.0 - COMPLETING_SHARE) * left;
        const bool whole = left > 3.0 * STRUCTURE_LEAST && then < fmax((1.0 - WHOLE_SHARE) * left, STRUCTURE_LEAST);
        const bool trace = left > TRACE_SIGNAL * STRUCTURE_LEAST && then < (1.0 - TRACE_SHARE) * left;
        any = any || (is_left(search, before, group, POLISH_SHARE, MATERIAL_SHARE) && halves) ||
              (simple && ((is_left(search, before, group, FORM_LEAST, ELSEWHERE_SHARE) && whole) ||
                                    (is_left(search, before, group, TRACE_LEAST, ELSEWHERE_SHARE) && trace)));
    }
    return any;
}

/* The same kind twice, though its forms are alternatives and do not add up. */
static bool repeats_kind(const struct gap_model *model) {
    for (size_t i = 0; i < model->count; i++) {
        for (size_t j = 0; j < i; j++) {
            if (model->effect[i].kind == model->effect[j].kind && !model->effect[i].kind->forms_add &&
                model->effect[i].chamber == model->effect[j].chamber) {
                return true;
            }
        }
    }
    return false;
}

static bool earns_place(const struct search *search, const struct fit *before, const struct fit *after) {
    if (before->model.count == 0) {
        const bool all_of_it = structure(after) < FAINT_LEFT * structure(before);
        return is_better(before, after) && (all_of_it || structure(before) > FAINT);
    }
    const size_t place = added(before, after);
    const bool adds = after->model.effect[place].kind->forms_add || gap_model_is_part(&after->model, place);
    if (adds && gap_model_kinds(&after->model) <= gap_model_kinds(&before->model) && !repeats_kind(&after->model)) {
        return is_better(before, after); /* more of the same kind */
    }
    return is_better(before, after) && completes(search, before, after) && !repeats_kind(&after->model);
}

/* Is what the model leaves more than noise? */
static bool is_structured(const struct fit *fit) {
    return fit_structure_of(&fit->sums, 1, FIT_PRESSURE) > STRUCTURE_LEAST ||
           fit_structure_of(&fit->sums, 1, FIT_TIP) > STRUCTURE_LEAST;
}

/* What the recalibrated model leaves under the present smoothing and weights, by which the rest is judged. */
static bool compare_again(struct search *search) {
    struct fit_base base;
    struct fitter fitter;
    bool sound = fit_base_open(&base, &search->replay, NULL, &search->recalibrated.model);
    if (sound) {
        sound = fitter_open(&fitter, &base);
        if (sound) {
            fitter_run(&fitter, &search->recalibrated, 0, false);
            fitter_close(&fitter);
        }
        fit_base_close(&base);
    }
    return sound;
}

/* Fit both scales; smoothing and weights follow the model that comes out. */
static bool recalibrate(struct search *search, struct fit *fit, bool fit_nominal) {
    struct replay_state state;
    struct fit_base base;
    struct fitter fitter;
    bool sound = replay_state_open(&state, &search->replay);
    for (int round = 0; round < 3 && sound; round++) {
        sound = replay_tune(&search->replay, &fit->model, &state) && fit_base_open(&base, &search->replay, NULL, &fit->model);
        if (!sound) {
            break;
        }
        sound = fitter_open(&fitter, &base);
        if (sound) {
            fitter_run(&fitter, fit, fit_nominal ? NOMINAL_ROUNDS : 0, fit_nominal);
            fitter_close(&fitter);
        }
        fit_base_close(&base);
    }
    replay_state_close(&state, &search->replay);
    replay_follow(&search->coarse, &search->replay);
    return sound && (fit != &search->best || compare_again(search));
}

static bool is_later_form(const struct gap_model *model, size_t e) {
    for (size_t i = 0; i < e; i++) {
        if (model->effect[i].kind == model->effect[e].kind && model->effect[e].kind->forms_add) {
            return true;
        }
    }
    return false;
}

/* All forms of a kind whose forms add up set in together. */
static void set_onset(struct gap_model *model, size_t e, double onset_s) {
    const struct effect_kind *kind = model->effect[e].kind;
    for (size_t i = 0; i < model->count; i++) {
        if (i == e || (kind->forms_add && model->effect[i].kind == kind)) {
            model->effect[i].onset_s = onset_s;
        }
    }
}

/* An onset within a block that is held out shows in that block only, and one outside in none of these. */
static double all_squares(const struct fit *fit) {
    return fit->sound ? fit_squares(&fit->sums, 0) + fit_squares(&fit->sums, 1) : INFINITY;
}

/* The same effect from each of these onsets; the best of them. */
static const struct fit *try_onsets(struct crew *crew, const struct fit *start, size_t e, double first_s, double step_s, int rounds,
                                    struct fit trial[ONSETS]) {
    size_t best = 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t k = 0; k < ONSETS; k++) {
        trial[k] = *start;
        set_onset(&trial[k].model, e, fmax(first_s + step_s * (double)k, 0.0));
        fitter_run(&crew->fitter[omp_get_thread_num()], &trial[k], rounds, true);
    }
    for (size_t k = 1; k < ONSETS; k++) {
        best = all_squares(&trial[k]) < all_squares(&trial[best]) ? k : best;
    }
    return &trial[best];
}

/* When did each effect set in? Tried on a grid, then closer and closer; kept where it explains more. */
static void find_onset(struct crew *crew, double end_s, size_t e, struct fit *fit) {
    struct fit trial[ONSETS];
    const struct fit before = *fit;
    double width_s = end_s / (ONSETS + 1.0);
    const struct fit *best = try_onsets(crew, &before, e, width_s, width_s, ONSET_ROUNDS, trial);
    if (!is_better(&before, best)) {
        return;
    }
    *fit = *best;
    while (width_s > ONSET_FINE_S) {
        const struct fit centre = *fit;
        const double first_s = centre.model.effect[e].onset_s - width_s;
        best = try_onsets(crew, &centre, e, first_s, 2.0 * width_s / (ONSETS - 1.0), ONSET_FINE_ROUNDS, trial);
        *fit = all_squares(best) < all_squares(fit) ? *best : *fit;
        width_s *= 0.4;
    }
    /* a real onset leaves little; a form that is somewhat off gains a little by any */
    if (before.model.effect[e].onset_s == 0.0 && structure(fit) > ONSET_LEAVES * structure(&before)) {
        *fit = before;
    }
}

/* To the end of the longest run. */
static double longest_s(const struct gap_data *data) {
    double end_s = 0.0;
    for (size_t i = 0; i < data->runs; i++) {
        end_s = fmax(end_s, data->run[i].time_s[data->run[i].rows - 1]);
    }
    return end_s;
}

static void find_onsets(struct search *search, struct crew *crew, struct fit *fit) {
    const double end_s = longest_s(search->data);
    for (size_t e = 0; e < fit->model.count && !stopped(search); e++) {
        if (!is_later_form(&fit->model, e)) { /* its forms belong together */
            find_onset(crew, end_s, e, fit);
        }
    }
}

/* Each pair of the best alone, from where each ended alone. */
static size_t pair_up(struct fit *const *single, size_t singles, struct fit *pairs) {
    size_t count = 0;
    for (size_t i = 0; i < singles; i++) {
        for (size_t j = i + 1; j < singles; j++) {
            const struct effect *other = &single[j]->model.effect[0];
            const bool whole = single[i]->model.count > 1 || single[j]->model.count > 1;
            if (!whole && model_has(&single[i]->model, other->kind, other->form, other->chamber) == 0) {
                pairs[count] = (struct fit){.model = single[i]->model};
                add_effect(&pairs[count].model, other);
                count++;
            }
        }
    }
    return count;
}

struct workspace {
    struct candidate list[SEARCH_CANDIDATES_MAX];
    size_t candidates;
    struct fit fits[SEARCH_CANDIDATES_MAX];
    struct fit *order[SEARCH_CANDIDATES_MAX];
    struct fit single[PAIRED_MAX];
    size_t singles;
    struct fit pairs[PAIRED_MAX * PAIRED_MAX];
    struct fit *pair_order[PAIRED_MAX * PAIRED_MAX];
};

/* One more effect on top of the best model. True: one was found. */
static bool add_one(struct search *search, struct workspace *room, size_t step) {
    struct fit_base base;
    struct crew crew = {NULL, 0};
    struct fit next = search->best;
    bool found = false;
    if (fit_base_open(&base, &search->replay, &search->coarse, &search->best.model) && crew_open(&crew, search, &base)) {
        size_t count = screen_all(search, &crew, &search->best.model, room->list, room->candidates, room->fits, room->order);
        count = choose(room->order, count);
        refine(search, &crew, room->order, count, step);
        for (size_t i = 0; i < count && !found; i++) {
            found = earns_place(search, &search->best, room->order[i]);
            next = found ? *room->order[i] : next;
        }
        for (size_t i = 0; step == 0 && i < count && i < PAIRED_MAX; i++) {
            room->single[room->singles++] = *room->order[i];
        }
        if (step == 1 && room->singles > 1) {
            struct fit *singles[PAIRED_MAX];
            for (size_t i = 0; i < room->singles; i++) {
                singles[i] = &room->single[i];
            }
            const size_t pairs = pair_up(singles, room->singles, room->pairs);
            for (size_t i = 0; i < pairs; i++) {
                room->pair_order[i] = &room->pairs[i];
            }
            say(search, "pairs", 0, pairs);
            refine(search, &crew, room->pair_order, pairs, step);
            if (pairs > 0 && held_out(room->pair_order[0]) < held_out(&next) &&
                earns_place(search, &search->best, room->pair_order[0])) {
                next = *room->pair_order[0];
                found = true;
            }
        }
        if (found && is_structured(&next) && !stopped(search)) {
            find_onsets(search, &crew, &next);
        }
    }
    crew_close(&crew);
    fit_base_close(&base);
    search->best = next;
    return found;
}

/* Leave out again what no longer earns its place. */
static void drop_idle(struct search *search) {
    struct fit_base base;
    struct crew crew = {NULL, 0};
    bool dropped = search->best.model.count > 1;
    while (dropped) {
        dropped = false;
        for (size_t e = 0; e < search->best.model.count && search->best.model.count > 1; e++) {
            struct fit without = search->best;
            if (without.model.effect[e].kind->by_chance) {
                continue; /* seen as such */
            }
            memmove(&without.model.effect[e], &without.model.effect[e + 1],
                    (without.model.count - e - 1) * sizeof without.model.effect[0]);
            without.model.count--;
            if (fit_base_open(&base, &search->replay, &search->coarse, &without.model) && crew_open(&crew, search, &base)) {
                fitter_run(&crew.fitter[0], &without, REFINE_ROUNDS, true);
            }
            crew_close(&crew);
            fit_base_close(&base);
            if (!earns_place(search, &without, &search->best)) {
                search->best = without;
                dropped = true;
                break;
            }
        }
    }
}

static bool prepare(struct search *search) {
    struct replay_state state;
    const bool sound = replay_state_open(&state, &search->replay) &&
                       replay_prepare(&search->replay, &search->nominal.model, &state);
    replay_state_close(&state, &search->replay);
    return sound;
}

/* What the reports say of parameters comes from all the data. */
static bool fit_everything(struct search *search) {
    struct fit_base base;
    struct fitter fitter;
    bool sound = fit_base_open(&base, &search->replay, NULL, &search->best.model);
    search->everything = search->best;
    if (sound) {
        sound = fitter_open(&fitter, &base);
        if (sound) {
            fitter.use_all = true;
            fitter.wants_covariance = true;
            fitter_run(&fitter, &search->everything, REFINE_ROUNDS, true);
            fitter_close(&fitter);
        }
        fit_base_close(&base);
    }
    return sound;
}

/* Repeated samples are seen as such: no fit has to find them. They count where the poses are better explained by them: a
 * log that is written more often than the sensor measures has them too. */
static bool take_repeats(struct search *search, size_t step) {
    const struct effect_kind *kind = effect_kind_find("tip_freeze");
    const double share = gap_data_repeated_share(search->data);
    const bool known = kind == NULL || is_without(&search->options, kind->name) || model_has(&search->best.model, kind, 0, 0) > 0;
    if (known || share < REPEATS_CERTAIN || search->best.model.count == GAP_EFFECTS_MAX) {
        return true;
    }
    struct effect effect;
    struct fit with = search->best;
    effect_init(&effect, kind);
    effect.parameter[0] = share;
    add_effect(&with.model, &effect);
    const bool sound = recalibrate(search, &with, true);
    const double noise = fmax(held_out(&with) / held_out_count(&with), 0.2);
    if (sound && held_out(&with) < held_out(&search->best) - GAIN_SIGMA * noise) {
        search->best = with;
        search->trial[search->trials++] = (struct search_trial){with, step};
        return compare_again(search);
    }
    return sound && recalibrate(search, &search->best, true);
}

static double belief_in_held(const struct search *search, const struct rivals *rivals) {
    const struct effect_kind *held = search->best.model.effect[rivals->place].kind;
    for (size_t i = 0; i < rivals->count; i++) {
        if (rivals->rival[i].kind == held) {
            return rivals->rival[i].belief;
        }
    }
    return 0.0;
}

/* What the comparison with rivals asks for: the rival that is believed in an effect's place, or the model without an effect that
 * could as well be others and is not needed. NULL: nothing. */
static const struct fit *ask_rivals(const struct search *search) {
    const double all = structure(&search->recalibrated);
    for (size_t r = 0; r < search->rivals_count; r++) {
        const struct rivals *rivals = &search->rivals[r];
        const bool by_chance = search->best.model.effect[rivals->place].kind->by_chance;
        if (!by_chance && rivals->count > 1 && belief_in_held(search, rivals) < DISBELIEVED) {
            return &rivals->rival[0].fit;
        }
    }
    for (size_t r = 0; r < search->rivals_count; r++) {
        const struct rivals *rivals = &search->rivals[r];
        const bool by_chance = search->best.model.effect[rivals->place].kind->by_chance;
        if (!by_chance && rivals->rest.sound && rivals->rest.model.count > 0 && belief_in_held(search, rivals) < DOUBTED &&
            structure(&rivals->rest) < STRUCTURE_LEAST + EXPLAINED_SHARE * all) {
            return &rivals->rest;
        }
    }
    return NULL;
}

/* Rivals are compared under the final weights: what they show may overturn what the search took on its way. */
static bool compare_rivals(struct search *search) {
    bool sound = true;
    for (size_t round = 0; round <= REVISIONS && sound && !stopped(search) && search->best.model.count > 0; round++) {
        say(search, "rivals", round, REVISIONS);
        sound = rivals_find(search);
        const struct fit *asked = sound && round < REVISIONS ? ask_rivals(search) : NULL;
        if (asked == NULL) {
            break;
        }
        search->best = *asked;
        sound = recalibrate(search, &search->best, true);
    }
    return sound;
}

/* What the best model leaves of the gap. */
static double share_left(const struct search *search) {
    return structure(&search->best) / fmax(structure(&search->recalibrated), STRUCTURE_LEAST);
}

/* All candidates once more, from that time on; better than `least`, and the best becomes it. */
static void try_from(struct search *search, struct workspace *room, double onset_s, struct fit *least) {
    search->onset_s = onset_s;
    search->best = search->recalibrated;
    room->singles = 0;
    if (add_one(search, room, 0) && held_out(&search->best) < held_out(least)) {
        *least = search->best;
    }
    search->onset_s = 0.0;
}

static void forget_blocks(struct replay *replay, size_t at, size_t blocks, size_t channels) {
    for (size_t k = 0; k < (size_t)(LAST_PART * (double)blocks) * channels; k++) {
        replay->weight[at + k] = 0.0;
    }
}

/* Until the weights are tuned again, only the last part of each run counts. */
static void look_at_last_part(struct search *search) {
    for (size_t i = 0; i < search->replay.runs; i++) {
        const struct replay_run *run = &search->replay.run[i];
        forget_blocks(&search->replay, run->pressure_at, run->blocks, 3);
        forget_blocks(&search->replay, run->supply_at, run->blocks, 1);
        forget_blocks(&search->replay, run->tip_at, run->tip_blocks, REPLAY_TIP_CHANNELS);
    }
    replay_follow(&search->coarse, &search->replay);
}

/* The onsets of what was found without them; better than `least`, and the best becomes it. */
static void place_onsets(struct search *search, const struct workspace *room, struct fit *least) {
    struct fit_base base;
    struct crew crew = {NULL, 0};
    const double end_s = longest_s(search->data);
    if (fit_base_open(&base, &search->replay, &search->coarse, &search->recalibrated.model) && crew_open(&crew, search, &base)) {
        for (size_t i = 0; i < room->singles && i < PLACED_MAX && !stopped(search); i++) {
            struct fit fit = room->single[i];
            fit.model.stiffness_scale = search->recalibrated.model.stiffness_scale;
            fit.model.supply_scale = search->recalibrated.model.supply_scale;
            fitter_run(&crew.fitter[0], &fit, ONSET_ROUNDS, true);
            find_onset(&crew, end_s, 0, &fit);
            if (fit.sound && held_out(&fit) < held_out(least)) {
                *least = fit;
            }
        }
    }
    crew_close(&crew);
    fit_base_close(&base);
}

/* An effect that set in before the last part of the runs acts throughout it: there it is found as if it always did. */
static bool try_last_part(struct search *search, struct workspace *room, struct fit *least) {
    look_at_last_part(search);
    bool sound = compare_again(search);
    search->best = search->recalibrated;
    room->singles = 0;
    (void)(sound && add_one(search, room, 0));
    sound = sound && recalibrate(search, &search->recalibrated, true);
    if (sound) {
        place_onsets(search, room, least);
    }
    return sound;
}

/* An effect that sets in late is taken for another while candidates act from the start. Where much is left, all are tried
 * again from the onset that was found, or where none was, on the last part of the recording. */
static bool search_after_onset(struct search *search, struct workspace *room) {
    const struct fit before = search->best;
    const double left = share_left(search);
    const bool late = before.model.count > 0 && before.model.effect[0].onset_s > 0.0;
    if (left < (late ? LATE_SHARE : UNEXPLAINED_SHARE) || structure(&before) < STRUCTURE_LEAST || stopped(search)) {
        return true;
    }
    bool sound = recalibrate(search, &search->recalibrated, true);
    struct fit least = search->recalibrated;
    if (late && sound) {
        try_from(search, room, before.model.effect[0].onset_s, &least);
    }
    sound = sound && try_last_part(search, room, &least);
    search->best = least;
    sound = sound && (least.model.count == 0 || recalibrate(search, &search->best, true));
    if (!sound || least.model.count == 0 || share_left(search) > left) {
        search->best = before;
        sound = sound && recalibrate(search, &search->best, true);
    }
    return sound;
}

/* What changes pressures only slightly shows best at the tip, once the pressures are taken to be what the duties make of them:
 * near ninety degrees a few pascals turn it more than its sensor errs. */
static bool look_closer(struct search *search, struct workspace *room) {
    search->replay.rigid = true;
    search->trials = 0;
    room->singles = 0;
    const struct gap_model plain = {.stiffness_scale = 1.0, .supply_scale = 1.0};
    search->nominal.model = plain;
    bool sound = recalibrate(search, &search->nominal, false) && recalibrate(search, &search->recalibrated, true);
    search->best = search->recalibrated;
    for (size_t step = 0; step < 2 && sound && !stopped(search) && is_structured(&search->best); step++) {
        if (!add_one(search, room, step)) {
            break;
        }
        sound = recalibrate(search, &search->best, true) && (step > 0 || search_after_onset(search, room));
    }
    return sound;
}

static bool all_have_duties(const struct gap_data *data) {
    return has_everywhere(data, offsetof(struct gap_run, has_duty)) && data->run[0].tips > 0;
}

bool search_run(struct search *search, const struct gap_data *data, const struct bend_table *table,
                const struct plant_parameters *nominal, const struct search_options *options) {
    struct workspace *room = calloc(1, sizeof *room);
    memset(search, 0, sizeof *search);
    search->data = data;
    search->options = *options;
    const struct gap_model plain = {.stiffness_scale = 1.0, .supply_scale = 1.0};
    search->nominal.model = plain;
    bool sound = room != NULL && replay_open(&search->replay, data, table, nominal) &&
                 replay_open_coarse(&search->coarse, &search->replay);
    say(search, "recalibration", 0, 1);
    sound = sound && prepare(search);
    sound = sound && recalibrate(search, &search->nominal, false);
    search->recalibrated.model = plain;
    sound = sound && recalibrate(search, &search->recalibrated, true);
    search->best = search->recalibrated;
    if (sound) {
        room->candidates = list_candidates(search, room->list);
        sound = take_repeats(search, 0);
    }
    const bool faint = structure(&search->best) < FAINT && all_have_duties(data);
    for (size_t step = search->best.model.count; step < SEARCH_STEPS_MAX && sound && !stopped(search) && !faint; step++) {
        if (search->best.model.count + 3 > GAP_EFFECTS_MAX) {
            break;
        }
        if (step > 0 && !is_left(search, &search->best, FIT_PRESSURE, TRACE_LEAST, ELSEWHERE_SHARE) &&
            !is_left(search, &search->best, FIT_TIP, TRACE_LEAST, ELSEWHERE_SHARE)) {
            break;
        }
        if (!add_one(search, room, step)) {
            break;
        }
        sound = recalibrate(search, &search->best, true) && (step > 0 || search_after_onset(search, room)) &&
                take_repeats(search, step);
    }
    if (sound && !stopped(search) && search->best.model.count == 0 && all_have_duties(data)) {
        sound = look_closer(search, room);
    }
    if (sound && !stopped(search)) {
        drop_idle(search);
        sound = recalibrate(search, &search->best, true);
    }
    sound = sound && compare_rivals(search);
    sound = sound && fit_everything(search);
    search->interrupted = stopped(search);
    free(room);
    return sound;
}

bool search_leaves_out(const struct search *search, const char *name) {
    return is_without(&search->options, name);
}

void search_close(struct search *search) {
    replay_close(&search->replay);
    replay_close(&search->coarse);
}
