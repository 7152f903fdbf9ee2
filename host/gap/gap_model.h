/* A model of the module: its nominal parameters and the effects that are added. */
#ifndef TRIBEND_GAP_MODEL_H
#define TRIBEND_GAP_MODEL_H

#include "sim/plant.h"

#define GAP_EFFECTS_MAX 13
#define GAP_PARAMETERS_MAX (2 + GAP_EFFECTS_MAX * EFFECT_PARAMETERS_MAX)

struct gap_model {
    double stiffness_scale;
    double supply_scale;
    size_t count;
    struct effect effect[GAP_EFFECTS_MAX];
};

/* One adjustable number of a model: nominal 0 (stiffness) and 1 (supply), then the effects' parameters in their order. */
struct gap_parameter {
    const char *name;
    const char *unit;
    double least;
    double most;
    double scale; /* a change of this size matters */
    double *value;
    int effect; /* -1: nominal */
    bool turns; /* a full turn's angle: from its bounds it goes on at the other end */
};

/* Fills `parameter`; returns how many. Parameters that data cannot move (probabilities) are left out. */
size_t gap_model_parameters(struct gap_model *model, struct gap_parameter parameter[GAP_PARAMETERS_MAX]);
/* Is it a full turn's angle? */
bool gap_parameter_turns(const struct effect_parameter *parameter);
/* The caller sees to it that there is room for one more. */
void gap_model_add(struct gap_model *model, const struct effect *effect);
/* Does the model have that form of the kind in that chamber? An effect on all of them (0) is in each. */
bool gap_model_has(const struct gap_model *model, const struct effect_kind *kind, size_t form, size_t chamber);
/* Is effect `e` part of a kind that is named elsewhere in the model? Forms of one kind are one effect; and a bent field
 * displaces the rest pose and tilts it too, so offset, lever arm and misalignment beside a distortion are part of that. */
bool gap_model_is_part(const struct gap_model *model, size_t e);
/* Kinds that the model names, parts not counted. */
size_t gap_model_kinds(const struct gap_model *model);
/* Does the effect act before the pressure readings (supply, valves, pressure sensors)? */
bool gap_effect_upstream(const struct effect_kind *kind);
bool gap_effect_downstream(const struct effect_kind *kind);

#endif
