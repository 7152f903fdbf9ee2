#include "gap/plan_judge.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/plan_fit.h"

/* How far a real effect may be from its formula, as a share of its showing, and anew in each part of the
 * working range: where a candidate leaves less than this of another, the two are not told apart, however long
 * one looks. */
#define SHARE 0.15
#define STARTS_QUICK 4 /* to first order */
#define STARTS_TRIED 3
#define BROKEN 4.0 /* a fit that ends at this many times the sum of squares that was promised */

/* A start, and what the first order promises of it. */
struct promise {
    const struct plan_view *view;
    double cost;
};

static int by_cost(const void *a, const void *b) {
    const double x = ((const struct promise *)a)->cost, y = ((const struct promise *)b)->cost;
    return (x > y) - (x < y);
}

static void sum_parts(const struct plan_stage *stage, const double *residual, double *part) {
    memset(part, 0, PLAN_PARTS * sizeof *part);
    for (size_t k = 0; k < stage->residuals; k++) {
        part[stage->part[k / PLAN_CHANNELS]] += residual[k] * residual[k];
    }
}

/* From the start that promises most, and from the next one where the fit ends far above what was promised: it
 * may have been caught in a minimum of its own. */
static void fit_from_starts(const struct plan_stage *stage, const struct plan_truth *truth,
                            const struct promise *promise, size_t starts, int rounds,
                            struct plan_room *room) {
    double least = INFINITY;
    for (size_t k = 0; k < starts && k < STARTS_TRIED; k++) {
        const double cost = plan_fit_refine(stage, truth, promise[k].view, rounds, room);
        if (cost < least) {
            least = cost;
            room->best = room->tried.model;
            sum_parts(stage, room->residual, room->left);
        }
        if (least < BROKEN * promise[0].cost + 1.0) {
            break;
        }
    }
}

/* What a candidate leaves of the truth once it is refitted, into room->left; to first order without rounds.
 */
static void leave(const struct plan_stage *stage, const struct plan_truth *truth, size_t wrong, int rounds,
                  struct plan_room *room) {
    struct promise promise[PLAN_STARTS] = {{NULL, 0.0}};
    size_t starts = 0;
    double least = INFINITY;
    for (size_t v = 0; v < stage->views; v++) {
        if (stage->view[v].candidate == wrong) {
            const double cost = plan_fit_look(stage, truth, &stage->view[v], room);
            promise[starts++] = (struct promise){&stage->view[v], cost};
            if (cost < least) {
                least = cost;
                sum_parts(stage, room->moved, room->left);
            }
        }
    }
    if (rounds > 0) {
        qsort(promise, starts, sizeof promise[0], by_cost);
        fit_from_starts(stage, truth, promise, starts, rounds, room);
    }
}

/* What the model without any candidate leaves, into room->effect. */
static void leave_all(const struct plan_stage *stage, const struct plan_truth *truth, int rounds,
                      struct plan_room *room) {
    if (rounds > 0) {
        (void)plan_fit_refine(stage, truth, &stage->base, rounds, room);
        sum_parts(stage, room->residual, room->effect);
    } else {
        (void)plan_fit_look(stage, truth, &stage->base, room);
        sum_parts(stage, room->moved, room->effect);
    }
}

/* d, from what is left in each part and what there was. */
static double distance_of(const struct plan_room *room) {
    double sum = 0.0;
    for (size_t i = 0; i < PLAN_PARTS; i++) {
        sum += room->left[i] / (1.0 + SHARE * SHARE * room->effect[i]);
    }
    return sqrt(sum);
}

/* --- verdict --- */

/* Odds against the right candidate from those of its pairs (as Hastie and Tibshirani 1998 couple pairs), so
 * that n candidates that nothing tells apart are confused in n - 1 of n cases. */
static void conclude(const struct plan_candidates *candidates, struct plan_verdict *verdict) {
    verdict->confusion = 0.0;
    verdict->left = 0.0;
    for (size_t i = 0; i < candidates->count; i++) {
        double odds = 0.0, left = 1.0;
        for (size_t j = 0; j < candidates->count; j++) {
            const double wrong = j == i ? 0.0 : 0.5 * erfc(0.5 * verdict->distance[i][j] * M_SQRT1_2);
            odds += wrong / (1.0 - wrong);
            left += 2.0 * wrong;
        }
        verdict->confusion += candidates->candidate[i].weight * odds / (1.0 + odds);
        verdict->left += candidates->candidate[i].weight * left;
    }
}

/* One row of distances. */
static bool judge_truth(const struct plan_stage *stage, size_t right, int rounds, struct plan_room *room,
                        double distance[PLAN_CANDIDATES_MAX]) {
    struct plan_truth truth;
    if (!plan_truth_open(&truth, stage, right, room)) {
        return false;
    }
    leave_all(stage, &truth, rounds, room);
    for (size_t j = 0; j < stage->candidates->count; j++) {
        if (j != right) {
            leave(stage, &truth, j, rounds, room);
            distance[j] = distance_of(room);
        }
    }
    plan_truth_close(&truth);
    return true;
}

bool plan_judge(const struct plan_bench *bench, const struct plan_candidates *candidates,
                const struct plan_drive *drive, int rounds, struct plan_verdict *verdict) {
    struct plan_stage *stage = plan_stage_open(bench, candidates, drive);
    struct plan_room room = {.pose = NULL};
    bool sound = stage != NULL && plan_stage_spread(stage, rounds > 0 ? PLAN_STARTS : STARTS_QUICK) &&
                 plan_room_open(&room, stage);
    memset(verdict->distance, 0, sizeof verdict->distance);
    for (size_t i = 0; i < candidates->count && sound; i++) {
        sound = judge_truth(stage, i, rounds, &room, verdict->distance[i]);
    }
    conclude(candidates, verdict);
    plan_room_close(&room);
    plan_stage_close(stage);
    return sound;
}

bool plan_judge_sizes(const struct plan_bench *bench, const struct plan_candidates *candidates,
                      const struct plan_drive *drive, double size[PLAN_CANDIDATES_MAX]) {
    struct plan_stage *stage = plan_stage_open(bench, candidates, drive);
    struct plan_room room = {.pose = NULL};
    bool sound = stage != NULL && plan_room_open(&room, stage);
    for (size_t i = 0; i < candidates->count && sound; i++) {
        struct plan_truth truth;
        sound = plan_truth_open(&truth, stage, i, &room);
        if (sound) {
            plan_stage_compare(stage, &truth, &stage->base.model, &stage->base.trace, NULL, 0.0, &room,
                               room.residual);
            sum_parts(stage, room.residual, room.effect);
            size[i] = 0.0;
            for (size_t k = 0; k < PLAN_PARTS; k++) {
                size[i] += room.effect[k];
            }
            size[i] = sqrt(size[i]);
            plan_truth_close(&truth);
        }
    }
    plan_room_close(&room);
    plan_stage_close(stage);
    return sound;
}

bool plan_judge_match(const struct plan_bench *bench, struct plan_candidates *candidates, size_t leader,
                      const struct plan_drive *drive, int rounds) {
    struct plan_stage *stage = plan_stage_open(bench, candidates, drive);
    struct plan_room room = {.pose = NULL};
    struct plan_truth truth;
    bool sound = stage != NULL && plan_stage_spread(stage, PLAN_STARTS) && plan_room_open(&room, stage) &&
                 plan_truth_open(&truth, stage, leader, &room);
    for (size_t i = 0; i < candidates->count && sound; i++) {
        struct plan_candidate *candidate = &candidates->candidate[i];
        if (i != leader && !candidate->measured) {
            room.best = candidate->model;
            leave(stage, &truth, i, rounds, &room);
            *plan_candidate_effect(candidate) = room.best.effect[room.best.count - 1];
        }
    }
    if (sound) {
        plan_truth_close(&truth);
    }
    plan_room_close(&room);
    plan_stage_close(stage);
    return sound;
}
