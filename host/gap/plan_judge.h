/* How well an experiment tells candidates apart.
 *
 * It is worth what it leaves of the difference between two candidates after the wrong one has been refitted
 * to what the right one shows (T-optimality: Atkinson and Fedorov 1975, The design of experiments for
 * discriminating between two rival models, Biometrika 62): stiffness, supply and the wrong candidate's own
 * parameters, from several starts. With d the length of what is left, in units of the noise and of how far an
 * effect may be from its formula, the wrong one is preferred with the probability Phi(-d / 2).
 *
 * Each candidate sees what a diagnosis sees: pressure readings, simulated from the duties, and poses,
 * simulated from the readings corrected by what it says of the sensors. Noise is that of plan_noise.h. */
#ifndef TRIBEND_GAP_PLAN_JUDGE_H
#define TRIBEND_GAP_PLAN_JUDGE_H

#include "gap/plan_candidates.h"
#include "gap/plan_predict.h"

#define PLAN_NAME_BYTES 96

#define PLAN_ROUNDS 8 /* of refitting that are enough */

struct plan_verdict {
    char name[PLAN_NAME_BYTES];
    double length_s;
    struct plan_reach reach; /* the farthest that a candidate goes */
    double confusion;        /* expected probability of a wrong choice among all candidates */
    double left;             /* expected number of candidates that still fit, the right one included */
    double distance[PLAN_CANDIDATES_MAX][PLAN_CANDIDATES_MAX]; /* d: [right][wrong] */
};

/* Distances, confusion and number left; the rest of `verdict` stays. `rounds` of refitting; 0: to first
 * order, which is quick and a little too hopeful. False: out of memory. */
bool plan_judge(const struct plan_bench *bench, const struct plan_candidates *candidates,
                const struct plan_drive *drive, int rounds, struct plan_verdict *verdict);
/* How much each candidate's effect shows beside the model without it, in units of the noise. */
bool plan_judge_sizes(const struct plan_bench *bench, const struct plan_candidates *candidates,
                      const struct plan_drive *drive, double size[PLAN_CANDIDATES_MAX]);
/* Fits every candidate that was not measured to what `leader` shows: it has to explain the same. */
bool plan_judge_match(const struct plan_bench *bench, struct plan_candidates *candidates, size_t leader,
                      const struct plan_drive *drive, int rounds);

#endif
