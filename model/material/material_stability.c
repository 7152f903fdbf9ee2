#include "material/material_stability.h"

#include <math.h>

#define SEARCH_STEP 1e-3
#define EQUAL_STRETCHES 1e-6

const char *const deformation_mode_name[DEFORMATION_MODES] = {"uniaxial", "pure shear", "equibiaxial"};

static void mode_stretches(enum deformation_mode mode, double stretch, double all[3]) {
    all[0] = stretch;
    all[1] = mode == DEFORMATION_UNIAXIAL ? 1.0 / sqrt(stretch) : mode == DEFORMATION_SHEAR ? 1.0 : stretch;
    all[2] = 1.0 / (all[0] * all[1]);
}

double material_nominal_stress_pa(const struct material *material, enum deformation_mode mode, double stretch) {
    double all[3], first[3], second[3][3];
    mode_stretches(mode, stretch, all);
    material_principal(material, all, first, second);
    return first[0] - first[2] * all[2] / all[0];
}

double material_stable_stretch(const struct material *material, enum deformation_mode mode, double stretch_max) {
    double last = 0.0;
    for (int step = 1; 1.0 + step * SEARCH_STEP < stretch_max; step++) {
        const double stretch = 1.0 + step * SEARCH_STEP;
        const double stress = material_nominal_stress_pa(material, mode, stretch);
        if (stress <= last) {
            return stretch - SEARCH_STEP;
        }
        last = stress;
    }
    return stretch_max;
}

/* Conditions of one principal plane with the instantaneous moduli A_ijkl = J^-1 F F d2W/dFdF (Ogden 1984, section 6.1). */
static double plane_margin(const double l[2], const double first[2], const double w11, const double w12,
                           const double w22) {
    const double a1111 = l[0] * l[0] * w11, a2222 = l[1] * l[1] * w22, a1122 = l[0] * l[1] * w12;
    const double gap = l[0] * l[0] - l[1] * l[1];
    double a1212, a2121;
    if (fabs(gap) < EQUAL_STRETCHES) {
        a1212 = 0.5 * (a1111 - a1122 + l[0] * first[0]);
        a2121 = a1212;
    } else {
        const double stress = (l[0] * first[0] - l[1] * first[1]) / gap;
        a1212 = stress * l[0] * l[0];
        a2121 = stress * l[1] * l[1];
    }
    const double shears = fmin(a1212, a2121);
    if (!(shears > 0.0)) {
        return shears;
    }
    const double half = 0.5 * (a1111 + a2222 - 2.0 * a1122) - (a1212 - l[0] * first[0]);
    return fmin(shears, half + sqrt(a1212 * a2121));
}

double material_ellipticity_margin(const struct material *material, const double stretch[3]) {
    double first[3], second[3][3], least = INFINITY;
    material_principal(material, stretch, first, second);
    for (size_t p = 0; p < 3; p++) {
        const size_t q = (p + 1) % 3;
        const double pair[2] = {stretch[p], stretch[q]}, slope[2] = {first[p], first[q]};
        least = fmin(least, plane_margin(pair, slope, second[p][p], second[p][q], second[q][q]));
    }
    return least / material_shear_modulus(material);
}

bool material_always_elliptic(const struct material *material) {
    for (size_t k = 0; k < material->terms; k++) {
        if (material->coefficient_pa[k] < 0.0 || (material->law == MATERIAL_OGDEN && fabs(material->exponent[k]) < 1.0)) {
            return false;
        }
    }
    return material_shear_modulus(material) > 0.0;
}

double material_elliptic_stretch(const struct material *material, enum deformation_mode mode, double stretch_max) {
    for (int step = 0; 1.0 + step * SEARCH_STEP < stretch_max; step++) {
        double all[3];
        mode_stretches(mode, 1.0 + step * SEARCH_STEP, all);
        if (!(material_ellipticity_margin(material, all) > 0.0)) {
            return 1.0 + (step > 0 ? step - 1 : 0) * SEARCH_STEP;
        }
    }
    return stretch_max;
}
