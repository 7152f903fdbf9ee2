/* An effect: something real that the nominal plant leaves out. One file each under effects/, which registers itself;
 * adding one touches no other file.
 *
 * An effect has hooks on the way from duty to tip pose. Each hook sees the plant's signals and may change, in place, the
 * one that its comment names. Hooks are called in the order of time; the hooks of one effect share its state, which is
 * of fixed size and zero at the start. An effect has at most three bounded parameters; with its parameters at `none` it
 * changes nothing. The framework keeps an effect to one chamber and to the time after its onset. */
#ifndef TRIBEND_SIM_EFFECT_H
#define TRIBEND_SIM_EFFECT_H

#include <math.h> /* NAN, for parameters without a value at which the effect is gone */
#include <stdbool.h>
#include <stddef.h>

#include "sim/body.h"
#include "sim/chamber.h"

#define EFFECT_PARAMETERS_MAX 3
#define EFFECT_FORMS_MAX 10
#define EFFECT_STATE_DOUBLES 320

/* Where the effect lies; the words of reports. */
enum effect_stage {
    EFFECT_STAGE_SUPPLY,
    EFFECT_STAGE_VALVE,
    EFFECT_STAGE_PRESSURE_SENSOR,
    EFFECT_STAGE_BODY,
    EFFECT_STAGE_TIP_SENSOR,
    EFFECT_STAGE_COUNT
};

/* Which chambers an effect can be confined to. */
enum effect_scope {
    EFFECT_GLOBAL,       /* has nothing to do with single chambers */
    EFFECT_EVERY_CHAMBER, /* on all of them, or on one */
    EFFECT_ONE_CHAMBER   /* always on one */
};

struct effect_parameter {
    const char *name;
    const char *unit; /* SI; "1" for a ratio */
    double least;
    double most;
    double typical;
    double none; /* the value at which the effect is gone, or NAN where another parameter decides that */
};

struct effect_signals {
    size_t form;          /* which of the kind's forms is meant (filled in by effects_run()) */
    double time_s;
    double step_s;
    double temperature_k; /* NAN: not known */
    double chance;        /* uniform in (0, 1), new at each tip sample */
    size_t chamber;       /* 1 to 3: the one that the effect is kept to; 0: none (filled in by effects_run()) */
    const struct bend_table *table;
    double stiffness_scale;
    const double *pressure_pa;           /* [3] true chamber pressures */
    double supply_flow_kgps;             /* drawn from the supply, mean over the last step */
    double *duty;                        /* [3] command hook */
    double *late_s;                      /* [3] command hook: by how much each valve sees its period late */
    struct chamber_influence *influence; /* gas hook */
    double *reading_pa;                  /* [3] reading hook: what noise-free sensors show */
    double *load_pa;                     /* [3] load hook: pressures that bend the module, on the table's scale; shape and
                                          * pose hooks may look, after all the load hooks */
    struct body_shape *shape;            /* shape hook */
    struct tip_pose *pose;               /* pose hook */
    bool aged;                           /* pose hook: the pose is of then already, see age_s below */
    bool repeats;                        /* pose hook: to be set where the sensor gives its last sample again, noise and all */
};

typedef void (*effect_hook)(double *state, const double *parameter, struct effect_signals *signals);

struct effect_kind {
    const char *name;
    const char *what;      /* one sentence */
    const char *signature; /* what it leaves in a recording, and what it may be taken for */
    enum effect_stage stage;
    enum effect_scope scope;
    size_t forms;          /* the same cause may act in different ways: how many, 0 or 1 where there is one */
    const char *form_what[EFFECT_FORMS_MAX];
    bool forms_add;        /* a real case has all forms at once, each with parameters of its own */
    bool remembers;        /* what it does depends on what was long ago: it may have seen that before its onset */
    bool delays;    /* what it does is to be late: in one loop it looks like whatever else is */
    bool by_chance; /* parameter 0 is the probability that it acts at a tip sample (signals->chance below it) */
    bool by_threshold; /* nothing happens on one side of parameter 0: a fit must start on the right one */
    /* By how much the tip sensor's poses are older than their times say. Where all pressures are known (the plant's own, a
     * replay's) the pose is taken at those of then; the pose hook is for what knows no pressures between samples. */
    double (*age_s)(const double *parameter);
    size_t parameter_count;
    struct effect_parameter parameter[EFFECT_PARAMETERS_MAX];
    double doubt[EFFECT_PARAMETERS_MAX]; /* real causes follow laws of their own: by how much that puts a parameter off where
                                          * this law fits best, one standard deviation, as a share of its size; 0: unknown */
    effect_hook command; /* at the start of a PWM period */
    effect_hook gas;     /* before each step of the gas */
    effect_hook reading; /* after each step of the gas */
    effect_hook load;    /* at each tip sample, before the table is asked */
    effect_hook shape;   /* then, with the table's answer */
    effect_hook pose;    /* then, with the tip pose */
};

/* An effect in use. */
struct effect {
    const struct effect_kind *kind;
    size_t chamber; /* 1 to 3: on that one only; 0: on all */
    size_t form;    /* 0 to kind->forms - 1 */
    double onset_s; /* nothing happens before */
    bool latent;    /* yet its state runs from the start, unseen: it remembers what was before its onset */
    double parameter[EFFECT_PARAMETERS_MAX];
    double state[EFFECT_STATE_DOUBLES];
};

enum effect_hook_kind {
    EFFECT_HOOK_COMMAND,
    EFFECT_HOOK_GAS,
    EFFECT_HOOK_READING,
    EFFECT_HOOK_LOAD,
    EFFECT_HOOK_SHAPE,
    EFFECT_HOOK_POSE
};

void effect_register(const struct effect_kind *kind);
size_t effect_kind_count(void);
const struct effect_kind *effect_kind_at(size_t index); /* sorted by name */
const struct effect_kind *effect_kind_find(const char *name);
const char *effect_stage_name(enum effect_stage stage);
void effect_init(struct effect *effect, const struct effect_kind *kind);
/* "NAME" or "NAME:parameter=value,parameter=value" in SI units; chamber=N, form=N, onset=SECONDS and, of a kind that
 * remembers, latent=0 or 1 as well. False: `error` says
 * what is wrong. */
bool effect_parse(const char *text, struct effect *effect, char *error, size_t error_bytes);
/* Of its law: the least doubt, over the parameters that have one; 0: none has. */
double effect_doubt(const struct effect_kind *kind);
/* By how much the tip sensor's poses are then older than their times say. */
double effects_age_s(const struct effect *effect, size_t count, double time_s);
bool effect_has(const struct effect_kind *kind, enum effect_hook_kind hook);
/* Call that hook of each effect that has it, within its chamber and after its onset; before that, a latent one unseen. */
void effects_run(struct effect *effect, size_t count, enum effect_hook_kind hook, struct effect_signals *signals);
/* For load and shape hooks: the nominal shape at these pressures, on the table's scale. */
void effect_shape_at(const struct effect_signals *signals, const double load_pa[3], struct body_shape *shape);

/* Register `kind` before main() runs. */
#define EFFECT_REGISTER(kind)                                                                                       \
    __attribute__((constructor)) static void register_effect(void) {                                               \
        effect_register(&(kind));                                                                                   \
    }                                                                                                               \
    _Static_assert(1, "wants a semicolon")

#endif
