#include "gap/plan_match.h"

#include <math.h>

#define ROUNDS 4
#define VISIBLE 3.0      /* an effect that shows less than this cannot be sized by it */
#define FACTOR_MOST 4.0  /* of its typical size, either way */
#define FITTED_LEAST 0.5 /* of the leader's size */

/* The first that was measured, else the first. */
static size_t find_leader(const struct plan_candidates *candidates) {
    for (size_t i = 0; i < candidates->count; i++) {
        if (candidates->candidate[i].measured) {
            return i;
        }
    }
    return 0;
}

/* Back to what it was where a fit came out much smaller than the leader: it explains something else, and a
 * fit that failed must not look like an effect that is not there. */
static void restore_misfits(struct plan_candidates *candidates, const double *size, size_t leader,
                            const struct effect *typical, bool *is_fitted) {
    for (size_t i = 0; i < candidates->count; i++) {
        is_fitted[i] =
            i == leader || candidates->candidate[i].measured || size[i] > FITTED_LEAST * size[leader];
        if (!is_fitted[i]) {
            *plan_candidate_effect(&candidates->candidate[i]) = typical[i];
        }
    }
}

/* What could not be fitted is made as large as the leader. False: out of memory. */
static bool match_sizes(const struct plan_bench *bench, struct plan_candidates *candidates,
                        const struct plan_drive *drive, size_t leader, const bool *is_fitted) {
    double size[PLAN_CANDIDATES_MAX] = {0.0}, factor[PLAN_CANDIDATES_MAX];
    for (size_t i = 0; i < PLAN_CANDIDATES_MAX; i++) {
        factor[i] = 1.0;
    }
    for (int round = 0; round < ROUNDS; round++) {
        if (!plan_judge_sizes(bench, candidates, drive, size)) {
            return false;
        }
        for (size_t i = 0; i < candidates->count; i++) {
            if (is_fitted[i] || size[i] < VISIBLE || size[leader] < VISIBLE) {
                continue;
            }
            const double wanted =
                fmin(fmax(factor[i] * size[leader] / size[i], 1.0 / FACTOR_MOST), FACTOR_MOST);
            plan_candidate_scale(&candidates->candidate[i], wanted / factor[i]);
            factor[i] = wanted;
        }
    }
    return true;
}

bool plan_match(const struct plan_bench *bench, struct plan_candidates *candidates,
                const struct plan_drive *drive) {
    const size_t leader = find_leader(candidates);
    struct effect typical[PLAN_CANDIDATES_MAX];
    double size[PLAN_CANDIDATES_MAX] = {0.0};
    bool is_fitted[PLAN_CANDIDATES_MAX] = {false};
    for (size_t i = 0; i < candidates->count; i++) {
        typical[i] = *plan_candidate_effect(&candidates->candidate[i]);
    }
    if (!plan_judge_match(bench, candidates, leader, drive, PLAN_ROUNDS) ||
        !plan_judge_sizes(bench, candidates, drive, size)) {
        return false;
    }
    restore_misfits(candidates, size, leader, typical, is_fitted);
    return match_sizes(bench, candidates, drive, leader, is_fitted);
}
