/* The emulated board's bus: a datagram socket of struct canfd_frame. The board answers to who spoke last. */
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "link/socketcan.h"

static enum transport_result receive(struct transport *transport, struct transport_frame *frame) {
    for (;;) {
        const struct can_batch_frame *read = can_batch_next(&transport->batch, transport->descriptor);
        if (read == NULL) {
            return errno == EAGAIN ? TRANSPORT_NOTHING : TRANSPORT_GONE;
        }
        if (socketcan_to_frame(&read->can, read->bytes, frame)) {
            frame->time_us = read->time_us;
            return TRANSPORT_DONE;
        }
        transport->malformed++;
    }
}

static enum transport_result send_frame(struct transport *transport, const struct hal_can_frame *frame) {
    struct sockaddr_un peer = {.sun_family = AF_UNIX};
    (void)snprintf(peer.sun_path, sizeof peer.sun_path, "%s", transport->peer_path);
    return socketcan_send(transport->descriptor, frame, &peer);
}

static void close_socket(struct transport *transport) {
    (void)close(transport->descriptor);
    if (transport->own_path[0] != '\0') {
        (void)unlink(transport->own_path);
    }
}

static bool refuse(const char *path, const char *what, char *error, size_t error_bytes) {
    (void)snprintf(error, error_bytes, "bus unix:%s: %s: %s", path, what, strerror(errno));
    return false;
}

/* A name of our own beside the board's, for its answers. */
static bool bind_own(struct transport *transport, const char *path) {
    static atomic_uint opened;
    struct sockaddr_un own = {.sun_family = AF_UNIX};
    if (snprintf(own.sun_path, sizeof own.sun_path, "%s.%ld.%u", path, (long)getpid(),
                 atomic_fetch_add(&opened, 1u)) >= (int)sizeof own.sun_path) {
        errno = ENAMETOOLONG;
        return false;
    }
    (void)unlink(own.sun_path); /* of a process that had our number before */
    if (bind(transport->descriptor, (const struct sockaddr *)&own, sizeof own) != 0) {
        return false;
    }
    memcpy(transport->own_path, own.sun_path, sizeof own.sun_path);
    return true;
}

bool unix_bus_open(struct transport *transport, const char *path, char *error, size_t error_bytes) {
    struct sockaddr_un peer = {.sun_family = AF_UNIX};
    if (snprintf(peer.sun_path, sizeof peer.sun_path, "%s", path) >= (int)sizeof peer.sun_path ||
        *path == '\0') {
        errno = *path == '\0' ? ENOENT : ENAMETOOLONG;
        return refuse(path, "no path that a Unix socket can have", error, error_bytes);
    }
    memcpy(transport->peer_path, peer.sun_path, sizeof peer.sun_path);
    transport->descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (transport->descriptor < 0) {
        return refuse(path, "no socket", error, error_bytes);
    }
    transport->receive = receive;
    transport->send = send_frame;
    transport->close = close_socket;
    if (connect(transport->descriptor, (const struct sockaddr *)&peer, sizeof peer) != 0) {
        return refuse(path,
                      errno == EACCES
                          ? "no permission (it is another user's board, or folder: ask for write permission)"
                          : "no board listens there (start one: tribend board --bus unix:PATH)",
                      error, error_bytes);
    }
    /* connected, the socket would refuse what others than the peer send, a board that was started anew among
     * them */
    const struct sockaddr none = {.sa_family = AF_UNSPEC};
    if (connect(transport->descriptor, &none, sizeof none) != 0 || !bind_own(transport, path)) {
        return refuse(path, "cannot make a socket beside it", error, error_bytes);
    }
    return true;
}
