#include "board/can_socket.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define UNIX_PREFIX "unix:"

static bool refuse(struct can_socket *can, const char *bus, const char *what, char *error,
                   size_t error_bytes) {
    (void)snprintf(error, error_bytes, "bus %s: %s: %s", bus, what, strerror(errno));
    can_socket_close(can);
    return false;
}

static bool open_interface(struct can_socket *can, const char *bus, char *error, size_t error_bytes) {
    const int on = 1;
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(bus)};
    if (address.can_ifindex == 0) {
        return refuse(can, bus,
                      "no such interface (for a virtual one, as root: ip link add dev vcan0 type vcan; ip "
                      "link set vcan0 up)",
                      error, error_bytes);
    }
    can->descriptor = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (can->descriptor < 0) {
        return refuse(can, bus, "this kernel has no CAN sockets; use --bus unix:PATH", error, error_bytes);
    }
    if (setsockopt(can->descriptor, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        bind(can->descriptor, (const struct sockaddr *)&address, sizeof address) != 0) {
        return refuse(can, bus, "cannot be used", error, error_bytes);
    }
    return true;
}

static bool open_unix(struct can_socket *can, const char *bus, char *error, size_t error_bytes) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const char *path = bus + strlen(UNIX_PREFIX);
    if (*path == '\0' || strlen(path) >= sizeof address.sun_path) {
        errno = ENAMETOOLONG;
        return refuse(can, bus, "no path that a Unix socket can have", error, error_bytes);
    }
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    can->descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (can->descriptor < 0 ||
        bind(can->descriptor, (const struct sockaddr *)&address, sizeof address) != 0) {
        return refuse(can, bus, "cannot be made (left over from another run? remove it)", error, error_bytes);
    }
    (void)snprintf(can->own_path, sizeof can->own_path, "%s", path);
    return true;
}

bool can_socket_open(struct can_socket *can, const char *bus, char *error, size_t error_bytes) {
    memset(can, 0, sizeof *can);
    can->descriptor = -1;
    return strncmp(bus, UNIX_PREFIX, strlen(UNIX_PREFIX)) == 0 ? open_unix(can, bus, error, error_bytes)
                                                               : open_interface(can, bus, error, error_bytes);
}

void can_socket_close(struct can_socket *can) {
    if (can->descriptor >= 0) {
        (void)close(can->descriptor);
        can->descriptor = -1;
    }
    if (can->own_path[0] != '\0') {
        (void)unlink(can->own_path);
        can->own_path[0] = '\0';
    }
}

static bool to_hal(const struct canfd_frame *frame, size_t size, struct hal_can_frame *hal) {
    const bool fd = size == CANFD_MTU;
    if ((!fd && size != CAN_MTU) || (frame->can_id & (CAN_ERR_FLAG | CAN_RTR_FLAG)) != 0 ||
        frame->len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
        return false;
    }
    *hal = (struct hal_can_frame){
        .extended = (frame->can_id & CAN_EFF_FLAG) != 0, .fd = fd, .length = frame->len};
    hal->id = frame->can_id & (hal->extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    memcpy(hal->data, frame->data, frame->len);
    return true;
}

static bool take(struct can_socket *can, struct board *board) {
    struct canfd_frame frame;
    struct hal_can_frame hal;
    struct sockaddr_un sender = {.sun_family = AF_UNSPEC};
    socklen_t sender_bytes = sizeof sender;
    for (;;) {
        const ssize_t size =
            recvfrom(can->descriptor, &frame, sizeof frame, 0, (struct sockaddr *)&sender, &sender_bytes);
        if (size < 0) {
            return errno == EAGAIN || errno == EINTR || errno == ENETDOWN;
        }
        if (can->own_path[0] != '\0' && sender.sun_family == AF_UNIX &&
            sender_bytes > sizeof sender.sun_family) {
            (void)snprintf(can->peer_path, sizeof can->peer_path, "%s", sender.sun_path);
        }
        if (!to_hal(&frame, (size_t)size, &hal)) {
            can->ignored++;
        } else if (board_send(board, &hal)) {
            can->taken++;
        }
        sender_bytes = sizeof sender;
    }
}

static bool give_one(struct can_socket *can, const struct hal_can_frame *hal) {
    struct canfd_frame frame = {.can_id = hal->id | (hal->extended ? CAN_EFF_FLAG : 0u), .len = hal->length};
    const size_t size = hal->fd ? CANFD_MTU : CAN_MTU;
    struct sockaddr_un peer = {.sun_family = AF_UNIX};
    memcpy(frame.data, hal->data, hal->length);
    if (can->own_path[0] == '\0') {
        return send(can->descriptor, &frame, size, 0) == (ssize_t)size;
    }
    (void)snprintf(peer.sun_path, sizeof peer.sun_path, "%s", can->peer_path);
    return can->peer_path[0] != '\0' && sendto(can->descriptor, &frame, size, 0,
                                               (const struct sockaddr *)&peer, sizeof peer) == (ssize_t)size;
}

bool can_socket_exchange(struct can_socket *can, struct board *board) {
    struct can_host_heard heard;
    while (board_receive(board, &heard)) {
        if (give_one(can, &heard.frame)) {
            can->given++;
        } else {
            can->not_sent++;
        }
    }
    return take(can, board);
}
