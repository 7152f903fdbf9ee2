/* Fit of a reduced polynomial law to a uniaxial tensile test, and whether a law is stable. Units: Pa, stretch. */
#ifndef TRIBEND_MATERIAL_FIT_H
#define TRIBEND_MATERIAL_FIT_H

#include <stdbool.h>

#include "material/material.h"

struct tensile_test {
    size_t count;
    double *strain;    /* engineering */
    double *stress_pa; /* nominal */
};

struct material_fit {
    struct material material; /* name and source are the caller's to fill */
    size_t points;
    double rms_pa;
    double rms_relative;  /* of the greatest stress in the range */
    double most_pa;       /* greatest deviation, and where */
    double most_strain;
};

enum deformation_mode { DEFORMATION_UNIAXIAL, DEFORMATION_SHEAR, DEFORMATION_EQUIBIAXIAL, DEFORMATION_MODES };

/* Semicolon-separated text in latin-1: header lines, then time s; true strain; true stress MPa; engineering strain;
 * engineering stress MPa (as in the Soft Robotics Materials Database). False: `error` names file and line. */
bool tensile_test_read(const char *path, struct tensile_test *test, char *error, size_t error_bytes);
void tensile_test_free(struct tensile_test *test);

/* Linear least squares of the nominal stress over strains [0, strain_max]. */
bool material_fit(const struct tensile_test *test, enum material_law law, size_t terms, double strain_max,
                  struct material_fit *fit, char *error, size_t error_bytes);

/* Nominal stress (Pa) of the incompressible law: 2 (s - s^-n) W'(I1), n = 2 uniaxial, 3 pure shear, 5 equibiaxial
 * (Treloar 1975). */
double material_nominal_stress_pa(const struct material *material, enum deformation_mode mode, double stretch);
/* Stretch above one at which the nominal stress first falls, or `stretch_max` when it never does. */
double material_stable_stretch(const struct material *material, enum deformation_mode mode, double stretch_max);

#endif
