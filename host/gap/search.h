/* Which effects of the catalogue explain the gap: every one alone, then stepwise and in pairs, compared on the blocks that
 * were held out of the fit. */
#ifndef TRIBEND_GAP_SEARCH_H
#define TRIBEND_GAP_SEARCH_H

#include <signal.h>

#include "gap/fit.h"
#include "gap/rivals.h"

#define SEARCH_CANDIDATES_MAX 160
#define SEARCH_TRIED_MAX 512
#define SEARCH_STEPS_MAX 3 /* effects on one module at once */

struct search_options {
    const char *const *without; /* names that are not tried */
    size_t without_count;
    int threads;                /* 0: all cores */
    const volatile sig_atomic_t *stop;
    void *context;
    void (*progress)(void *context, const char *what, size_t done, size_t total); /* may be NULL */
};

/* A model that was tried in place of, or on top of, the one before. */
struct search_trial {
    struct fit fit;
    size_t step; /* 0: one effect, 1: two, .. */
};

struct search {
    const struct gap_data *data;
    struct replay replay;
    struct replay coarse; /* follows it */
    struct search_options options;
    struct fit nominal;      /* nothing fitted */
    struct fit recalibrated; /* stiffness and supply fitted */
    struct fit best;         /* with the effects that earn their place; the recalibrated one where none does */
    struct fit everything;   /* the best one's parameters from all blocks, held-out ones too */
    size_t trials;
    struct search_trial trial[SEARCH_TRIED_MAX]; /* refined ones of all steps */
    double onset_s; /* before it no candidate acts */
    size_t rivals_count;
    struct rivals rivals[SEARCH_STEPS_MAX]; /* of each kind that the best model names */
    bool interrupted;
};

/* False: out of memory, or interrupted before anything was known. */
bool search_run(struct search *search, const struct gap_data *data, const struct bend_table *table,
                const struct plant_parameters *nominal, const struct search_options *options);
/* Was the name not to be tried? */
bool search_leaves_out(const struct search *search, const char *name);
void search_close(struct search *search);

#endif
