/* tables/modules/NAME.yaml -> struct module_description. */
#include "description/module_description.h"

#include <libgen.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "description/module_check.h"
#include "description/yaml_file.h"

struct cavity_yaml {
    int shape;
    double centre_m[2];
    double radius_m;
    double inner_radius_m;
    double opening_deg;
    double orientation_deg;
    double hoop_stiffness_npm;
};

struct layer_yaml {
    double inner_radius_m;
    double outer_radius_m;
    char *material;
    char *corrugation_material;
    double corrugation_fraction;
};

struct chamber_yaml {
    struct cavity_yaml *cavities;
    unsigned cavities_count;
};

struct caps_yaml {
    double proximal_m;
    double distal_m;
};

struct end_correction_yaml {
    double balloon_ratio;
    double cap_rotation;
};

struct limits_yaml {
    double working_pressure_pa;
    double burst_pressure_pa;
    double bend_deg;
};

struct module_yaml {
    char *name;
    char *source;
    double outer_diameter_m;
    double bore_diameter_m;
    double length_m;
    struct caps_yaml end_caps;
    struct end_correction_yaml end_correction;
    char *material;
    struct chamber_yaml *chambers;
    unsigned chambers_count;
    struct layer_yaml *layers;
    unsigned layers_count;
    struct limits_yaml limits;
};

static const cyaml_strval_t shapes[] = {{"circle", CAVITY_CIRCLE},
                                        {"semicircle", CAVITY_SEMICIRCLE},
                                        {"sector", CAVITY_SECTOR},
                                        {"ring-sector", CAVITY_RING_SECTOR}};
static const cyaml_schema_value_t coordinate = {CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_field_t cavity_fields[] = {
    CYAML_FIELD_ENUM("shape", CYAML_FLAG_STRICT, struct cavity_yaml, shape, shapes, 4),
    CYAML_FIELD_SEQUENCE_FIXED("centre_m", CYAML_FLAG_DEFAULT, struct cavity_yaml, centre_m, &coordinate, 2),
    CYAML_FIELD_FLOAT("radius_m", CYAML_FLAG_DEFAULT, struct cavity_yaml, radius_m),
    CYAML_FIELD_FLOAT("inner_radius_m", CYAML_FLAG_OPTIONAL, struct cavity_yaml, inner_radius_m),
    CYAML_FIELD_FLOAT("opening_deg", CYAML_FLAG_OPTIONAL, struct cavity_yaml, opening_deg),
    CYAML_FIELD_FLOAT("orientation_deg", CYAML_FLAG_OPTIONAL, struct cavity_yaml, orientation_deg),
    CYAML_FIELD_FLOAT("hoop_stiffness_npm", CYAML_FLAG_OPTIONAL, struct cavity_yaml, hoop_stiffness_npm),
    CYAML_FIELD_END};
static const cyaml_schema_value_t cavity_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct cavity_yaml, cavity_fields)};
static const cyaml_schema_field_t chamber_fields[] = {
    CYAML_FIELD_SEQUENCE("cavities", CYAML_FLAG_POINTER, struct chamber_yaml, cavities, &cavity_schema, 1,
                         MODULE_CAVITIES_MAX),
    CYAML_FIELD_END};
static const cyaml_schema_value_t chamber_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct chamber_yaml, chamber_fields)};
static const cyaml_schema_field_t layer_fields[] = {
    CYAML_FIELD_FLOAT("inner_radius_m", CYAML_FLAG_DEFAULT, struct layer_yaml, inner_radius_m),
    CYAML_FIELD_FLOAT("outer_radius_m", CYAML_FLAG_DEFAULT, struct layer_yaml, outer_radius_m),
    CYAML_FIELD_STRING_PTR("material", CYAML_FLAG_POINTER, struct layer_yaml, material, 1, MATERIAL_NAME_BYTES - 1),
    CYAML_FIELD_STRING_PTR("corrugation_material", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL, struct layer_yaml,
                           corrugation_material, 1, MATERIAL_NAME_BYTES - 1),
    CYAML_FIELD_FLOAT("corrugation_fraction", CYAML_FLAG_OPTIONAL, struct layer_yaml, corrugation_fraction),
    CYAML_FIELD_END};
static const cyaml_schema_value_t layer_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct layer_yaml, layer_fields)};
static const cyaml_schema_field_t caps_fields[] = {
    CYAML_FIELD_FLOAT("proximal_m", CYAML_FLAG_DEFAULT, struct caps_yaml, proximal_m),
    CYAML_FIELD_FLOAT("distal_m", CYAML_FLAG_DEFAULT, struct caps_yaml, distal_m), CYAML_FIELD_END};
static const cyaml_schema_field_t correction_fields[] = {
    CYAML_FIELD_FLOAT("balloon_ratio", CYAML_FLAG_DEFAULT, struct end_correction_yaml, balloon_ratio),
    CYAML_FIELD_FLOAT("cap_rotation", CYAML_FLAG_DEFAULT, struct end_correction_yaml, cap_rotation), CYAML_FIELD_END};
static const cyaml_schema_field_t limits_fields[] = {
    CYAML_FIELD_FLOAT("working_pressure_pa", CYAML_FLAG_DEFAULT, struct limits_yaml, working_pressure_pa),
    CYAML_FIELD_FLOAT("burst_pressure_pa", CYAML_FLAG_DEFAULT, struct limits_yaml, burst_pressure_pa),
    CYAML_FIELD_FLOAT("bend_deg", CYAML_FLAG_DEFAULT, struct limits_yaml, bend_deg), CYAML_FIELD_END};
static const cyaml_schema_field_t module_fields[] = {
    CYAML_FIELD_STRING_PTR("name", CYAML_FLAG_POINTER, struct module_yaml, name, 1, MODULE_NAME_BYTES - 1),
    CYAML_FIELD_STRING_PTR("source", CYAML_FLAG_POINTER, struct module_yaml, source, 1, 511),
    CYAML_FIELD_FLOAT("outer_diameter_m", CYAML_FLAG_DEFAULT, struct module_yaml, outer_diameter_m),
    CYAML_FIELD_FLOAT("bore_diameter_m", CYAML_FLAG_OPTIONAL, struct module_yaml, bore_diameter_m),
    CYAML_FIELD_FLOAT("length_m", CYAML_FLAG_DEFAULT, struct module_yaml, length_m),
    CYAML_FIELD_MAPPING("end_caps", CYAML_FLAG_DEFAULT, struct module_yaml, end_caps, caps_fields),
    CYAML_FIELD_MAPPING("end_correction", CYAML_FLAG_OPTIONAL, struct module_yaml, end_correction, correction_fields),
    CYAML_FIELD_STRING_PTR("material", CYAML_FLAG_POINTER, struct module_yaml, material, 1, MATERIAL_NAME_BYTES - 1),
    CYAML_FIELD_SEQUENCE("chambers", CYAML_FLAG_POINTER, struct module_yaml, chambers, &chamber_schema, 1,
                         MODULE_CHAMBERS),
    CYAML_FIELD_SEQUENCE("layers", CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL, struct module_yaml, layers, &layer_schema, 0,
                         MODULE_LAYERS_MAX),
    CYAML_FIELD_MAPPING("limits", CYAML_FLAG_DEFAULT, struct module_yaml, limits, limits_fields),
    CYAML_FIELD_END};
static const cyaml_schema_value_t schema = {CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct module_yaml, module_fields)};

struct positive {
    const char *key;
    double value;
};

static bool check_positive(const char *path, const struct module_yaml *yaml, struct description_error *error) {
    const struct positive values[] = {{"outer_diameter_m", yaml->outer_diameter_m},
                                      {"length_m", yaml->length_m},
                                      {"working_pressure_pa", yaml->limits.working_pressure_pa},
                                      {"burst_pressure_pa", yaml->limits.burst_pressure_pa},
                                      {"bend_deg", yaml->limits.bend_deg}};
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
        if (!(values[i].value > 0.0) || !isfinite(values[i].value)) {
            return yaml_file_reject(error, path, values[i].key, 1, "must be a number above zero, not %g",
                                    values[i].value);
        }
    }
    return true;
}

/* `occurrence`: the how-manieth cavity of the file. */
static bool check_cavity(const char *path, const struct cavity_yaml *cavity, int occurrence,
                         struct description_error *error) {
    const bool sector = cavity->shape == CAVITY_SECTOR, ring = cavity->shape == CAVITY_RING_SECTOR;
    if (!(cavity->radius_m > 0.0) || !isfinite(cavity->radius_m)) {
        return yaml_file_reject(error, path, "radius_m", occurrence,
                                "the radius of a cavity must be above zero, not %g", cavity->radius_m);
    }
    if (!isfinite(cavity->centre_m[0]) || !isfinite(cavity->centre_m[1])) {
        return yaml_file_reject(error, path, "centre_m", occurrence, "must be two finite numbers");
    }
    if ((sector || ring) && !(cavity->opening_deg > 0.0 && cavity->opening_deg < 350.0)) {
        return yaml_file_reject(error, path, "shape", occurrence,
                                "a sector needs opening_deg, its whole angle between 0 and 350, not %g",
                                cavity->opening_deg);
    }
    if (!sector && !ring && cavity->opening_deg != 0.0) {
        return yaml_file_reject(error, path, "shape", occurrence, "only a sector or ring-sector takes opening_deg");
    }
    if (ring && !(cavity->inner_radius_m > 0.0 && cavity->inner_radius_m < cavity->radius_m)) {
        return yaml_file_reject(error, path, "shape", occurrence,
                                "a ring-sector needs inner_radius_m between 0 and radius_m, not %g",
                                cavity->inner_radius_m);
    }
    if (!ring && cavity->inner_radius_m != 0.0) {
        return yaml_file_reject(error, path, "shape", occurrence, "only a ring-sector takes inner_radius_m");
    }
    if (!(cavity->hoop_stiffness_npm >= 0.0) || !isfinite(cavity->hoop_stiffness_npm)) {
        return yaml_file_reject(error, path, "hoop_stiffness_npm", 1, "must be zero or above, not %g",
                                cavity->hoop_stiffness_npm);
    }
    return true;
}

static bool check_cavities(const char *path, const struct module_yaml *yaml, struct description_error *error) {
    int occurrence = 0;
    for (unsigned c = 0; c < yaml->chambers_count; c++) {
        for (unsigned k = 0; k < yaml->chambers[c].cavities_count; k++) {
            if (!check_cavity(path, &yaml->chambers[c].cavities[k], ++occurrence, error)) {
                return false;
            }
        }
    }
    return true;
}

/* Layers: rings inside the module, apart from each other; corrugation complete or absent. */
static bool check_layers(const char *path, const struct module_yaml *yaml, struct description_error *error) {
    const double outer_m = 0.5 * yaml->outer_diameter_m;
    if (!(yaml->bore_diameter_m >= 0.0 && yaml->bore_diameter_m < yaml->outer_diameter_m)) {
        return yaml_file_reject(error, path, "bore_diameter_m", 1, "must be below the outer diameter, not %g",
                                yaml->bore_diameter_m);
    }
    for (unsigned l = 0; l < yaml->layers_count; l++) {
        const struct layer_yaml *layer = &yaml->layers[l];
        if (!(layer->inner_radius_m > 0.5 * yaml->bore_diameter_m && layer->outer_radius_m > layer->inner_radius_m &&
              layer->outer_radius_m <= outer_m + 1e-9)) {
            return yaml_file_reject(error, path, "layers", 1,
                                    "layer %u from %g to %g m is no ring inside the module (radii between bore and %g m)",
                                    l + 1, layer->inner_radius_m, layer->outer_radius_m, outer_m);
        }
        for (unsigned k = 0; k < l; k++) {
            if (layer->inner_radius_m < yaml->layers[k].outer_radius_m - 1e-9 &&
                yaml->layers[k].inner_radius_m < layer->outer_radius_m - 1e-9) {
                return yaml_file_reject(error, path, "layers", 1, "layers %u and %u overlap", k + 1, l + 1);
            }
        }
        const bool corrugated = layer->corrugation_material != NULL;
        if (corrugated != (layer->corrugation_fraction > 0.0) || !(layer->corrugation_fraction < 1.0)) {
            return yaml_file_reject(error, path, "layers", 1,
                                    "layer %u: a corrugated layer needs corrugation_material and a corrugation_fraction "
                                    "between 0 and 1",
                                    l + 1);
        }
    }
    return true;
}

static bool check_relations(const char *path, const struct module_yaml *yaml, struct description_error *error) {
    if (yaml->chambers_count == 2) {
        return yaml_file_reject(error, path, "chambers", 1,
                                "give one chamber (the others are its copies at 120 and 240 degrees) or all three");
    }
    if (yaml->end_caps.proximal_m < 0.0 || yaml->end_caps.distal_m < 0.0 ||
        !(yaml->end_caps.proximal_m + yaml->end_caps.distal_m < yaml->length_m)) {
        return yaml_file_reject(error, path, "end_caps", 1,
                                "caps of %g and %g m leave no chamber in a module of %g m", yaml->end_caps.proximal_m,
                                yaml->end_caps.distal_m, yaml->length_m);
    }
    if (!(yaml->end_correction.balloon_ratio >= 0.0 && yaml->end_correction.balloon_ratio <= 2.0)) {
        return yaml_file_reject(error, path, "balloon_ratio", 1, "must be between 0 and 2, not %g",
                                yaml->end_correction.balloon_ratio);
    }
    if (!(yaml->end_correction.cap_rotation >= 0.0 && yaml->end_correction.cap_rotation <= 1.0)) {
        return yaml_file_reject(error, path, "cap_rotation", 1, "must be between 0 and 1, not %g",
                                yaml->end_correction.cap_rotation);
    }
    if (!(yaml->limits.burst_pressure_pa > yaml->limits.working_pressure_pa)) {
        return yaml_file_reject(error, path, "burst_pressure_pa", 1,
                                "must be above the working pressure of %g Pa, not %g", yaml->limits.working_pressure_pa,
                                yaml->limits.burst_pressure_pa);
    }
    if (!(yaml->limits.bend_deg <= 170.0)) {
        return yaml_file_reject(error, path, "bend_deg", 1, "over 170 degrees the tip meets the base");
    }
    return true;
}

static void take(const struct module_yaml *yaml, struct module_description *module) {
    memset(module, 0, sizeof *module);
    (void)snprintf(module->name, sizeof module->name, "%s", yaml->name);
    module->outer_diameter_m = yaml->outer_diameter_m;
    module->bore_diameter_m = yaml->bore_diameter_m;
    module->length_m = yaml->length_m;
    module->cap_proximal_m = yaml->end_caps.proximal_m;
    module->cap_distal_m = yaml->end_caps.distal_m;
    module->chamber_length_m = yaml->length_m - yaml->end_caps.proximal_m - yaml->end_caps.distal_m;
    module->end_correction =
        (struct end_correction){yaml->end_correction.balloon_ratio, yaml->end_correction.cap_rotation};
    module->working_pressure_pa = yaml->limits.working_pressure_pa;
    module->burst_pressure_pa = yaml->limits.burst_pressure_pa;
    module->bend_limit_rad = yaml->limits.bend_deg * M_PI / 180.0;
    module->three_fold = yaml->chambers_count == 1;
    module->layer_count = yaml->layers_count;
    for (unsigned l = 0; l < yaml->layers_count; l++) {
        module->layer[l].inner_radius_m = yaml->layers[l].inner_radius_m;
        module->layer[l].outer_radius_m = fmin(yaml->layers[l].outer_radius_m, 0.5 * yaml->outer_diameter_m);
        module->layer[l].corrugation_fraction = yaml->layers[l].corrugation_fraction;
    }
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        const struct chamber_yaml *chamber = &yaml->chambers[module->three_fold ? 0 : c];
        module->chamber[c].cavity_count = chamber->cavities_count;
        for (size_t k = 0; k < chamber->cavities_count; k++) {
            const struct cavity_yaml *from = &chamber->cavities[k];
            const struct cavity cavity = {.shape = (enum cavity_shape)from->shape,
                                          .centre_m = {from->centre_m[0], from->centre_m[1]},
                                          .radius_m = from->radius_m,
                                          .inner_radius_m = from->inner_radius_m,
                                          .opening_rad = from->opening_deg * M_PI / 180.0,
                                          .orientation_rad = from->orientation_deg * M_PI / 180.0,
                                          .hoop_stiffness_npm = from->hoop_stiffness_npm};
            cavity_turn(&cavity, module->three_fold ? (double)c * 2.0 * M_PI / 3.0 : 0.0, &module->chamber[c].cavity[k]);
        }
    }
}

static bool check_section(const char *path, const struct module_description *module, struct description_error *error) {
    size_t first = 0, second = 0;
    switch (module_check_section(module, &first, &second)) {
    case MODULE_CAVITY_LEAVES:
        return yaml_file_reject(error, path, "chambers", 1,
                                "a cavity of chamber %zu leaves the module (or a wall under %g mm): move it inwards or "
                                "make it smaller",
                                first + 1, 1e3 * MODULE_WALL_LEAST_M);
    case MODULE_CAVITIES_OVERLAP:
        return yaml_file_reject(error, path, "chambers", 1,
                                "cavities of chambers %zu and %zu overlap (or their wall is under %g mm): move them "
                                "apart or make them smaller",
                                first + 1, second + 1, 1e3 * MODULE_WALL_LEAST_M);
    case MODULE_CENTRE_HOLLOW:
        return yaml_file_reject(error, path, "chambers", 1,
                                "a cavity of chamber %zu covers the section's centre, which must be solid or bored: "
                                "move it outwards, or give bore_diameter_m",
                                first + 1);
    case MODULE_BORE_OPENS:
        return yaml_file_reject(error, path, "chambers", 1,
                                "a cavity of chamber %zu opens into the bore (or their wall is under %g mm): move it "
                                "outwards or make the bore smaller",
                                first + 1, 1e3 * MODULE_WALL_LEAST_M);
    case MODULE_LAYER_CUT:
        return yaml_file_reject(error, path, "layers", 1,
                                "a cavity of chamber %zu cuts the edge of layer %zu (or comes nearer than %g mm)", first + 1,
                                second + 1, 1e3 * MODULE_WALL_LEAST_M);
    default:
        return true;
    }
}

static bool read_material(const char *path, const char *name, struct material *material,
                          struct description_error *error) {
    char copy[PATH_MAX], file[PATH_MAX];
    const size_t length = strlen(name);
    if (strchr(name, '/') != NULL || (length > 5 && strcmp(name + length - 5, ".yaml") == 0)) {
        return material_read(name, material, error);
    }
    (void)snprintf(copy, sizeof copy, "%s", path);
    const int written = snprintf(file, sizeof file, "%s/../materials/%s.yaml", dirname(copy), name);
    if (written < 0 || (size_t)written >= sizeof file) {
        return yaml_file_reject(error, path, "material", 1, "the path to '%s' is too long", name);
    }
    return material_read(file, material, error);
}

static bool read_layer_materials(const char *path, const struct module_yaml *yaml, struct module_description *module,
                                 struct description_error *error) {
    for (unsigned l = 0; l < yaml->layers_count; l++) {
        const struct layer_yaml *layer = &yaml->layers[l];
        if (!read_material(path, layer->material, &module->layer[l].material, error) ||
            (layer->corrugation_material != NULL &&
             !read_material(path, layer->corrugation_material, &module->layer[l].corrugation, error))) {
            return false;
        }
    }
    return true;
}

bool module_description_read(const char *path, const char *material_name, struct module_description *module,
                             struct description_error *error) {
    struct module_yaml *yaml = NULL;
    if (!yaml_file_load(path, &schema, (void **)&yaml, error)) {
        return false;
    }
    bool sound = check_positive(path, yaml, error) && check_cavities(path, yaml, error) &&
                 check_layers(path, yaml, error) && check_relations(path, yaml, error);
    if (sound) {
        take(yaml, module);
        sound = check_section(path, module, error) &&
                read_material(path, material_name != NULL ? material_name : yaml->material, &module->material, error) &&
                read_layer_materials(path, yaml, module, error);
    }
    if (sound) {
        (void)snprintf(module->material_name, sizeof module->material_name, "%s", module->material.name);
    }
    cyaml_free(&yaml_config, &schema, yaml, 0);
    return sound;
}

/* FNV-1a 64 (Fowler, Noll, Vo). */
static unsigned long long hash_byte(unsigned long long hash, unsigned long long byte) {
    return (hash ^ byte) * 1099511628211ULL;
}

static unsigned long long hash_numbers(unsigned long long hash, const double *number, size_t count) {
    for (size_t i = 0; i < count; i++) {
        unsigned long long bits = 0;
        memcpy(&bits, &number[i], sizeof bits);
        for (unsigned shift = 0; shift < 64; shift += 8) {
            hash = hash_byte(hash, bits >> shift & 0xffu);
        }
    }
    return hash;
}

static unsigned long long hash_material(unsigned long long hash, const struct material *material) {
    const double numbers[] = {(double)material->law, (double)material->terms, material->bulk_modulus_pa};
    hash = hash_numbers(hash, numbers, sizeof numbers / sizeof numbers[0]);
    hash = hash_numbers(hash, material->coefficient_pa, MATERIAL_TERMS_MAX);
    return hash_numbers(hash, material->exponent, MATERIAL_TERMS_MAX);
}

unsigned long long module_description_hash(const struct module_description *module) {
    unsigned long long hash = 14695981039346656037ULL;
    for (size_t i = 0; module->name[i] != '\0'; i++) {
        hash = hash_byte(hash, (unsigned char)module->name[i]);
    }
    const double numbers[] = {module->outer_diameter_m,    module->bore_diameter_m,   module->length_m,
                              module->chamber_length_m,    module->end_correction.balloon_ratio, module->end_correction.cap_rotation,  module->cap_proximal_m,
                              module->cap_distal_m,        module->working_pressure_pa, module->burst_pressure_pa,
                              module->bend_limit_rad,      (double)module->layer_count};
    hash = hash_material(hash_numbers(hash, numbers, sizeof numbers / sizeof numbers[0]), &module->material);
    for (size_t l = 0; l < module->layer_count; l++) {
        const struct module_layer *layer = &module->layer[l];
        const double values[] = {layer->inner_radius_m, layer->outer_radius_m, layer->corrugation_fraction};
        hash = hash_material(hash_numbers(hash, values, sizeof values / sizeof values[0]), &layer->material);
        hash = layer->corrugation_fraction > 0.0 ? hash_material(hash, &layer->corrugation) : hash;
    }
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            const struct cavity *cavity = &module->chamber[c].cavity[k];
            const double values[] = {(double)cavity->shape,  cavity->centre_m[0],  cavity->centre_m[1],
                                     cavity->radius_m,       cavity->inner_radius_m, cavity->opening_rad,
                                     cavity->orientation_rad, cavity->hoop_stiffness_npm};
            hash = hash_numbers(hash, values, sizeof values / sizeof values[0]);
        }
    }
    return hash;
}
