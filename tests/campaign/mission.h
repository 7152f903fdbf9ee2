/* A random mission: a plan of bends, steps, ramps, sines, co-contraction, vents and holds, and when its commands are sent.
 * Knows nothing of what it drives. A lab keeps its working limit above what it uses: missions ask for no more than
 * MISSION_MOST_SHARE of it, so that the limit itself can be held against a fault. */
#ifndef TRIBEND_MISSION_H
#define TRIBEND_MISSION_H

#include "plan/plan.h"

#define MISSION_LENGTH_US 12000000
#define MISSION_MOST_SHARE 0.9
#define MISSION_HOLDS 4

struct mission {
    struct plan plan;
    double hold_from_s[MISSION_HOLDS]; /* the last part of some steps is held */
    double hold_to_s[MISSION_HOLDS];
    size_t holds;
    int64_t phase_us; /* of its commands */
};

/* The same seed gives the same mission. */
void mission_random(struct mission *mission, const struct bend_table_module *module, uint64_t seed);
/* The command that is sent at `time_us` since the start; false: none is sent then. */
bool mission_command(const struct mission *mission, int64_t time_us, struct controller_command *command);

#endif
