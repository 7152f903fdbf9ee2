/* A mission on the host and on the emulated core side by side: the same bits, and what each call cost. */
#ifndef TRIBEND_COMPARE_H
#define TRIBEND_COMPARE_H

#include "call_counter.h"
#include "mission.h"

/* Instructions of one kind of call. */
struct cost {
    uint64_t *count;
    size_t calls;
    size_t room;
};

struct compare {
    struct call_counter *counter;
    struct mission mission;
    uint32_t frame_address;
    uint32_t active;            /* steps in which air could flow: a mission in FAULT costs little */
    struct cost step;           /* app_step(), with the stand-in for the hal */
    struct cost inversion_step; /* of an inversion; taking it up counts with the first */
    struct cost inversion;      /* all steps of one */
    double preview_rad[2];      /* worst residual of bends that can be reached, after the first and second step */
    char difference[256];       /* empty: none so far */
};

/* False: `difference` says why. */
bool compare_open(struct compare *compare, const char *elf_path, const void *image, size_t bytes,
                  enum frame_variant variant, uint64_t seed);
void compare_close(struct compare *compare);
/* False at the first bit that differs, or a call that does not return. */
bool compare_steps(struct compare *compare, uint32_t steps);
bool compare_inversions(struct compare *compare, uint32_t inversions);

double cost_mean(const struct cost *cost);
/* The count that `share` of the calls do not exceed; 1 gives the worst. */
uint64_t cost_quantile(const struct cost *cost, double share);

#endif
