#include "section/section_element.h"

#include <math.h>
#include <string.h>

#define LEAST_JACOBIAN 0.05

/* Six-point rule, exact to degree 4 (Dunavant 1985), in area coordinates. */
#define A1 0.108103018168070
#define B1 0.445948490915965
#define A2 0.816847572980459
#define B2 0.091576213509771
#define WEIGHT1 (0.223381589678011 / 2.0)
#define WEIGHT2 (0.109951743655322 / 2.0)

const double element_gauss_corner[ELEMENT_GAUSS_POINTS][ELEMENT_CORNERS] = {
    {A1, B1, B1}, {B1, A1, B1}, {B1, B1, A1}, {A2, B2, B2}, {B2, A2, B2}, {B2, B2, A2}};
static const double gauss_weight[ELEMENT_GAUSS_POINTS] = {WEIGHT1, WEIGHT1, WEIGHT1, WEIGHT2, WEIGHT2, WEIGHT2};

#define SHAPES(a, b, c)                                                                                             \
    {(a) * (2 * (a) - 1), (b) * (2 * (b) - 1), (c) * (2 * (c) - 1), 4 * (a) * (b), 4 * (b) * (c), 4 * (c) * (a)}
const double element_gauss_shape[ELEMENT_GAUSS_POINTS][ELEMENT_NODES] = {
    SHAPES(A1, B1, B1), SHAPES(B1, A1, B1), SHAPES(B1, B1, A1), SHAPES(A2, B2, B2), SHAPES(B2, A2, B2),
    SHAPES(B2, B2, A2)};

/* Derivatives of the six shape functions by the second and third area coordinate. */
static void local_gradients(const double corner[3], double gradient[ELEMENT_NODES][2]) {
    const double a = corner[0], b = corner[1], c = corner[2];
    const double values[ELEMENT_NODES][2] = {{1 - 4 * a, 1 - 4 * a}, {4 * b - 1, 0}, {0, 4 * c - 1},
                                             {4 * (a - b), -4 * b},  {4 * c, 4 * b}, {-4 * c, 4 * (a - c)}};
    memcpy(gradient, values, sizeof values);
}

bool element_geometry(double position[ELEMENT_NODES][2], struct gauss_point point[ELEMENT_GAUSS_POINTS]) {
    for (size_t g = 0; g < ELEMENT_GAUSS_POINTS; g++) {
        double local[ELEMENT_NODES][2], map[2][2] = {{0}};
        local_gradients(element_gauss_corner[g], local);
        for (size_t a = 0; a < ELEMENT_NODES; a++) {
            for (size_t i = 0; i < 2; i++) {
                map[i][0] += position[a][i] * local[a][0];
                map[i][1] += position[a][i] * local[a][1];
            }
        }
        const double determinant = map[0][0] * map[1][1] - map[0][1] * map[1][0];
        if (!(determinant > 0.0)) {
            return false;
        }
        for (size_t a = 0; a < ELEMENT_NODES; a++) {
            point[g].gradient[a][0] = (map[1][1] * local[a][0] - map[1][0] * local[a][1]) / determinant;
            point[g].gradient[a][1] = (map[0][0] * local[a][1] - map[0][1] * local[a][0]) / determinant;
        }
        point[g].weight = gauss_weight[g] * determinant;
    }
    return true;
}

void element_deformation(const struct gauss_point *point, size_t index, double position[ELEMENT_NODES][2],
                         const struct section_globals *globals, double gradient[5]) {
    double y[2] = {0.0, 0.0};
    memset(gradient, 0, 5 * sizeof *gradient);
    for (size_t a = 0; a < ELEMENT_NODES; a++) {
        for (size_t j = 0; j < 2; j++) {
            gradient[j] += position[a][0] * point->gradient[a][j];
            gradient[2 + j] += position[a][1] * point->gradient[a][j];
            y[j] += element_gauss_shape[index][a] * position[a][j];
        }
    }
    gradient[4] = globals->stretch + globals->curvature[0] * y[1] - globals->curvature[1] * y[0];
}

/* Hoop fibres: stress P(l) / l (F t) t with l = |F t| and the uniaxial stress P of the corrugation's rubber. */
static void add_corrugation(const double hoop[2], const double g[5], const struct element_law *law, double modulus_pa,
                            struct point_response *response) {
    const double along[2] = {g[0] * hoop[0] + g[1] * hoop[1], g[2] * hoop[0] + g[3] * hoop[1]};
    const double stretch = hypot(along[0], along[1]), share = law->corrugation_fraction / modulus_pa;
    double stress = 0.0, slope = 0.0;
    material_uniaxial(&law->corrugation, stretch, &stress, &slope);
    const double tension = share * stress / stretch, stiffening = (share * slope - tension) / (stretch * stretch);
    for (size_t k = 0; k < 4; k++) {
        const double fk = along[k / 2] * hoop[k % 2];
        response->stress[k] += tension * fk;
        for (size_t l = 0; l < 4; l++) {
            response->stiffness[k][l] += stiffening * fk * along[l / 2] * hoop[l % 2] +
                                         (k / 2 == l / 2 ? tension * hoop[k % 2] * hoop[l % 2] : 0.0);
        }
    }
}

/* By the chain rule through i = F2:F2, j = det F2 and s = F33; the volume ratio is j s. */
void point_response(const struct gauss_point *point, const double g[5], double pressure, const struct element_law *law,
                    double modulus_pa, struct point_response *response) {
    const double j = g[0] * g[3] - g[1] * g[2], s = g[4];
    const double cofactor[5] = {g[3], -g[2], -g[1], g[0], 0.0};
    const double by[3][5] = {{2.0 * g[0], 2.0 * g[1], 2.0 * g[2], 2.0 * g[3], 0.0},
                             {cofactor[0], cofactor[1], cofactor[2], cofactor[3], 0.0},
                             {0.0, 0.0, 0.0, 0.0, 1.0}};
    const double share = (1.0 - law->corrugation_fraction) / modulus_pa;
    struct material_response rubber;
    material_respond(&law->material, g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + g[3] * g[3], j, s, &rubber);
    for (size_t m = 0; m < 3; m++) {
        rubber.first[m] *= share;
        for (size_t n = 0; n < 3; n++) {
            rubber.second[m][n] *= share;
        }
    }
    for (size_t k = 0; k < 5; k++) {
        response->dj[k] = s * cofactor[k] + (k == 4 ? j : 0.0);
        response->stress[k] =
            rubber.first[0] * by[0][k] + rubber.first[1] * by[1][k] + rubber.first[2] * by[2][k] + pressure * response->dj[k];
        double part[3];
        for (size_t n = 0; n < 3; n++) {
            part[n] = rubber.second[n][0] * by[0][k] + rubber.second[n][1] * by[1][k] + rubber.second[n][2] * by[2][k];
        }
        for (size_t l = 0; l <= k; l++) {
            const double squeeze = (k == 4 ? cofactor[l] : 0.0) + (l == 4 ? cofactor[k] : 0.0);
            response->stiffness[k][l] = part[0] * by[0][l] + part[1] * by[1][l] + part[2] * by[2][l] + pressure * squeeze;
            response->stiffness[l][k] = response->stiffness[k][l];
        }
    }
    for (size_t k = 0; k < 4; k++) {
        response->stiffness[k][k] += 2.0 * rubber.first[0];
    }
    const double bend = rubber.first[1] + pressure * s; /* second derivative of j */
    response->stiffness[0][3] += bend;
    response->stiffness[3][0] += bend;
    response->stiffness[1][2] -= bend;
    response->stiffness[2][1] -= bend;
    response->jacobian = j * s;
    response->energy = rubber.energy * share;
    if (law->corrugation_fraction > 0.0) {
        add_corrugation(point->hoop, g, law, modulus_pa, response);
    }
}

/* Derivative of the deformation gradient by the local displacements, then stretch and the two curvatures: columns of
 * three entries at most, so the products below touch only those. */
#define COLUMNS (ELEMENT_DISPLACEMENTS + GLOBALS)

static void gradient_columns(const struct gauss_point *point, const double *shape, const double y[2],
                             const struct section_globals *globals, double column[COLUMNS][5]) {
    memset(column, 0, COLUMNS * 5 * sizeof(double));
    for (size_t a = 0; a < ELEMENT_NODES; a++) {
        for (size_t i = 0; i < 2; i++) {
            column[2 * a + i][2 * i] = point->gradient[a][0];
            column[2 * a + i][2 * i + 1] = point->gradient[a][1];
        }
        column[2 * a][4] = -globals->curvature[1] * shape[a];
        column[2 * a + 1][4] = globals->curvature[0] * shape[a];
    }
    column[ELEMENT_DISPLACEMENTS][4] = 1.0;
    column[ELEMENT_DISPLACEMENTS + 1][4] = y[1];
    column[ELEMENT_DISPLACEMENTS + 2][4] = -y[0];
}

static double sparse_product(size_t k, double column[COLUMNS][5], const double vector[5]) {
    const double last = column[k][4] * vector[4];
    if (k >= ELEMENT_DISPLACEMENTS) {
        return last;
    }
    const size_t row = 2 * (k % 2);
    return column[k][row] * vector[row] + column[k][row + 1] * vector[row + 1] + last;
}

static void add_point(const struct gauss_point *point, const double *shape, const double *corner, const double y[2],
                      const struct section_globals *globals, const struct point_response *response, double constraint,
                      double bulk, struct element_matrix *matrix) {
    double column[COLUMNS][5], full[COLUMNS][COLUMNS];
    const double weight = point->weight;
    gradient_columns(point, shape, y, globals, column);
    for (size_t k = 0; k < COLUMNS; k++) {
        double product[5];
        for (size_t i = 0; i < 5; i++) {
            product[i] = weight * sparse_product(k, column, response->stiffness[i]);
        }
        for (size_t l = 0; l <= k; l++) {
            full[k][l] = sparse_product(l, column, product);
        }
        const double force = weight * sparse_product(k, column, response->stress);
        const double squeeze = weight * sparse_product(k, column, response->dj);
        if (k < ELEMENT_DISPLACEMENTS) {
            matrix->residual[k] += force;
            for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
                matrix->tangent[ELEMENT_DISPLACEMENTS + c][k] += corner[c] * squeeze;
            }
        } else {
            matrix->global_residual[k - ELEMENT_DISPLACEMENTS] += force;
            for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
                matrix->global_column[k - ELEMENT_DISPLACEMENTS][ELEMENT_DISPLACEMENTS + c] += corner[c] * squeeze;
            }
        }
    }
    for (size_t k = 0; k < ELEMENT_DISPLACEMENTS; k++) {
        for (size_t l = 0; l <= k; l++) {
            matrix->tangent[k][l] += full[k][l];
        }
    }
    for (size_t m = 0; m < GLOBALS; m++) {
        for (size_t l = 0; l < ELEMENT_DISPLACEMENTS; l++) {
            matrix->global_column[m][l] += full[ELEMENT_DISPLACEMENTS + m][l];
        }
        for (size_t l = 0; l <= m; l++) {
            matrix->global_tangent[m][l] += full[ELEMENT_DISPLACEMENTS + m][ELEMENT_DISPLACEMENTS + l];
        }
    }
    /* F33 is bilinear in curvature and position: the second derivative carries the stress. */
    for (size_t a = 0; a < ELEMENT_NODES; a++) {
        matrix->global_column[1][2 * a + 1] += weight * response->stress[4] * shape[a];
        matrix->global_column[2][2 * a] -= weight * response->stress[4] * shape[a];
    }
    for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
        matrix->residual[ELEMENT_DISPLACEMENTS + c] += weight * corner[c] * constraint;
        for (size_t d = 0; d <= c; d++) {
            matrix->tangent[ELEMENT_DISPLACEMENTS + c][ELEMENT_DISPLACEMENTS + d] -= weight * corner[c] * corner[d] / bulk;
        }
    }
}

bool element_assemble(const struct gauss_point point[ELEMENT_GAUSS_POINTS], double position[ELEMENT_NODES][2],
                      const double pressure[ELEMENT_CORNERS], const struct section_globals *globals,
                      const struct element_law *law, double modulus_pa, struct element_matrix *matrix) {
    memset(matrix, 0, sizeof *matrix);
    for (size_t g = 0; g < ELEMENT_GAUSS_POINTS; g++) {
        const double *shape = element_gauss_shape[g], *corner = element_gauss_corner[g];
        double gradient[5], y[2] = {0.0, 0.0}, q = 0.0;
        element_deformation(&point[g], g, position, globals, gradient);
        for (size_t a = 0; a < ELEMENT_NODES; a++) {
            y[0] += shape[a] * position[a][0];
            y[1] += shape[a] * position[a][1];
        }
        for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
            q += corner[c] * pressure[c];
        }
        const double area = gradient[0] * gradient[3] - gradient[1] * gradient[2];
        if (!(area > LEAST_JACOBIAN) || !(gradient[4] > LEAST_JACOBIAN) || !(area * gradient[4] > LEAST_JACOBIAN)) {
            return false;
        }
        struct point_response response;
        point_response(&point[g], gradient, q, law, modulus_pa, &response);
        add_point(&point[g], shape, corner, y, globals, &response, response.jacobian - 1.0 - q / law->bulk, law->bulk,
                  matrix);
    }
    return true;
}

/* V = stretch A - curvature_x / 2 \oint y2^2 dy1 - curvature_y / 2 \oint y1^2 dy2 (Green), 3-point Gauss: exact, since
 * the integrand has degree five. The contour runs with the cavity to its left. */
void edge_assemble(double position[EDGE_NODES][2], const struct section_globals *globals,
                   struct edge_matrix *matrix) {
    static const double station[3] = {-0.774596669241483, 0.0, 0.774596669241483};
    static const double weight[3] = {5.0 / 9.0, 8.0 / 9.0, 5.0 / 9.0};
    const double s = globals->stretch, kx = globals->curvature[0], ky = globals->curvature[1];
    memset(matrix, 0, sizeof *matrix);
    for (size_t g = 0; g < 3; g++) {
        const double t = station[g], w = weight[g];
        const double n[EDGE_NODES] = {0.5 * t * (t - 1), 0.5 * t * (t + 1), 1 - t * t};
        const double d[EDGE_NODES] = {t - 0.5, t + 0.5, -2 * t};
        double x = 0, y = 0, dx = 0, dy = 0;
        for (size_t a = 0; a < EDGE_NODES; a++) {
            x += n[a] * position[a][0];
            y += n[a] * position[a][1];
            dx += d[a] * position[a][0];
            dy += d[a] * position[a][1];
        }
        const double part[GLOBALS] = {0.5 * (x * dy - y * dx), -0.5 * y * y * dx, -0.5 * x * x * dy};
        matrix->volume += w * (s * part[0] + kx * part[1] + ky * part[2]);
        for (size_t m = 0; m < GLOBALS; m++) {
            matrix->global_gradient[m] += w * part[m];
        }
        for (size_t a = 0; a < EDGE_NODES; a++) {
            const double by_x[GLOBALS] = {0.5 * (n[a] * dy - y * d[a]), -0.5 * y * y * d[a], -x * n[a] * dy};
            const double by_y[GLOBALS] = {0.5 * (x * d[a] - n[a] * dx), -y * n[a] * dx, -0.5 * x * x * d[a]};
            for (size_t m = 0; m < GLOBALS; m++) {
                matrix->global_column[m][2 * a] += w * by_x[m];
                matrix->global_column[m][2 * a + 1] += w * by_y[m];
            }
            matrix->gradient[2 * a] += w * (s * by_x[0] + kx * by_x[1] + ky * by_x[2]);
            matrix->gradient[2 * a + 1] += w * (s * by_y[0] + kx * by_y[1] + ky * by_y[2]);
            for (size_t b = 0; b < EDGE_NODES; b++) {
                const double cross = w * (n[a] * d[b] * (0.5 * s - ky * x) - d[a] * n[b] * (0.5 * s + kx * y));
                matrix->hessian[2 * a][2 * b] -= w * ky * dy * n[a] * n[b];
                matrix->hessian[2 * a + 1][2 * b + 1] -= w * kx * dx * n[a] * n[b];
                matrix->hessian[2 * a][2 * b + 1] += cross;
                matrix->hessian[2 * b + 1][2 * a] += cross;
            }
        }
    }
}

void fibre_assemble(double rest[EDGE_NODES][2], double position[EDGE_NODES][2], double stiffness,
                    struct fibre_matrix *matrix) {
    static const double station[3] = {-0.774596669241483, 0.0, 0.774596669241483};
    static const double weight[3] = {5.0 / 9.0, 8.0 / 9.0, 5.0 / 9.0};
    memset(matrix, 0, sizeof *matrix);
    for (size_t g = 0; g < 3; g++) {
        const double t = station[g], d[EDGE_NODES] = {t - 0.5, t + 0.5, -2 * t};
        double before[2] = {0.0, 0.0}, after[2] = {0.0, 0.0};
        for (size_t a = 0; a < EDGE_NODES; a++) {
            for (size_t i = 0; i < 2; i++) {
                before[i] += d[a] * rest[a][i];
                after[i] += d[a] * position[a][i];
            }
        }
        const double length = hypot(before[0], before[1]), now = hypot(after[0], after[1]), stretch = now / length;
        if (stretch <= 1.0) {
            continue;
        }
        /* dE = w length k (stretch - 1) d(stretch), d(stretch) = n . d(after) / length with n = after / now */
        const double tension = weight[g] * stiffness * (stretch - 1.0), n[2] = {after[0] / now, after[1] / now};
        for (size_t k = 0; k < EDGE_LOCAL; k++) {
            matrix->gradient[k] += tension * n[k % 2] * d[k / 2];
            for (size_t l = 0; l < EDGE_LOCAL; l++) {
                const double both = d[k / 2] * d[l / 2], nn = n[k % 2] * n[l % 2];
                matrix->hessian[k][l] += both * (weight[g] * stiffness / length * nn +
                                                 tension / now * ((k % 2 == l % 2 ? 1.0 : 0.0) - nn));
            }
        }
    }
}
