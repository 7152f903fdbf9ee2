#include "blind_score_plan.h"

#include <string.h>

static bool says_group(const struct score_case *scored) {
    return scored->answered && strcmp(scored->said_verdict, "group") == 0;
}

/* A name stands in a group once for each chamber or form that it is possible with: it counts once. */
static size_t group_names(const struct score_case *scored) {
    size_t names = 0;
    for (size_t i = 0; i < scored->said_groups; i++) {
        bool again = false;
        for (size_t j = 0; j < i; j++) {
            again = again || strcmp(scored->said_group[i], scored->said_group[j]) == 0;
        }
        names += again ? 0 : 1;
    }
    return names;
}

size_t score_names_left(const struct score_case *scored) {
    if (says_group(scored)) {
        return group_names(scored);
    }
    return score_names_effects(scored) ? scored->said_effects : 0;
}

static bool all_named_are_true(const struct score_case *scored) {
    for (size_t i = 0; i < scored->said_effects; i++) {
        if (!score_is_true(scored, scored->said[i].name)) {
            return false;
        }
    }
    return score_names_effects(scored);
}

bool score_halved(const struct score_case *before, const struct score_case *after) {
    const size_t left = score_names_left(after);
    return all_named_are_true(after) ||
           (says_group(after) && score_in_group(after) && 2 * left <= score_names_left(before));
}

/* Fewer names, the truth among them. */
static bool is_better(const struct score_case *one, const struct score_case *other) {
    const bool mine = score_names_left(one) > 0 && score_in_group(one);
    const bool its = score_names_left(other) > 0 && score_in_group(other);
    return mine && (!its || score_names_left(one) < score_names_left(other));
}

struct score_plan score_plans(const struct score_case *cases, const struct score_case *planned, const struct score_case *random,
                              size_t count) {
    struct score_plan sum = {0};
    for (size_t i = 0; i < count; i++) {
        if (!says_group(&cases[i])) {
            continue;
        }
        if (!score_in_group(&cases[i])) {
            sum.outside++;
            continue;
        }
        sum.groups++;
        sum.planned_halved += score_halved(&cases[i], &planned[i]) ? 1 : 0;
        sum.random_halved += score_halved(&cases[i], &random[i]) ? 1 : 0;
        sum.planned_better += is_better(&planned[i], &random[i]) ? 1 : 0;
        sum.random_better += is_better(&random[i], &planned[i]) ? 1 : 0;
    }
    return sum;
}
