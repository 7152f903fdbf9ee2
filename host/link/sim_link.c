#include "link/sim_link.h"

#include <string.h>

static int64_t tap_time_us(void *context) {
    struct sim_link *link = context;
    return link->plant.time_us(link->plant.context);
}

static bool tap_read_pressures(void *context, struct hal_pressures *pressures) {
    struct sim_link *link = context;
    const bool read = link->plant.read_pressures(link->plant.context, pressures);
    for (size_t c = 0; c < 3 && read; c++) {
        link->report.pressure_pa[c] = pressures->chamber_pa[c];
    }
    link->report.supply_pa = read ? pressures->supply_pa : link->report.supply_pa;
    return read;
}

static bool tap_read_tip(void *context, struct hal_tip_sample *sample) {
    struct sim_link *link = context;
    if (!link->plant.read_tip(link->plant.context, sample)) {
        return false;
    }
    link->report.tip_new = true;
    link->report.tip_measured_us = sample->measured_us;
    memcpy(link->report.tip_position_m, sample->position_m, sizeof sample->position_m);
    memcpy(link->report.tip_quaternion, sample->quaternion, sizeof sample->quaternion);
    link->report.tip_quality = sample->quality;
    link->report.tip_status = sample->status;
    return true;
}

static bool tap_write_outputs(void *context, const struct hal_outputs *outputs) {
    struct sim_link *link = context;
    memcpy(link->report.duty, outputs->duty, sizeof outputs->duty);
    return link->plant.write_outputs(link->plant.context, outputs);
}

static void tap_read_health(void *context, struct hal_health *health) {
    struct sim_link *link = context;
    link->plant.read_health(link->plant.context, health);
}

static bool sim_link_send(void *context, const struct controller_command *command) {
    struct sim_link *link = context;
    app_command(&link->app, command);
    return true;
}

static bool sim_link_receive(void *context, struct link_report *report) {
    struct sim_link *link = context;
    link->report.tip_new = false;
    link->report.time_us = link->sim.time_us;
    (void)app_step(&link->app); /* a latched fault shows in the status */
    link->report.status = link->app.controller.status;
    *report = link->report;
    sim_advance(&link->sim, CONTROLLER_STEP_US);
    return true;
}

static void sim_link_close(void *context) {
    (void)context; /* nothing is held */
}

void sim_link_default_setup(struct sim_link_setup *setup, const struct bend_table *table, uint64_t seed) {
    memset(setup, 0, sizeof *setup);
    setup->module_table = table;
    setup->controller_table = table;
    setup->seed = seed;
    sim_default_parameters(&setup->sim);
    controller_default_parameters(&setup->controller, table);
}

void sim_link_open_setup(struct sim_link *link, const struct sim_link_setup *setup, struct link *interface) {
    memset(link, 0, sizeof *link);
    sim_init(&link->sim, setup->module_table, &setup->sim, setup->seed);
    sim_bind(&link->sim, &link->plant);
    link->tapped = (struct hal){.context = link,
                                .time_us = tap_time_us,
                                .read_pressures = tap_read_pressures,
                                .read_tip = tap_read_tip,
                                .write_outputs = tap_write_outputs,
                                .read_health = tap_read_health};
    app_init(&link->app, &link->tapped, setup->controller_table, &setup->controller);
    *interface = (struct link){
        .context = link, .send = sim_link_send, .receive = sim_link_receive, .close = sim_link_close};
}

void sim_link_open(struct sim_link *link, const struct bend_table *table, uint64_t seed, struct link *interface) {
    struct sim_link_setup setup;
    sim_link_default_setup(&setup, table, seed);
    sim_link_open_setup(link, &setup, interface);
}
