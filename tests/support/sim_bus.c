#include "support/sim_bus.h"

#include <string.h>

static bool receive(void *context, struct hal_can_frame *frame) {
    struct sim_bus *bus = context;
    bus->receives++;
    if (bus->in_first == bus->in_end) {
        return false;
    }
    *frame = bus->in[bus->in_first++ % SIM_BUS_FRAMES];
    return true;
}

static bool send(void *context, const struct hal_can_frame *frame) {
    struct sim_bus *bus = context;
    if (bus->room == 0u) {
        bus->state.transmit_lost++;
        return false;
    }
    bus->room -= bus->room != UINT32_MAX ? 1u : 0u;
    bus->out[bus->sent++ % SIM_BUS_FRAMES] = *frame;
    return true;
}

static void state(void *context, struct hal_can_state *state) {
    *state = ((const struct sim_bus *)context)->state;
}

void sim_bus_init(struct sim_bus *bus) {
    memset(bus, 0, sizeof *bus);
    bus->room = UINT32_MAX;
    bus->hal = (struct hal_bus){.context = bus, .receive = receive, .send = send, .state = state};
}

void sim_bus_put(struct sim_bus *bus, const struct hal_can_frame *frame) {
    bus->in[bus->in_end++ % SIM_BUS_FRAMES] = *frame;
}

void sim_bus_forget(struct sim_bus *bus) {
    bus->sent = 0u;
}
