/* The models that a diagnosis could not tell apart, each as a model of the whole module. */
#ifndef TRIBEND_GAP_PLAN_CANDIDATES_H
#define TRIBEND_GAP_PLAN_CANDIDATES_H

#include "gap/gap_model.h"

#define PLAN_CANDIDATES_MAX 12
#define PLAN_LABEL_BYTES 96

struct plan_candidate {
    struct gap_model model; /* its last effect is the one in question */
    char label[PLAN_LABEL_BYTES];
    double weight; /* how far it is believed; all weights add up to 1 */
    bool measured; /* its parameters are a diagnosis'; else typical ones */
};

struct plan_candidates {
    struct gap_model base; /* what is taken for sure: recalibration, effects that are not in question */
    size_t count;
    struct plan_candidate candidate[PLAN_CANDIDATES_MAX];
};

void plan_candidates_init(struct plan_candidates *candidates);
/* "NAME" or "NAME:parameter=value,.." as effect_parse() reads it, equally believed. False: `error` says why.
 */
bool plan_candidates_add(struct plan_candidates *candidates, const char *text, char *error,
                         size_t error_bytes);
/* From a report of `tribend gap diagnose --json`: its group, else the effect that it believes least and its
 * alternatives, with what it says of their parameters and how far it believes them. `module` (of
 * PLAN_LABEL_BYTES) gets the module's name. */
bool plan_candidates_read(struct plan_candidates *candidates, const char *path, char *module, char *error,
                          size_t error_bytes);
/* Weights that add up to 1. False: fewer than two candidates, or two that are the same; `error` says so. */
bool plan_candidates_finish(struct plan_candidates *candidates, char *error, size_t error_bytes);
/* The effect in question. */
struct effect *plan_candidate_effect(struct plan_candidate *candidate);
/* The chamber, 1 to 3, that the candidates are about; 1 where they are about all or different ones. */
size_t plan_candidates_lead(const struct plan_candidates *candidates);
/* The effect's deviation from `none` times `factor`, within its bounds. */
void plan_candidate_scale(struct plan_candidate *candidate, double factor);

#endif
