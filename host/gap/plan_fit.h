/* A candidate fitted to what another one shows: Levenberg and Marquardt's method within bounds, on the
 * whitened residuals of plan_stage.h. Stiffness and supply move with the candidate's own parameters; a weak
 * prior holds them where nothing else does. The cost is the sum of squares with the prior's. */
#ifndef TRIBEND_GAP_PLAN_FIT_H
#define TRIBEND_GAP_PLAN_FIT_H

#include "gap/plan_stage.h"

/* The least cost that the first order promises from a view; room->moved gets the residuals that are promised.
 */
double plan_fit_look(const struct plan_stage *stage, const struct plan_truth *truth,
                     const struct plan_view *view, struct plan_room *room);
/* At most `rounds` steps from a view on. Returns the least cost; room->tried and room->residual are where it
 * ended. */
double plan_fit_refine(const struct plan_stage *stage, const struct plan_truth *truth,
                       const struct plan_view *view, int rounds, struct plan_room *room);

#endif
