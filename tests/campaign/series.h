/* Which trials a campaign consists of, and running them on all cores. */
#ifndef TRIBEND_SERIES_H
#define TRIBEND_SERIES_H

#include "campaign/trial.h"

enum series_kind {
    SERIES_SOUND,  /* nothing breaks */
    SERIES_SINGLE, /* each injection in turn */
    SERIES_PAIRS   /* each pair in turn */
};

struct series {
    enum series_kind kind;
    uint64_t seed;
    size_t trials;
    const char *only; /* injections whose name or row has this in it; NULL: all */
    const char *elf;  /* flown by the emulated board; NULL: by the simulated one */
};

/* How many different trials there are before they repeat with other seeds: 0 where `only` matches nothing. */
size_t series_variants(const struct series *series);
void series_trial(const struct series *series, size_t index, struct trial *trial);
/* Runs all of them into result[trials]; done[i] says which were run before an interrupt. False: no memory, or an ELF that
 * cannot be run (and it has said so). */
bool series_run(const struct series *series, const struct bend_table *table, const struct plant_parameters *plant,
                struct trial_result *result, bool *done, bool shows_progress);

#endif
