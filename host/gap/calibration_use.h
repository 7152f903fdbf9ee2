/* What a calibration makes of the simulated module and of the controller.
 *
 * The simulation takes everything. The controller takes what it can know beforehand: its table, its valves, its sensors;
 * for the rest there are notes, for people. docs/calibration.md says which effect is used how. */
#ifndef TRIBEND_GAP_CALIBRATION_USE_H
#define TRIBEND_GAP_CALIBRATION_USE_H

#include "control/controller.h"
#include "gap/calibration.h"
#include "gap/table_scaled.h"
#include "sim/sim_hal.h"

#define CALIBRATION_NOTES_MAX (2 * CALIBRATION_EFFECTS_MAX + 2)
#define CALIBRATION_NOTE_BYTES 320

/* A controller that knows the calibration. */
struct calibrated_controller {
    struct table_scaled table;
    struct controller_parameters parameters;
    size_t notes; /* what it cannot use, and why */
    char note[CALIBRATION_NOTES_MAX][CALIBRATION_NOTE_BYTES];
};

/* Stiffness and supply of the simulated module. */
void calibration_scale_plant(const struct calibration *calibration, struct plant_parameters *plant);
/* Its effects, whose onsets count from `start_s` on. False: there is no room for them. */
bool calibration_add_effects(const struct calibration *calibration, double start_s, struct sim *sim);

/* `nominal` is the module's table without the calibration; it is not needed afterwards. Free with
 * calibrated_controller_free(). False: `error` says why. */
bool calibrated_controller_make(struct calibrated_controller *controller, const struct calibration *calibration,
                                const struct bend_table *nominal, char *error, size_t error_bytes);
void calibrated_controller_free(struct calibrated_controller *controller);
/* Why the controller makes no use of an effect; NULL: it does. An effect that nobody has thought about has a reason too. */
const char *calibration_why_unused(const struct effect_kind *kind);

#endif
