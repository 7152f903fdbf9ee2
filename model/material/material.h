/* A hyperelastic material: U = W(I1) + volumetric part, W = sum_i c_i (I1 - 3)^i, i = 1..terms.
 * neo-Hookean is one term, Yeoh (Yeoh 1993) three; reduced polynomial one to three. I1 is the first invariant of the
 * isochoric left Cauchy-Green tensor. Units: Pa, kg/m3. */
#ifndef TRIBEND_MATERIAL_H
#define TRIBEND_MATERIAL_H

#include <stddef.h>

#define MATERIAL_NAME_BYTES 64
#define MATERIAL_TERMS_MAX 3

enum material_law { MATERIAL_NEO_HOOKEAN, MATERIAL_REDUCED_POLYNOMIAL, MATERIAL_YEOH };

struct material {
    char name[MATERIAL_NAME_BYTES];
    enum material_law law;
    size_t terms;
    double coefficient_pa[MATERIAL_TERMS_MAX];
    double bulk_modulus_pa;
    double density_kgpm3;
    double strain_min; /* engineering strain range over which the law was fitted */
    double strain_max;
    char source[512];
};

/* W and its first two derivatives by I1 (Pa). */
void material_energy(const struct material *material, double i1, double *w, double *dw, double *d2w);
/* Initial shear modulus 2 c_1, Pa. */
double material_shear_modulus(const struct material *material);

#endif
