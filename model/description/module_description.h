/* A module as its YAML file describes it, checked: geometry, chambers, material name and limits. SI units.
 * Base frame: x through chamber 1, chambers 2 and 3 at 120 and 240 degrees counter-clockwise seen from the tip. */
#ifndef TRIBEND_MODULE_DESCRIPTION_H
#define TRIBEND_MODULE_DESCRIPTION_H

#include <stdbool.h>
#include <stddef.h>

#include "material/material.h"

#define MODULE_NAME_BYTES 32
#define MODULE_CHAMBERS 3
#define MODULE_CAVITIES_MAX 4

enum cavity_shape { CAVITY_CIRCLE, CAVITY_SEMICIRCLE };

struct cavity {
    enum cavity_shape shape;
    double centre_m[2];     /* of the circle, or of the middle of the semicircle's flat side */
    double radius_m;
    double orientation_rad; /* semicircle: where its round side points */
};

struct chamber {
    size_t cavity_count;
    struct cavity cavity[MODULE_CAVITIES_MAX];
};

struct module_description {
    char name[MODULE_NAME_BYTES];
    double outer_diameter_m;
    double length_m;
    double chamber_length_m;
    double end_correction_m; /* added to the chamber length: bend = curvature * (chamber length + correction) */
    double cap_proximal_m;
    double cap_distal_m;
    char material_name[MATERIAL_NAME_BYTES];
    struct material material;
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
