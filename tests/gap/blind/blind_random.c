#include "blind_random.h"

#include <math.h>

/* FNV-1a over the purpose, the index and the seed (Fowler, Noll, Vo). */
static uint64_t hash_of(uint64_t seed, const char *purpose, uint64_t index) {
    uint64_t hash = 14695981039346656037u;
    for (const char *letter = purpose; *letter != '\0'; letter++) {
        hash = (hash ^ (uint64_t)(unsigned char)*letter) * 1099511628211u;
    }
    for (unsigned byte = 0; byte < 16; byte++) {
        const uint64_t word = byte < 8 ? seed : index;
        hash = (hash ^ ((word >> (8u * (byte % 8u))) & 255u)) * 1099511628211u;
    }
    return hash;
}

void blind_random_open(struct blind_random *random, uint64_t seed, const char *purpose, uint64_t index) {
    const uint64_t hash = hash_of(seed, purpose, index);
    *random = (struct blind_random){.state = hash, .increment = (hash_of(hash, purpose, seed) << 1) | 1u};
    for (int i = 0; i < 4; i++) {
        (void)blind_random_u32(random);
    }
}

uint32_t blind_random_u32(struct blind_random *random) {
    const uint64_t old = random->state;
    random->state = old * 6364136223846793005u + random->increment;
    const uint32_t shifted = (uint32_t)(((old >> 18) ^ old) >> 27), turn = (uint32_t)(old >> 59);
    return (shifted >> turn) | (shifted << ((32u - turn) & 31u));
}

double blind_uniform(struct blind_random *random, double low, double high) {
    return low + (high - low) * ((double)blind_random_u32(random) + 0.5) / 4294967296.0;
}

double blind_log_uniform(struct blind_random *random, double low, double high) {
    return exp(blind_uniform(random, log(low), log(high)));
}

double blind_signed(struct blind_random *random, double low, double high) {
    const double size = blind_log_uniform(random, low, high);
    return blind_chance(random, 0.5) ? size : -size;
}

double blind_normal(struct blind_random *random) {
    if (random->has_spare) {
        random->has_spare = false;
        return random->spare;
    }
    double u = 0.0, v = 0.0, square = 0.0;
    do {
        u = blind_uniform(random, -1.0, 1.0);
        v = blind_uniform(random, -1.0, 1.0);
        square = u * u + v * v;
    } while (square >= 1.0 || square < 1e-30);
    const double factor = sqrt(-2.0 * log(square) / square);
    random->spare = v * factor;
    random->has_spare = true;
    return u * factor;
}

bool blind_chance(struct blind_random *random, double probability) {
    return blind_uniform(random, 0.0, 1.0) < probability;
}

size_t blind_below(struct blind_random *random, size_t count) {
    return (size_t)(((uint64_t)blind_random_u32(random) * (uint64_t)count) >> 32);
}

void blind_direction(struct blind_random *random, double length, double vector[3]) {
    double square = 0.0;
    for (int i = 0; i < 3; i++) {
        vector[i] = blind_normal(random);
        square += vector[i] * vector[i];
    }
    for (int i = 0; i < 3; i++) {
        vector[i] *= length / sqrt(square);
    }
}
