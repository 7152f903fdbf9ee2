/* Seeded random numbers of the blind data: PCG32 (O'Neill 2014) and Marsaglia's polar normal. A stream is named by what it
 * is for and by an index, so that one more draw in one place changes nothing elsewhere. */
#ifndef TRIBEND_BLIND_RANDOM_H
#define TRIBEND_BLIND_RANDOM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct blind_random {
    uint64_t state;
    uint64_t increment;
    double spare;
    bool has_spare;
};

void blind_random_open(struct blind_random *random, uint64_t seed, const char *purpose, uint64_t index);
uint32_t blind_random_u32(struct blind_random *random);
/* Uniform in (low, high). */
double blind_uniform(struct blind_random *random, double low, double high);
/* Uniform in the logarithm; both ends above zero. */
double blind_log_uniform(struct blind_random *random, double low, double high);
/* Magnitude uniform in the logarithm, either sign. */
double blind_signed(struct blind_random *random, double low, double high);
double blind_normal(struct blind_random *random);
bool blind_chance(struct blind_random *random, double probability);
/* 0 .. count - 1. */
size_t blind_below(struct blind_random *random, size_t count);
/* A vector of the given length, all directions alike. */
void blind_direction(struct blind_random *random, double length, double vector[3]);

#endif
