/* Which differences of neighbouring residuals are noise, and what noise they do not show.
 *
 * The noise floor is half the mean square of neighbours' differences (von Neumann 1941). That takes the model's error to be
 * the same in both, which it is not where the recording was cut between them, nor, in a log without duties, while the
 * pressure moves: how it got from one sample to the next is then not known. Such pairs are marked and left out. With duties
 * the replay knows what happened in between, and all pairs count but those across a cut.
 *
 * Without duties the tip is simulated from readings that were smoothed, and what is left of their noise is the same in
 * neighbouring blocks: a difference does not show it. Its share of a block's noise, replay->lasting, is added (replay_tune()
 * knows it: how the smoothed pressure may be off, times how far that turns the tip). */
#ifndef TRIBEND_GAP_NOISE_FLOOR_H
#define TRIBEND_GAP_NOISE_FLOOR_H

#include <stddef.h>

/* Where only the command is known, the pressure has arrived by then after it. */
#define NOISE_FLOOR_ARRIVES_S 0.5

struct replay;

/* Fills replay->apart for one run; its noise levels must be known. */
void noise_floor_mark(struct replay *replay, size_t run);

#endif
