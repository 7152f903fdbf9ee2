/* Which experiment tells the remaining candidates apart best.
 *
 * A library of safe experiments is made to the module's measure, each is judged (plan_judge.h), and the best
 * one, or the best two one after the other where one alone is not enough, becomes the plan. Safe: under none
 * of the candidates does the module, in closed loop, pass its bend limit or its working pressure. */
#ifndef TRIBEND_GAP_PLAN_SEARCH_H
#define TRIBEND_GAP_PLAN_SEARCH_H

#include <signal.h>

#include "gap/plan_judge.h"
#include "gap/plan_library.h"

#define PLAN_TRIED_MAX 24

struct plan_search_options {
    const struct gap_run *run; /* what has been recorded, with duties; NULL: a constant hold stands for it */
    int threads;               /* 0: all cores */
    const volatile sig_atomic_t *stop;
    void *context;
    void (*progress)(void *context, const char *what, size_t done, size_t total); /* may be NULL */
};

/* An experiment, and how well it does. */
struct plan_trial {
    struct plan_experiment experiment;
    struct plan_verdict verdict;
    bool safe;
    bool refined; /* else judged to first order, and only so far that it cannot be the best */
};

struct plan_search {
    struct plan_verdict before; /* of what has been recorded */
    struct plan_verdict random; /* of pressures at random, as a measure of the others */
    size_t tried;
    struct plan_trial *trial[PLAN_TRIED_MAX]; /* safe ones first, least confusion first */
    double bend_rad;                          /* the greatest nominal bend of the experiments */
};

enum plan_outcome { PLAN_FOUND, PLAN_INTERRUPTED, PLAN_NO_MEMORY, PLAN_UNSAFE };

/* Sizes the candidates to what has been recorded, and searches; with PLAN_FOUND, trial[0] is the answer. */
enum plan_outcome plan_search_run(struct plan_search *search, const struct plan_bench *bench,
                                  struct plan_candidates *candidates,
                                  const struct plan_search_options *options);
void plan_search_close(struct plan_search *search);
/* One plan alone. False: out of memory. */
bool plan_search_judge(const struct plan_bench *bench, const struct plan_candidates *candidates,
                       const struct plan *plan, struct plan_verdict *verdict);

#endif
