#include "app.h"

#include <stddef.h>

#define TIP_SAMPLES_A_STEP 4u

void app_init(struct app *app, const struct hal *hal, const struct bend_table *table,
              const struct controller_parameters *parameters) {
    controller_init(&app->controller, table, parameters);
    app->hal = hal;
    app->pending = (struct controller_command){.kind = COMMAND_NONE};
    app->hal_errors = 0u;
    app->bus_off = false;
    app->error_passive = false;
    app->outputs_refused = false;
    app->parameters_corrupt = false;
    app->input = (struct controller_input){.time_us = 0};
    app->output = (struct controller_output){.valves_enabled = false};
}

void app_command(struct app *app, const struct controller_command *command) {
    app->pending = *command;
}

/* The newest of the samples that arrived; older ones that came with it say nothing more. */
static void read_tip(struct app *app, struct controller_input *input) {
    const struct hal *hal = app->hal;
    struct hal_tip_sample sample;
    for (uint32_t i = 0; i < TIP_SAMPLES_A_STEP && hal->read_tip(hal->context, &sample); i++) {
        input->tip_new = true;
        input->tip_measured_us = sample.measured_us;
        for (uint32_t k = 0; k < 3u; k++) {
            input->tip_position_m[k] = sample.position_m[k];
        }
        for (uint32_t k = 0; k < 4u; k++) {
            input->tip_quaternion[k] = sample.quaternion[k];
        }
        input->tip_quality = sample.quality;
        input->tip_status = sample.status;
    }
}

static void read_pressures(struct app *app, struct controller_input *input) {
    struct hal_pressures pressures;
    if (!app->hal->read_pressures(app->hal->context, &pressures)) {
        app->hal_errors++;
        return; /* every channel stays not ok: a sensor fault */
    }
    for (uint32_t c = 0; c < 3u; c++) {
        input->pressure_pa[c] = pressures.chamber_pa[c];
        input->pressure_ok[c] = pressures.chamber_ok[c];
    }
    input->supply_pa = pressures.supply_pa;
    input->supply_ok = pressures.supply_ok;
}

bool app_step(struct app *app) {
    struct controller_input *input = &app->input;
    const struct controller_output *output = &app->output;
    struct hal_outputs outputs;
    *input = (struct controller_input){.time_us = app->hal->time_us(app->hal->context),
                                       .bus_off = app->bus_off,
                                       .error_passive = app->error_passive,
                                       .outputs_refused = app->outputs_refused,
                                       .parameters_corrupt = app->parameters_corrupt,
                                       .command = app->pending};
    app->pending.kind = COMMAND_NONE;
    read_pressures(app, input);
    read_tip(app, input);
    if (app->hal->read_health != NULL) {
        app->hal->read_health(app->hal->context, &input->health);
    }
    controller_step(&app->controller, input, &app->output);
    for (uint32_t c = 0; c < 3u; c++) {
        outputs.duty[c] = output->duty[c];
    }
    outputs.valves_enabled = output->valves_enabled;
    outputs.supply_enabled = output->supply_enabled;
    app->outputs_refused = !app->hal->write_outputs(app->hal->context, &outputs);
    app->hal_errors += app->outputs_refused ? 1u : 0u;
    return app->controller.status.state != SUPERVISOR_FAULT;
}
