/* Controller and plant in this process: each receive() is one control step of both. */
#ifndef TRIBEND_SIM_LINK_H
#define TRIBEND_SIM_LINK_H

#include "app.h"
#include "link/link.h"
#include "sim/sim_hal.h"

struct sim_link {
    struct app app;
    struct sim sim;
    struct hal plant;  /* the plant's own HAL */
    struct hal tapped; /* what the app sees: the same, noting what went through */
    struct link_report report;
};

/* Both tables are kept by pointer. Where they differ, the controller does not know the module as it is, or knows it
 * better than the module's table does. */
struct sim_link_setup {
    const struct bend_table *module_table;
    const struct bend_table *controller_table;
    struct sim_parameters sim;
    struct controller_parameters controller;
    uint64_t seed;
};

/* The nominal module and a controller that takes it for that. */
void sim_link_default_setup(struct sim_link_setup *setup, const struct bend_table *table, uint64_t seed);
void sim_link_open_setup(struct sim_link *link, const struct sim_link_setup *setup, struct link *interface);
/* With the default setup. */
void sim_link_open(struct sim_link *link, const struct bend_table *table, uint64_t seed, struct link *interface);

#endif
