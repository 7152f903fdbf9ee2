/* Whether the experiment of `tribend gap plan` told apart what a group could not, and whether a random one did. */
#ifndef TRIBEND_BLIND_SCORE_PLAN_H
#define TRIBEND_BLIND_SCORE_PLAN_H

#include "blind_score_case.h"

/* Cases whose answer is a group with the truth in it, and what became of them. */
struct score_plan {
    size_t groups;
    size_t outside;        /* groups without the truth in them: not counted above */
    size_t planned_halved; /* at least, with the truth still in it, or down to the right effects */
    size_t random_halved;
    size_t planned_better; /* fewer names left after the plan than after the random experiment, with the truth among them */
    size_t random_better;
};

/* How many effects an answer leaves possible: names of a group, or effects that are named; 0: neither. */
size_t score_names_left(const struct score_case *scored);
/* `after` is the same case, diagnosed with one more log. */
bool score_halved(const struct score_case *before, const struct score_case *after);
/* All three in the same order, `planned` and `random` with the answers after the experiments. */
struct score_plan score_plans(const struct score_case *cases, const struct score_case *planned, const struct score_case *random,
                              size_t count);

#endif
