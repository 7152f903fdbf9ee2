/* An ideal CAN controller on the virtual bus, for whoever is not the board: scripts, sockets, other boards'
 * traffic. It sends what it is given in order, keeps what it hears with its time, and never errs. */
#ifndef TRIBEND_EMULATOR_CAN_HOST_H
#define TRIBEND_EMULATOR_CAN_HOST_H

#include "emulator/can_bus.h"

#define CAN_HOST_RING 1024u

struct can_host_heard {
    int64_t at_us;
    struct hal_can_frame frame;
};

struct can_host {
    struct can_bus *bus;
    struct can_bus_node node;
    struct can_bus_frame waiting[CAN_HOST_RING];
    size_t first_waiting, waiting_count;
    struct can_host_heard heard[CAN_HOST_RING];
    size_t first_heard, heard_count;
    bool floods; /* sends `flood` whenever the bus is free */
    struct can_bus_frame flood;
    uint64_t heard_lost, refused; /* nobody took them in time; no room to send */
};

/* 1 Mbit/s, data of FD frames at 2 Mbit/s: what boards come with. False: no room on the bus. */
bool can_host_join(struct can_host *host, struct can_bus *bus);
/* False: no room. */
bool can_host_send(struct can_host *host, const struct hal_can_frame *frame);
/* The oldest frame heard; false: none. */
bool can_host_receive(struct can_host *host, struct can_host_heard *heard);
/* Keep the bus full with this frame; NULL: no more. */
void can_host_flood(struct can_host *host, const struct hal_can_frame *frame);

#endif
