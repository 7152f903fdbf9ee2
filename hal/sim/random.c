#include "sim/random.h"

#include <math.h>

static uint64_t next(struct random_stream *stream) {
    stream->state += 0x9e3779b97f4a7c15u;
    uint64_t z = stream->state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

void random_seed(struct random_stream *stream, uint64_t seed, uint64_t which) {
    stream->state = seed ^ (which * 0xd1b54a32d192ed03u);
    (void)next(stream);
}

double random_uniform(struct random_stream *stream) {
    return ((double)(next(stream) >> 11) + 0.5) * (1.0 / 9007199254740992.0);
}

double random_normal(struct random_stream *stream) {
    const double radius = sqrt(-2.0 * log(random_uniform(stream)));
    return radius * cos(2.0 * M_PI * random_uniform(stream));
}
