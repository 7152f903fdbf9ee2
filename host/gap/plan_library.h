/* The experiments that a plan is chosen from: safe ones, 20 to 40 s each, made to the module's measure. */
#ifndef TRIBEND_GAP_PLAN_LIBRARY_H
#define TRIBEND_GAP_PLAN_LIBRARY_H

#include "plan/plan.h"

#define PLAN_LIBRARY_MAX 16

struct plan_experiment {
    const char *name;
    const char *what; /* one sentence: what it shows */
    struct plan plan;
};

/* How far the experiments go: `bend_rad` is the greatest nominal bend, `lead` (1 to 3) the chamber that moves
 * where one does. Returns how many there are. */
size_t plan_library_make(const struct bend_table *table, size_t lead, double bend_rad,
                         struct plan_experiment experiment[PLAN_LIBRARY_MAX]);
/* The chamber at rest, then held at the greatest bend: what a plan is measured against. */
void plan_library_hold(const struct bend_table *table, size_t lead, double bend_rad,
                       struct plan_experiment *experiment);
/* Pressures that change at random times, to random heights, in all chambers. */
void plan_library_random(const struct bend_table *table, double bend_rad, uint64_t seed,
                         struct plan_experiment *experiment);
/* The pressure of one chamber alone that bends the module so far, at most nine tenths of the working
 * pressure. */
double plan_library_pressure(const struct bend_table *table, size_t chamber, double bend_rad);

#endif
