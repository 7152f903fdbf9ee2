/* An experiment as each candidate sees it: what its gas does, what it would show, and what of another's
 * showing it leaves unexplained. Internal to plan_judge.c; split from it for its size. */
#ifndef TRIBEND_GAP_PLAN_STAGE_H
#define TRIBEND_GAP_PLAN_STAGE_H

#include "gap/plan_candidates.h"
#include "gap/plan_noise.h"
#include "gap/plan_predict.h"

#define PLAN_STARTS 8
#define PLAN_LEVELS 3 /* of a chamber: it hardly bends, it bends, it bends far */
#define PLAN_PARTS (PLAN_LEVELS * PLAN_LEVELS * PLAN_LEVELS)

/* A model to start a fit from, what the gas does under it, and how that moves with its parameters. */
struct plan_view {
    size_t candidate;
    struct gap_model model;
    struct plan_trace trace;
    struct plan_trace
        moved[GAP_PARAMETERS_MAX]; /* derivatives; samples 0: this parameter does not move the gas */
};

struct plan_stage {
    const struct plan_bench *bench;
    const struct plan_candidates *candidates;
    const struct plan_drive *drive;
    size_t samples;
    size_t residuals; /* PLAN_CHANNELS a sample */
    unsigned char
        *part; /* [samples] in which part of its working range the module is: the levels of its chambers */
    struct plan_view base; /* none of the candidates */
    size_t views;
    struct plan_view view[PLAN_CANDIDATES_MAX * PLAN_STARTS]; /* of each candidate, where it stands first */
};

/* What a candidate shows where it is the right one, and the noise on that. */
struct plan_truth {
    const struct plan_trace *trace;
    struct tip_pose *pose;
    struct plan_noise noise;
};

/* A thread's room to work in. */
struct plan_room {
    struct plan_view tried;  /* where a fit stands */
    struct plan_trace trial; /* and what its next step would do */
    struct gap_model best;   /* where the best of several fits ended */
    double *pressure_pa;     /* [3 * samples] */
    struct tip_pose *pose;
    struct tip_pose *nudged;
    double *residual;
    double *moved;
    double *jacobian; /* [GAP_PARAMETERS_MAX][residuals] */
    double
        left[PLAN_PARTS]; /* squares that the best of several fits leaves in each part of the working range */
    double effect[PLAN_PARTS]; /* squares that there are to explain */
};

/* Every candidate where it stands. NULL: out of memory. */
struct plan_stage *plan_stage_open(const struct plan_bench *bench, const struct plan_candidates *candidates,
                                   const struct plan_drive *drive);
/* More starts, `most` in all (PLAN_STARTS at most) for a candidate, and derivatives. False: out of memory. */
bool plan_stage_spread(struct plan_stage *stage, size_t most);
void plan_stage_close(struct plan_stage *stage);
/* Derivatives by the effects' own parameters at view->model, whose gas is in view->trace. False: out of
 * memory. */
bool plan_stage_derive(const struct plan_stage *stage, struct plan_view *view);
/* A view's model, gas and derivatives into another one. False: out of memory. */
bool plan_view_copy(const struct plan_view *from, struct plan_view *to);
/* The gas under `model`, near `from`: simulated, or where only small changes of stiffness and supply move it,
 * along the derivatives. */
void plan_stage_gas(const struct plan_stage *stage, const struct plan_view *from,
                    const struct gap_model *model, struct plan_trace *trace);
bool plan_room_open(struct plan_room *room, const struct plan_stage *stage);
void plan_room_close(struct plan_room *room);

/* What the stage shows where that candidate is the truth. False: the room has no memory for it. */
bool plan_truth_open(struct plan_truth *truth, const struct plan_stage *stage, size_t candidate,
                     struct plan_room *room);
void plan_truth_close(struct plan_truth *truth);

/* For differences: how far a parameter is moved. */
double plan_stage_step(const struct gap_parameter *parameter);
/* What the truth shows less what `model` says of it, whitened; its gas is in `trace`, moved by `step` along
 * `along` (may be NULL). */
void plan_stage_compare(const struct plan_stage *stage, const struct plan_truth *truth,
                        const struct gap_model *model, const struct plan_trace *trace,
                        const struct plan_trace *along, double step, struct plan_room *room,
                        double *residual);

#endif
