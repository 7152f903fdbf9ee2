/* The HTTP server of the live view, on libmicrohttpd: the page's files, the stream of events, the few
 * requests that command.
 *
 * On a loopback address the page is given the token under a loopback name only; elsewhere people must bring
 * it. Everything but the page's files needs the token; a request that commands needs it in a header, which no
 * other site's page can send, and no foreign Origin. Clients, streams, bodies and waiting times are bounded,
 * and each refusal is counted. */
#ifndef TRIBEND_VIEW_SERVER_H
#define TRIBEND_VIEW_SERVER_H

#include <microhttpd.h>

#include "view/view_hub.h"
#include "view/view_request.h"

#define VIEW_CONNECTIONS_MOST 24u
#define VIEW_STREAMS_MOST 8u
#define VIEW_BODY_MOST 1024u

struct view_server;

struct view_stream {
    struct view_server *server; /* NULL: free */
    struct MHD_Connection *connection;
    char page[VIEW_PAGE_BYTES];
    char text[VIEW_EVENT_BYTES];
    size_t length, sent;
    uint64_t sequence;
    bool waits; /* suspended until there is an event */
};

struct view_server {
    struct view_hub *hub;
    struct view_access access;
    char *module; /* JSON of the module */
    struct MHD_Daemon *daemon;
    uint16_t port;
    pthread_mutex_t lock; /* of what follows */
    struct view_stream stream[VIEW_STREAMS_MOST];
    bool closing;
    uint64_t refused; /* requests */
};

/* `address` numeric, port 0: any free one. `access` by value, `module` is taken over. False: `error` says
 * why, and what to do. */
bool view_server_open(struct view_server *server, struct view_hub *hub, const struct view_access *access,
                      char *module, const char *address, uint16_t port, char *error, size_t error_bytes);
/* There is a new event: `context` is the server. */
void view_server_wake(void *context);
void view_server_close(struct view_server *server);

#endif
