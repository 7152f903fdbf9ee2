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

/* `table` is kept by pointer. */
void sim_link_open(struct sim_link *link, const struct bend_table *table, uint64_t seed, struct link *interface);

#endif
