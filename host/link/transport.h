/* Transports: CAN frames to and from the world, all behind one interface.
 *
 *     can0, vcan0                 a SocketCAN interface, error frames on, classic and FD
 *     slcan:/dev/ttyACM0[@500000] an adapter that speaks the ASCII protocol of Lawicel's CAN232 (SLCAN)
 *     unix:PATH                   the emulated board's datagram socket
 *
 * Nothing here blocks: poll `descriptor`, then receive until there is nothing; who stops before does not
 * poll, for what was read already may wait in here. Not here: what frames mean (can_link.h), when to open
 * again (can_link.h). */
#ifndef TRIBEND_TRANSPORT_H
#define TRIBEND_TRANSPORT_H

#include <stddef.h>

#include "hal.h"
#include "link/can_batch.h"
#include "link/slcan.h"

#define TRANSPORT_PATH_BYTES 108
#define TRANSPORT_IN_BYTES 1024
#define TRANSPORT_OUT_BYTES 4096

struct transport_frame {
    int64_t time_us; /* since 1970; of the kernel where it says, else when it was read */
    bool is_error;
    uint32_t error_class; /* CAN_ERR_... bits of linux/can/error.h */
    struct hal_can_frame frame;
};

enum transport_result {
    TRANSPORT_DONE = 0,
    TRANSPORT_NOTHING, /* nothing to read, or no room to send */
    TRANSPORT_GONE     /* the interface, the adapter or the board's socket went away: errno says how */
};

struct transport {
    int descriptor;
    uint64_t overflowed; /* frames that the kernel dropped because nobody read in time */
    uint64_t malformed;  /* what was no frame of ours: remote frames, half lines, wrong sizes */
    enum transport_result (*receive)(struct transport *transport, struct transport_frame *frame);
    enum transport_result (*send)(struct transport *transport, const struct hal_can_frame *frame);
    /* From now on only frames of and to this node, and error frames; NULL: it cannot choose. */
    void (*listen_to)(struct transport *transport, uint32_t node);
    void (*close)(struct transport *transport);
    /* what one of them keeps */
    struct can_batch batch;
    uint32_t overflow_seen;
    char own_path[TRANSPORT_PATH_BYTES];
    char peer_path[TRANSPORT_PATH_BYTES];
    struct slcan_reader reader;
    char in[TRANSPORT_IN_BYTES];
    size_t in_bytes, in_at;
    char out[TRANSPORT_OUT_BYTES];
    size_t out_bytes;
};

/* False: `error` names what is missing and the remedy. */
bool transport_open(struct transport *transport, const char *bus, char *error, size_t error_bytes);
void transport_close(struct transport *transport);
/* Microseconds since 1970. */
int64_t transport_now_us(void);

/* the kinds, by the rest of the bus' name */
bool socketcan_open(struct transport *transport, const char *interface, char *error, size_t error_bytes);
bool slcan_open(struct transport *transport, const char *device, char *error, size_t error_bytes);
bool unix_bus_open(struct transport *transport, const char *path, char *error, size_t error_bytes);

#endif
