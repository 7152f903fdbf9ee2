/* tables/materials/NAME.yaml -> struct material. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "description/yaml_file.h"

struct material_yaml {
    char *name;
    int law;
    double *coefficients_pa;
    unsigned coefficients_pa_count;
    double *exponents;
    unsigned exponents_count;
    double density_kgpm3;
    double bulk_modulus_pa;
    double strain_min;
    double strain_max;
    char *source;
};

static const cyaml_strval_t laws[] = {
    {"neo-hookean", MATERIAL_NEO_HOOKEAN},
    {"reduced-polynomial", MATERIAL_REDUCED_POLYNOMIAL},
    {"yeoh", MATERIAL_YEOH},
    {"ogden", MATERIAL_OGDEN},
};
static const cyaml_schema_value_t coefficient = {CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_field_t fields[] = {
    CYAML_FIELD_STRING_PTR("name", CYAML_FLAG_POINTER, struct material_yaml, name, 1, MATERIAL_NAME_BYTES - 1),
    CYAML_FIELD_ENUM("law", CYAML_FLAG_STRICT, struct material_yaml, law, laws, 4),
    CYAML_FIELD_SEQUENCE("coefficients_pa", CYAML_FLAG_POINTER, struct material_yaml, coefficients_pa, &coefficient, 1,
                         MATERIAL_TERMS_MAX),
    CYAML_FIELD_SEQUENCE("exponents", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL, struct material_yaml, exponents,
                         &coefficient, 0, MATERIAL_TERMS_MAX),
    CYAML_FIELD_FLOAT("density_kgpm3", CYAML_FLAG_DEFAULT, struct material_yaml, density_kgpm3),
    CYAML_FIELD_FLOAT("bulk_modulus_pa", CYAML_FLAG_DEFAULT, struct material_yaml, bulk_modulus_pa),
    CYAML_FIELD_FLOAT("strain_min", CYAML_FLAG_DEFAULT, struct material_yaml, strain_min),
    CYAML_FIELD_FLOAT("strain_max", CYAML_FLAG_DEFAULT, struct material_yaml, strain_max),
    CYAML_FIELD_STRING_PTR("source", CYAML_FLAG_POINTER, struct material_yaml, source, 1, 511),
    CYAML_FIELD_END};
static const cyaml_schema_value_t schema = {CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct material_yaml, fields)};

static double shear_modulus_pa(const struct material_yaml *yaml) {
    double sum = 0.0;
    for (unsigned i = 0; i < yaml->coefficients_pa_count; i++) {
        sum += yaml->coefficients_pa[i];
    }
    return yaml->law == MATERIAL_OGDEN ? sum : 2.0 * yaml->coefficients_pa[0];
}

static bool check_exponents(const char *path, const struct material_yaml *yaml, struct description_error *error) {
    const unsigned wanted = yaml->law == MATERIAL_OGDEN ? yaml->coefficients_pa_count : 0;
    if (yaml->exponents_count != wanted) {
        return yaml_file_reject(error, path, yaml->exponents_count > 0 ? "exponents" : "law", 1,
                                wanted == 0 ? "only ogden takes exponents: remove these %u"
                                            : "ogden takes one exponent for each coefficient (exponents: [..]), not %u",
                                yaml->exponents_count);
    }
    for (unsigned i = 0; i < wanted; i++) {
        if (!isfinite(yaml->exponents[i]) || yaml->exponents[i] == 0.0) {
            return yaml_file_reject(error, path, "exponents", 1, "exponent %u must be a finite number other than zero",
                                    i + 1);
        }
    }
    return true;
}

static bool check(const char *path, const struct material_yaml *yaml, struct description_error *error) {
    const unsigned count = yaml->coefficients_pa_count;
    if (yaml->law == MATERIAL_NEO_HOOKEAN && count != 1) {
        return yaml_file_reject(error, path, "coefficients_pa", 1, "neo-hookean takes one coefficient, not %u", count);
    }
    if (yaml->law == MATERIAL_YEOH && count != 3) {
        return yaml_file_reject(error, path, "coefficients_pa", 1, "yeoh takes three coefficients, not %u", count);
    }
    for (unsigned i = 0; i < count; i++) {
        if (!isfinite(yaml->coefficients_pa[i])) {
            return yaml_file_reject(error, path, "coefficients_pa", 1, "coefficient %u is not a finite number", i + 1);
        }
    }
    if (!check_exponents(path, yaml, error)) {
        return false;
    }
    const double modulus_pa = shear_modulus_pa(yaml);
    if (!(modulus_pa > 0.0)) {
        return yaml_file_reject(error, path, "coefficients_pa", 1,
                                "the initial shear modulus (%s) must be above zero, not %g Pa",
                                yaml->law == MATERIAL_OGDEN ? "the sum of the coefficients" : "twice the first coefficient",
                                modulus_pa);
    }
    if (!(yaml->bulk_modulus_pa > 50.0 * modulus_pa) || !isfinite(yaml->bulk_modulus_pa)) {
        return yaml_file_reject(error, path, "bulk_modulus_pa", 1,
                                "%g Pa is not that of a rubber; give over 50 times the shear modulus of %g Pa",
                                yaml->bulk_modulus_pa, modulus_pa);
    }
    if (!(yaml->density_kgpm3 > 0.0) || !isfinite(yaml->density_kgpm3)) {
        return yaml_file_reject(error, path, "density_kgpm3", 1, "must be above zero, not %g", yaml->density_kgpm3);
    }
    if (!(yaml->strain_max > yaml->strain_min) || !(yaml->strain_min > -1.0) || !isfinite(yaml->strain_max)) {
        return yaml_file_reject(error, path, "strain_max", 1,
                                "the strain range %g to %g is empty; give engineering strains (3 = 300 %%)",
                                yaml->strain_min, yaml->strain_max);
    }
    return true;
}

bool material_read(const char *path, struct material *material, struct description_error *error) {
    struct material_yaml *yaml = NULL;
    if (!yaml_file_load(path, &schema, (void **)&yaml, error)) {
        return false;
    }
    const bool sound = check(path, yaml, error);
    if (sound) {
        memset(material, 0, sizeof *material);
        (void)snprintf(material->name, sizeof material->name, "%s", yaml->name);
        (void)snprintf(material->source, sizeof material->source, "%s", yaml->source);
        material->law = (enum material_law)yaml->law;
        material->terms = yaml->coefficients_pa_count;
        memcpy(material->coefficient_pa, yaml->coefficients_pa, material->terms * sizeof(double));
        if (material->law == MATERIAL_OGDEN) {
            memcpy(material->exponent, yaml->exponents, material->terms * sizeof(double));
        }
        material->bulk_modulus_pa = yaml->bulk_modulus_pa;
        material->density_kgpm3 = yaml->density_kgpm3;
        material->strain_min = yaml->strain_min;
        material->strain_max = yaml->strain_max;
    }
    cyaml_free(&yaml_config, &schema, yaml, 0);
    return sound;
}
