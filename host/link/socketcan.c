#include "link/socketcan.h"

#include <errno.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "comms/codec.h"

#define RECEIVE_BUFFER_BYTES (4 << 20) /* some seconds of a full bus */

bool socketcan_to_frame(const struct canfd_frame *can, size_t size, struct transport_frame *frame) {
    const bool fd = size == CANFD_MTU;
    memset(frame, 0, sizeof *frame);
    if ((!fd && size != CAN_MTU) || can->len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
        return false;
    }
    frame->is_error = (can->can_id & CAN_ERR_FLAG) != 0;
    frame->error_class = frame->is_error ? can->can_id & CAN_ERR_MASK : 0;
    frame->frame =
        (struct hal_can_frame){.extended = (can->can_id & CAN_EFF_FLAG) != 0, .fd = fd, .length = can->len};
    frame->frame.id = can->can_id & (frame->frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    memcpy(frame->frame.data, can->data, can->len);
    return frame->is_error || (can->can_id & CAN_RTR_FLAG) == 0;
}

size_t socketcan_from_frame(const struct hal_can_frame *frame, struct canfd_frame *can) {
    memset(can, 0, sizeof *can);
    can->can_id = frame->id | (frame->extended ? CAN_EFF_FLAG : 0u);
    can->len = frame->length;
    memcpy(can->data, frame->data, frame->length);
    return frame->fd ? CANFD_MTU : CAN_MTU;
}

static enum transport_result receive(struct transport *transport, struct transport_frame *frame) {
    for (;;) {
        const struct can_batch_frame *read = can_batch_next(&transport->batch, transport->descriptor);
        if (read == NULL) {
            return errno == EAGAIN ? TRANSPORT_NOTHING : TRANSPORT_GONE;
        }
        if (read->has_dropped) {
            transport->overflowed += read->dropped - transport->overflow_seen;
            transport->overflow_seen = read->dropped;
        }
        if (socketcan_to_frame(&read->can, read->bytes, frame)) {
            frame->time_us = read->time_us;
            return TRANSPORT_DONE;
        }
        transport->malformed++;
    }
}

enum transport_result socketcan_send(int descriptor, const struct hal_can_frame *frame,
                                     const struct sockaddr_un *peer) {
    struct canfd_frame can;
    const size_t size = socketcan_from_frame(frame, &can);
    for (;;) {
        const ssize_t sent = sendto(descriptor, &can, size, MSG_NOSIGNAL, (const struct sockaddr *)peer,
                                    peer != NULL ? sizeof *peer : 0);
        if (sent == (ssize_t)size) {
            return TRANSPORT_DONE;
        }
        if (sent < 0 && errno != EINTR) {
            return errno == EAGAIN || errno == ENOBUFS ? TRANSPORT_NOTHING : TRANSPORT_GONE;
        }
    }
}

static enum transport_result send_frame(struct transport *transport, const struct hal_can_frame *frame) {
    return socketcan_send(transport->descriptor, frame, NULL);
}

/* Of and to one node, by standard identifiers; all that a bus of many nodes carries costs nothing then. */
static void listen_to(struct transport *transport, uint32_t node) {
    const struct can_filter filter = {.can_id = node,
                                      .can_mask = MESSAGE_NODE_MOST | CAN_EFF_FLAG | CAN_RTR_FLAG};
    (void)setsockopt(transport->descriptor, SOL_CAN_RAW, CAN_RAW_FILTER, &filter, sizeof filter);
}

static void close_socket(struct transport *transport) {
    (void)close(transport->descriptor);
}

static bool refuse(const char *interface, const char *what, char *error, size_t error_bytes) {
    (void)snprintf(error, error_bytes, "bus %s: %s: %s", interface, what, strerror(errno));
    return false;
}

/* What is asked for before binding. A kernel that cannot do one of them leaves it out. */
static void set_options(int descriptor) {
    const int on = 1, bytes = RECEIVE_BUFFER_BYTES;
    const can_err_mask_t errors = CAN_ERR_MASK;
    (void)setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors);
    (void)setsockopt(descriptor, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    (void)setsockopt(descriptor, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (setsockopt(descriptor, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0) {
        (void)setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    }
    (void)setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
}

bool socketcan_open(struct transport *transport, const char *interface, char *error, size_t error_bytes) {
    struct ifreq request;
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(interface)};
    if (address.can_ifindex == 0) {
        (void)snprintf(
            error, error_bytes,
            "there is no bus '%s': %s. There are sim, unix:PATH, slcan:DEVICE, and the CAN interfaces that "
            "`ip link` lists (a virtual one, as root: ip link add dev vcan0 type vcan)",
            interface, strerror(errno));
        return false;
    }
    transport->descriptor = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (transport->descriptor < 0) {
        return refuse(interface,
                      "no CAN socket (as root: modprobe can_raw; or use unix:PATH or slcan:DEVICE)", error,
                      error_bytes);
    }
    transport->receive = receive;
    transport->send = send_frame;
    transport->listen_to = listen_to;
    transport->close = close_socket;
    memset(&request, 0, sizeof request);
    (void)snprintf(request.ifr_name, sizeof request.ifr_name, "%s", interface);
    if (ioctl(transport->descriptor, SIOCGIFFLAGS, &request) != 0) {
        return refuse(interface, "its state cannot be read", error, error_bytes);
    }
    if ((request.ifr_flags & IFF_UP) == 0) {
        errno = ENETDOWN;
        return refuse(
            interface,
            "the interface is down (as root: ip link set NAME up type can bitrate 1000000; a vcan: ip link "
            "set NAME up)",
            error, error_bytes);
    }
    set_options(transport->descriptor);
    if (bind(transport->descriptor, (const struct sockaddr *)&address, sizeof address) != 0) {
        return refuse(interface, "this is no CAN interface", error, error_bytes);
    }
    return true;
}
