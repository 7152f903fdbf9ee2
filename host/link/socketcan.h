/* Between frames of linux/can.h and hal.h, for sockets that carry the former. */
#ifndef TRIBEND_SOCKETCAN_H
#define TRIBEND_SOCKETCAN_H

#include <linux/can.h>
#include <sys/un.h>

#include "link/transport.h"

/* `size` is what was read. False: no frame that can carry one of our messages. */
bool socketcan_to_frame(const struct canfd_frame *can, size_t size, struct transport_frame *frame);
/* Returns the bytes to write. */
size_t socketcan_from_frame(const struct hal_can_frame *frame, struct canfd_frame *can);
/* Puts `frame` on a CAN socket (`peer` NULL), or to that datagram socket. */
enum transport_result socketcan_send(int descriptor, const struct hal_can_frame *frame,
                                     const struct sockaddr_un *peer);

#endif
