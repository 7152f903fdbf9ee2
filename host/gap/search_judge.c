#include "gap/search_parts.h"

#include <math.h>

#define GAIN_SHARE 0.03      /* an effect must take off this share of the held-out squares .. */
#define GAIN_SIGMA 40.0      /* .. and so much that noise does not */
#define COMPLETING_SHARE 0.5 /* of what is left, that a further effect must explain .. */
#define LEFT_OF_MUCH 0.7     /* .. or of much that is left, this may stay, .. */
#define LAWFUL 0.1           /* .. by effects whose laws are no more in doubt than that */
#define TWICE_THE_DOUBT 4.0  /* of a law, in squares: what it leaves may be less */
#define BESIDE_EXACT_SHARE 0.1 /* of the squares that exact effects leave, noise and all, that a further one must explain */
#define FORESTALLED_SHARE 0.25 /* of what is left, that another explains more of */
/* Shares of the gap, in pressures or at the tip: */
#define POLISH_SHARE 0.025  /* less than that is left by any form of the right effect, .. */
#define EXACT_SHARE 0.01    /* .. less than that by effects that have but one form, .. */
#define FORM_LEAST 0.0005   /* .. less than that by most forms of it, .. */
#define TRACE_LEAST 0.00005 /* .. and less than that by all: no effect is sought for it */
/* Shares of the whole gap: */
#define MATERIAL_SHARE 0.0003 /* less than that, elsewhere than the gap lies, is form, .. */
#define ELSEWHERE_SHARE 3e-5  /* .. down to that, if no simple effect explains it whole */
#define LAW_AT_TIP 0.2      /* of a law's doubt: what it leaves at the tip, where six coordinates hold it */
#define WHOLE_SHARE 0.95      /* of such a small rest, that an effect must explain, .. */
#define UNEXPLAINED_MOST 0.1  /* .. but for what its own law may leave, at most that, .. */
#define TRACE_SHARE 0.98      /* .. and of a trace, .. */
#define TRACE_SIGNAL 10.0     /* .. which is so many times what is worth explaining at all */
/* Of pressures that no effect acts on yet: so much is no form's doing, and an effect must explain all but that. */
#define UNTOUCHED_LEAST 0.3
#define UNTOUCHED_LEFT 0.15
/* Of a faint gap: more than that left means that something else was meant, but for what chance makes of so little. */
#define FAINT_LEFT 0.25
#define FAINT_LEFT_BY_CHANCE 0.4
#define FAINT_REST 0.1 /* mean square */

double search_held_out(const struct fit *fit) {
    return fit->sound ? fit_squares(&fit->sums, 1) : INFINITY;
}

double search_structure(const struct fit *fit) {
    return fmax(fit_structure(&fit->sums, 1), 0.0);
}

/* --- what is left --- */

/* Is there more left, in pressures or at the tip, than the noise, than a share of the gap there and than one
 * of the whole? */
static bool is_left(const struct search *search, const struct fit *fit, enum fit_group group, double share,
                    double of_whole) {
    const double all = fit_structure_of(&search->recalibrated.sums, 1, group);
    const double least = fmax(share * all, of_whole * search_structure(&search->recalibrated));
    return fit_structure_of(&fit->sums, 1, group) > fmax(STRUCTURE_LEAST, least);
}

bool search_has_rest(const struct search *search, const struct fit *fit) {
    return is_left(search, fit, FIT_PRESSURE, TRACE_LEAST, ELSEWHERE_SHARE) ||
           is_left(search, fit, FIT_TIP, TRACE_LEAST, ELSEWHERE_SHARE);
}

bool search_is_structured(const struct fit *fit) {
    return fit_structure_of(&fit->sums, 1, FIT_PRESSURE) > STRUCTURE_LEAST ||
           fit_structure_of(&fit->sums, 1, FIT_TIP) > STRUCTURE_LEAST;
}

/* --- what earns a place --- */

double search_gain_by_noise(const struct fit *after) {
    return GAIN_SIGMA * fmax(search_held_out(after) / fit_count(&after->sums, 1), 0.2);
}

bool search_is_better(const struct fit *before, const struct fit *after) {
    const double gain = search_held_out(before) - search_held_out(after);
    const double completing = COMPLETING_SHARE * search_structure(before) * fit_count(&before->sums, 1);
    const double worth = fmin(GAIN_SHARE * search_held_out(before), completing);
    return gain > worth && gain > search_gain_by_noise(after);
}

static size_t parts_of(const struct fit *fit, const struct effect_kind *kind) {
    size_t parts = 0;
    for (size_t e = 0; e < fit->model.count; e++) {
        parts += fit->model.effect[e].kind == kind;
    }
    return parts;
}

/* What the second has and the first does not: the last such effect; the last of all where it has only more of
 * the same. */
static size_t added(const struct fit *before, const struct fit *after) {
    size_t place = after->model.count - 1;
    while (place > 0 && parts_of(before, after->model.effect[place].kind) > 0) {
        place--;
    }
    return parts_of(before, after->model.effect[place].kind) > 0 ? after->model.count - 1 : place;
}

/* What the laws of the model's effects may leave in a group by being other than the real causes' own: that of their sizes, as a
 * share of squares. Where pressures are measured, what acts before them errs there, and no longer at the tip. */
static double form_share(const struct fit *fit, enum fit_group group) {
    const bool measured = fit->sums.part[1][FIT_PRESSURE].count > 0.0;
    double most = 0.0;
    for (size_t e = 0; e < fit->model.count; e++) {
        const struct effect_kind *kind = fit->model.effect[e].kind;
        const double doubt = effect_doubt(kind) * (group == FIT_TIP ? LAW_AT_TIP : 1.0);
        const bool here = gap_effect_upstream(kind) ? group == FIT_PRESSURE || !measured : group == FIT_TIP;
        most = here ? fmax(most, doubt * doubt) : most;
    }
    return fmin(most, POLISH_SHARE);
}

static bool acts_on_pressures(const struct gap_model *model) {
    bool acts = false;
    for (size_t e = 0; e < model->count; e++) {
        acts = acts || gap_effect_upstream(model->effect[e].kind);
    }
    return acts;
}

/* Geometry, scale and timing of sensors have no other form than theirs. */
static bool is_exact(const struct gap_model *model) {
    bool exact = true;
    for (size_t e = 0; e < model->count; e++) {
        const struct effect_kind *kind = model->effect[e].kind;
        const bool sensor = kind->stage == EFFECT_STAGE_TIP_SENSOR || kind->stage == EFFECT_STAGE_PRESSURE_SENSOR;
        exact = exact && sensor && kind->forms < 2;
    }
    return exact;
}

static bool is_lawful(const struct gap_model *model) {
    bool lawful = true;
    for (size_t e = 0; e < model->count; e++) {
        lawful = lawful && effect_doubt(model->effect[e].kind) <= LAWFUL;
    }
    return lawful;
}

/* A further effect must be the rest of the explanation, of the pressures or of the tip; not polish on a form
 * that only nearly fits. A small rest may as well be the form: the smaller its share of the gap is, the more of it must a
 * simple effect explain, as no form's error is likely to be just what another effect does. */
static bool completes_in(const struct search *search, const struct fit *before, const struct fit *after, enum fit_group group) {
    const struct effect_kind *kind = after->model.effect[added(before, after)].kind;
    const bool simple = parts_of(after, kind) == 1 && !kind->forms_add;
    const double law = effect_doubt(kind), unexplained = fmin(fmax(1.0 - WHOLE_SHARE, law * law), UNEXPLAINED_MOST);
    const double left = fit_structure_of(&before->sums, 1, group), then = fit_structure_of(&after->sums, 1, group);
    const double form = form_share(before, group), polish = is_exact(&before->model) ? EXACT_SHARE : POLISH_SHARE;
    const double share = left / fmax(fit_structure_of(&search->recalibrated.sums, 1, group), left);
    const bool halves = then < (1.0 - COMPLETING_SHARE) * left;
    const double of_whole = left / fmax(MATERIAL_SHARE * search_structure(&search->recalibrated), STRUCTURE_LEAST);
    const double may_be_left = (1.0 - COMPLETING_SHARE) * fmin(share / polish, of_whole);
    const double of_much = is_lawful(&before->model) ? LEFT_OF_MUCH : 1.0 - COMPLETING_SHARE;
    const bool most = then < fmin(may_be_left, of_much) * left;
    const bool whole = left > 3.0 * STRUCTURE_LEAST && then < fmax(unexplained * left, STRUCTURE_LEAST);
    const bool trace = left > TRACE_SIGNAL * STRUCTURE_LEAST && then < (1.0 - TRACE_SHARE) * left;
    const bool over_form = share > TWICE_THE_DOUBT * form;
    const bool untouched = group == FIT_PRESSURE && !acts_on_pressures(&before->model) && left > UNTOUCHED_LEAST &&
                           then < UNTOUCHED_LEFT * left;
    const bool of_form = is_left(search, before, group, fmax(FORM_LEAST, form), ELSEWHERE_SHARE);
    return (simple && untouched) || (is_left(search, before, group, polish, MATERIAL_SHARE) && halves) ||
           (simple && ((of_form && (whole || (most && over_form))) ||
                       (is_left(search, before, group, fmax(TRACE_LEAST, form), ELSEWHERE_SHARE) && trace)));
}

/* What exact effects leave is no form of theirs: be it ever so little, a further one that explains it is there. */
static bool completes_exact(const struct fit *before, const struct fit *after) {
    const struct effect_kind *kind = after->model.effect[added(before, after)].kind;
    const bool simple = parts_of(after, kind) == 1 && !kind->forms_add;
    const double gain = search_held_out(before) - search_held_out(after);
    return simple && is_exact(&before->model) && gain > BESIDE_EXACT_SHARE * search_held_out(before) &&
           search_structure(after) < fmin((1.0 - COMPLETING_SHARE) * search_structure(before), STRUCTURE_LEAST);
}

static bool completes(const struct search *search, const struct fit *before, const struct fit *after) {
    const struct effect_kind *kind = after->model.effect[added(before, after)].kind;
    bool any = completes_exact(before, after);
    for (int g = gap_effect_upstream(kind) ? FIT_PRESSURE : FIT_TIP; g < FIT_GROUPS; g++) {
        any = any || completes_in(search, before, after, (enum fit_group)g);
    }
    return any;
}

bool search_is_forestalled(const struct search *search, const struct fit *before, const struct fit *after,
                           const struct fit *other) {
    const struct effect_kind *kind = after->model.effect[added(before, after)].kind;
    bool in_a_group = false, better = true;
    if (before->model.count == 0 || parts_of(before, kind) > 0 || !(search_held_out(other) < search_held_out(after)) ||
        parts_of(other, other->model.effect[added(before, other)].kind) != 1) {
        return false;
    }
    for (int g = gap_effect_upstream(kind) ? FIT_PRESSURE : FIT_TIP; g < FIT_GROUPS; g++) {
        const enum fit_group group = (enum fit_group)g;
        const double left = fit_structure_of(&before->sums, 1, group), then = fit_structure_of(&after->sums, 1, group);
        const bool gives_place = completes_in(search, before, after, group);
        in_a_group = in_a_group || gives_place;
        better = better && (!gives_place || then - fit_structure_of(&other->sums, 1, group) > FORESTALLED_SHARE * left);
    }
    const double more = search_structure(after) - search_structure(other);
    return in_a_group ? better : more > FORESTALLED_SHARE * search_structure(before);
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

bool search_earns_place(const struct search *search, const struct fit *before, const struct fit *after) {
    if (before->model.count == 0) {
        const double faint = search_structure(before);
        const bool all_of_it =
            search_structure(after) < fmax(FAINT_LEFT * faint, fmin(FAINT_LEFT_BY_CHANCE * faint, FAINT_REST));
        return search_is_better(before, after) && (all_of_it || search_structure(before) > FAINT);
    }
    const size_t place = added(before, after);
    const bool adds = after->model.effect[place].kind->forms_add || gap_model_is_part(&after->model, place);
    /* a bent field beside what could be a part of it is new */
    const struct effect_kind *kind = after->model.effect[place].kind;
    const bool known = parts_of(before, kind) > 0 || (!kind->forms_add && gap_model_is_part(&after->model, place));
    if (known && adds && gap_model_kinds(&after->model) <= gap_model_kinds(&before->model) &&
        !repeats_kind(&after->model)) {
        return search_is_better(before, after); /* more of the same kind */
    }
    return search_is_better(before, after) && completes(search, before, after) &&
           !repeats_kind(&after->model);
}
