#include "emulator/can_host.h"

#include <string.h>

#include "emulator/core.h"

static bool node_wants(void *context, struct can_bus_frame *frame) {
    const struct can_host *host = context;
    if (host->waiting_count > 0) {
        *frame = host->waiting[host->first_waiting];
    } else if (host->floods) {
        *frame = host->flood;
    }
    return host->waiting_count > 0 || host->floods;
}

static void node_sent(void *context) {
    struct can_host *host = context;
    if (host->waiting_count > 0) {
        host->first_waiting = (host->first_waiting + 1u) % CAN_HOST_RING;
        host->waiting_count--;
    }
}

static void node_received(void *context, const struct can_bus_frame *frame) {
    struct can_host *host = context;
    if (host->heard_count == CAN_HOST_RING) {
        host->first_heard = (host->first_heard + 1u) % CAN_HOST_RING;
        host->heard_count--;
        host->heard_lost++;
    }
    host->heard[(host->first_heard + host->heard_count++) % CAN_HOST_RING] =
        (struct can_host_heard){.at_us = *host->bus->now_ticks / TICKS_PER_US, .frame = frame->frame};
}

/* Bus-off would be for good: an ideal controller is never driven there. */
static void node_changed(void *context) {
    struct can_host *host = context;
    host->node.transmit_errors = host->node.receive_errors = 0u;
    host->node.bus_off = false;
    host->node.online = true;
}

bool can_host_join(struct can_host *host, struct can_bus *bus) {
    memset(host, 0, sizeof *host);
    host->bus = bus;
    host->node = (struct can_bus_node){.context = host,
                                       .wants = node_wants,
                                       .sent = node_sent,
                                       .received = node_received,
                                       .changed = node_changed,
                                       .bit_ticks = TICKS_PER_SECOND / 1000000,
                                       .data_bit_ticks = TICKS_PER_SECOND / 2000000,
                                       .online = true};
    return can_bus_join(bus, &host->node);
}

bool can_host_send(struct can_host *host, const struct hal_can_frame *frame) {
    if (host->waiting_count == CAN_HOST_RING) {
        host->refused++;
        return false;
    }
    host->waiting[(host->first_waiting + host->waiting_count++) % CAN_HOST_RING] =
        (struct can_bus_frame){.frame = *frame, .rate_switch = frame->fd};
    can_bus_attend(host->bus);
    return true;
}

bool can_host_receive(struct can_host *host, struct can_host_heard *heard) {
    if (host->heard_count == 0) {
        return false;
    }
    *heard = host->heard[host->first_heard];
    host->first_heard = (host->first_heard + 1u) % CAN_HOST_RING;
    host->heard_count--;
    return true;
}

void can_host_flood(struct can_host *host, const struct hal_can_frame *frame) {
    host->floods = frame != NULL;
    if (frame != NULL) {
        host->flood = (struct can_bus_frame){.frame = *frame, .rate_switch = frame->fd};
    }
    can_bus_attend(host->bus);
}
