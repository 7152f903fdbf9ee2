/* A hyperelastic material. Three families, each for an incompressible rubber with a pressure of its own:
 *
 *   neo-Hookean, reduced polynomial, Yeoh   W = sum_i c_i (I1 - 3)^i, one, one to three and three terms (Yeoh 1993)
 *   Ogden                                   W = sum_i 2 c_i / a_i^2 (l1^a_i + l2^a_i + l3^a_i - 3), one to three terms
 *
 * with stretches and I1 of the isochoric part J^(-1/3) F. The Ogden law is in the form that commercial finite-element
 * programs print, whose c_i add up to the initial shear modulus (Ogden 1972 writes mu_i = 2 c_i / a_i). Units: Pa. */
#ifndef TRIBEND_MATERIAL_H
#define TRIBEND_MATERIAL_H

#include <stddef.h>

#define MATERIAL_NAME_BYTES 64
#define MATERIAL_TERMS_MAX 3

enum material_law { MATERIAL_NEO_HOOKEAN, MATERIAL_REDUCED_POLYNOMIAL, MATERIAL_YEOH, MATERIAL_OGDEN };

struct material {
    char name[MATERIAL_NAME_BYTES];
    enum material_law law;
    size_t terms;
    double coefficient_pa[MATERIAL_TERMS_MAX];
    double exponent[MATERIAL_TERMS_MAX]; /* Ogden only */
    double bulk_modulus_pa;
    double density_kgpm3;
    double strain_min; /* engineering strain range over which the law was fitted */
    double strain_max;
    char source[512];
};

/* Energy of a deformation gradient [F2 0; 0 s] with its derivatives by i = F2:F2, j = det F2 and s, in this order. These
 * three are smooth functions of F where two stretches meet, which the stretches themselves are not. Pa. */
struct material_response {
    double energy;
    double first[3];
    double second[3][3];
};
void material_respond(const struct material *material, double i, double j, double s,
                      struct material_response *response);

/* Derivatives of W by three principal stretches whose product is one (W extended without the isochoric factor). Pa. */
void material_principal(const struct material *material, const double stretch[3], double first[3], double second[3][3]);
/* Nominal stress of uniaxial tension (Pa) and its derivative by the stretch, free faces. */
void material_uniaxial(const struct material *material, double stretch, double *stress_pa, double *slope_pa);
/* Initial shear modulus, Pa: 2 c_1, or the sum of Ogden's c_i. */
double material_shear_modulus(const struct material *material);

#endif
