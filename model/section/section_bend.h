/* From the section to the tip: the ends are not like the middle. */
#ifndef TRIBEND_SECTION_BEND_H
#define TRIBEND_SECTION_BEND_H

#include "section/section_solver.h"

/* Rotation of the tip face against the base, rad; the vector points where the tip moves (x, y of the base frame):
 *
 *   bend = curvature (length - balloon_ratio (width - diameter)) + cap_rotation sum_i (p_i / G) u_i
 *
 * The caps hold the balloon down over a length in proportion to its height, which then bends less; and the pressure on a
 * cap turns its face a little away from the chamber (u_i, unit), which counts at small bends. Both numbers are the
 * module's `end_correction`, found by comparison with a three-dimensional solution (docs/three-dimensional-check.md); zero
 * leaves bend = curvature x length. G is the shear modulus of the module's material. */
void section_tip_bend(const struct module_description *module, const struct section_state *state, double bend_rad[2]);

#endif
