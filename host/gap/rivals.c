#include "gap/rivals.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "gap/search.h"

#define ROUNDS 8
#define FORM_SHARE 0.002 /* of what an effect takes off */
/* Of what the best leaves: of two laws that are both off, the one that is off by less is seldom the wrong one. */
#define REST_SHARE 0.25
/* A parameter takes off a noise's square by chance, and fits the noise for as much (Akaike 1974). */
#define NOISE_SQUARES 10.0

static double held_out(const struct fit *fit) {
    return fit_squares(&fit->sums, 1);
}

static bool names_kind(const struct gap_model *model, const struct effect_kind *kind) {
    for (size_t e = 0; e < model->count; e++) {
        if (model->effect[e].kind == kind) {
            return true;
        }
    }
    return false;
}

/* The best model without the effect at `place` and all that is part of it. */
static void leave_out(const struct gap_model *model, size_t place, struct gap_model *rest) {
    const struct effect_kind *kind = model->effect[place].kind;
    const bool bends = strcmp(kind->name, "tip_distortion") == 0;
    *rest =
        (struct gap_model){.stiffness_scale = model->stiffness_scale, .supply_scale = model->supply_scale};
    for (size_t e = 0; e < model->count; e++) {
        if (model->effect[e].kind != kind && !(bends && gap_model_is_part(model, e))) {
            rest->effect[rest->count++] = model->effect[e];
        }
    }
}

/* The trial's first effect of a kind that the rest does not name; NULL: none, or several kinds, or it lacks
 * some of the rest. */
static const struct effect *own_effect(const struct fit *fit, const struct gap_model *rest) {
    const struct effect *own = NULL;
    size_t met = 0;
    for (size_t e = 0; e < fit->model.count; e++) {
        const struct effect *effect = &fit->model.effect[e];
        const bool of_rest = names_kind(rest, effect->kind);
        met += of_rest;
        if (!of_rest && own != NULL && own->kind != effect->kind) {
            return NULL;
        }
        own = !of_rest && own == NULL ? effect : own;
    }
    return met < rest->count ? NULL : own;
}

/* The trials that a kind is judged by: on top of the rest where that was tried, else alone; of these the
 * best. */
struct entry {
    const struct fit *fit;
    const struct effect *own;
    bool alone;
};

static bool goes_before(const struct entry *a, const struct entry *b) {
    return a->alone != b->alone ? b->alone : held_out(a->fit) < held_out(b->fit);
}

static void offer(struct entry *list, size_t *count, const struct entry *offered) {
    size_t at = 0;
    while (at < *count && list[at].own->kind != offered->own->kind) {
        at++;
    }
    if (at == *count && at < SEARCH_CANDIDATES_MAX) {
        list[(*count)++] = *offered;
    } else if (at < *count && goes_before(offered, &list[at])) {
        list[at] = *offered;
    }
}

static int by_merit(const void *a, const void *b) {
    const struct entry *x = a, *y = b;
    return goes_before(x, y) ? -1 : goes_before(y, x);
}

static size_t gather(const struct search *search, const struct gap_model *rest,
                     const struct effect_kind *kept, struct entry *list) {
    const struct gap_model none = {.count = 0};
    size_t count = 0;
    for (size_t t = 0; t < search->trials; t++) {
        const struct fit *fit = &search->trial[t].fit;
        if (!fit->sound) {
            continue;
        }
        struct entry entry = {fit, own_effect(fit, rest), false};
        if (entry.own == NULL && search->trial[t].step == 0) {
            entry = (struct entry){fit, own_effect(fit, &none), true};
        }
        if (entry.own != NULL && entry.own->kind != kept && !entry.own->kind->by_chance &&
            !names_kind(rest, entry.own->kind)) {
            offer(list, &count, &entry);
        }
    }
    qsort(list, count, sizeof list[0], by_merit);
    return count;
}

/* The rest with the entry's own effects, from the onset of the one that they stand in for. */
static bool put_in_place(const struct gap_model *rest, const struct entry *entry, const struct effect *held,
                         struct gap_model *model) {
    *model = *rest;
    if (entry->alone) {
        model->stiffness_scale = entry->fit->model.stiffness_scale;
        model->supply_scale = entry->fit->model.supply_scale;
    }
    for (size_t e = 0; e < entry->fit->model.count; e++) {
        const struct effect *effect = &entry->fit->model.effect[e];
        if (names_kind(rest, effect->kind)) {
            continue;
        }
        if (model->count == GAP_EFFECTS_MAX) {
            return false;
        }
        model->effect[model->count] = *effect;
        struct effect *put = &model->effect[model->count++];
        put->onset_s = fmax(effect->onset_s, held->onset_s);
        put->latent = put->onset_s > 0.0 && put->kind->remembers && (effect->latent || held->latent);
    }
    return true;
}

static double parameters_of(const struct gap_model *model, const struct effect_kind *kind) {
    double count = 0.0;
    for (size_t e = 0; e < model->count; e++) {
        count += model->effect[e].kind == kind ? (double)kind->parameter_count : 0.0;
    }
    return fmax(count, 1.0);
}

static int by_belief(const void *a, const void *b) {
    const double x = ((const struct rival *)a)->belief, y = ((const struct rival *)b)->belief;
    return (x < y) - (x > y);
}

static double squares_of(const struct fit *fit, enum fit_group group) {
    return fit->sums.part[1][group].square;
}

/* Of all rivals, the one that leaves least of a group. */
static const struct fit *least_of(const struct rivals *rivals, const struct fit *best, enum fit_group group) {
    const struct fit *least = best;
    for (size_t i = 0; i < rivals->count; i++) {
        const struct fit *fit = &rivals->rival[i].fit;
        least = squares_of(fit, group) < squares_of(least, group) ? fit : least;
    }
    return least;
}

/* The logarithm of how much less the rival's residuals of one group speak for it than the best ones there: of
 * two of which each explains a group that the other does not, neither is judged by what its own leaves over.
 * `without`: what is left without those whose forms err there, by `form`, a share of what they take off.
 */
static double misfit(const struct rivals *rivals, const struct fit *rival, const struct fit *without,
                     const struct fit *best, enum fit_group group, double form) {
    const struct fit *least = least_of(rivals, best, group);
    const double count = fmax(least->sums.part[1][group].count, 1.0),
                 structure = fit_structure_of(&least->sums, 1, group);
    const double noise = fmax(squares_of(least, group) / count - structure, 0.1);
    const double taken_off = fmax(squares_of(without, group) - squares_of(least, group), 0.0);
    return (squares_of(rival, group) - squares_of(least, group)) /
           (form * taken_off + REST_SHARE * structure * count + NOISE_SQUARES * noise);
}

/* How far the forms may err of those that act on the pressures. */
static double form_of_pressures(const struct gap_model *model) {
    double form = FORM_SHARE;
    for (size_t e = 0; e < model->count; e++) {
        const double doubt = gap_effect_upstream(model->effect[e].kind) ? effect_doubt(model->effect[e].kind) : 0.0;
        form = fmax(form, doubt * doubt);
    }
    return form;
}

/* Where the effect in this place hardly acts on the pressures, what speaks there is mostly the forms of others. */
static void weigh(const struct search *search, struct rivals *rivals) {
    const struct effect_kind *held = search->best.model.effect[rivals->place].kind;
    const struct fit *best = &search->best, *without = rivals->rest.sound ? &rivals->rest : &search->recalibrated;
    const bool acts = gap_effect_upstream(held);
    const struct fit *without_any = acts ? without : &search->recalibrated;
    const double form = acts ? FORM_SHARE : form_of_pressures(&best->model);
    double sum = 0.0, most = -INFINITY;
    for (size_t i = 0; i < rivals->count; i++) {
        struct rival *rival = &rivals->rival[i];
        const double parameters = parameters_of(&rival->fit.model, rival->kind);
        rival->belief = -misfit(rivals, &rival->fit, without_any, best, FIT_PRESSURE, form) -
                        misfit(rivals, &rival->fit, without, best, FIT_TIP, FORM_SHARE) -
                        0.5 * log(parameters) - parameters / NOISE_SQUARES;
        most = fmax(most, rival->belief);
    }
    for (size_t i = 0; i < rivals->count; i++) {
        rivals->rival[i].belief = exp(rivals->rival[i].belief - most);
        sum += rivals->rival[i].belief;
    }
    for (size_t i = 0; i < rivals->count; i++) {
        rivals->rival[i].belief /= sum;
    }
    qsort(rivals->rival, rivals->count, sizeof rivals->rival[0], by_belief);
}

/* Keeps those whose fit came to an end. */
static void drop_unsound(struct rivals *rivals) {
    size_t kept = 0;
    for (size_t i = 0; i < rivals->count; i++) {
        if (rivals->rival[i].fit.sound) {
            rivals->rival[kept++] = rivals->rival[i];
        }
    }
    rivals->count = kept;
}

static void find_in_place(struct search *search, struct rivals *rivals, struct entry *list) {
    const struct effect *held = &search->best.model.effect[rivals->place];
    struct gap_model rest;
    leave_out(&search->best.model, rivals->place, &rest);
    const size_t found = gather(search, &rest, held->kind, list);
    rivals->rival[0] = (struct rival){.kind = held->kind, .effect = *held, .fit = search->best};
    rivals->count = 1;
    for (size_t i = 0; i < found && rivals->count < RIVALS_MAX; i++) {
        struct rival *rival = &rivals->rival[rivals->count];
        *rival = (struct rival){.kind = list[i].own->kind};
        rivals->count += put_in_place(&rest, &list[i], held, &rival->fit.model);
    }
    struct fit *without = &rivals->rest;
    *without = (struct fit){.model = rest};
#pragma omp parallel for schedule(dynamic, 1)                                                                \
    num_threads(search->options.threads > 0 ? search->options.threads : omp_get_max_threads())
    for (size_t i = 0; i < rivals->count;
         i++) { /* the best model is fitted already: in its turn, the rest alone */
        const bool stopped = search->options.stop != NULL && *search->options.stop != 0;
        if (!stopped) {
            (void)fit_rebased(&search->replay, &search->coarse, i == 0 ? without : &rivals->rival[i].fit,
                              ROUNDS);
        }
    }
    drop_unsound(rivals);
    for (size_t i = 0; i < rivals->count; i++) {
        const struct effect *own = own_effect(&rivals->rival[i].fit, &rest);
        rivals->rival[i].effect = own != NULL ? *own : rivals->rival[i].effect;
    }
    weigh(search, rivals);
}

bool rivals_find(struct search *search) {
    struct entry *list = calloc(SEARCH_CANDIDATES_MAX, sizeof *list);
    search->rivals_count = 0;
    for (size_t e = 0; e < search->best.model.count && list != NULL; e++) {
        if (!gap_model_is_part(&search->best.model, e) && search->rivals_count < SEARCH_STEPS_MAX) {
            struct rivals *rivals = &search->rivals[search->rivals_count++];
            rivals->place = e;
            find_in_place(search, rivals, list);
        }
    }
    free(list);
    return list != NULL;
}
