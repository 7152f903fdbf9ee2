/* The replay where another simulator's outputs are the baseline (gap/baseline.h). Its pressures stand in for those that the
 * duties make; its pose is moved by what the model's effects, its stiffness and the difference between its pressures and the
 * measured ones change in our own table model:
 *
 *   pose = change of the table model's pose, from the simulator's pressures without effects to the estimated ones with them,
 *          put onto the simulator's pose; then the tip sensor's effects
 *
 * So that the change has the right size, the table model is first given the stiffness with which it moves most like the
 * other simulator. */
#ifndef TRIBEND_GAP_REPLAY_ELSEWHERE_H
#define TRIBEND_GAP_REPLAY_ELSEWHERE_H

#include "gap/replay.h"

/* The simulator's pressures at the end of each step of a run. */
void replay_elsewhere_pressures(const struct replay *replay, size_t index, double *pressure_pa);
/* What plant_sample_tip() does, for tip sample `i` of a run: into plant->pose. `step_s`: since the last one. */
void replay_elsewhere_sample(const struct replay *replay, size_t index, const struct replay_state *state, struct plant *plant,
                             size_t i, const double pressure_pa[3], double step_s, double chance);
/* What the simulator says of the position's part `k` (kind 0), or of twice the quaternion's (kind 1), at tip sample `i`: taken
 * off the measured one, since its own noise counts as well. */
double replay_elsewhere_noise_part(const struct gap_run *run, size_t i, size_t kind, size_t k);
/* Finds replay->elsewhere from the pressures in `state`, those of a model without effects. */
void replay_elsewhere_match(struct replay *replay, const struct replay_state *state);

#endif
