#include "gap/search_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define REPEATS_CERTAIN 0.04 /* share of repeated samples that no noise makes */
#define HOPELESS_SHARE 0.5 /* of the gap: where two effects leave more, a third does not explain it */

static bool prepare(struct search *search) {
    struct replay_state state;
    const bool sound = replay_state_open(&state, &search->replay) &&
                       replay_prepare(&search->replay, &search->nominal.model, &state);
    replay_state_close(&state, &search->replay);
    return sound;
}

/* Repeated samples are seen as such: no fit has to find them. They count where the poses are better explained
 * by them: a log that is written more often than the sensor measures has them too. */
static bool take_repeats(struct search *search, size_t step) {
    const struct effect_kind *kind = effect_kind_find("tip_freeze");
    const struct gap_repeats repeats = gap_data_repeats(search->data);
    const bool known = kind == NULL || search_leaves_out(search, kind->name) ||
                       gap_model_has(&search->best.model, kind, 0, 0);
    if (known || repeats.share < REPEATS_CERTAIN || search->best.model.count == GAP_EFFECTS_MAX) {
        return true;
    }
    struct effect effect;
    struct fit with = search->best;
    effect_init(&effect, kind);
    effect.parameter[0] = repeats.share;
    effect.onset_s = repeats.onset_s;
    gap_model_add(&with.model, &effect);
    const bool sound = search_recalibrate(search, &with, true);
    if (sound && search_held_out(&with) < search_held_out(&search->best) - search_gain_by_noise(&with)) {
        search->best = with;
        search->trial[search->trials++] = (struct search_trial){with, step};
        return search_compare_again(search);
    }
    return sound && search_recalibrate(search, &search->best, true);
}

/* Anew, with the tip from measured pressures or, `rigid`, from what the duties make of them. */
static bool begin_anew(struct search *search, struct search_workspace *room, bool rigid) {
    const struct gap_model plain = {.stiffness_scale = 1.0, .supply_scale = 1.0};
    search->replay.rigid = rigid;
    room->singles = 0;
    search->nominal.model = plain;
    const bool sound = search_recalibrate(search, &search->nominal, false) &&
                       search_recalibrate(search, &search->recalibrated, true);
    search->best = search->recalibrated;
    return sound;
}

static bool look_again(struct search *search, struct search_workspace *room, bool rigid) {
    bool sound = begin_anew(search, room, rigid);
    for (size_t step = 0; step < 2 && sound && !search_stopped(search) && search_is_structured(&search->best);
         step++) {
        const bool found = search_add_one(search, room, step);
        if (!found && step > 0) {
            break;
        }
        sound =
            search_recalibrate(search, &search->best, true) && (step > 0 || search_after_onset(search, room));
        if (search->best.model.count == 0) {
            break; /* not even of the last part */
        }
    }
    return sound;
}

/* What changes pressures only slightly shows best at the tip, once the pressures are taken to be what the
 * duties make of them: near ninety degrees a few pascals turn it more than its sensor errs. Where they turn it so far that
 * no fit finds its way, a faint gap of the pressures is looked at by itself after all. */
static bool look_closer(struct search *search, struct search_workspace *room, bool faint) {
    search->trials = 0;
    bool sound = look_again(search, room, true);
    if (sound && faint && search->best.model.count == 0 && search_is_structured(&search->best) &&
        !search_stopped(search)) {
        const size_t trials = search->trials;
        sound = look_again(search, room, false);
        if (sound && search->best.model.count == 0) {
            search->trials = trials;
            sound = begin_anew(search, room, true);
        } else { /* those under other weights are not its rivals */
            search->trials -= trials;
            memmove(search->trial, search->trial + trials, search->trials * sizeof search->trial[0]);
        }
    }
    return sound;
}

/* Leave out again what no longer earns its place; yet what goes form by form, none of which is much, may be much together. */
static void drop_idle(struct search *search) {
    const struct fit all = search->best;
    struct fit_base base;
    struct search_crew crew = {NULL, 0};
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
            if (fit_base_open(&base, &search->replay, &search->coarse, &without.model) &&
                search_crew_open(&crew, search, &base)) {
                fitter_run(&crew.fitter[0], &without, REFINE_ROUNDS, true);
            }
            search_crew_close(&crew);
            fit_base_close(&base);
            if (!search_earns_place(search, &without, &search->best)) {
                search->best = without;
                dropped = true;
                break;
            }
        }
    }
    if (gap_model_kinds(&search->best.model) < gap_model_kinds(&all.model) && search_earns_place(search, &search->best, &all)) {
        search->best = all;
    }
}

/* --- rivals --- */

/* What was not worth adding to what the search took may be the rest of what the rivals put there. */
static bool settle_with_rivals(struct search *search, struct search_workspace *room) {
    bool overturned;
    bool sound = search_compare_rivals(search, &overturned);
    const size_t count = search->best.model.count;
    if (sound && overturned && count > 0 && count + 3 <= GAP_EFFECTS_MAX &&
        gap_model_kinds(&search->best.model) < SEARCH_STEPS_MAX && search_has_rest(search, &search->best) &&
        !search_stopped(search) && search_add_one(search, room, SEARCH_STEPS_MAX)) {
        sound = search_recalibrate(search, &search->best, true) && search_compare_rivals(search, &overturned);
    }
    return sound;
}

/* Do two effects leave so much that a third does not explain it? Repeats are seen as such, and are none of the two. */
static bool is_hopeless(const struct search *search) {
    const double left = search_structure(&search->best) / fmax(search_structure(&search->recalibrated), STRUCTURE_LEAST);
    size_t kinds = gap_model_kinds(&search->best.model);
    for (size_t e = 0; e < search->best.model.count; e++) {
        kinds -= search->best.model.effect[e].kind->by_chance;
    }
    return kinds > 1 && left > HOPELESS_SHARE;
}

/* --- the whole --- */

bool search_run(struct search *search, const struct gap_data *data, const struct bend_table *table,
                const struct plant_parameters *nominal, const struct search_options *options) {
    struct search_workspace *room = calloc(1, sizeof *room);
    memset(search, 0, sizeof *search);
    search->data = data;
    search->options = *options;
    const struct gap_model plain = {.stiffness_scale = 1.0, .supply_scale = 1.0};
    search->nominal.model = plain;
    bool sound = room != NULL && replay_open(&search->replay, data, table, nominal) &&
                 replay_open_coarse(&search->coarse, &search->replay);
    search_say(search, "recalibration", 0, 1);
    sound = sound && prepare(search);
    sound = sound && search_recalibrate(search, &search->nominal, false);
    search->recalibrated.model = plain;
    sound = sound && search_recalibrate(search, &search->recalibrated, true);
    search->best = search->recalibrated;
    if (sound) {
        room->candidates = search_list_candidates(search, room->list);
        sound = take_repeats(search, 0);
    }
    const bool faint =
        search->best.model.count == 0 && search_structure(&search->best) < FAINT && search_all_have_duties(data);
    for (size_t step = search->best.model.count;
         step < SEARCH_STEPS_MAX && sound && !search_stopped(search) && !faint; step++) {
        if (search->best.model.count + 3 > GAP_EFFECTS_MAX) {
            break;
        }
        if ((step > 0 && !search_has_rest(search, &search->best)) || is_hopeless(search)) {
            break;
        }
        const bool found = search_add_one(search, room, step);
        if (!found && step > 0) {
            break;
        }
        sound = search_recalibrate(search, &search->best, true) && (step > 0 || search_after_onset(search, room));
        if (search->best.model.count == 0) {
            break; /* not even of the last part */
        }
        sound = sound && take_repeats(search, step);
    }
    if (sound && !search_stopped(search) && search->best.model.count == 0 && search_all_have_duties(data)) {
        sound = look_closer(search, room, faint);
    }
    if (sound && !search_stopped(search)) {
        drop_idle(search);
        sound = search_recalibrate(search, &search->best, true);
    }
    sound = sound && settle_with_rivals(search, room);
    sound = sound && search_fit_everything(search);
    search->interrupted = search_stopped(search);
    free(room);
    return sound;
}

void search_close(struct search *search) {
    replay_close(&search->replay);
    replay_close(&search->coarse);
}
