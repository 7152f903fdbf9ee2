/* Candidates of equal standing: what has been recorded is explained by any of them, so each has to show what
 * the leader shows, the first one that a diagnosis measured, else the first. */
#ifndef TRIBEND_GAP_PLAN_MATCH_H
#define TRIBEND_GAP_PLAN_MATCH_H

#include "gap/plan_judge.h"

/* Fits every candidate that was not measured to what the leader shows under `drive`; one that cannot show
 * anything like it is made as large. False: out of memory. */
bool plan_match(const struct plan_bench *bench, struct plan_candidates *candidates,
                const struct plan_drive *drive);

#endif
