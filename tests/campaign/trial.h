/* One trial of the campaign: a random mission on the simulated or the emulated board, one or two injections at random times,
 * and what the oracle says of it. A number and a seed give the same trial again, on any machine and thread. */
#ifndef TRIBEND_TRIAL_H
#define TRIBEND_TRIAL_H

#include "campaign/bench.h"
#include "campaign/mission.h"
#include "campaign/vehicle.h"

#define TRIAL_NONE SIZE_MAX

struct trial {
    uint64_t seed;        /* of everything in it */
    size_t injection[2];  /* the second may be TRIAL_NONE; both may, for a mission in which nothing breaks */
};

/* The memory that a thread runs trials in. */
struct trial_place {
    const struct bend_table *plant_table;
    struct bend_table table;
    uint8_t *image;
    struct bench bench;
    struct vehicle vehicle; /* the bench, unless another one is put here */
    double *flown_pa; /* [MISSION_LENGTH_US / CONTROLLER_STEP_US][3] of the last flight, */
    double *twin_pa;  /* and of the same mission in which nothing breaks */
};

enum trial_end {
    TRIAL_LATCHED,    /* a fault was latched */
    TRIAL_WARNED,     /* the warnings that belong to it came, and no fault */
    TRIAL_HARMLESS,   /* nothing was said, and the true pressures went as without it, or only down, valves off */
    TRIAL_UNDETECTED, /* nothing was said, and they did not */
    TRIAL_END_COUNT
};

struct trial_result {
    enum trial_end end;
    struct oracle oracle;
    int64_t fault_us[2];  /* since the start */
    size_t chamber[2];
    int64_t seen_us;      /* from the first injection to fault or warning, ORACLE_NEVER */
    double apart_pa;      /* how far the pressures went from those without it, where nothing was said */
    bool cleared;         /* the operator cleared and went on: times to vent do not count */
    bool false_alarm;     /* a fault latched before anything was wrong */
};

#define TRIAL_APART_PA 1000.0
#define TRIAL_APART_STEPS 250 /* steep flanks that come so much sooner or later are not apart */

/* False: no memory. `image` is copied. */
bool trial_place_open(struct trial_place *place, const struct bend_table *table);
void trial_place_close(struct trial_place *place);
void trial_run(struct trial_place *place, const struct plant_parameters *plant, const struct trial *trial,
               struct trial_result *result);

#endif
