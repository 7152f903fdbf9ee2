/* The schedule: binds the controller to a hal. One app_step() every CONTROLLER_STEP_US. */
#ifndef TRIBEND_APP_H
#define TRIBEND_APP_H

#include "control/controller.h"
#include "hal.h"

struct app {
    struct controller controller;
    const struct hal *hal;
    struct controller_command pending; /* set by app_command, consumed by the next step */
    uint32_t hal_errors;               /* reads or writes that the hal refused */
    bool bus_off;                      /* of the bus that commands come over; set by the node before each step */
    bool error_passive;
    bool outputs_refused;          /* by the last step's write */
    bool parameters_corrupt;       /* the stored ones failed their check; set by who reads them */
    struct controller_input input; /* of the last step, for reports */
    struct controller_output output;
};

void app_init(struct app *app, const struct hal *hal, const struct bend_table *table,
              const struct controller_parameters *parameters);
/* Hand over a command; the next step takes it. A later one replaces it. */
void app_command(struct app *app, const struct controller_command *command);
/* Read, step, write. False: a fault is latched. */
bool app_step(struct app *app);

#endif
