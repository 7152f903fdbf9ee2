/* What chamber 1 alone does beyond the pressure at which it snaps: rubber that softens gives a greatest pressure (limit
 * point), beyond which the chamber balloons at falling pressure, and, if it stiffens again, a least one, from which a
 * second stable branch rises. Followed by volume, along which the states are one smooth curve (Alexander 1971). */
#ifndef TRIBEND_SNAP_H
#define TRIBEND_SNAP_H

#include "section/section_solver.h"

#define SNAP_VOLUMES 24 /* nodes on the ballooned grid's volume axis */
#define SNAP_OTHERS 7   /* and on the other two chambers' pressure axes */

struct snap {
    double jump_up_pa;              /* 0: there is no limit point up to the pressure asked about */
    double jump_down_pa;            /* 0: no second stable branch */
    double volume_m2[SNAP_VOLUMES]; /* of chamber 1 per reference length; [0] = 0: the curve ends at once, no grid */
    double others_pa[SNAP_OTHERS];
};

/* Follows chamber 1 alone from nothing until it holds `most_pa` on the second branch, the curvature is `most_1pm`, walls
 * touch, the rubber loses ellipticity or nothing is found any more. The solver is left anywhere. */
void snap_find(struct section_solver *solver, double most_pa, double most_1pm, struct snap *snap);

#endif
