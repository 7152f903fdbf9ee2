/* A calibration, read and checked against the catalogue of effects: how a real module differs from its model. What the
 * simulation and the controller make of it: gap/calibration_use.h. */
#ifndef TRIBEND_GAP_CALIBRATION_H
#define TRIBEND_GAP_CALIBRATION_H

#include "description/calibration_file.h"
#include "sim/plant.h"

struct calibration {
    char module[MODULE_NAME_BYTES];
    double stiffness_scale;
    double supply_scale;
    size_t effects;
    struct effect effect[CALIBRATION_EFFECTS_MAX];
};

/* A calibration of `module` (the table's). False: `error` names file, line, key and remedy. */
bool calibration_read(const char *path, const char *module, struct calibration *calibration, char *error,
                      size_t error_bytes);
/* When the last of its effects sets in, s; 0 where all act from the start. */
double calibration_onset_s(const struct calibration *calibration);

#endif
