/* A CAN bus in virtual time, frame by frame: arbitration, bit times of classic and FD frames with their stuff
 * bits, acknowledgement, errors and their counters as ISO 11898-1 has them, bus-off, and faults of the wire.
 * Nodes are the emulated controller and as many ideal ones of scripts and sockets as one likes. Two nodes
 * that start the same identifier at the same time are not told apart: the first of them sends. */
#ifndef TRIBEND_EMULATOR_CAN_BUS_H
#define TRIBEND_EMULATOR_CAN_BUS_H

#include "emulator/schedule.h"

#include <stdbool.h>

#include "hal.h"

#define CAN_BUS_NODES 6u

struct can_bus_frame {
    struct hal_can_frame frame;
    bool remote;
    bool rate_switch;
};

/* One controller on the bus. Times of bits in ticks. */
struct can_bus_node {
    void *context;
    /* The frame it wants to send most; false: none. */
    bool (*wants)(void *context, struct can_bus_frame *frame);
    void (*sent)(void *context);
    void (*received)(void *context, const struct can_bus_frame *frame);
    void (*changed)(void *context); /* an error counter or state; `last_error` says what happened */
    int64_t bit_ticks, data_bit_ticks;
    bool online;       /* takes part: acknowledges, sends, counts */
    bool listens_only; /* acknowledges nothing and sends nothing */
    uint32_t transmit_errors, receive_errors;
    bool bus_off;
    uint32_t recovery;        /* sequences of 11 recessive bits still to see; 0: none */
    uint8_t last_error;       /* code of ISO 11898-1: 1 stuff, 2 form, 3 ack, 4 bit 1, 5 bit 0, 6 CRC */
    int64_t not_before_ticks; /* suspended after an error as error-passive transmitter */
    uint64_t sent_frames, received_frames, error_frames;
};

enum can_bus_wire {
    CAN_BUS_SOUND,
    CAN_BUS_SHORTED,  /* the two wires to each other: every bit reads recessive, each node is alone with its
                         errors */
    CAN_BUS_DOMINANT, /* a wire to the supply: every bit reads dominant, nobody sees the bus idle */
    CAN_BUS_OPEN      /* the board is cut off from the others, which wait */
};

struct can_bus {
    struct schedule *schedule;
    const int64_t *now_ticks;
    struct can_bus_node *node[CAN_BUS_NODES]; /* [0] is the emulated controller */
    size_t nodes;
    enum can_bus_wire wire;
    uint32_t corrupt_next;             /* so many frames are hit on their way */
    uint32_t lose_ack_next;            /* so many frames are not acknowledged */
    struct can_bus_frame frame;        /* on the wire */
    struct can_bus_node *sender;       /* NULL: idle */
    int64_t started_ticks, idle_ticks; /* since when it has been idle */
    size_t slot, idle_slot;
    int64_t busy_ticks; /* in all */
    uint64_t frames, errors;
};

void can_bus_init(struct can_bus *bus, struct schedule *schedule, const int64_t *now_ticks);
/* False: no room. */
bool can_bus_join(struct can_bus *bus, struct can_bus_node *node);
/* Somebody has something to send, or the wire changed. */
void can_bus_attend(struct can_bus *bus);
void can_bus_set_wire(struct can_bus *bus, enum can_bus_wire wire);
/* The node starts anew: after 11 recessive bits, or after 128 times that when it was off the bus. */
void can_bus_start_node(struct can_bus *bus, struct can_bus_node *node);
/* Length of a frame on the wire, intermission apart; data bits counted at their own time. */
int64_t can_bus_frame_ticks(const struct can_bus_frame *frame, int64_t bit_ticks, int64_t data_bit_ticks);

#endif
