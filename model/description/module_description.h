/* A module as its YAML file describes it, checked: geometry, chambers, material name and limits. SI units.
 * Base frame: x through chamber 1, chambers 2 and 3 at 120 and 240 degrees counter-clockwise seen from the tip. */
#ifndef TRIBEND_MODULE_DESCRIPTION_H
#define TRIBEND_MODULE_DESCRIPTION_H

#include <stdbool.h>
#include <stddef.h>

#include "description/cavity.h"
#include "material/material.h"

#define MODULE_NAME_BYTES 32
#define MODULE_CHAMBERS 3
#define MODULE_CAVITIES_MAX 4
#define MODULE_LAYERS_MAX 4

struct chamber {
    size_t cavity_count;
    struct cavity cavity[MODULE_CAVITIES_MAX];
};

/* A ring of the section in a material of its own. Corrugated (an accordion of a stiffer rubber, its folds filled with
 * the ring's material): the folds open along the axis and carry hoop stretch only, so they count as fibres round the
 * axis with the uniaxial stress of `corrugation`, over `corrugation_fraction` of the ring's volume. */
struct module_layer {
    double inner_radius_m;
    double outer_radius_m;
    struct material material;
    double corrugation_fraction; /* 0: not corrugated */
    struct material corrugation;
};

/* Without dimension; see section/section_bend.h. */
struct end_correction {
    double balloon_ratio;
    double cap_rotation;
};

struct module_description {
    char name[MODULE_NAME_BYTES];
    double outer_diameter_m;
    double bore_diameter_m; /* 0: solid */
    double length_m;
    double chamber_length_m;
    struct end_correction end_correction;
    double cap_proximal_m;
    double cap_distal_m;
    char material_name[MATERIAL_NAME_BYTES];
    struct material material;
    size_t layer_count;
    struct module_layer layer[MODULE_LAYERS_MAX];
    bool three_fold; /* chambers 2 and 3 are chamber 1 turned: the table needs one sixth */
    struct chamber chamber[MODULE_CHAMBERS];
    double working_pressure_pa;
    double burst_pressure_pa;
    double bend_limit_rad;
};

#define DESCRIPTION_ERROR_BYTES 512
/* Message for people: file, line, key, what is wrong and the remedy. */
struct description_error {
    char text[DESCRIPTION_ERROR_BYTES];
};

/* Read and check `path`; the material is looked up as DIR/../materials/NAME.yaml beside the module file unless
 * `material_name` (may be NULL) names another one (a name, or a path ending in .yaml). False: `error` says why. */
bool module_description_read(const char *path, const char *material_name, struct module_description *module,
                             struct description_error *error);
bool material_read(const char *path, struct material *material, struct description_error *error);
/* FNV-1a 64 of every number and name that the solver's answer depends on. */
unsigned long long module_description_hash(const struct module_description *module);

#endif
