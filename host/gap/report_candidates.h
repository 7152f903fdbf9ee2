/* What the search tried, as the HTML report shows it: each kind of effect by its best trial on its own, and
 * the kinds that were not tried, with the reason. */
#ifndef TRIBEND_GAP_REPORT_CANDIDATES_H
#define TRIBEND_GAP_REPORT_CANDIDATES_H

#include "gap/diagnosis.h"

struct report_candidate {
    const struct effect *effect;
    double closed; /* share of the held-out gap, on the scale of diagnosis->closed */
};

struct report_candidates {
    size_t count; /* most closed first */
    struct report_candidate list[SEARCH_CANDIDATES_MAX];
};

/* Replays every trial that is kept. False: out of memory. */
bool report_candidates_find(struct report_candidates *candidates, const struct diagnosis *diagnosis,
                            const struct search *search);
/* Why a kind was left out of the search; NULL: it was not. */
const char *report_why_untried(const struct search *search, const struct effect_kind *kind);

#endif
