/* The module as a solid for CalculiX: a quarter of it (half the section, half the length), quadratic bricks (C3D20R),
 * end cap included, chamber 1 under follower pressure. Lengths in mm, stresses in MPa: the unit set that ccx is used with. */
#ifndef TRIBEND_TESTS_SOLID_MODEL_H
#define TRIBEND_TESTS_SOLID_MODEL_H

#include <stdbool.h>
#include <stddef.h>

#include "description/module_description.h"

#define SOLID_STEPS_MAX 16

struct solid_options {
    double size_m;        /* of the bricks in the section */
    size_t layers;        /* of bricks along half the chamber */
    size_t cap_layers;
    size_t steps;
    double pressure_pa[SOLID_STEPS_MAX]; /* rising */
};

/* What ccx says at one pressure. */
struct solid_answer {
    double bend_rad;     /* twice the tip face's rotation against the middle of the module */
    double width_m;      /* of the middle section in the bending plane, balloon included */
    double volume_ratio; /* of chamber 1 */
};

/* Writes `folder`/solid.inp, runs ccx there, reads its displacements. Returns how many pressures were reached (ccx stops
 * where its increments become too small); `cpu_s` is the time that ccx used. Negative: `error` says why. */
int solid_model_run(const struct module_description *module, const struct solid_options *options, const char *folder,
                    struct solid_answer *answers, size_t *equations, double *cpu_s, char *error, size_t error_bytes);

#endif
