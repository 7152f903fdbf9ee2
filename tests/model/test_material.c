#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "description/module_description.h"
#include "material/material_fit.h"
#include "support/scratch.h"

static const struct material yeoh = {.law = MATERIAL_YEOH, .terms = 3, .coefficient_pa = {8000.0, 120.0, -0.9},
                                     .bulk_modulus_pa = 1e9};

static const struct material ogden = {.law = MATERIAL_OGDEN, .terms = 3, .coefficient_pa = {9000.0, 21.0, -300.0},
                                      .exponent = {1.55, 7.86, -1.91}, .bulk_modulus_pa = 1e9};
static const struct material quadratic = {.law = MATERIAL_REDUCED_POLYNOMIAL, .terms = 2,
                                          .coefficient_pa = {6000.0, 200.0}, .bulk_modulus_pa = 1e9};
static const struct material *const every_law[] = {&yeoh, &ogden, &quadratic};

/* Invariants (i, j, s) from equal in-plane stretches to very unequal ones, so that both branches of the Ogden law and
 * their meeting are passed. */
static void energy_and_its_derivatives_agree(void **state) {
    (void)state;
    const double share[] = {1.0, 1.0000001, 1.01, 1.0999, 1.1001, 1.5, 4.0, 12.0};
    for (size_t l = 0; l < sizeof every_law / sizeof every_law[0]; l++) {
        for (size_t n = 0; n < sizeof share / sizeof share[0]; n++) {
            const double j = 0.7 + 0.1 * (double)n, s = 1.3 / j;
            const double at[3] = {2.0 * j * share[n], j, s};
            struct material_response here;
            material_respond(every_law[l], at[0], at[1], at[2], &here);
            for (size_t m = 0; m < 3; m++) {
                const double h = 1e-5;
                double up[3] = {at[0], at[1], at[2]}, down[3] = {at[0], at[1], at[2]};
                struct material_response above, below;
                up[m] += h;
                down[m] -= h;
                material_respond(every_law[l], up[0], up[1], up[2], &above);
                material_respond(every_law[l], down[0], down[1], down[2], &below);
                assert_close(here.first[m], (above.energy - below.energy) / (2.0 * h), 1e-3 + 1e-6 * fabs(here.first[m]));
                for (size_t k = 0; k < 3; k++) {
                    assert_close(here.second[m][k], (above.first[k] - below.first[k]) / (2.0 * h),
                                 1e-2 + 1e-6 * fabs(here.second[m][k]));
                }
            }
        }
    }
    assert_close(material_shear_modulus(&yeoh), 16000.0, 1e-9);
    assert_close(material_shear_modulus(&ogden), 8721.0, 1e-9);
}

/* The energy of invariants against the law in stretches, at a volume ratio of one. */
static void energy_in_invariants_is_the_law_in_stretches(void **state) {
    (void)state;
    for (double a = 0.4; a < 4.0; a *= 1.25) { /* NOLINT: a few values, their exact count does not matter */
        const double b = 1.2, c = 1.0 / (a * b);
        struct material_response response;
        double sum = 0.0;
        material_respond(&ogden, a * a + b * b, a * b, c, &response);
        for (size_t k = 0; k < 3; k++) {
            const double e = ogden.exponent[k];
            sum += 2.0 * ogden.coefficient_pa[k] / (e * e) * (pow(a, e) + pow(b, e) + pow(c, e) - 3.0);
        }
        assert_close(response.energy, sum, 1e-9 * (fabs(sum) + 1e4));
        material_respond(&yeoh, a * a + b * b, a * b, c, &response);
        const double x = a * a + b * b + c * c - 3.0;
        assert_relative(response.energy, 8000.0 * x + 120.0 * x * x - 0.9 * x * x * x, 1e-12);
    }
    /* exponent 2 is neo-Hooke: the same derivatives, where two stretches meet as well */
    const struct material neo = {.law = MATERIAL_NEO_HOOKEAN, .terms = 1, .coefficient_pa = {4000.0}};
    const struct material two = {.law = MATERIAL_OGDEN, .terms = 1, .coefficient_pa = {8000.0}, .exponent = {2.0}};
    for (double share = 1.0; share < 3.0; share += 0.05) { /* NOLINT */
        struct material_response one, other;
        material_respond(&neo, 2.0 * 1.3 * share, 1.3, 0.8, &one);
        material_respond(&two, 2.0 * 1.3 * share, 1.3, 0.8, &other);
        for (size_t m = 0; m < 3; m++) {
            assert_close(one.first[m], other.first[m], 1e-8);
            for (size_t k = 0; k < 3; k++) {
                assert_close(one.second[m][k], other.second[m][k], 1e-6);
            }
        }
    }
}

/* Ogden in closed form: sum 2 c / a (s^(a - 1) - s^(-n a / ... - 1)), the free face's stretch to the power a. */
static void nominal_stress_of_ogden(void **state) {
    (void)state;
    const double s = 1.7, free_face[DEFORMATION_MODES] = {1.0 / sqrt(s), 1.0 / s, 1.0 / (s * s)};
    for (int mode = 0; mode < (int)DEFORMATION_MODES; mode++) {
        double sum = 0.0;
        for (size_t k = 0; k < 3; k++) {
            const double e = ogden.exponent[k];
            sum += 2.0 * ogden.coefficient_pa[k] / e * (pow(s, e) - pow(free_face[mode], e)) / s;
        }
        assert_relative(material_nominal_stress_pa(&ogden, (enum deformation_mode)mode, s), sum, 1e-12);
    }
}

/* Neo-Hooke is elliptic everywhere; a law whose first derivative vanishes is not. In simple states the margin is known:
 * at rest, every wave has the shear modulus. */
static void ellipticity(void **state) {
    (void)state;
    const struct material neo = {.law = MATERIAL_NEO_HOOKEAN, .terms = 1, .coefficient_pa = {1000.0}};
    const double rest[3] = {1.0, 1.0, 1.0}, pulled[3] = {4.0, 0.5, 0.5};
    assert_relative(material_ellipticity_margin(&neo, rest), 1.0, 1e-9);
    assert_relative(material_ellipticity_margin(&neo, pulled), 0.25, 1e-9); /* the least squared stretch */
    assert_close(material_elliptic_stretch(&neo, DEFORMATION_UNIAXIAL, 5.0), 5.0, 1e-12);
    struct material printed;
    struct description_error error;
    assert_true(material_read("tables/materials/ecoflex-0030-printed.yaml", &printed, &error));
    const double lost = material_elliptic_stretch(&printed, DEFORMATION_UNIAXIAL, 5.0);
    assert_true(lost > 1.5 && lost < 2.8);
    /* W' > 0 is needed: beyond the stretch where it vanishes, the law cannot be elliptic (5072 - 662 x - 45 x^2 = 0) */
    const double x = (-662.0 + sqrt(662.0 * 662.0 + 4.0 * 45.0 * 5072.0)) / 90.0;
    assert_true(lost * lost + 2.0 / lost - 3.0 < x);
}

/* Neo-Hooke: 2 C (s - s^-2), 2 C (s - s^-3), 2 C (s - s^-5). */
static void nominal_stress_in_three_modes(void **state) {
    (void)state;
    const struct material neo = {.law = MATERIAL_NEO_HOOKEAN, .terms = 1, .coefficient_pa = {1000.0}};
    assert_relative(material_nominal_stress_pa(&neo, DEFORMATION_UNIAXIAL, 2.0), 2000.0 * (2.0 - 0.25), 1e-12);
    assert_relative(material_nominal_stress_pa(&neo, DEFORMATION_SHEAR, 2.0), 2000.0 * (2.0 - 0.125), 1e-12);
    assert_relative(material_nominal_stress_pa(&neo, DEFORMATION_EQUIBIAXIAL, 2.0), 2000.0 * (2.0 - 1.0 / 32.0), 1e-12);
}

/* The stretches at which the founding paper's printed Ecoflex 00-30 turns. */
static void the_printed_coefficients_lose_stability_where_they_should(void **state) {
    (void)state;
    struct material material;
    struct description_error error;
    assert_true(material_read("tables/materials/ecoflex-0030-printed.yaml", &material, &error));
    assert_close(material_stable_stretch(&material, DEFORMATION_UNIAXIAL, 4.0), 1.95, 0.01);
    assert_close(material_stable_stretch(&material, DEFORMATION_SHEAR, 4.0), 1.86, 0.01);
    assert_close(material_stable_stretch(&material, DEFORMATION_EQUIBIAXIAL, 4.0), 1.48, 0.01);
    assert_true(material_read("tables/materials/ecoflex-0030-positive.yaml", &material, &error));
    for (int mode = 0; mode < (int)DEFORMATION_MODES; mode++) {
        assert_close(material_stable_stretch(&material, (enum deformation_mode)mode, 4.5), 4.5, 1e-9);
    }
}

static void every_material_file_can_be_read(void **state) {
    (void)state;
    const char *const names[] = {"ecoflex-0030-printed",     "ecoflex-0030-positive",  "ecoflex-0030-c30-positive",
                                 "ecoflex-0030-measured",    "ecoflex-0050-measured",  "dragon-skin-0030-printed",
                                 "dragon-skin-0030-measured", "ecoflex-0050-printed",
                                 "ecoflex-0030-measured-ogden", "ecoflex-0050-measured-ogden",
                                 "dragon-skin-0030-measured-ogden"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        char path[128];
        struct material material;
        struct description_error error;
        (void)snprintf(path, sizeof path, "tables/materials/%s.yaml", names[i]);
        if (!material_read(path, &material, &error)) {
            fail_msg("%s", error.text);
        }
        assert_string_equal(material.name, names[i]);
        assert_true(material_shear_modulus(&material) > 0.0);
        assert_true(strlen(material.source) > 10);
    }
}

/* --- fit --- */

static const struct material_fit_options free_yeoh = {MATERIAL_YEOH, 3, 3.0, false};

static struct tensile_test made_of(const struct material *material, size_t count, double strain_max) {
    struct tensile_test test = {.count = count,
                                .strain = calloc(count, sizeof(double)),
                                .stress_pa = calloc(count, sizeof(double))};
    assert_true(test.strain != NULL && test.stress_pa != NULL);
    for (size_t i = 0; i < count; i++) {
        test.strain[i] = strain_max * (double)(i + 1) / (double)count;
        test.stress_pa[i] = material_nominal_stress_pa(material, DEFORMATION_UNIAXIAL, 1.0 + test.strain[i]);
    }
    return test;
}

static void a_fit_finds_the_law_that_made_the_data(void **state) {
    (void)state;
    struct tensile_test test = made_of(&yeoh, 300, 4.0);
    const struct material_fit_options neo = {MATERIAL_NEO_HOOKEAN, 1, 3.0, true};
    struct material_fit fit;
    char error[256];
    assert_true(material_fit(&test, 1, &free_yeoh, &fit, error, sizeof error));
    for (size_t i = 0; i < 3; i++) {
        assert_relative(fit.material.coefficient_pa[i], yeoh.coefficient_pa[i], 1e-6);
    }
    assert_under(fit.rms_relative, 1e-9);
    assert_int_equal(fit.points, 225); /* strains up to 3 of 4 */
    /* a law with too few terms cannot, and says how far it is off */
    assert_true(material_fit(&test, 1, &neo, &fit, error, sizeof error));
    assert_true(fit.rms_relative > 0.02);
    assert_true(fit.most_pa >= fit.rms_pa);
    tensile_test_free(&test);
}

/* With bounds no coefficient is negative, the law is stable far beyond its data, and the fit is the best there is: with
 * c3 = 0 it must equal the fit of two terms. */
static void bounds_keep_a_fit_stable(void **state) {
    (void)state;
    struct tensile_test test = made_of(&yeoh, 300, 4.0);
    const struct material_fit_options bounded = {MATERIAL_YEOH, 3, 3.0, true};
    const struct material_fit_options two_terms = {MATERIAL_REDUCED_POLYNOMIAL, 2, 3.0, false};
    struct material_fit fit, shorter;
    char error[256];
    assert_true(material_fit(&test, 1, &bounded, &fit, error, sizeof error));
    assert_true(material_fit(&test, 1, &two_terms, &shorter, error, sizeof error));
    assert_close(fit.material.coefficient_pa[2], 0.0, 1e-12);
    assert_relative(fit.material.coefficient_pa[0], shorter.material.coefficient_pa[0], 1e-9);
    assert_relative(fit.rms_pa, shorter.rms_pa, 1e-9);
    for (int mode = 0; mode < (int)DEFORMATION_MODES; mode++) {
        assert_close(material_stable_stretch(&fit.material, (enum deformation_mode)mode, 8.0), 8.0, 1e-9);
        assert_close(material_elliptic_stretch(&fit.material, (enum deformation_mode)mode, 8.0), 8.0, 1e-9);
    }
    tensile_test_free(&test);
}

/* An Ogden law is found again from a pull and an equibiaxial test together, and AIC prefers it to others. */
static void ogden_is_found_from_two_tests(void **state) {
    (void)state;
    const struct material law = {.law = MATERIAL_OGDEN, .terms = 2, .coefficient_pa = {8000.0, 40.0},
                                 .exponent = {1.4, 5.5}};
    struct tensile_test tests[2] = {made_of(&law, 60, 3.0), made_of(&law, 60, 1.5)};
    tests[1].mode = DEFORMATION_EQUIBIAXIAL;
    for (size_t i = 0; i < tests[1].count; i++) {
        tests[1].stress_pa[i] = material_nominal_stress_pa(&law, DEFORMATION_EQUIBIAXIAL, 1.0 + tests[1].strain[i]);
    }
    const struct material_fit_options two = {MATERIAL_OGDEN, 2, 3.0, true}, cubic = {MATERIAL_YEOH, 3, 3.0, true};
    struct material_fit fit, other;
    char error[256];
    assert_true(material_fit(tests, 2, &two, &fit, error, sizeof error));
    const size_t soft = fit.material.exponent[0] < fit.material.exponent[1] ? 0 : 1;
    assert_relative(fit.material.exponent[soft], 1.4, 0.02);
    assert_relative(fit.material.exponent[1 - soft], 5.5, 0.02);
    assert_under(fit.rms_relative, 1e-3);
    assert_int_equal(fit.points, 120);
    assert_int_equal(fit.parameters, 4);
    assert_true(material_fit(tests, 2, &cubic, &other, error, sizeof error));
    assert_true(fit.aic < other.aic);
    tensile_test_free(&tests[0]);
    tensile_test_free(&tests[1]);
}

static void too_little_data_is_refused(void **state) {
    (void)state;
    struct tensile_test test = made_of(&yeoh, 2, 2.0);
    struct material_fit fit;
    char error[256] = "";
    assert_false(material_fit(&test, 1, &free_yeoh, &fit, error, sizeof error));
    assert_true(strlen(error) > 10);
    tensile_test_free(&test);
}

static void tensile_files_good_and_bad(void **state) {
    (void)state;
    char path[SCRATCH_BYTES], error[256] = "";
    const char *const header = "PARAMETER;INFO\nL\xe4nge;33\nTime (s);True Strain;True Stress (MPa);Engineering "
                               "Strain;Engineering Stress (MPa)\n";
    const struct {
        int good_rows;
        const char *last_row;
        size_t count;
    } cases[] = {{12, "", 12},
                 {0, "", 0},
                 {3, "", 0}, /* too few to fit anything */
                 {12, "0.1;0.01;0.001;0.01\n", 0},
                 {12, "0.1;0.01;0.001;0.01;abc\n", 0},
                 {12, "0.1;0.01;0.001;nan;0.001\n", 0}};
    const int file = scratch_file(path);
    assert_true(file >= 0);
    assert_int_equal(close(file), 0);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct tensile_test test;
        FILE *stream = fopen(path, "w");
        assert_non_null(stream);
        assert_true(fputs(header, stream) >= 0);
        for (int r = 1; r <= cases[i].good_rows; r++) {
            assert_true(fprintf(stream, "0.%d;0.01;0.001;%.2f;%.4f\n", r, 0.01 * r, 0.001 * r) > 0);
        }
        assert_true(fputs(cases[i].last_row, stream) >= 0);
        assert_int_equal(fclose(stream), 0);
        const bool read = tensile_test_read(path, &test, error, sizeof error);
        assert_int_equal(read, cases[i].count > 0);
        if (read) {
            assert_int_equal(test.count, cases[i].count);
            assert_relative(test.stress_pa[1], 2000.0, 1e-12);
            tensile_test_free(&test);
        } else {
            assert_non_null(strstr(error, path));
        }
    }
    assert_int_equal(remove(path), 0);
    struct tensile_test test;
    assert_false(tensile_test_read(path, &test, error, sizeof error));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(energy_and_its_derivatives_agree),
        cmocka_unit_test(energy_in_invariants_is_the_law_in_stretches),
        cmocka_unit_test(nominal_stress_in_three_modes),
        cmocka_unit_test(nominal_stress_of_ogden),
        cmocka_unit_test(ellipticity),
        cmocka_unit_test(the_printed_coefficients_lose_stability_where_they_should),
        cmocka_unit_test(every_material_file_can_be_read),
        cmocka_unit_test(a_fit_finds_the_law_that_made_the_data),
        cmocka_unit_test(bounds_keep_a_fit_stable),
        cmocka_unit_test(ogden_is_found_from_two_tests),
        cmocka_unit_test(too_little_data_is_refused),
        cmocka_unit_test(tensile_files_good_and_bad),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
