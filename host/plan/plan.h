/* A plan: what a module is to be commanded, step by step, for an experiment that can be repeated.
 *
 * A plan is a list of steps, each of a length of its own: constant pressures, a ramp to pressures, a sum of
 * sines, a bend, or a vent. This file holds one, says what it commands at a time, and checks it against a
 * module's limits. How it is written down: plan_file.h. How it is followed: `tribend run`. Units: s, Pa, rad.
 * Pressures are indexed by chamber. */
#ifndef TRIBEND_PLAN_H
#define TRIBEND_PLAN_H

#include "control/controller.h"

#define PLAN_STEPS_MAX 256
#define PLAN_TONES_MAX 128
#define PLAN_NOTE_BYTES 512
#define PLAN_LENGTH_MOST_S 86400.0

enum plan_step_kind { PLAN_PRESSURE, PLAN_RAMP, PLAN_SINE, PLAN_BEND, PLAN_VENT };

/* mean + amplitude sin(2 pi t / period + phase), t from the start of the step. */
struct plan_tone {
    bool chamber[3];
    double amplitude_pa;
    double mean_pa;
    double period_s;
    double phase_rad;
};

struct plan_step {
    enum plan_step_kind kind;
    double length_s;
    double pressure_pa[3]; /* PLAN_PRESSURE: held; PLAN_RAMP: reached at the end */
    double bend_rad;       /* PLAN_BEND */
    double direction_rad;
    double co_contraction_pa;
    size_t first_tone; /* PLAN_SINE: the step's tones are added up */
    size_t tones;
};

struct plan {
    char module[BEND_TABLE_NAME_BYTES];
    char note[PLAN_NOTE_BYTES];
    size_t steps;
    struct plan_step step[PLAN_STEPS_MAX];
    size_t tones;
    struct plan_tone tone[PLAN_TONES_MAX];
};

/* --- making one --- */

void plan_init(struct plan *plan, const char *module, const char *note);
/* Each adds a step at the end. False: no room; the plan is as before. */
bool plan_add_pressure(struct plan *plan, double length_s, const double pressure_pa[3]);
bool plan_add_ramp(struct plan *plan, double length_s, const double pressure_pa[3]);
bool plan_add_sine(struct plan *plan, double length_s, const struct plan_tone *tone, size_t tones);
bool plan_add_bend(struct plan *plan, double length_s, double bend_rad, double direction_rad,
                   double co_contraction_pa);
bool plan_add_vent(struct plan *plan, double length_s);
/* The steps of `after` behind those of `plan`. False: no room; the plan is as before. */
bool plan_append(struct plan *plan, const struct plan *after);

/* --- following it --- */

double plan_length_s(const struct plan *plan);
/* Start of a step. */
double plan_start_s(const struct plan *plan, size_t step);
/* The step that a time lies in; the last one after the end. */
size_t plan_step_at(const struct plan *plan, double time_s);
/* What is commanded at a time from the start. A ramp starts where the step before it ended. */
void plan_command_at(const struct plan *plan, double time_s, struct controller_command *command);

/* --- checking it --- */

#define PLAN_TEXT_BYTES 384

/* Why a plan is refused: the step, the key that is wrong, and words. */
struct plan_fault {
    size_t step;
    const char *key;
    char text[PLAN_TEXT_BYTES];
};

/* Sound in itself, within the module's limits (working pressure, greatest bend) and where its table holds.
 * False: `fault` says what is wrong. */
bool plan_check(const struct plan *plan, const struct bend_table *table, struct plan_fault *fault);
/* The bend that the table has for these pressures. */
double plan_bend_at(const struct bend_table *table, const float pressure_pa[3]);

#endif
