/* What else could be in an effect's place: other kinds, fitted anew beside the rest of the best model, with its onset and under
 * its weights, so that all are compared alike. */
#ifndef TRIBEND_GAP_RIVALS_H
#define TRIBEND_GAP_RIVALS_H

#include "gap/fit.h"

#define RIVALS_MAX 7

struct rival {
    const struct effect_kind *kind;
    struct effect effect; /* the first of its parts */
    struct fit fit;
    double belief; /* of the kinds in this place; they sum to one */
};

struct rivals {
    size_t place; /* in the best model */
    size_t count;
    struct rival rival[RIVALS_MAX]; /* the most believed first; the best model's own kind is one of them */
    struct fit rest;                /* the best model without any in this place, fitted anew */
};

struct search;

/* Fits the rivals of each kind that search->best names. Fills search->rivals and search->rivals_count. False: out of memory.
 *
 * A kind is believed in proportion to exp(-sum of (squares - best one's) / scale - parameters / 10) / sqrt(parameters), over
 * pressures and tip; the tenth is what a parameter fits of noise by chance (Akaike 1974), on that scale. The scale is ten times
 * what noise makes of the squares, plus a five hundredth of what the effect takes off, for what the form of a right effect may be
 * off by, plus a quarter of what the best there leaves beyond noise, by which forms are seen to be off. For an effect that hardly
 * acts on the pressures, what counts there is what all effects take off, by the greatest doubt of those that do act on them. */
bool rivals_find(struct search *search);

#endif
