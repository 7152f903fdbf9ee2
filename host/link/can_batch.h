/* Frames of linux/can.h out of a socket, many in one system call: a full bus carries 8,000 a second.
 *
 * What was read waits here: receive until there is nothing before the next poll. Not here: which socket
 * (socketcan.c, unix_bus.c). */
#ifndef TRIBEND_CAN_BATCH_H
#define TRIBEND_CAN_BATCH_H

#include <linux/can.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CAN_BATCH_FRAMES 64u
#define CAN_BATCH_CONTROL_BYTES 64 /* a time and a count */

struct can_batch_frame {
    struct canfd_frame can;
    size_t bytes;    /* that were read: CAN_MTU or CANFD_MTU, of frames */
    int64_t time_us; /* since 1970; of the kernel where it says, else when it was read */
    bool has_dropped;
    uint32_t dropped; /* by the kernel so far, for want of room (SO_RXQ_OVFL) */
};

struct can_batch {
    struct can_batch_frame frame[CAN_BATCH_FRAMES];
    struct {
        _Alignas(size_t) char bytes[CAN_BATCH_CONTROL_BYTES];
    } control[CAN_BATCH_FRAMES];
    size_t count, next;
    bool drained; /* the last call found fewer than it had room for */
};

/* The next frame, good until the call after; NULL: none now, or, with errno other than EAGAIN, none any more.
 */
const struct can_batch_frame *can_batch_next(struct can_batch *batch, int descriptor);

#endif
