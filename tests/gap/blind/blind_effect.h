/* What is wrong with a blind plant. Each kind is a row of hooks into what passes between the plant's stages; those named in
 * the catalogue of the design page have other functional forms here than a catalogue would choose, and those outside it have
 * names that no catalogue knows. Parameters in SI units, named as a sensible catalogue would name them. */
#ifndef TRIBEND_BLIND_EFFECT_H
#define TRIBEND_BLIND_EFFECT_H

#include "blind_plant.h"
#include "blind_random.h"

#define BLIND_PARAMETERS_MAX 4
#define BLIND_MEMORY 24

enum blind_reach {
    BLIND_ALL_CHAMBERS, /* or no chamber in particular */
    BLIND_ONE_CHAMBER,  /* always one */
    BLIND_ANY_CHAMBER   /* all, or one where the effect is local */
};

/* What the draw of parameters needs to know of the module and the rig. */
struct blind_scene {
    double pressure_most_pa;
    bool temperature_logged;
};

struct blind_effect {
    const struct blind_effect_kind *kind;
    int chamber;     /* 1..3; 0: all, or none in particular */
    double onset_s;  /* 0: from the start */
    double parameter[BLIND_PARAMETERS_MAX];
    double form[4];  /* of the functional form, and directions: not scored */
    int variant;
    /* state of one run */
    double memory[BLIND_MEMORY];
    double *history; /* grows; owned */
    size_t history_count;
    size_t history_room;
    struct blind_random random;
};

struct blind_effect_kind {
    const char *name;
    const char *stage; /* a word of the design page */
    enum blind_reach reach;
    const char *parameter[BLIND_PARAMETERS_MAX]; /* NULL: no more */
    double neutral[BLIND_PARAMETERS_MAX]; /* where the effect vanishes; NAN: the parameter has no such value */
    void (*draw)(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene);
    /* hooks, each may be NULL; called in the order of the stages */
    void (*command)(struct blind_effect *effect, const struct blind_plant *plant, struct blind_pulse pulse[3]);
    void (*ports)(struct blind_effect *effect, const struct blind_plant *plant, struct blind_ports *ports);
    void (*pressure)(struct blind_effect *effect, const struct blind_plant *plant, double pressure_pa[3]);
    void (*reading)(struct blind_effect *effect, const struct blind_plant *plant, double reading_pa[3]);
    void (*load)(struct blind_effect *effect, const struct blind_plant *plant, double load_pa[3]);
    void (*shape)(struct blind_effect *effect, struct blind_plant *plant, double step_s, struct blind_shape *shape);
    void (*pose)(struct blind_effect *effect, const struct blind_plant *plant, double step_s, struct blind_pose *pose);
    bool (*repeats)(struct blind_effect *effect, const struct blind_plant *plant);
    int64_t (*latency_us)(const struct blind_effect *effect);
    /* The parameters that a run's flows amount to, where the form has none of that name. */
    void (*amounts)(const struct blind_effect *effect, const struct blind_measure *measure, double *parameter);
};

/* Kinds of the catalogue in the order of the design page, then those outside it. */
size_t blind_catalogue_count(void);
const struct blind_effect_kind *blind_catalogue_at(size_t index);
size_t blind_outside_count(void);
const struct blind_effect_kind *blind_outside_at(size_t index);
/* NULL: no such kind. */
const struct blind_effect_kind *blind_kind_find(const char *name);

/* The tables of the stages' files. */
struct blind_kinds {
    const struct blind_effect_kind *kind;
    size_t count;
};
extern const struct blind_kinds blind_valve_kinds;
extern const struct blind_kinds blind_pressure_kinds;
extern const struct blind_kinds blind_body_kinds;
extern const struct blind_kinds blind_tip_kinds;
extern const struct blind_kinds blind_outside_kinds;

/* Forgets a former run. */
void blind_effect_reset(struct blind_effect *effect, uint64_t seed);
void blind_effect_free(struct blind_effect *effect);
/* Draws the effect's parameters at full strength. */
void blind_effect_draw(struct blind_effect *effect, const struct blind_effect_kind *kind, struct blind_random *random,
                       const struct blind_scene *scene);
/* Moves the parameters towards where the effect vanishes: 1 leaves them, 0 is no effect. */
void blind_effect_weaken(struct blind_effect *effect, double share);
/* 0 before the onset, 1 after it, a smooth rise of 0.2 s between. */
double blind_effect_gate(const struct blind_effect *effect, double time_s);
/* The effect acts on chamber index `c`. */
bool blind_effect_on(const struct blind_effect *effect, size_t c);
/* Appends to the history; false: out of memory. */
bool blind_effect_remember(struct blind_effect *effect, double value);

static inline double blind_time_s(const struct blind_plant *plant) {
    return 1e-6 * (double)plant->time_us;
}

#endif
