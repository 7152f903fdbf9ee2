#include "board/can_socket.h"

#include <errno.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "link/socketcan.h"

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

/* To all who listen at the Unix socket but the one who said it; false: nobody took it. */
static bool give_peers(struct can_socket *can, const struct hal_can_frame *frame, const char *sender) {
    struct sockaddr_un peer = {.sun_family = AF_UNIX};
    bool given = false;
    for (size_t p = 0; p < can->peers; p++) {
        if (strcmp(can->peer_path[p], sender) == 0) {
            continue;
        }
        (void)snprintf(peer.sun_path, sizeof peer.sun_path, "%s", can->peer_path[p]);
        const enum transport_result result = socketcan_send(can->descriptor, frame, &peer);
        given = given || result == TRANSPORT_DONE;
        can->not_sent += result == TRANSPORT_NOTHING ? 1 : 0;
        if (result == TRANSPORT_GONE) { /* it went without a word */
            memcpy(can->peer_path[p--], can->peer_path[--can->peers], sizeof can->peer_path[0]);
        }
    }
    return given;
}

static void remember(struct can_socket *can, const char *sender) {
    size_t p = 0;
    while (p < can->peers && strcmp(can->peer_path[p], sender) != 0) {
        p++;
    }
    if (p == can->peers) {
        p = can->peers < CAN_SOCKET_PEERS ? can->peers++ : CAN_SOCKET_PEERS - 1;
        (void)snprintf(can->peer_path[p], sizeof can->peer_path[p], "%s", sender);
    }
}

static void take_one(struct can_socket *can, struct board *board, const struct hal_can_frame *frame,
                     const char *sender) {
    can->taken += board_send(board, frame) ? 1 : 0;
    if (*sender != '\0') {
        remember(can, sender);
        (void)give_peers(can, frame, sender);
    }
}

static bool take(struct can_socket *can, struct board *board) {
    struct canfd_frame frame;
    struct transport_frame taken;
    struct sockaddr_un sender;
    for (;;) {
        memset(&sender, 0, sizeof sender);
        socklen_t sender_bytes = sizeof sender;
        const ssize_t size =
            recvfrom(can->descriptor, &frame, sizeof frame, 0, (struct sockaddr *)&sender, &sender_bytes);
        if (size < 0) {
            return errno == EAGAIN || errno == EINTR || errno == ENETDOWN;
        }
        const bool is_unix = can->own_path[0] != '\0' && sender.sun_family == AF_UNIX;
        if (!socketcan_to_frame(&frame, (size_t)size, &taken) || taken.is_error) {
            can->ignored++;
        } else {
            take_one(can, board, &taken.frame, is_unix ? sender.sun_path : "");
        }
    }
}

static bool give_one(struct can_socket *can, const struct hal_can_frame *frame) {
    return can->own_path[0] != '\0' ? give_peers(can, frame, "")
                                    : socketcan_send(can->descriptor, frame, NULL) == TRANSPORT_DONE;
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
