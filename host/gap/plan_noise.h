/* What a difference between two predictions is worth: whitening by what no model gets right.
 *
 * Besides its sensors' noise, a real module differs from any model by something slow (it repeats itself to a
 * few tenths of a millimetre, and an effect's formula is only near to the truth). So a channel's noise is
 * white noise plus a first-order Markov process whose size may change with time; the Kalman filter's
 * innovations of any signal are the whitened signal. */
#ifndef TRIBEND_GAP_PLAN_NOISE_H
#define TRIBEND_GAP_PLAN_NOISE_H

#include <stdbool.h>
#include <stddef.h>

struct plan_noise {
    size_t samples;
    double *size;  /* [channels * samples] of the slow part, in the channel's unit */
    double *gain;  /* [channels * samples] */
    double *scale; /* [channels * samples] 1 / standard deviation of an innovation */
};

bool plan_noise_open(struct plan_noise *noise, size_t samples, size_t channels);
void plan_noise_close(struct plan_noise *noise);
/* Once noise->size is filled in: the filter of a channel. `memory_s` is the slow part's, `step_s` a sample's.
 */
void plan_noise_prepare(struct plan_noise *noise, size_t channel, double white, double memory_s,
                        double step_s);
/* In place; `signal` is [samples] with that stride. */
void plan_noise_whiten(const struct plan_noise *noise, size_t channel, double memory_s, double step_s,
                       double *signal, size_t stride);

#endif
