/* A CAN bus behind struct hal_bus, in RAM: frames for the node wait in one queue, those that it sent in
 * another. */
#ifndef TRIBEND_SIM_BUS_H
#define TRIBEND_SIM_BUS_H

#include "hal.h"

#define SIM_BUS_FRAMES 4096u

struct sim_bus {
    struct hal_bus hal;
    struct hal_can_state state;
    uint32_t room; /* sends that succeed until it is set again; UINT32_MAX: all */
    struct hal_can_frame in[SIM_BUS_FRAMES];
    uint32_t in_first;
    uint32_t in_end;
    struct hal_can_frame out[SIM_BUS_FRAMES]; /* the newest of all that were sent */
    uint32_t sent;
    uint32_t receives; /* calls */
};

void sim_bus_init(struct sim_bus *bus);
/* One more for the node. */
void sim_bus_put(struct sim_bus *bus, const struct hal_can_frame *frame);
void sim_bus_forget(struct sim_bus *bus);

#endif
