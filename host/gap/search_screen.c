#include "gap/search_parts.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#define SCREEN_ROUNDS 1
#define SCREEN_ROUNDS_CHEAP 3
#define THRESHOLD_ROUNDS 2
#define STARTS_KEPT 4 /* of many that an evaluation each tells apart */
#define SETTLED_MAX 5 /* of the refined ones, the best, from a base of their own .. */
#define SETTLE_ROUNDS 4
#define REFINED_GAS_MAX 8  /* of the screened candidates that need gas replayed */
#define REFINED_KIND_MAX 2 /* of each kind */
#define PART_COST 0.03     /* an effect more must better the fit by that to go before, ... */
#define FORM_COST 0.003    /* ... a form more of the same by that */
#define SHORTLIST 10       /* of the candidates that act on the gas; the best variant of each kind besides */

/* What remembers may have done so before. */
static void set_onset(const struct search *search, struct effect *effect) {
    effect->onset_s = search->onset_s;
    effect->latent = search->onset_s > 0.0 && effect->kind->remembers;
}

/* For an order: of two that explain the same, the one with fewer parts goes first. */
static double rank(const struct fit *fit) {
    return search_held_out(fit) *
           (1.0 + PART_COST * (double)gap_model_kinds(&fit->model) + FORM_COST * (double)fit->model.count);
}

static int by_rank(const void *a, const void *b) {
    const double x = rank(*(const struct fit *const *)a), y = rank(*(const struct fit *const *)b);
    return (x > y) - (x < y);
}

static void put_best_first(struct fit **order, size_t count) {
    qsort(order, count, sizeof *order, by_rank); // NOLINT(bugprone-sizeof-expression): pointers are sorted
}

/* --- coarsely --- */

/* Of many starts the few that promise most, each at the size that does best; returns how many. The size: what is gone at
 * `none`. */
static size_t place_starts(struct fitter *fitter, const struct search *search, const struct gap_model *onto,
                           const struct search_candidate *candidate, struct effect starts[STARTS_KEPT]) {
    double gains[STARTS_KEPT] = {0.0};
    size_t kept = 0;
    fitter_evaluate(fitter, onto);
    for (size_t k = 0; k < SEARCH_STARTS_PLACED; k++) {
        struct gap_model model = *onto;
        struct effect effect;
        double share;
        effect_init(&effect, candidate->kind);
        effect.chamber = candidate->chamber;
        effect.form = candidate->form;
        set_onset(search, &effect);
        (void)search_place_start(candidate->kind, k, &effect);
        gap_model_add(&model, &effect);
        const double gain = fitter_gain(fitter, &model, &share);
        if (!(gain > 0.0) || (kept == STARTS_KEPT && gain <= gains[kept - 1])) {
            continue;
        }
        for (size_t i = 0; i < effect.kind->parameter_count; i++) {
            const struct effect_parameter *parameter = &effect.kind->parameter[i];
            if (!isnan(parameter->none)) {
                const double size = parameter->none + share * (effect.parameter[i] - parameter->none);
                effect.parameter[i] = fmin(fmax(size, parameter->least), parameter->most);
            }
        }
        size_t at = kept < STARTS_KEPT ? kept++ : kept - 1;
        for (; at > 0 && gains[at - 1] < gain; at--) {
            gains[at] = gains[at - 1];
            starts[at] = starts[at - 1];
        }
        gains[at] = gain;
        starts[at] = effect;
    }
    return kept;
}

static void screen_one(struct fitter *fitter, const struct search *search, const struct gap_model *onto,
                       const struct search_candidate *candidate, struct fit *best) {
    const int rounds = search_needs_gas(candidate->kind) ? SCREEN_ROUNDS : SCREEN_ROUNDS_CHEAP;
    struct effect placed[STARTS_KEPT], effect;
    effect_init(&effect, candidate->kind);
    size_t starts = search_place_start(candidate->kind, 0, &effect);
    const bool many = starts == SEARCH_STARTS_PLACED;
    starts = many ? place_starts(fitter, search, onto, candidate, placed) : starts;
    *best = (struct fit){.sound = false};
    for (size_t k = 0; k < starts; k++) {
        struct fit fit = {.model = *onto};
        effect_init(&effect, candidate->kind);
        effect.chamber = candidate->chamber;
        effect.form = candidate->form;
        set_onset(search, &effect);
        (void)search_place_start(candidate->kind, k, &effect);
        effect = many ? placed[k] : effect;
        if (candidate->kind->by_chance) {
            const struct gap_repeats repeats = gap_data_repeats(search->data);
            effect.parameter[0] = repeats.share;
            effect.onset_s = fmax(effect.onset_s, repeats.onset_s);
        }
        const bool all_forms = candidate->form > 0 && candidate->form == candidate->kind->forms;
        effect.form = all_forms ? 0 : effect.form;
        gap_model_add(&fit.model, &effect);
        for (size_t form = 1; all_forms && form < candidate->kind->forms && fit.model.count < GAP_EFFECTS_MAX;
             form++) {
            effect.form = form;
            gap_model_add(&fit.model, &effect);
        }
        fitter_run(fitter, &fit, rounds, true);
        const double mine = fit_squares(&fit.sums, 0), least = fit_squares(&best->sums, 0);
        if (fit.sound && (!best->sound || mine < least)) {
            *best = fit;
        }
    }
}

/* The gas is dear to replay. One replay of each kind on all chambers tells, to first order, what it could do
 * on each; only the most promising are then tried in earnest. Marks the others as not wanted. */
static void shortlist(struct search *search, struct search_crew *crew, const struct search_candidate *list,
                      size_t count, bool *wanted) {
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
        const bool on_gas = search_needs_gas(kind);
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
            set_onset(search, &effect);
            starts = search_place_start(kind, k, &effect);
            fitter_linear(&crew->fitter[omp_get_thread_num()], crew->fitter[0].base, base_residual, &effect,
                          mine);
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
        const bool on_gas = search_needs_gas(kind);
        wanted[i] = !on_gas || above < SHORTLIST || own_above == 0;
    }
    free(base_residual);
}

size_t search_screen(struct search *search, struct search_crew *crew, const struct gap_model *onto,
                     const struct search_candidate *list, size_t count, struct fit *fits,
                     struct fit **order) {
    size_t done = 0, kept = 0;
    bool wanted[SEARCH_CANDIDATES_MAX];
    shortlist(search, crew, list, count, wanted);
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t i = 0; i < count; i++) {
        fits[i] = (struct fit){.sound = false};
        if (wanted[i] && !search_stopped(search) &&
            !gap_model_has(onto, list[i].kind, list[i].form, list[i].chamber)) {
            screen_one(&crew->fitter[omp_get_thread_num()], search, onto, &list[i], &fits[i]);
        }
        size_t now;
#pragma omp atomic capture
        now = ++done;
        search_say(search, list[i].kind->name, now, count);
    }
    for (size_t i = 0; i < count; i++) {
        if (fits[i].sound) {
            order[kept++] = &fits[i];
        }
    }
    put_best_first(order, kept);
    return kept;
}

size_t search_choose(struct fit **order, size_t count) {
    size_t kept = 0, dear = 0;
    for (size_t i = 0; i < count && order[i] != NULL; i++) {
        const struct effect_kind *kind = order[i]->model.effect[order[i]->model.count - 1].kind;
        size_t same = 0;
        for (size_t j = 0; j < kept; j++) {
            same += order[j]->model.effect[order[j]->model.count - 1].kind == kind;
        }
        if (same < REFINED_KIND_MAX && (!search_needs_gas(kind) || dear < REFINED_GAS_MAX)) {
            dear += search_needs_gas(kind);
            order[kept++] = order[i];
        }
    }
    return kept;
}

/* --- closely --- */

/* A base tells of other stiffnesses and supplies to first order. The best are fitted again from where they
 * stand. */
static void settle(struct search *search, struct search_crew *crew, struct fit **order, size_t count) {
    const size_t most = count < SETTLED_MAX ? count : SETTLED_MAX;
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t i = 0; i < most; i++) {
        if (!search_stopped(search)) {
            (void)fit_rebased(&search->replay, &search->coarse, order[i], SETTLE_ROUNDS);
        }
    }
    put_best_first(order, count);
}

/* Derivatives do not lead to a threshold: single pulses lie on this side of it or on that. It is stepped to
 * from both sides. */
static void step_to_threshold(struct fitter *fitter, struct fit *fit) {
    static const double steps[] = {0.96, 0.98, 0.99, 1.01, 1.02, 1.04};
    for (size_t e = 0; e < fit->model.count; e++) {
        const struct fit start = *fit;
        for (size_t k = 0; k < sizeof steps / sizeof steps[0] && start.model.effect[e].kind->by_threshold;
             k++) {
            struct fit trial = start;
            trial.model.effect[e].parameter[0] *= steps[k];
            fitter_run(fitter, &trial, THRESHOLD_ROUNDS, true);
            if (trial.sound && fit_squares(&trial.sums, 0) < fit_squares(&fit->sums, 0)) {
                *fit = trial;
            }
        }
    }
}

void search_refine(struct search *search, struct search_crew *crew, struct fit **order, size_t count,
                   size_t step) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(crew->count)
    for (size_t i = 0; i < count; i++) {
        if (!search_stopped(search)) {
            fitter_run(&crew->fitter[omp_get_thread_num()], order[i], REFINE_ROUNDS, true);
            step_to_threshold(&crew->fitter[omp_get_thread_num()], order[i]);
        }
    }
    put_best_first(order, count);
    settle(search, crew, order, count);
    for (size_t i = 0; i < count && search->trials < SEARCH_TRIED_MAX; i++) {
        search->trial[search->trials++] = (struct search_trial){*order[i], step};
    }
}
