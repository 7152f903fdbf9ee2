#include "gap/search_parts.h"

#include <math.h>
#include <omp.h>

#define ONSETS 12
#define ONSET_LEAVES 0.5 /* of the structure, at most */
#define ONSET_ROUNDS 4
#define ONSET_FINE_ROUNDS 2
#define ONSET_FINE_S 0.15 /* an onset is not sought closer than that */
#define PLACED_MAX 3      /* of the best alone, of which onsets are sought */

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
static const struct fit *try_onsets(struct search_crew *crew, const struct fit *start, size_t e,
                                    double first_s, double step_s, int rounds, struct fit trial[ONSETS]) {
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

/* Without its onset an effect's forms are all off, and the best of them may be the wrong one: the others from there, too. */
static void try_other_forms(struct search_crew *crew, size_t e, struct fit *fit) {
    const struct fit start = *fit;
    const struct effect *own = &start.model.effect[e];
    for (size_t form = 0; form < own->kind->forms && !own->kind->forms_add; form++) {
        struct fit trial = start;
        struct effect *other = &trial.model.effect[e];
        effect_init(other, own->kind);
        other->form = form;
        other->chamber = own->chamber;
        other->onset_s = own->onset_s;
        other->latent = own->latent;
        if (form != own->form) {
            fitter_run(&crew->fitter[0], &trial, REFINE_ROUNDS, true);
            *fit = all_squares(&trial) < all_squares(fit) ? trial : *fit;
        }
    }
}

/* Closer and closer around where it is. */
static void refine_onset(struct search_crew *crew, double width_s, size_t e, struct fit *fit) {
    struct fit trial[ONSETS];
    while (width_s > ONSET_FINE_S) {
        const struct fit centre = *fit;
        const double first_s = centre.model.effect[e].onset_s - width_s;
        const struct fit *best =
            try_onsets(crew, &centre, e, first_s, 2.0 * width_s / (ONSETS - 1.0), ONSET_FINE_ROUNDS, trial);
        *fit = all_squares(best) < all_squares(fit) ? *best : *fit;
        width_s *= 0.4;
    }
}

/* What remembers may do so from before its onset, or from there on only, and then sets in at another time. */
static void try_memory(struct search_crew *crew, double width_s, size_t e, struct fit *fit) {
    struct fit other = *fit;
    if (!other.model.effect[e].kind->remembers) {
        return;
    }
    other.model.effect[e].latent = !other.model.effect[e].latent;
    fitter_run(&crew->fitter[0], &other, ONSET_ROUNDS, true);
    refine_onset(crew, width_s, e, &other);
    *fit = all_squares(&other) < all_squares(fit) ? other : *fit;
}

/* When did each effect set in? Tried on a grid, then closer and closer; kept where it explains more. */
static void find_onset(struct search_crew *crew, double end_s, size_t e, struct fit *fit) {
    struct fit trial[ONSETS];
    const struct fit before = *fit;
    const double width_s = end_s / (ONSETS + 1.0);
    const struct fit *best = try_onsets(crew, &before, e, width_s, width_s, ONSET_ROUNDS, trial);
    if (!search_is_better(&before, best)) {
        if (before.model.effect[e].onset_s > 0.0) { /* which is right already */
            try_memory(crew, width_s, e, fit);
        }
        return;
    }
    *fit = *best;
    refine_onset(crew, width_s, e, fit);
    try_memory(crew, width_s, e, fit);
    /* a real onset leaves little; a form that is somewhat off gains a little by any */
    if (before.model.effect[e].onset_s == 0.0 &&
        search_structure(fit) > ONSET_LEAVES * search_structure(&before)) {
        *fit = before;
    } else {
        try_other_forms(crew, e, fit);
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

void search_find_onsets(struct search *search, struct search_crew *crew, struct fit *fit) {
    const double end_s = longest_s(search->data);
    for (size_t e = 0; e < fit->model.count && !search_stopped(search); e++) {
        if (!is_later_form(&fit->model, e)) { /* its forms belong together */
            find_onset(crew, end_s, e, fit);
        }
    }
}

void search_place_onsets(struct search *search, const struct search_workspace *room, struct fit *least) {
    struct fit_base base;
    struct search_crew crew = {NULL, 0};
    const double end_s = longest_s(search->data);
    if (fit_base_open(&base, &search->replay, &search->coarse, &search->recalibrated.model) &&
        search_crew_open(&crew, search, &base)) {
        for (size_t i = 0; i < room->singles && i < PLACED_MAX && !search_stopped(search); i++) {
            struct fit fit = room->single[i];
            fit.model.stiffness_scale = search->recalibrated.model.stiffness_scale;
            fit.model.supply_scale = search->recalibrated.model.supply_scale;
            fitter_run(&crew.fitter[0], &fit, ONSET_ROUNDS, true);
            find_onset(&crew, end_s, 0, &fit);
            if (fit.sound && search_held_out(&fit) < search_held_out(least)) {
                *least = fit;
            }
        }
    }
    search_crew_close(&crew);
    fit_base_close(&base);
}
