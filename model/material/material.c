#include "material/material.h"

void material_energy(const struct material *material, double i1, double *w, double *dw, double *d2w) {
    const double x = i1 - 3.0;
    double power = 1.0; /* x^(i - 1) */
    *w = 0.0;
    *dw = 0.0;
    *d2w = 0.0;
    for (size_t i = 0; i < material->terms; i++) {
        const double order = (double)(i + 1);
        *d2w += i == 0 ? 0.0 : material->coefficient_pa[i] * order * (order - 1.0) * (i == 1 ? 1.0 : x);
        *dw += material->coefficient_pa[i] * order * power;
        *w += material->coefficient_pa[i] * power * x;
        power *= x;
    }
}

double material_shear_modulus(const struct material *material) {
    return 2.0 * material->coefficient_pa[0];
}
