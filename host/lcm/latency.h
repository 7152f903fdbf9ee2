/* A histogram of delays with eight steps an octave: median and percentiles within 9 %, in fixed memory. */
#ifndef TRIBEND_LATENCY_H
#define TRIBEND_LATENCY_H

#include <stdint.h>

#define LATENCY_STEPS 256 /* to 2^32 us */

struct latency {
    uint64_t count[LATENCY_STEPS];
    uint64_t total;
};

/* Negative delays (a clock that was set) count as 0. */
void latency_add(struct latency *latency, int64_t delay_us);
/* The delay that `share` of all stay under, us; 0 without any. */
int64_t latency_of(const struct latency *latency, double share);

#endif
