/* An effect: something real that the nominal plant leaves out. One file each under effects/, which registers itself;
 * adding one touches no other file.
 *
 * An effect acts on one stage of the plant. In each step of that stage it sees the plant's signals and may change them
 * in place. It owns a state of fixed size, zeroed at the start, and at most three bounded parameters. */
#ifndef TRIBEND_SIM_EFFECT_H
#define TRIBEND_SIM_EFFECT_H

#include <stdbool.h>
#include <stddef.h>

#include "sim/body.h"
#include "sim/chamber.h"

#define EFFECT_PARAMETERS_MAX 3
#define EFFECT_STATE_DOUBLES 64

enum effect_stage {
    EFFECT_STAGE_GAS,  /* signals: influence on supply, valves and leaks */
    EFFECT_STAGE_BODY, /* signals: shape */
    EFFECT_STAGE_TIP   /* signals: pose */
};

struct effect_parameter {
    const char *name;
    const char *unit; /* SI; "1" for a ratio */
    double least;
    double most;
    double typical;
};

struct effect_signals {
    double time_s;
    double step_s;
    const double *pressure_pa;           /* [3], true chamber pressures */
    struct chamber_influence *influence; /* EFFECT_STAGE_GAS */
    struct body_shape *shape;            /* EFFECT_STAGE_BODY */
    struct tip_pose *pose;               /* EFFECT_STAGE_TIP */
};

struct effect_kind {
    const char *name;
    const char *what; /* one sentence */
    enum effect_stage stage;
    size_t parameter_count;
    struct effect_parameter parameter[EFFECT_PARAMETERS_MAX];
    void (*step)(double *state, const double *parameter, struct effect_signals *signals);
};

/* An effect in use. */
struct effect {
    const struct effect_kind *kind;
    double parameter[EFFECT_PARAMETERS_MAX];
    double state[EFFECT_STATE_DOUBLES];
};

void effect_register(const struct effect_kind *kind);
size_t effect_kind_count(void);
const struct effect_kind *effect_kind_at(size_t index); /* sorted by name */
const struct effect_kind *effect_kind_find(const char *name);
void effect_init(struct effect *effect, const struct effect_kind *kind);
/* "NAME" or "NAME:parameter=value,parameter=value" in SI units. False: `error` says what is wrong. */
bool effect_parse(const char *text, struct effect *effect, char *error, size_t error_bytes);

/* Register `kind` before main() runs. */
#define EFFECT_REGISTER(kind)                                                                                       \
    __attribute__((constructor)) static void register_effect(void) {                                               \
        effect_register(&(kind));                                                                                   \
    }                                                                                                               \
    _Static_assert(1, "wants a semicolon")

#endif
