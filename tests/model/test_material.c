#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "description/module_description.h"
#include "material/material_fit.h"

static const struct material yeoh = {.law = MATERIAL_YEOH, .terms = 3, .coefficient_pa = {8000.0, 120.0, -0.9},
                                     .bulk_modulus_pa = 1e9};

static void energy_and_its_derivatives_agree(void **state) {
    (void)state;
    const double h = 1e-4;
    for (double i1 = 3.1; i1 < 20.0; i1 *= 1.3) { /* NOLINT: a few values, their exact count does not matter */
        double w, dw, d2w, plus, minus, dplus, dminus, ignored;
        material_energy(&yeoh, i1, &w, &dw, &d2w);
        material_energy(&yeoh, i1 + h, &plus, &dplus, &ignored);
        material_energy(&yeoh, i1 - h, &minus, &dminus, &ignored);
        assert_relative(dw, (plus - minus) / (2.0 * h), 1e-7);
        assert_close(d2w, (dplus - dminus) / (2.0 * h), 1e-4);
        const double x = i1 - 3.0;
        assert_relative(w, 8000.0 * x + 120.0 * x * x - 0.9 * x * x * x, 1e-12);
    }
    assert_close(material_shear_modulus(&yeoh), 16000.0, 1e-9);
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
                                 "dragon-skin-0030-measured"};
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
    struct material_fit fit;
    char error[256];
    assert_true(material_fit(&test, MATERIAL_YEOH, 3, 3.0, &fit, error, sizeof error));
    for (size_t i = 0; i < 3; i++) {
        assert_relative(fit.material.coefficient_pa[i], yeoh.coefficient_pa[i], 1e-6);
    }
    assert_under(fit.rms_relative, 1e-9);
    assert_int_equal(fit.points, 225); /* strains up to 3 of 4 */
    /* a law with too few terms cannot, and says how far it is off */
    assert_true(material_fit(&test, MATERIAL_NEO_HOOKEAN, 1, 3.0, &fit, error, sizeof error));
    assert_true(fit.rms_relative > 0.02);
    assert_true(fit.most_pa >= fit.rms_pa);
    tensile_test_free(&test);
}

static void too_little_data_is_refused(void **state) {
    (void)state;
    struct tensile_test test = made_of(&yeoh, 2, 2.0);
    struct material_fit fit;
    char error[256] = "";
    assert_false(material_fit(&test, MATERIAL_YEOH, 3, 3.0, &fit, error, sizeof error));
    assert_true(strlen(error) > 10);
    tensile_test_free(&test);
}

static void tensile_files_good_and_bad(void **state) {
    (void)state;
    char path[] = "/tmp/tribend-tensile-XXXXXX", error[256] = "";
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
    const int file = mkstemp(path);
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
        cmocka_unit_test(nominal_stress_in_three_modes),
        cmocka_unit_test(the_printed_coefficients_lose_stability_where_they_should),
        cmocka_unit_test(every_material_file_can_be_read),
        cmocka_unit_test(a_fit_finds_the_law_that_made_the_data),
        cmocka_unit_test(too_little_data_is_refused),
        cmocka_unit_test(tensile_files_good_and_bad),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
