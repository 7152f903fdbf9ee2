/* What a search found, said so that a person can act on it: verdict, where, which, how far. */
#ifndef TRIBEND_GAP_DIAGNOSIS_H
#define TRIBEND_GAP_DIAGNOSIS_H

#include "gap/dependence.h"
#include "gap/direction.h"
#include "gap/search.h"

#define DIAGNOSIS_NAMES_MAX 8
#define DIAGNOSIS_WARNINGS_MAX 12
#define DIAGNOSIS_TEXT_BYTES 320
#define DIAGNOSIS_CLOSEST_MAX 4
#define DIAGNOSIS_RESIDUALS 5
#define DIAGNOSIS_MODELS 3 /* nominal, recalibrated, with effects */

enum gap_verdict {
    GAP_NONE,
    GAP_RECALIBRATE,
    GAP_EFFECT,
    GAP_EFFECTS,
    GAP_GROUP,
    GAP_UNKNOWN,
    GAP_INSUFFICIENT_DATA,
    GAP_VERDICT_COUNT
};

struct diagnosis_interval {
    double value;
    double low; /* 90 % */
    double high;
};

struct diagnosis_effect {
    const struct effect_kind *kind;
    size_t form;
    size_t place; /* in the search's best model */
    size_t chamber;
    double onset_s;
    bool latent; /* it remembers what was before its onset */
    double probability;
    struct diagnosis_interval parameter[EFFECT_PARAMETERS_MAX];
};

/* Root mean square of one residual on held-out data, in its own unit. */
struct diagnosis_gap {
    const char *name;
    const char *unit;
    bool measured;
    double before;
    double after_recalibration;
    double after_effect;
    double floor;
    double low[DIAGNOSIS_MODELS]; /* 90 % of the three figures, in their order: blocks of time resampled */
    double high[DIAGNOSIS_MODELS];
};

/* What else was tried, each kind by its best: in place of the last effect, or alone where the verdict names
 * none. */
struct diagnosis_alternative {
    const struct effect *effect;
    double probability;
    double structure; /* left, in units of the noise's mean square */
};

/* A model that was tried, and the share of the held-out gap that it closes beyond the noise floor. */
struct diagnosis_closest {
    struct gap_model model;
    double closed;
};

struct diagnosis {
    enum gap_verdict verdict;
    const char *stage; /* of the locus; "" where there is none */
    bool chamber[3];
    char regime[DIAGNOSIS_TEXT_BYTES];
    size_t effects;
    struct diagnosis_effect effect[GAP_EFFECTS_MAX];
    size_t group;
    const char *group_name[DIAGNOSIS_NAMES_MAX];
    double group_probability[DIAGNOSIS_NAMES_MAX];
    size_t alternatives;
    struct diagnosis_alternative alternative[DIAGNOSIS_NAMES_MAX];
    struct diagnosis_interval stiffness_scale;
    struct diagnosis_interval supply_scale;
    struct diagnosis_gap gap[DIAGNOSIS_RESIDUALS];
    struct diagnosis_interval closed;               /* share of the gap closed by everything */
    struct diagnosis_interval closed_recalibration; /* by recalibration alone */
    double structure[3];    /* share of noise floor squared that is left: nominal, recalibrated, best */
    const char *rest_stage; /* where the best model leaves most */
    bool rest_chamber[3];
    struct dependences
        dependences; /* where inside a stage; of the best model too where that is no explanation */
    char description[DIAGNOSIS_TEXT_BYTES]; /* of an unknown gap */
    struct direction direction;             /* which way the gap goes while a pressure is held */
    size_t closest;                         /* of an unknown gap: what comes nearest, best first */
    struct diagnosis_closest closest_model[DIAGNOSIS_CLOSEST_MAX];
    char next_experiment[DIAGNOSIS_TEXT_BYTES];
    size_t warnings;
    char warning[DIAGNOSIS_WARNINGS_MAX][DIAGNOSIS_TEXT_BYTES];
};

const char *gap_verdict_name(enum gap_verdict verdict);
/* Draws the conclusions. False: out of memory. */
bool diagnosis_conclude(struct diagnosis *diagnosis, struct search *search);
void diagnosis_warn(struct diagnosis *diagnosis, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
