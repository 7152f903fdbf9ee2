#include "material/material.h"

#include <math.h>
#include <string.h>

#define SERIES_BELOW 0.1     /* of cosh(delta) - 1 */
#define SERIES_TERMS_MAX 60
#define SERIES_TOLERANCE 1e-17

/* --- laws in the first invariant --- */

/* W and its first two derivatives by x = I1 - 3. */
static void polynomial(const struct material *material, double x, double *w, double *dw, double *d2w) {
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

/* I1 of the isochoric part is (j s)^(-2/3) (i + s^2). */
static void respond_polynomial(const struct material *material, double i, double j, double s,
                               struct material_response *response) {
    const double scale = pow(j * s, -2.0 / 3.0), sum = i + s * s;
    const double by_i = scale, by_j = -2.0 / 3.0 * scale * sum / j, by_s = scale * (2.0 * s - 2.0 / 3.0 * sum / s);
    const double first[3] = {by_i, by_j, by_s};
    const double second[3][3] = {
        {0.0, -2.0 / 3.0 * scale / j, -2.0 / 3.0 * scale / s},
        {-2.0 / 3.0 * scale / j, 10.0 / 9.0 * scale * sum / (j * j), scale / j * (4.0 / 9.0 * sum / s - 4.0 / 3.0 * s)},
        {-2.0 / 3.0 * scale / s, scale / j * (4.0 / 9.0 * sum / s - 4.0 / 3.0 * s),
         scale * (10.0 / 9.0 * sum / (s * s) - 2.0 / 3.0)}};
    double dw, d2w;
    polynomial(material, scale * sum - 3.0, &response->energy, &dw, &d2w);
    for (size_t m = 0; m < 3; m++) {
        response->first[m] = dw * first[m];
        for (size_t n = 0; n < 3; n++) {
            response->second[m][n] = d2w * first[m] * first[n] + dw * second[m][n];
        }
    }
}

/* --- Ogden --- */

/* cosh(n delta) and its first two derivatives by c = cosh(delta): a Chebyshev function of order n, which is not whole.
 * Near c = 1 by the series of 2F1(-n, n; 1/2; (1 - c) / 2) (Abramowitz and Stegun 1964, 15.1.17). */
static void chebyshev(double n, double c, double value[3]) {
    const double x = c - 1.0;
    if (x > SERIES_BELOW) {
        const double delta = acosh(c), root = sinh(delta);
        const double even = cosh(n * delta), odd = sinh(n * delta);
        value[0] = even;
        value[1] = n * odd / root;
        value[2] = (n * n * even - c * value[1]) / (root * root);
        return;
    }
    double factor = 1.0; /* of x^k */
    double power[3] = {1.0, 0.0, 0.0}; /* x^k and its derivatives */
    memset(value, 0, 3 * sizeof *value);
    for (int k = 0; k < SERIES_TERMS_MAX; k++) {
        for (size_t d = 0; d < 3; d++) {
            value[d] += factor * power[d];
        }
        factor *= 0.5 * (n * n - (double)k * (double)k) / ((k + 0.5) * (k + 1.0));
        power[2] = (k + 1.0) * power[1]; /* d2 x^(k+1) = (k+1) k x^(k-1), d x^k = k x^(k-1) */
        power[1] = (k + 1.0) * power[0];
        power[0] *= x;
        if (k > 2 && fabs(factor * power[2]) < SERIES_TOLERANCE * fabs(value[2]) + 1e-300) {
            break;
        }
    }
}

/* One term: h = (j s)^(-a/3) (2 j^(a/2) T(c) + s^a), c = i / (2 j), T = cosh(a delta / 2): with in-plane stretches
 * sqrt(j) e^(+-delta/2) the bracket is the sum of the three stretches to the power a. */
static void add_ogden_term(double a, double weight, double i, double j, double s, struct material_response *response) {
    double t[3];
    const double c = 0.5 * i / j; /* at least one; rounding below it does no harm to the series */
    chebyshev(0.5 * a, c, t);
    const double b = a / 6.0; /* (j s)^(-a/3) j^(a/2) = j^(a/6) s^(-a/3) */
    const double plane = 2.0 * pow(j, b) * pow(s, -2.0 * b), out = pow(j, -2.0 * b) * pow(s, 4.0 * b);
    const double ci = 0.5 / j, cj = -c / j; /* derivatives of c; cij = -ci / j, cjj = 2 c / j^2 */
    const double first[3] = {plane * t[1] * ci, plane * (t[0] * b / j + t[1] * cj) - 2.0 * b * out / j,
                             -2.0 * b * plane * t[0] / s + 4.0 * b * out / s};
    double second[3][3];
    second[0][0] = plane * t[2] * ci * ci;
    second[0][1] = plane * (t[2] * ci * cj - t[1] * ci / j + t[1] * ci * b / j);
    second[0][2] = -2.0 * b * plane * t[1] * ci / s;
    second[1][1] = plane * (t[2] * cj * cj + 2.0 * t[1] * c / (j * j) + 2.0 * b * t[1] * cj / j + t[0] * b * (b - 1.0) / (j * j)) +
                   2.0 * b * (2.0 * b + 1.0) * out / (j * j);
    second[1][2] = -2.0 * b / s * plane * (t[0] * b / j + t[1] * cj) - 8.0 * b * b * out / (j * s);
    second[2][2] = 2.0 * b * (2.0 * b + 1.0) * plane * t[0] / (s * s) + 4.0 * b * (4.0 * b - 1.0) * out / (s * s);
    second[1][0] = second[0][1];
    second[2][0] = second[0][2];
    second[2][1] = second[1][2];
    response->energy += weight * (plane * t[0] + out - 3.0);
    for (size_t m = 0; m < 3; m++) {
        response->first[m] += weight * first[m];
        for (size_t n = 0; n < 3; n++) {
            response->second[m][n] += weight * second[m][n];
        }
    }
}

/* --- all --- */

void material_respond(const struct material *material, double i, double j, double s,
                      struct material_response *response) {
    if (material->law != MATERIAL_OGDEN) {
        respond_polynomial(material, i, j, s, response);
        return;
    }
    memset(response, 0, sizeof *response);
    for (size_t k = 0; k < material->terms; k++) {
        const double a = material->exponent[k];
        add_ogden_term(a, 2.0 * material->coefficient_pa[k] / (a * a), i, j, s, response);
    }
}

void material_principal(const struct material *material, const double stretch[3], double first[3],
                        double second[3][3]) {
    memset(first, 0, 3 * sizeof *first);
    memset(second, 0, 9 * sizeof(double));
    if (material->law == MATERIAL_OGDEN) {
        for (size_t m = 0; m < 3; m++) {
            for (size_t k = 0; k < material->terms; k++) {
                const double a = material->exponent[k];
                const double slope = 2.0 * material->coefficient_pa[k] / a * pow(stretch[m], a - 2.0);
                first[m] += slope * stretch[m];
                second[m][m] += (a - 1.0) * slope;
            }
        }
        return;
    }
    double w, dw, d2w;
    polynomial(material, stretch[0] * stretch[0] + stretch[1] * stretch[1] + stretch[2] * stretch[2] - 3.0, &w, &dw,
               &d2w);
    for (size_t m = 0; m < 3; m++) {
        first[m] = 2.0 * stretch[m] * dw;
        for (size_t n = 0; n < 3; n++) {
            second[m][n] = 4.0 * stretch[m] * stretch[n] * d2w + (m == n ? 2.0 * dw : 0.0);
        }
    }
}

void material_uniaxial(const struct material *material, double stretch, double *stress_pa, double *slope_pa) {
    *stress_pa = 0.0;
    *slope_pa = 0.0;
    if (material->law == MATERIAL_OGDEN) {
        for (size_t k = 0; k < material->terms; k++) {
            const double a = material->exponent[k], along = pow(stretch, a), across = pow(stretch, -0.5 * a);
            const double factor = 2.0 * material->coefficient_pa[k] / a;
            *stress_pa += factor * (along - across) / stretch;
            *slope_pa += factor * ((a - 1.0) * along + (0.5 * a + 1.0) * across) / (stretch * stretch);
        }
        return;
    }
    const double square = 1.0 / (stretch * stretch), shape = 2.0 * (stretch - square);
    double w, dw, d2w;
    polynomial(material, stretch * stretch + 2.0 / stretch - 3.0, &w, &dw, &d2w);
    *stress_pa = shape * dw;
    *slope_pa = (2.0 + 4.0 * square / stretch) * dw + shape * shape * d2w;
}

double material_shear_modulus(const struct material *material) {
    double sum = 0.0;
    for (size_t i = 0; i < material->terms; i++) {
        sum += material->coefficient_pa[i];
    }
    return material->law == MATERIAL_OGDEN ? sum : 2.0 * material->coefficient_pa[0];
}
