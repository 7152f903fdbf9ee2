/* A controller and its plant on the reference table, stepped a millisecond at a time, for closed-loop tests. Header only:
 * the model's tests do not link the plant. */
#ifndef TRIBEND_RIG_H
#define TRIBEND_RIG_H

#include "link/sim_link.h"
#include "program/table_file.h"

#define RIG_TABLE "tables/paper-semicircle.tbt"
#define RIG_REPEAT_US 100000

struct rig {
    struct sim_link sim;
    struct link link;
    struct link_report report;
    struct controller_command command; /* repeated every RIG_REPEAT_US */
    bool silent;                       /* the host sends no more */
};

static struct table_file rig_file; /* the reference table, between the group's set-up and tear-down */

static inline int rig_open(void **state) {
    (void)state;
    return table_file_open(&rig_file, RIG_TABLE, NULL);
}

static inline int rig_close(void **state) {
    (void)state;
    table_file_close(&rig_file);
    return 0;
}

/* Up to SAFE. */
static inline void rig_start(struct rig *rig, const struct bend_table *table, uint64_t seed) {
    memset(rig, 0, sizeof *rig);
    sim_link_open(&rig->sim, table, seed, &rig->link);
    do {
        assert_true(rig->link.receive(rig->link.context, &rig->report));
        assert_true(rig->report.time_us < 1000000);
    } while (rig->report.status.state != SUPERVISOR_SAFE);
}

static inline void rig_step(struct rig *rig) {
    if (!rig->silent && rig->command.kind != COMMAND_NONE && rig->sim.sim.time_us % RIG_REPEAT_US == 0) {
        assert_true(rig->link.send(rig->link.context, &rig->command));
    }
    assert_true(rig->link.receive(rig->link.context, &rig->report));
}

static inline void rig_command(struct rig *rig, const struct controller_command *command) {
    rig->command = *command;
    assert_true(rig->link.send(rig->link.context, command));
}

static inline void rig_run(struct rig *rig, int milliseconds) {
    for (int i = 0; i < milliseconds; i++) {
        rig_step(rig);
    }
}

static inline struct controller_command rig_bend(double bend_deg, double direction_deg) {
    return (struct controller_command){.kind = COMMAND_BEND,
                                       .bend_rad = (float)(bend_deg * M_PI / 180.0),
                                       .direction_rad = (float)(direction_deg * M_PI / 180.0)};
}

static inline struct controller_command rig_pressure(double p1_pa, double p2_pa, double p3_pa) {
    return (struct controller_command){.kind = COMMAND_PRESSURE,
                                       .pressure_pa = {(float)p1_pa, (float)p2_pa, (float)p3_pa}};
}

/* Any valve of the plant that still lets air in. */
static inline bool rig_fills(const struct rig *rig) {
    const struct sim *sim = &rig->sim.sim;
    return valve_fills(&sim->plant.valve[0], sim->time_us) || valve_fills(&sim->plant.valve[1], sim->time_us) ||
           valve_fills(&sim->plant.valve[2], sim->time_us);
}

#endif
