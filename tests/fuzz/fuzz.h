/* What libFuzzer calls, once for each input; the same function runs the kept corpus in a plain build
 * (replay.c). */
#ifndef TRIBEND_FUZZ_H
#define TRIBEND_FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

/* A finding, with the place. */
#define fuzz_assert(holds)                                                                                   \
    do {                                                                                                     \
        if (!(holds)) {                                                                                      \
            (void)fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #holds);                 \
            abort();                                                                                         \
        }                                                                                                    \
    } while (0)

#endif
