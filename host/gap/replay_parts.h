/* What the parts of the replay ask of each other: blocks and memory (replay_open.c), how noisy the sensors
 * are (replay_noise.c), pressures and their readings (replay_pressures.c), the tip (replay_tip.c), smoothing
 * and weights (replay_weights.c). For these files only. */
#ifndef TRIBEND_GAP_REPLAY_PARTS_H
#define TRIBEND_GAP_REPLAY_PARTS_H

#include "gap/replay.h"

#define READING_FLOOR_PA 4.0 /* what a sensor's steps leave in a mean, however many readings it has */

/* A recording that breaks off and goes on elsewhere: pressures are smoothed on either side, never across. */
struct replay_stretch {
    size_t block; /* first of its blocks .. */
    size_t blocks;
    size_t step; /* .. and of its steps */
    size_t end_step;
};

/* --- replay_open.c --- */

/* The pressure block that a step lies in. */
size_t replay_block_of_step(const struct replay *replay, size_t step);
/* Block of the level at a time in steps: levels stand for their block's middle. */
double replay_block_position(const struct replay *replay, double step);
/* The tip block that a tip sample lies in. */
size_t replay_tip_block(const struct replay_run *run, size_t tip);

/* --- replay_noise.c --- */

/* Noise of one sample of each sensor. False: out of memory. */
bool replay_find_noise(struct replay_run *run);
/* Variances of the pressure blocks' means, from the readings' noise. */
void replay_find_variance(const struct replay *replay, struct replay_run *run);

/* --- replay_pressures.c --- */

/* A plant with the model's scales and effects. */
void replay_set_up_plant(const struct replay *replay, const struct gap_model *model, struct plant *plant);
/* NaN: not measured. */
double replay_temperature_at(const struct gap_run *data, size_t row);
/* Interpolated between the `count` values, the first and the last of which go on beyond them. */
double replay_between(const double *value, size_t stride, size_t count, double position);
/* The index-th stretch of the run: the one after as many breaks. */
struct replay_stretch replay_stretch_at(const struct replay *replay, const struct replay_run *run,
                                        size_t index);

/* --- replay_tip.c --- */

/* Measured less simulated pose, block means, of one run: [tip_blocks * REPLAY_TIP_CHANNELS]. The pressure of
 * chamber `nudged` (3: of none) is taken to be `nudge_pa` more. */
void replay_tip_of_run(const struct replay *replay, const struct gap_model *model,
                       const struct replay_state *state, size_t index, bool from_duties, double nudge_pa,
                       size_t nudged, double *mean);

#endif
