#include "lcm/latency.h"

#include <math.h>

#define STEPS_AN_OCTAVE 8.0

static int step_of(int64_t delay_us) {
    const int step = delay_us > 1 ? (int)(STEPS_AN_OCTAVE * log2((double)delay_us)) : 0;
    return step < LATENCY_STEPS ? step : LATENCY_STEPS - 1;
}

void latency_add(struct latency *latency, int64_t delay_us) {
    latency->count[step_of(delay_us)]++;
    latency->total++;
}

int64_t latency_of(const struct latency *latency, double share) {
    const double wanted = share * (double)latency->total;
    double below = 0.0;
    for (int step = 0; step < LATENCY_STEPS && latency->total > 0; step++) {
        below += (double)latency->count[step];
        if (below >= wanted) {
            return llround(exp2(((double)step + 0.5) / STEPS_AN_OCTAVE));
        }
    }
    return 0;
}
