#include "material/material_fit.h"

#include <errno.h>
#include <gsl/gsl_multifit.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_BYTES 512
#define COLUMNS 5
#define COLUMN_STRAIN 3
#define COLUMN_STRESS 4
#define STABILITY_STEP 1e-3
#define DEFAULT_BULK_MODULUS_PA 1e9
#define DEFAULT_DENSITY_KGPM3 1070.0
#define POINTS_LEAST 10

/* Numbers of one row; fewer than COLUMNS means a header line. */
static int parse_row(const char *line, double value[COLUMNS]) {
    int count = 0;
    while (count < COLUMNS) {
        char *end = NULL;
        value[count] = strtod(line, &end);
        if (end == line) {
            break;
        }
        count++;
        if (*end != ';') {
            break;
        }
        line = end + 1;
    }
    return count;
}

static bool append(struct tensile_test *test, size_t *room, double strain, double stress_pa) {
    if (test->count == *room) {
        *room = *room == 0 ? 256 : 2 * *room;
        double *strains = realloc(test->strain, *room * sizeof(double));
        if (strains != NULL) {
            test->strain = strains;
        }
        double *stresses = realloc(test->stress_pa, *room * sizeof(double));
        if (stresses != NULL) {
            test->stress_pa = stresses;
        }
        if (strains == NULL || stresses == NULL) {
            return false;
        }
    }
    test->strain[test->count] = strain;
    test->stress_pa[test->count++] = stress_pa;
    return true;
}

bool tensile_test_read(const char *path, struct tensile_test *test, char *error, size_t error_bytes) {
    memset(test, 0, sizeof *test);
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        (void)snprintf(error, error_bytes, "%s: %s", path, strerror(errno));
        return false;
    }
    char line[LINE_BYTES];
    size_t room = 0;
    bool sound = true;
    for (int number = 1; sound && fgets(line, sizeof line, file) != NULL; number++) {
        double value[COLUMNS];
        const int count = parse_row(line, value);
        const bool blank = line[strspn(line, "; \t\r\n")] == '\0';
        if (count == COLUMNS && isfinite(value[COLUMN_STRAIN]) && isfinite(value[COLUMN_STRESS])) {
            sound = append(test, &room, value[COLUMN_STRAIN], 1e6 * value[COLUMN_STRESS]);
            if (!sound) {
                (void)snprintf(error, error_bytes, "%s:%d: out of memory", path, number);
            }
        } else if (test->count > 0 && !blank) {
            (void)snprintf(error, error_bytes, "%s:%d: a row needs %d numbers parted by semicolons, this one has %d", path,
                           number, COLUMNS, count);
            sound = false;
        }
    }
    (void)fclose(file);
    if (sound && test->count < POINTS_LEAST) {
        (void)snprintf(error, error_bytes,
                       "%s: %zu rows of numbers, too few; expected time s;true strain;true stress MPa;engineering "
                       "strain;engineering stress MPa",
                       path, test->count);
        sound = false;
    }
    if (!sound) {
        tensile_test_free(test);
    }
    return sound;
}

void tensile_test_free(struct tensile_test *test) {
    free(test->strain);
    free(test->stress_pa);
    memset(test, 0, sizeof *test);
}

static const double mode_exponent[DEFORMATION_MODES] = {-2.0, -3.0, -5.0};

static double mode_i1(enum deformation_mode mode, double s) {
    switch (mode) {
    case DEFORMATION_UNIAXIAL:
        return s * s + 2.0 / s;
    case DEFORMATION_SHEAR:
        return s * s + 1.0 + 1.0 / (s * s);
    default:
        return 2.0 * s * s + 1.0 / (s * s * s * s);
    }
}

double material_nominal_stress_pa(const struct material *material, enum deformation_mode mode, double stretch) {
    double w, dw, d2w;
    material_energy(material, mode_i1(mode, stretch), &w, &dw, &d2w);
    return 2.0 * (stretch - pow(stretch, mode_exponent[mode])) * dw;
}

double material_stable_stretch(const struct material *material, enum deformation_mode mode, double stretch_max) {
    double last = 0.0;
    for (int step = 1; 1.0 + step * STABILITY_STEP < stretch_max; step++) {
        const double stretch = 1.0 + step * STABILITY_STEP;
        const double stress = material_nominal_stress_pa(material, mode, stretch);
        if (stress <= last) {
            return stretch - STABILITY_STEP;
        }
        last = stress;
    }
    return stretch_max;
}

/* Row of the design matrix: d stress / d c_i = 2 (s - s^-2) i (I1 - 3)^(i - 1). */
static void fill_row(gsl_matrix *design, size_t row, size_t terms, double stretch) {
    const double x = mode_i1(DEFORMATION_UNIAXIAL, stretch) - 3.0;
    double power = 1.0;
    for (size_t i = 0; i < terms; i++) {
        gsl_matrix_set(design, row, i, 2.0 * (stretch - 1.0 / (stretch * stretch)) * (double)(i + 1) * power);
        power *= x;
    }
}

static size_t select_rows(const struct tensile_test *test, double strain_max, size_t *rows) {
    size_t count = 0;
    for (size_t i = 0; i < test->count; i++) {
        if (test->strain[i] >= 0.0 && test->strain[i] <= strain_max) {
            rows[count++] = i;
        }
    }
    return count;
}

static void measure_fit(const struct tensile_test *test, const size_t *rows, size_t count, struct material_fit *fit) {
    double sum = 0.0, greatest = 0.0;
    for (size_t k = 0; k < count; k++) {
        const double strain = test->strain[rows[k]], stress = test->stress_pa[rows[k]];
        const double gap = material_nominal_stress_pa(&fit->material, DEFORMATION_UNIAXIAL, 1.0 + strain) - stress;
        sum += gap * gap;
        greatest = fmax(greatest, stress);
        fit->material.strain_max = fmax(fit->material.strain_max, strain);
        if (fabs(gap) > fit->most_pa) {
            fit->most_pa = fabs(gap);
            fit->most_strain = strain;
        }
    }
    fit->points = count;
    fit->rms_pa = sqrt(sum / (double)count);
    fit->rms_relative = fit->rms_pa / greatest;
}

bool material_fit(const struct tensile_test *test, enum material_law law, size_t terms, double strain_max,
                  struct material_fit *fit, char *error, size_t error_bytes) {
    size_t *rows = malloc(test->count * sizeof *rows);
    const size_t count = rows == NULL ? 0 : select_rows(test, strain_max, rows);
    if (count < POINTS_LEAST || terms == 0 || terms > MATERIAL_TERMS_MAX) {
        (void)snprintf(error, error_bytes, "%zu points up to %g %% strain are too few for a fit of %zu terms", count,
                       100.0 * strain_max, terms);
        free(rows);
        return false;
    }
    gsl_matrix *design = gsl_matrix_alloc(count, terms), *covariance = gsl_matrix_alloc(terms, terms);
    gsl_vector *stress = gsl_vector_alloc(count), *coefficient = gsl_vector_alloc(terms);
    gsl_multifit_linear_workspace *workspace = gsl_multifit_linear_alloc(count, terms);
    for (size_t k = 0; k < count; k++) {
        fill_row(design, k, terms, 1.0 + test->strain[rows[k]]);
        gsl_vector_set(stress, k, test->stress_pa[rows[k]]);
    }
    double squares = 0.0;
    const int status = gsl_multifit_linear(design, stress, coefficient, covariance, &squares, workspace);
    memset(fit, 0, sizeof *fit);
    fit->material.law = law;
    fit->material.terms = terms;
    fit->material.bulk_modulus_pa = DEFAULT_BULK_MODULUS_PA;
    fit->material.density_kgpm3 = DEFAULT_DENSITY_KGPM3;
    for (size_t i = 0; i < terms; i++) {
        fit->material.coefficient_pa[i] = gsl_vector_get(coefficient, i);
    }
    measure_fit(test, rows, count, fit);
    gsl_multifit_linear_free(workspace);
    gsl_vector_free(coefficient);
    gsl_vector_free(stress);
    gsl_matrix_free(covariance);
    gsl_matrix_free(design);
    free(rows);
    if (status != 0) {
        (void)snprintf(error, error_bytes, "the least squares failed");
    }
    return status == 0;
}
