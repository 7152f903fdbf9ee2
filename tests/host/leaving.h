/* Fits that are made up, by what each leaves of the pressures and of the tip. Header only. */
#ifndef TRIBEND_TEST_LEAVING_H
#define TRIBEND_TEST_LEAVING_H

#include "gap/search_parts.h"
#include "support/test.h"

#define COUNT 4000.0 /* residuals of each group that were held out */
#define NOISE 0.6    /* their mean square where nothing is left */

/* A model of up to two effects that leaves so much structure in the pressures and at the tip. */
static inline struct fit leaving(double pressures, double tip, const char *first, const char *second) {
    struct fit fit = {.model = {.stiffness_scale = 1.0, .supply_scale = 1.0}, .sound = true};
    const double left[FIT_GROUPS] = {pressures, tip};
    const char *const text[] = {first, second};
    for (size_t e = 0; e < 2 && text[e] != NULL; e++) {
        struct effect effect;
        char error[256];
        if (!effect_parse(text[e], &effect, error, sizeof error)) {
            fail_msg("%s", error);
        }
        gap_model_add(&fit.model, &effect);
    }
    for (size_t g = 0; g < FIT_GROUPS; g++) {
        fit.sums.part[1][g] = (struct fit_part){COUNT * (left[g] + NOISE), COUNT, COUNT * NOISE, COUNT, 1.2};
    }
    return fit;
}

#endif
