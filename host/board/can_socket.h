/* The emulated board's CAN bus to the world: SocketCAN (can0, vcan0), or a Unix datagram socket of struct
 * canfd_frame for machines without it. Frames of the world join the virtual bus as another node's; what the
 * board sends goes out. On a Unix socket whoever spoke hears the board, and the others who spoke, until it goes. */
#ifndef TRIBEND_CAN_SOCKET_H
#define TRIBEND_CAN_SOCKET_H

#include <stddef.h>

#include "emulator/board.h"

#define CAN_SOCKET_PATH_BYTES 108
#define CAN_SOCKET_PEERS 8

struct can_socket {
    int descriptor;
    char
        own_path[CAN_SOCKET_PATH_BYTES]; /* of a Unix socket that is ours to remove; "" where there is none */
    char peer_path[CAN_SOCKET_PEERS][CAN_SOCKET_PATH_BYTES]; /* a ninth takes the place of the last */
    size_t peers;
    uint64_t taken, given;
    uint64_t not_sent; /* the socket had no room, or nobody listened */
    uint64_t ignored;  /* error frames, and what is no frame at all */
};

/* `bus` is an interface, or unix:PATH. False: `error` says what is missing and what helps. */
bool can_socket_open(struct can_socket *socket, const char *bus, char *error, size_t error_bytes);
void can_socket_close(struct can_socket *socket);
/* What has come in goes to the board, what the board has sent goes out. Never waits. False: the interface is
 * gone. */
bool can_socket_exchange(struct can_socket *socket, struct board *board);

#endif
