/* Seeded random numbers: SplitMix64 (Steele, Lea, Flood 2014). One stream for each sensor, so that reading one does not
 * change the noise of another. */
#ifndef TRIBEND_SIM_RANDOM_H
#define TRIBEND_SIM_RANDOM_H

#include <stdint.h>

struct random_stream {
    uint64_t state;
};

void random_seed(struct random_stream *stream, uint64_t seed, uint64_t which);
/* Uniform in (0, 1). */
double random_uniform(struct random_stream *stream);
/* Standard normal (Box and Muller 1958). */
double random_normal(struct random_stream *stream);

#endif
