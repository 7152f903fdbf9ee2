/* The measures of the design page, as far as single answers can be scored. */
#ifndef TRIBEND_BLIND_SCORE_MEASURE_H
#define TRIBEND_BLIND_SCORE_MEASURE_H

#include "blind_score_case.h"

/* A rate: of the cases that count, those that are right (or, for a bound from above, those that are as they must not be). */
struct score_measure {
    const char *name;
    double target;
    bool at_most;
    bool (*counts)(const struct score_case *scored);
    bool (*hit)(const struct score_case *scored);
};

extern const struct score_measure score_measures[];
extern const size_t score_measure_count;

/* Wilson's interval of 95 % (Wilson 1927). */
void score_wilson(size_t hits, size_t count, double *low, double *high);

/* Of the parameters that truth and a right answer share: how far off, relative to the size of the effect, and whether the
 * answer's interval covers the truth. */
struct score_parameters {
    double *error; /* owned by the caller, room for all */
    size_t errors;
    size_t covered;
    size_t intervals;
};
void score_add_parameters(const struct score_case *scored, struct score_parameters *sum);

/* Expected calibration error of the top effects' probabilities in bins of equal mass. NaN: none were given. */
double score_calibration(const struct score_case *cases, size_t count, size_t bins, size_t *used);
/* NaN where there are none; sorts. */
double score_median(double *value, size_t count);
/* The answer to this case is one that a measure calls wrong. */
bool score_failed(const struct score_case *scored);

#endif
