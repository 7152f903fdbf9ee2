#include "description/calibration_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "description/yaml_file.h"

#define TEXT_MOST 255
#define LOGS_MOST 256
#define PARAMETERS_MOST 8
#define WHOLE_MOST 1000

#define OPTIONAL_POINTER (CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL)

static const cyaml_schema_value_t text_value = {CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char, 0, 4095)};
/* `within`: the struct that holds the value, `member`: where in it. */
#define VALUE_FIELDS(within, member)                                                                                   \
    CYAML_FIELD_STRING_PTR("value", CYAML_FLAG_POINTER, within, member value_text, 0, TEXT_MOST),                     \
        CYAML_FIELD_STRING_PTR("low", OPTIONAL_POINTER, within, member low_text, 0, TEXT_MOST),                       \
        CYAML_FIELD_STRING_PTR("high", OPTIONAL_POINTER, within, member high_text, 0, TEXT_MOST),                     \
        CYAML_FIELD_STRING_PTR("unit", OPTIONAL_POINTER, within, member unit, 0, TEXT_MOST)

static const cyaml_schema_field_t value_fields[] = {VALUE_FIELDS(struct calibration_value, ), CYAML_FIELD_END};
static const cyaml_schema_field_t parameter_fields[] = {
    CYAML_FIELD_STRING_PTR("name", CYAML_FLAG_POINTER, struct calibration_parameter_entry, name, 1, TEXT_MOST),
    VALUE_FIELDS(struct calibration_parameter_entry, number.), CYAML_FIELD_END};
static const cyaml_schema_value_t parameter_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct calibration_parameter_entry, parameter_fields)};
static const cyaml_schema_field_t effect_fields[] = {
    CYAML_FIELD_STRING_PTR("name", CYAML_FLAG_POINTER, struct calibration_effect_entry, name, 1, TEXT_MOST),
    CYAML_FIELD_STRING_PTR("form", OPTIONAL_POINTER, struct calibration_effect_entry, form_text, 0, TEXT_MOST),
    CYAML_FIELD_STRING_PTR("chamber", OPTIONAL_POINTER, struct calibration_effect_entry, chamber_text, 0, TEXT_MOST),
    CYAML_FIELD_STRING_PTR("onset_s", OPTIONAL_POINTER, struct calibration_effect_entry, onset_text, 0, TEXT_MOST),
    CYAML_FIELD_STRING_PTR("latent", OPTIONAL_POINTER, struct calibration_effect_entry, latent_text, 0, TEXT_MOST),
    CYAML_FIELD_SEQUENCE("parameters", CYAML_FLAG_POINTER, struct calibration_effect_entry, parameters,
                         &parameter_schema, 0, PARAMETERS_MOST),
    CYAML_FIELD_END};
static const cyaml_schema_value_t effect_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct calibration_effect_entry, effect_fields)};
static const cyaml_schema_field_t file_fields[] = {
    CYAML_FIELD_STRING_PTR("module", CYAML_FLAG_POINTER, struct calibration_file, module, 0, TEXT_MOST),
    CYAML_FIELD_STRING_PTR("verdict", OPTIONAL_POINTER, struct calibration_file, verdict, 0, TEXT_MOST),
    CYAML_FIELD_SEQUENCE("logs", OPTIONAL_POINTER, struct calibration_file, logs, &text_value, 0, LOGS_MOST),
    CYAML_FIELD_MAPPING("stiffness_scale", CYAML_FLAG_DEFAULT, struct calibration_file, stiffness_scale, value_fields),
    CYAML_FIELD_MAPPING("supply_scale", CYAML_FLAG_DEFAULT, struct calibration_file, supply_scale, value_fields),
    CYAML_FIELD_SEQUENCE("effects", CYAML_FLAG_POINTER, struct calibration_file, effects, &effect_schema, 0,
                         CALIBRATION_EFFECTS_MAX),
    CYAML_FIELD_END};
static const cyaml_schema_value_t schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct calibration_file, file_fields)};

/* How much stiffer or softer than its model a module, and how much higher or lower than planned a supply, may be. */
#define STIFFNESS_LEAST 0.2
#define STIFFNESS_MOST 5.0
#define SUPPLY_LEAST 0.2
#define SUPPLY_MOST 5.0

struct reading {
    const char *path;
    struct description_error *error;
};

static bool reject(const struct reading *reading, int line, const char *key, const char *text, const char *wanted) {
    (void)snprintf(reading->error->text, sizeof reading->error->text, "%s:%d: %s: '%.40s' is no %s", reading->path, line, key,
                   text, wanted);
    return false;
}

/* NULL leaves the number as it is. */
static bool read_number(const struct reading *reading, int line, const char *key, const char *text, double *number) {
    char *end = NULL;
    if (text == NULL) {
        return true;
    }
    *number = strtod(text, &end);
    return (end != text && *end == '\0' && isfinite(*number)) ||
           reject(reading, line, key, text, "finite number (in SI units, without its unit)");
}

static bool read_whole(const struct reading *reading, int line, const char *key, const char *text, int *number) {
    char *end = NULL;
    if (text == NULL) {
        return true;
    }
    const long value = strtol(text, &end, 10);
    *number = (int)value;
    return (end != text && *end == '\0' && value >= 0 && value <= WHOLE_MOST) ||
           reject(reading, line, key, text, "whole number from 0 on");
}

static bool read_value(const struct reading *reading, int line, struct calibration_value *value) {
    double unused;
    return read_number(reading, line, "value", value->value_text, &value->value) &&
           read_number(reading, line, "low", value->low_text, &unused) &&
           read_number(reading, line, "high", value->high_text, &unused);
}

/* `names`: how many names start lines before this effect's. */
static bool read_effect(const struct reading *reading, struct calibration_effect_entry *effect, int *names) {
    effect->line = yaml_file_line(reading->path, "name", ++*names);
    bool sound = read_whole(reading, effect->line, "form", effect->form_text, &effect->form) &&
                 read_whole(reading, effect->line, "chamber", effect->chamber_text, &effect->chamber) &&
                 read_number(reading, effect->line, "onset_s", effect->onset_text, &effect->onset_s) &&
                 read_whole(reading, effect->line, "latent", effect->latent_text, &effect->latent);
    for (unsigned i = 0; i < effect->parameters_count && sound; i++) {
        struct calibration_parameter_entry *parameter = &effect->parameters[i];
        parameter->line = yaml_file_line(reading->path, "name", ++*names);
        sound = read_value(reading, parameter->line, &parameter->number);
    }
    return sound;
}

static bool read_scale(const struct reading *reading, const char *key, struct calibration_value *scale, double least,
                       double most) {
    if (!read_value(reading, yaml_file_line(reading->path, key, 1), scale)) {
        return false;
    }
    if (scale->unit != NULL && strcmp(scale->unit, "1") != 0) {
        return yaml_file_reject(reading->error, reading->path, key, 1, "is a ratio, of unit \"1\", not \"%s\"", scale->unit);
    }
    return (scale->value >= least && scale->value <= most) ||
           yaml_file_reject(reading->error, reading->path, key, 1, "value %g is not between %g and %g", scale->value, least,
                            most);
}

static bool check_module(const struct reading *reading, const char *found, const char *wanted) {
    if (found[0] == '\0') {
        return yaml_file_reject(reading->error, reading->path, "module", 1,
                                "names no module: write the one that was measured, such as %s", wanted);
    }
    return strcmp(found, wanted) == 0 ||
           yaml_file_reject(reading->error, reading->path, "module", 1,
                            "this is a calibration of %s, not of %s: give the table of the module that was measured", found,
                            wanted);
}

static bool read_texts(const struct reading *reading, const char *module, struct calibration_file *file) {
    int names = 0;
    bool sound =
        check_module(reading, file->module, module) &&
        read_scale(reading, "stiffness_scale", &file->stiffness_scale, STIFFNESS_LEAST, STIFFNESS_MOST) &&
        read_scale(reading, "supply_scale", &file->supply_scale, SUPPLY_LEAST, SUPPLY_MOST);
    for (unsigned e = 0; e < file->effects_count && sound; e++) {
        sound = read_effect(reading, &file->effects[e], &names);
    }
    return sound;
}

struct calibration_file *calibration_file_read(const char *path, const char *module, struct description_error *error) {
    struct calibration_file *file = NULL;
    if (!yaml_file_load(path, &schema, (void **)&file, error)) {
        return NULL;
    }
    const struct reading reading = {path, error};
    if (!read_texts(&reading, module, file)) {
        calibration_file_free(file);
        return NULL;
    }
    return file;
}

void calibration_file_free(struct calibration_file *file) {
    (void)cyaml_free(&yaml_config, &schema, file, 0);
}

static void stiffen(struct material *material, double scale) {
    for (size_t i = 0; i < material->terms; i++) {
        material->coefficient_pa[i] *= scale;
    }
    material->bulk_modulus_pa *= scale;
}

void module_description_stiffen(struct module_description *module, double scale) {
    const double limits = fmin(scale, 1.0);
    stiffen(&module->material, scale);
    for (size_t l = 0; l < module->layer_count; l++) {
        stiffen(&module->layer[l].material, scale);
        stiffen(&module->layer[l].corrugation, scale);
    }
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            module->chamber[c].cavity[k].hoop_stiffness_npm *= scale;
        }
    }
    module->working_pressure_pa *= limits;
    module->burst_pressure_pa *= limits;
}
