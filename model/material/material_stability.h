/* How far a material law may be used: where its nominal stress turns and where it loses ellipticity, on the three
 * homogeneous deformations that tests are made of. */
#ifndef TRIBEND_MATERIAL_STABILITY_H
#define TRIBEND_MATERIAL_STABILITY_H

#include <stdbool.h>

#include "material/material.h"

enum deformation_mode { DEFORMATION_UNIAXIAL, DEFORMATION_SHEAR, DEFORMATION_EQUIBIAXIAL, DEFORMATION_MODES };
extern const char *const deformation_mode_name[DEFORMATION_MODES];

/* Nominal stress (Pa) of the incompressible law in the direction of `stretch`: W_1 - W_3 l_3 / l_1 with l_3 the stretch
 * through the free faces (Treloar 1975). */
double material_nominal_stress_pa(const struct material *material, enum deformation_mode mode, double stretch);
/* Stretch above one at which the nominal stress first falls, or `stretch_max` when it never does. */
double material_stable_stretch(const struct material *material, enum deformation_mode mode, double stretch_max);

/* Least of the strong-ellipticity conditions in the three principal planes, over the shear modulus: waves of every
 * direction in those planes have a real speed while it is above zero (Dowaikh and Ogden 1990, incompressible). Necessary
 * in three dimensions. Product of the stretches: one. */
double material_ellipticity_margin(const struct material *material, const double stretch[3]);
/* Is the law elliptic at every stretch by the signs of its coefficients alone (sufficient, not necessary)? */
bool material_always_elliptic(const struct material *material);
/* Stretch at which the margin is first not above zero, or `stretch_max`. */
double material_elliptic_stretch(const struct material *material, enum deformation_mode mode, double stretch_max);

#endif
