#include "gap/gap_model.h"

#include <math.h>
#include <string.h>

#define STIFFNESS_LEAST 0.4
#define STIFFNESS_MOST 2.5
#define SUPPLY_LEAST 0.6
#define SUPPLY_MOST 1.5
#define FULL_TURN_RAD (2.0 * M_PI)

static double scale_of(const struct effect_parameter *parameter) {
    const double from_none = isnan(parameter->none) ? 0.0 : fabs(parameter->typical - parameter->none);
    if (from_none > 0.0) {
        return from_none;
    }
    return parameter->typical != 0.0 ? 0.5 * fabs(parameter->typical) : 0.25 * (parameter->most - parameter->least);
}

bool gap_parameter_turns(const struct effect_parameter *parameter) {
    return strcmp(parameter->unit, "rad") == 0 && parameter->most - parameter->least > FULL_TURN_RAD - 1e-9;
}

size_t gap_model_parameters(struct gap_model *model, struct gap_parameter parameter[GAP_PARAMETERS_MAX]) {
    size_t count = 0;
    parameter[count++] = (struct gap_parameter){
        "stiffness_scale", "1", STIFFNESS_LEAST, STIFFNESS_MOST, 0.05, &model->stiffness_scale, -1, false};
    parameter[count++] =
        (struct gap_parameter){"supply_scale", "1", SUPPLY_LEAST, SUPPLY_MOST, 0.05, &model->supply_scale, -1, false};
    for (size_t e = 0; e < model->count; e++) {
        struct effect *effect = &model->effect[e];
        for (size_t i = effect->kind->by_chance ? 1 : 0; i < effect->kind->parameter_count; i++) {
            const struct effect_parameter *kind = &effect->kind->parameter[i];
            parameter[count++] =
                (struct gap_parameter){kind->name,      kind->unit, kind->least, kind->most, scale_of(kind), &effect->parameter[i],
                                       (int)e,          gap_parameter_turns(kind)};
        }
    }
    return count;
}

void gap_model_add(struct gap_model *model, const struct effect *effect) {
    model->effect[model->count++] = *effect;
}

bool gap_model_has(const struct gap_model *model, const struct effect_kind *kind, size_t form, size_t chamber) {
    for (size_t e = 0; e < model->count; e++) {
        const struct effect *effect = &model->effect[e];
        const bool same_place = effect->chamber == chamber || effect->chamber == 0 || chamber == 0;
        if (effect->kind == kind && effect->form == form && same_place) {
            return true;
        }
    }
    return false;
}

bool gap_effect_upstream(const struct effect_kind *kind) {
    return effect_has(kind, EFFECT_HOOK_COMMAND) || effect_has(kind, EFFECT_HOOK_GAS) ||
           effect_has(kind, EFFECT_HOOK_READING);
}

bool gap_effect_downstream(const struct effect_kind *kind) {
    return effect_has(kind, EFFECT_HOOK_LOAD) || effect_has(kind, EFFECT_HOOK_SHAPE) ||
           effect_has(kind, EFFECT_HOOK_POSE);
}

static bool is_part_of_distortion(const char *name) {
    static const char *const parts[] = {"tip_offset", "tip_lever_arm", "tip_misalignment"};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
        if (strcmp(name, parts[i]) == 0) {
            return true;
        }
    }
    return false;
}

bool gap_model_is_part(const struct gap_model *model, size_t e) {
    const struct effect_kind *kind = model->effect[e].kind;
    for (size_t f = 0; f < model->count; f++) {
        const bool repeats = f < e && model->effect[f].kind == kind;
        const bool bends = f != e && strcmp(model->effect[f].kind->name, "tip_distortion") == 0;
        if (repeats || (bends && is_part_of_distortion(kind->name))) {
            return true;
        }
    }
    return false;
}

size_t gap_model_kinds(const struct gap_model *model) {
    size_t kinds = 0;
    for (size_t e = 0; e < model->count; e++) {
        kinds += !gap_model_is_part(model, e);
    }
    return kinds;
}
