/* Every law is linear in its coefficients, so these follow from a linear least squares for given exponents; bounds on
 * their signs are met by trying every subset of terms (three at most), which finds the constrained optimum exactly.
 * Ogden's exponents are searched by the simplex of Nelder and Mead 1965 from several starts (variable projection). */
#include "material/material_fit.h"

#include <gsl/gsl_multifit.h>
#include <gsl/gsl_multimin.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DEFAULT_BULK_MODULUS_PA 1e9
#define DEFAULT_DENSITY_KGPM3 1070.0
#define EXPONENT_LEAST 0.1        /* free fits; below it a term is a logarithm */
#define EXPONENT_LEAST_STABLE 1.0
#define EXPONENT_MOST 20.0
#define SIMPLEX_ITERATIONS_MAX 400
#define SIMPLEX_SIZE 1e-5

struct point {
    double stretch;
    double stress_pa;
    double weight; /* square root of its share over the test's greatest stress */
    double scale_pa;
    enum deformation_mode mode;
};

struct fit_data {
    const struct material_fit_options *options;
    size_t count;
    struct point *point;
    double *unit; /* [count * terms] stress of each term with a coefficient of one */
    gsl_matrix *design;
    gsl_vector *stress;
};

/* --- points --- */

static double greatest_stress(const struct tensile_test *test, double strain_max, size_t *count) {
    double greatest = 0.0;
    *count = 0;
    for (size_t i = 0; i < test->count; i++) {
        if (test->strain[i] >= 0.0 && test->strain[i] <= strain_max) {
            greatest = fmax(greatest, fabs(test->stress_pa[i]));
            (*count)++;
        }
    }
    return greatest;
}

static bool take_points(const struct tensile_test *tests, size_t test_count, struct fit_data *data, char *error,
                        size_t error_bytes) {
    size_t all = 0;
    for (size_t t = 0; t < test_count; t++) {
        all += tests[t].count;
    }
    data->point = calloc(all + 1, sizeof *data->point);
    for (size_t t = 0; t < test_count && data->point != NULL; t++) {
        size_t count = 0;
        const double scale_pa = greatest_stress(&tests[t], data->options->strain_max, &count);
        if (count < TENSILE_POINTS_LEAST || !(scale_pa > 0.0)) {
            (void)snprintf(error, error_bytes, "%zu points up to %g %% strain in test %zu are too few for a fit", count,
                           100.0 * data->options->strain_max, t + 1);
            return false;
        }
        for (size_t i = 0; i < tests[t].count; i++) {
            if (tests[t].strain[i] >= 0.0 && tests[t].strain[i] <= data->options->strain_max) {
                data->point[data->count++] =
                    (struct point){1.0 + tests[t].strain[i], tests[t].stress_pa[i],
                                   1.0 / (scale_pa * sqrt((double)count)), scale_pa, tests[t].mode};
            }
        }
    }
    if (data->point == NULL) {
        (void)snprintf(error, error_bytes, "out of memory for %zu points", all);
    }
    return data->point != NULL;
}

/* --- coefficients for given exponents --- */

/* Least squares over the terms in `subset`; the sum of squares, or infinity where a bound is broken. */
static double solve_subset(const struct fit_data *data, unsigned subset, struct material *material) {
    const size_t terms = material->terms;
    size_t used[MATERIAL_TERMS_MAX] = {0}, count = 0;
    for (size_t k = 0; k < terms; k++) {
        if ((subset >> k & 1u) != 0) {
            used[count++] = k;
        }
    }
    gsl_matrix_view design = gsl_matrix_submatrix(data->design, 0, 0, data->count, count);
    for (size_t i = 0; i < data->count; i++) {
        for (size_t k = 0; k < count; k++) {
            gsl_matrix_set(&design.matrix, i, k, data->unit[i * terms + used[k]] * data->point[i].weight);
        }
    }
    gsl_vector *answer = gsl_vector_alloc(count);
    gsl_matrix *covariance = gsl_matrix_alloc(count, count);
    gsl_multifit_linear_workspace *workspace = gsl_multifit_linear_alloc(data->count, count);
    double squares = INFINITY;
    if (gsl_multifit_linear(&design.matrix, data->stress, answer, covariance, &squares, workspace) != 0) {
        squares = INFINITY;
    }
    memset(material->coefficient_pa, 0, sizeof material->coefficient_pa);
    for (size_t k = 0; k < count; k++) {
        const double value = gsl_vector_get(answer, k);
        material->coefficient_pa[used[k]] = value;
        squares = data->options->stable && value < 0.0 ? INFINITY : squares;
    }
    gsl_multifit_linear_free(workspace);
    gsl_matrix_free(covariance);
    gsl_vector_free(answer);
    return squares;
}

static double solve_coefficients(const struct fit_data *data, struct material *material) {
    for (size_t k = 0; k < material->terms; k++) {
        struct material one = *material;
        memset(one.coefficient_pa, 0, sizeof one.coefficient_pa);
        one.coefficient_pa[k] = 1.0;
        for (size_t i = 0; i < data->count; i++) {
            data->unit[i * material->terms + k] =
                material_nominal_stress_pa(&one, data->point[i].mode, data->point[i].stretch);
        }
    }
    const unsigned all = (1u << material->terms) - 1u;
    double least = solve_subset(data, all, material);
    struct material best = *material;
    /* where the whole set breaks a bound, the optimum has some coefficient at zero */
    for (unsigned subset = 1; subset < all && data->options->stable; subset++) {
        struct material trial = *material;
        const double squares = solve_subset(data, subset, &trial);
        if (squares < least) {
            least = squares;
            best = trial;
        }
    }
    *material = best;
    return least;
}

/* --- Ogden's exponents --- */

struct search {
    const struct fit_data *data;
    struct material material;
};

/* Into the allowed range, with the distance outside it as a penalty. */
static double bounded_exponent(const struct fit_data *data, double value, double *outside) {
    const double least = data->options->stable ? EXPONENT_LEAST_STABLE : EXPONENT_LEAST;
    const double size = fmin(fmax(fabs(value), least), EXPONENT_MOST);
    *outside += fabs(fabs(value) - size);
    return copysign(size, value);
}

static double exponent_cost(const gsl_vector *exponents, void *context) {
    struct search *search = context;
    double outside = 0.0;
    for (size_t k = 0; k < search->material.terms; k++) {
        search->material.exponent[k] = bounded_exponent(search->data, gsl_vector_get(exponents, k), &outside);
    }
    const double squares = solve_coefficients(search->data, &search->material);
    return isfinite(squares) ? log(squares + 1e-30) + outside : 1e3 + outside;
}

static double search_from(struct search *search, const double *start) {
    const size_t terms = search->material.terms;
    gsl_vector *at = gsl_vector_alloc(terms), *step = gsl_vector_alloc(terms);
    gsl_multimin_fminimizer *minimiser = gsl_multimin_fminimizer_alloc(gsl_multimin_fminimizer_nmsimplex2, terms);
    gsl_multimin_function cost = {exponent_cost, terms, search};
    for (size_t k = 0; k < terms; k++) {
        gsl_vector_set(at, k, start[k]);
        gsl_vector_set(step, k, 0.3 * fabs(start[k]));
    }
    int status = gsl_multimin_fminimizer_set(minimiser, &cost, at, step);
    for (int i = 0; i < SIMPLEX_ITERATIONS_MAX && status == 0; i++) {
        status = gsl_multimin_fminimizer_iterate(minimiser);
        if (status == 0 && gsl_multimin_fminimizer_size(minimiser) < SIMPLEX_SIZE) {
            break;
        }
    }
    const double least = exponent_cost(gsl_multimin_fminimizer_x(minimiser), search);
    gsl_multimin_fminimizer_free(minimiser);
    gsl_vector_free(step);
    gsl_vector_free(at);
    return least;
}

static double fit_ogden(const struct fit_data *data, struct material *material) {
    static const double starts[][MATERIAL_TERMS_MAX] = {
        {2.0, -2.0, 6.0}, {1.3, 5.0, -2.0}, {1.1, -4.0, 3.0}, {4.0, -1.2, 8.0}, {-2.0, 3.0, 1.5}};
    double least = INFINITY;
    for (size_t i = 0; i < sizeof starts / sizeof starts[0]; i++) {
        struct search search = {data, *material};
        const double cost = search_from(&search, starts[i]);
        if (cost < least) {
            least = cost;
            *material = search.material;
        }
    }
    return exp(least);
}

/* --- all --- */

static void measure(const struct fit_data *data, struct material_fit *fit) {
    double sum = 0.0, relative = 0.0;
    for (size_t i = 0; i < data->count; i++) {
        const struct point *point = &data->point[i];
        const double gap = material_nominal_stress_pa(&fit->material, point->mode, point->stretch) - point->stress_pa;
        sum += gap * gap;
        relative += gap * gap / (point->scale_pa * point->scale_pa);
        fit->material.strain_max = fmax(fit->material.strain_max, point->stretch - 1.0);
        if (fabs(gap) > fit->most_pa) {
            fit->most_pa = fabs(gap);
            fit->most_strain = point->stretch - 1.0;
        }
    }
    const double count = (double)data->count;
    fit->points = data->count;
    fit->parameters = fit->material.terms * (fit->material.law == MATERIAL_OGDEN ? 2 : 1);
    fit->rms_pa = sqrt(sum / count);
    fit->rms_relative = sqrt(relative / count);
    fit->aic = count * log(relative / count + 1e-30) + 2.0 * (double)(fit->parameters + 1);
}

bool material_fit(const struct tensile_test *tests, size_t test_count, const struct material_fit_options *options,
                  struct material_fit *fit, char *error, size_t error_bytes) {
    struct fit_data data = {.options = options};
    if (options->terms == 0 || options->terms > MATERIAL_TERMS_MAX) {
        (void)snprintf(error, error_bytes, "a law takes 1 to %d terms, not %zu", MATERIAL_TERMS_MAX, options->terms);
        return false;
    }
    if (!take_points(tests, test_count, &data, error, error_bytes)) {
        free(data.point);
        return false;
    }
    memset(fit, 0, sizeof *fit);
    fit->material.law = options->law;
    fit->material.terms = options->terms;
    fit->material.bulk_modulus_pa = DEFAULT_BULK_MODULUS_PA;
    fit->material.density_kgpm3 = DEFAULT_DENSITY_KGPM3;
    data.unit = calloc(data.count * options->terms + 1, sizeof(double));
    data.design = gsl_matrix_alloc(data.count, options->terms);
    data.stress = gsl_vector_alloc(data.count);
    double squares = INFINITY;
    if (data.unit != NULL && data.design != NULL && data.stress != NULL) {
        for (size_t i = 0; i < data.count; i++) {
            gsl_vector_set(data.stress, i, data.point[i].stress_pa * data.point[i].weight);
        }
        squares = options->law == MATERIAL_OGDEN ? fit_ogden(&data, &fit->material)
                                                 : solve_coefficients(&data, &fit->material);
    }
    if (isfinite(squares)) {
        measure(&data, fit);
    } else {
        (void)snprintf(error, error_bytes, "the least squares found no answer: does the stress rise with the strain?");
    }
    gsl_vector_free(data.stress);
    gsl_matrix_free(data.design);
    free(data.unit);
    free(data.point);
    return isfinite(squares);
}
