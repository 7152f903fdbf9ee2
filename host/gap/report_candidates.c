#include "gap/report_candidates.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/baseline.h"

/* --- tried --- */

static double held_out(const struct fit *fit) {
    return fit_squares(&fit->sums, 1);
}

/* The best trial of each kind, of those with one effect. */
static size_t pick_trials(const struct search *search, const struct fit **picked) {
    size_t count = 0;
    for (size_t t = 0; t < search->trials; t++) {
        const struct fit *fit = &search->trial[t].fit;
        if (search->trial[t].step != 0 || !fit->sound || fit->model.count != 1) {
            continue;
        }
        size_t at = 0;
        while (at < count && picked[at]->model.effect[0].kind != fit->model.effect[0].kind) {
            at++;
        }
        if (at == count && count < SEARCH_CANDIDATES_MAX) {
            picked[count++] = fit;
        } else if (at < count && held_out(fit) < held_out(picked[at])) {
            picked[at] = fit;
        }
    }
    return count;
}

struct room {
    const struct replay *replay;
    struct replay_state state;
    double *residual;
};

/* Sum of squares of the held-out whitened residuals under the weights that the search ended with. */
static double squares(struct room *room, const struct gap_model *model) {
    double sum = 0.0;
    memset(room->residual, 0, room->replay->residuals * sizeof(double));
    replay_pressures(room->replay, model, &room->state);
    replay_take_pressures(room->replay, &room->state, room->residual);
    replay_tip(room->replay, model, &room->state, false, room->residual);
    for (size_t k = 0; k < room->replay->residuals; k++) {
        const bool counts = room->replay->held_out[k] && room->replay->weight[k] > 0.0;
        sum += counts ? room->residual[k] * room->residual[k] : 0.0;
    }
    return sum;
}

static int by_closed(const void *a, const void *b) {
    const double x = ((const struct report_candidate *)a)->closed,
                 y = ((const struct report_candidate *)b)->closed;
    return (x < y) - (x > y);
}

/* The best model closes diagnosis->closed of the gap by taking off a sum of squares; others take off more or
 * less. */
static void weigh(struct report_candidates *candidates, const struct diagnosis *diagnosis,
                  const struct search *search, struct room *room) {
    const struct fit *picked[SEARCH_CANDIDATES_MAX];
    const size_t count = pick_trials(search, picked);
    const double before = squares(room, &search->nominal.model);
    const double taken_off = before - squares(room, &search->best.model);
    const double scale = taken_off > 0.0 ? diagnosis->closed.value / taken_off : 0.0;
    for (size_t i = 0; i < count && scale > 0.0; i++) {
        candidates->list[candidates->count++] = (struct report_candidate){
            &picked[i]->model.effect[0], scale * (before - squares(room, &picked[i]->model))};
    }
    qsort(candidates->list, candidates->count, sizeof candidates->list[0], by_closed);
}

bool report_candidates_find(struct report_candidates *candidates, const struct diagnosis *diagnosis,
                            const struct search *search) {
    struct room room = {.replay = &search->replay};
    candidates->count = 0;
    room.residual = calloc(search->replay.residuals + 1, sizeof *room.residual);
    const bool sound = replay_state_open(&room.state, &search->replay) && room.residual != NULL;
    if (sound) {
        weigh(candidates, diagnosis, search, &room);
    }
    replay_state_close(&room.state, &search->replay);
    free(room.residual);
    return sound;
}

/* --- untried --- */

static bool asked_without(const struct search *search, const char *name) {
    for (size_t i = 0; i < search->options.without_count; i++) {
        if (strcmp(search->options.without[i], name) == 0) {
            return true;
        }
    }
    return false;
}

static bool was_tried(const struct search *search, const struct effect_kind *kind) {
    for (size_t t = 0; t < search->trials; t++) {
        const struct gap_model *model = &search->trial[t].fit.model;
        for (size_t e = 0; e < model->count; e++) {
            if (model->effect[e].kind == kind) {
                return true;
            }
        }
    }
    return false;
}

/* What every run has, and tips in the first: the search asks for the same. */
struct recorded {
    bool duties;
    bool readings;
    bool tips;
    bool repeats;
};

static struct recorded what_is_recorded(const struct gap_data *data) {
    struct recorded has = {true, true, data->run[0].tips > 0, false};
    for (size_t i = 0; i < data->runs; i++) {
        has.duties = has.duties && data->run[i].has_duty;
        has.readings = has.readings && data->run[i].has_reading;
        has.repeats = gap_data_repeats(data).share > 0.02;
    }
    return has;
}

const char *report_why_untried(const struct search *search, const struct effect_kind *kind) {
    const struct recorded has = what_is_recorded(search->data);
    if (asked_without(search, kind->name)) {
        return "left out on request (--without)";
    }
    if (was_tried(search, kind)) {
        return NULL;
    }
    if (search->data->from_simulator && gap_baseline_why_not(search->data, kind) != NULL) {
        return gap_baseline_why_not(search->data, kind);
    }
    if (kind->by_chance) {
        return has.repeats ? NULL : "hardly any tip sample is repeated while the tip moves";
    }
    if (gap_effect_downstream(kind)) {
        return has.tips ? NULL : "no tip samples in the logs";
    }
    if (kind->stage == EFFECT_STAGE_PRESSURE_SENSOR) {
        return !has.readings            ? "no measured pressures in the logs"
               : has.duties || has.tips ? NULL
                                        : "neither duties nor tip samples to hold the readings against";
    }
    return !has.duties                ? "no duties in the logs"
           : has.readings || has.tips ? NULL
                                      : "neither measured pressures nor tip samples in the logs";
}
