/* A calibration as its YAML file writes it: how a real module differs from its model (docs/calibration.md has the keys).
 * Read against a schema; what the schema cannot know (which effects there are, and between which bounds) is not checked
 * here. SI units. */
#ifndef TRIBEND_CALIBRATION_FILE_H
#define TRIBEND_CALIBRATION_FILE_H

#include "description/module_description.h"

#define CALIBRATION_EFFECTS_MAX 8

/* Texts are as they stand in the file, NULL where an optional one is not given; the numbers beside them are what they say.
 * (libcyaml would take 800mbar for 800.) */
struct calibration_value {
    char *value_text;
    char *low_text;
    char *high_text;
    char *unit;
    double value;
};

struct calibration_parameter_entry {
    char *name;
    struct calibration_value number; /* its keys stand beside the name */
    int line;
};

struct calibration_effect_entry {
    char *name;
    char *form_text;
    char *chamber_text;
    char *onset_text;
    char *latent_text;
    struct calibration_parameter_entry *parameters;
    unsigned parameters_count;
    int line;
    int form;
    int chamber;
    double onset_s;
    int latent;
};

struct calibration_file {
    char *module;
    char *verdict; /* NULL: not given */
    char **logs;
    unsigned logs_count;
    struct calibration_value stiffness_scale;
    struct calibration_value supply_scale;
    struct calibration_effect_entry *effects;
    unsigned effects_count;
};

/* Read `path`, a calibration of `module`. NULL: `error` names file, line and key. */
struct calibration_file *calibration_file_read(const char *path, const char *module, struct description_error *error);
void calibration_file_free(struct calibration_file *file);
/* Every stiffness of the module (rubbers, folds, fibres) times `scale`, so that each of its states comes at `scale` times
 * the pressure. Its limits come down with it and never go up: they are promises to people. */
void module_description_stiffen(struct module_description *module, double scale);

#endif
