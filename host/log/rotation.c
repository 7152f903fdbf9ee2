#include "log/rotation.h"

#include <math.h>
#include <string.h>

#define JACOBI_SWEEPS 30

void rotation_multiply(const double a[4], const double b[4], double product[4]) {
    const double result[4] = {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                              a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                              a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                              a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
    memcpy(product, result, sizeof result);
}

void rotation_inverse(const double rotation[4], double inverse[4]) {
    inverse[0] = rotation[0];
    for (size_t k = 1; k < 4; k++) {
        inverse[k] = -rotation[k];
    }
}

void rotation_apply(const double rotation[4], const double vector[3], double turned[3]) {
    double pure[4] = {0.0, vector[0], vector[1], vector[2]}, inverse[4];
    rotation_inverse(rotation, inverse);
    rotation_multiply(rotation, pure, pure);
    rotation_multiply(pure, inverse, pure);
    memcpy(turned, pure + 1, 3 * sizeof *turned);
}

double rotation_normalise(double rotation[4]) {
    double square = 0.0;
    for (size_t k = 0; k < 4; k++) {
        square += rotation[k] * rotation[k];
    }
    const double length = sqrt(square);
    for (size_t k = 0; length > 0.0 && k < 4; k++) {
        rotation[k] /= length;
    }
    return length;
}

/* The eigenvector of the greatest eigenvalue of a symmetric matrix, by Jacobi rotations. */
static void greatest_eigenvector(double matrix[4][4], double vector[4]) {
    double basis[4][4] = {
        {1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
    for (size_t turn = 0; turn < JACOBI_SWEEPS * 6; turn++) {
        size_t p = 0, q = 1;
        for (size_t i = 0; i < 4; i++) {
            for (size_t j = i + 1; j < 4; j++) {
                if (fabs(matrix[i][j]) > fabs(matrix[p][q])) {
                    p = i;
                    q = j;
                }
            }
        }
        if (matrix[p][q] == 0.0) {
            break;
        }
        const double angle = 0.5 * atan2(2.0 * matrix[p][q], matrix[q][q] - matrix[p][p]);
        const double c = cos(angle), s = sin(angle);
        for (size_t k = 0; k < 4; k++) {
            const double left = matrix[k][p], right = matrix[k][q];
            matrix[k][p] = c * left - s * right;
            matrix[k][q] = s * left + c * right;
        }
        for (size_t k = 0; k < 4; k++) {
            const double upper = matrix[p][k], lower = matrix[q][k], left = basis[k][p], right = basis[k][q];
            matrix[p][k] = c * upper - s * lower;
            matrix[q][k] = s * upper + c * lower;
            basis[k][p] = c * left - s * right;
            basis[k][q] = s * left + c * right;
        }
    }
    size_t best = 0;
    for (size_t k = 1; k < 4; k++) {
        best = matrix[k][k] > matrix[best][best] ? k : best;
    }
    for (size_t k = 0; k < 4; k++) {
        vector[k] = basis[k][best];
    }
}

/* Horn's matrix N of the sums m[i][j] of from_i to_j; its eigenvector is the rotation. */
static void from_sums(const double m[3][3], double rotation[4]) {
    double n[4][4] = {{m[0][0] + m[1][1] + m[2][2], m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]},
                      {m[1][2] - m[2][1], m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[2][0] + m[0][2]},
                      {m[2][0] - m[0][2], m[0][1] + m[1][0], m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1]},
                      {m[0][1] - m[1][0], m[2][0] + m[0][2], m[1][2] + m[2][1], m[2][2] - m[0][0] - m[1][1]}};
    greatest_eigenvector(n, rotation);
    (void)rotation_normalise(rotation);
    const double sign = rotation[0] < 0.0 ? -1.0 : 1.0;
    for (size_t k = 0; k < 4; k++) {
        rotation[k] *= sign;
    }
}

void rotation_from_rows(const double matrix[3][3], double rotation[4]) {
    double sums[3][3]; /* the unit vectors laid onto the columns */
    for (size_t i = 0; i < 3; i++) {
        for (size_t j = 0; j < 3; j++) {
            sums[i][j] = matrix[j][i];
        }
    }
    from_sums((const double(*)[3])sums, rotation);
}

void rotation_between(const double (*from)[3], const double (*to)[3], size_t points, double rotation[4]) {
    double centre_from[3] = {0.0}, centre_to[3] = {0.0}, sums[3][3] = {{0.0}};
    for (size_t p = 0; p < points; p++) {
        for (size_t k = 0; k < 3; k++) {
            centre_from[k] += from[p][k] / (double)points;
            centre_to[k] += to[p][k] / (double)points;
        }
    }
    for (size_t p = 0; p < points; p++) {
        for (size_t i = 0; i < 3; i++) {
            for (size_t j = 0; j < 3; j++) {
                sums[i][j] += (from[p][i] - centre_from[i]) * (to[p][j] - centre_to[j]);
            }
        }
    }
    from_sums((const double(*)[3])sums, rotation);
}
