/* Which way the gap goes while a pressure is held: does the module bend on after the model has stopped (creep, the model
 * lags behind), or does it sag, and how fast? Seen in the bend at the tip, measured minus simulated from the measured
 * pressures; where the orientation was not measured, the bend of a constant-curvature arc to the tip's position. */
#ifndef TRIBEND_GAP_DIRECTION_H
#define TRIBEND_GAP_DIRECTION_H

#include "gap/replay.h"

#define DIRECTION_HOLDS_MAX 64
#define DIRECTION_TEXT_BYTES 480

/* A stretch of at least a second after a step of the model's bend, in which the model's bend stays. Where pressures were only
 * commanded, the first NOISE_FLOOR_ARRIVES_S are left out: when they arrived is not known. */
struct direction_hold {
    size_t run;
    double from_s; /* of the log */
    double until_s;
    double bend_rad;        /* measured, at its end */
    double just_after_rad;  /* measured minus nominal model: over its first 0.2 s */
    double end_rad;         /* the same over its last 0.3 s */
    double growth;          /* what the bend gains over the hold beyond the model, as a share of the bend just after the step */
    double time_constant_s; /* of that, least squares on one exponential; NAN where the hold shows none */
};

struct direction {
    size_t holds;
    struct direction_hold hold[DIRECTION_HOLDS_MAX];
    bool from_orientation;
    /* Means over the holds, measured minus simulated; NAN where there is none. */
    double just_after_rad;
    double end_rad;
    double end_with_effects_rad; /* of the best model, held-out blocks only */
    double time_constant_s;      /* median of those that show one, and their range */
    double time_constant_low_s;
    double time_constant_high_s;
    double growth_low;
    double growth_high;
    char text[DIRECTION_TEXT_BYTES]; /* the same in words; "" without holds */
};

/* `nominal` and `best`: whitened residuals of the two models, as replay_tip() leaves them. False: out of memory. */
bool direction_find(struct direction *direction, const struct replay *replay, const double *nominal, const double *best);

#endif
