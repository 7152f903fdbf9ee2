/* One number from a run: by which factor the rubber of a real module is stiffer than its material says. The equilibrium
 * depends on pressure over stiffness alone (where fibres stiffen with the rubber or do not stretch), so one path of the
 * section serves every factor. SI units. */
#ifndef TRIBEND_STIFFNESS_FIT_H
#define TRIBEND_STIFFNESS_FIT_H

#include "calibration/plateau.h"
#include "description/module_description.h"

struct stiffness_fit {
    double factor;
    size_t fitted;
    size_t held_out;
    double rms_fitted_rad;
    double rms_held_out_rad;
    double rms_line_rad;        /* of the held-out plateaus, by bend = a + b p fitted to the same others */
    double rms_proportion_rad;  /* the same with bend = b p */
    double model_rad[PLATEAUS_MAX]; /* of every plateau, fitted or not */
    bool used[PLATEAUS_MAX];        /* fitted */
};

/* Fits to every second plateau, the first included, and judges on the others. Plateaus must load one chamber: `error`
 * names one that does not. */
bool stiffness_fit(const struct module_description *module, const struct plateau *plateaus, size_t count,
                   struct stiffness_fit *fit, struct description_error *error);

#endif
