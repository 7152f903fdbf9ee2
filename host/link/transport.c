#include "link/transport.h"

#include <string.h>
#include <time.h>

static const struct {
    const char *prefix;
    bool (*open)(struct transport *transport, const char *rest, char *error, size_t error_bytes);
} kinds[] = {{"slcan:", slcan_open}, {"unix:", unix_bus_open}, {"", socketcan_open}};

bool transport_open(struct transport *transport, const char *bus, char *error, size_t error_bytes) {
    size_t kind = 0;
    memset(transport, 0, sizeof *transport);
    transport->descriptor = -1;
    while (strncmp(bus, kinds[kind].prefix, strlen(kinds[kind].prefix)) != 0) {
        kind++; /* the last one takes all */
    }
    if (!kinds[kind].open(transport, bus + strlen(kinds[kind].prefix), error, error_bytes)) {
        transport_close(transport);
        return false;
    }
    return true;
}

void transport_close(struct transport *transport) {
    if (transport->descriptor >= 0) {
        transport->close(transport);
        transport->descriptor = -1;
    }
}

int64_t transport_now_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}
