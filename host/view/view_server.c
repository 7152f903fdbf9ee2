#include "view/view_server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "view/view_assets.h"

#define CONNECTION_TIMEOUT_S 10u
#define CONNECTION_BYTES (32u * 1024u)
#define CLOSING_WAITS 200 /* of 10 ms, for the streams to end */
#define ERROR_BYTES 512
#define BEARER "Bearer "
/* The page loads from its own server and from nowhere else, and no other page may frame it. */
#define POLICY                                                                                               \
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "    \
    "base-uri 'none'; "                                                                                      \
    "form-action 'none'; frame-ancestors 'none'"

/* A request while its body comes in. */
struct request {
    char body[VIEW_BODY_MOST + 1];
    size_t length;
    bool too_large;
};

/* --- answers --- */

static enum MHD_Result answer(struct MHD_Connection *connection, unsigned status, const char *type,
                              struct MHD_Response *response) {
    if (response == NULL) {
        return MHD_NO;
    }
    (void)MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, type);
    (void)MHD_add_response_header(response, MHD_HTTP_HEADER_CACHE_CONTROL, "no-store");
    (void)MHD_add_response_header(response, "Content-Security-Policy", POLICY);
    (void)MHD_add_response_header(response, "X-Content-Type-Options", "nosniff");
    (void)MHD_add_response_header(response, "Referrer-Policy", "no-referrer");
    if (status == MHD_HTTP_METHOD_NOT_ALLOWED) {
        (void)MHD_add_response_header(response, MHD_HTTP_HEADER_ALLOW, "GET, POST");
    }
    const enum MHD_Result result = MHD_queue_response(connection, status, response);
    MHD_destroy_response(response);
    return result;
}

static enum MHD_Result answer_text(struct MHD_Connection *connection, unsigned status, const char *text) {
    return answer(
        connection, status, "application/json",
        MHD_create_response_from_buffer(strlen(text), (void *)(uintptr_t)text, MHD_RESPMEM_MUST_COPY));
}

static enum MHD_Result refuse(struct view_server *server, struct MHD_Connection *connection, unsigned status,
                              const char *why) {
    (void)pthread_mutex_lock(&server->lock);
    server->refused++;
    (void)pthread_mutex_unlock(&server->lock);
    json_t *root = json_pack("{ss}", "error", why);
    char *text = root != NULL ? json_dumps(root, JSON_COMPACT) : NULL;
    const enum MHD_Result result =
        answer_text(connection, status, text != NULL ? text : "{\"error\":\"refused\"}");
    free(text);
    json_decref(root);
    return result;
}

/* --- the stream of events --- */

static ssize_t stream_take(struct view_stream *stream, char *buffer, size_t most) {
    const size_t left = stream->length - stream->sent, count = left < most ? left : most;
    memcpy(buffer, stream->text + stream->sent, count);
    stream->sent += count;
    return (ssize_t)count;
}

static ssize_t stream_read(void *context, uint64_t position, char *buffer, size_t most) {
    struct view_stream *stream = context;
    struct view_server *server = stream->server;
    ssize_t count = 0;
    (void)position;
    (void)pthread_mutex_lock(&server->lock);
    if (server->closing) {
        count = MHD_CONTENT_READER_END_OF_STREAM;
    } else if (stream->sent < stream->length) {
        count = stream_take(stream, buffer, most);
    } else {
        stream->length = view_hub_event(server->hub, &stream->sequence, stream->text);
        stream->sent = 0;
        if (stream->length > 0) {
            count = stream_take(stream, buffer, most);
        } else {
            stream->waits = true;
            MHD_suspend_connection(stream->connection);
        }
    }
    (void)pthread_mutex_unlock(&server->lock);
    return count;
}

static void stream_end(void *context) {
    struct view_stream *stream = context;
    struct view_server *server = stream->server;
    view_hub_release(server->hub, stream->page, VIEW_ARM_GONE);
    (void)pthread_mutex_lock(&server->lock);
    stream->server = NULL;
    (void)pthread_mutex_unlock(&server->lock);
}

static struct view_stream *stream_begin(struct view_server *server, struct MHD_Connection *connection,
                                        const char *page) {
    struct view_stream *found = NULL;
    (void)pthread_mutex_lock(&server->lock);
    for (size_t i = 0; i < VIEW_STREAMS_MOST && found == NULL && !server->closing; i++) {
        found = server->stream[i].server == NULL ? &server->stream[i] : NULL;
    }
    if (found != NULL) {
        memset(found, 0, sizeof *found);
        found->server = server;
        found->connection = connection;
        (void)snprintf(found->page, sizeof found->page, "%s", page);
    }
    (void)pthread_mutex_unlock(&server->lock);
    return found;
}

void view_server_wake(void *context) {
    struct view_server *server = context;
    (void)pthread_mutex_lock(&server->lock);
    for (size_t i = 0; i < VIEW_STREAMS_MOST; i++) {
        struct view_stream *stream = &server->stream[i];
        if (stream->server != NULL && stream->waits) {
            stream->waits = false;
            MHD_resume_connection(stream->connection);
        }
    }
    (void)pthread_mutex_unlock(&server->lock);
}

static enum MHD_Result get_events(struct view_server *server, struct MHD_Connection *connection) {
    const char *page = MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, "page");
    if (page == NULL || *page == '\0' || strlen(page) >= VIEW_PAGE_BYTES) {
        return refuse(server, connection, MHD_HTTP_BAD_REQUEST, "which page? ?page=NAME");
    }
    struct view_stream *stream = stream_begin(server, connection, page);
    if (stream == NULL) {
        return refuse(server, connection, MHD_HTTP_SERVICE_UNAVAILABLE, "too many pages are open: close one");
    }
    struct MHD_Response *response = MHD_create_response_from_callback(MHD_SIZE_UNKNOWN, VIEW_EVENT_BYTES,
                                                                      stream_read, stream, stream_end);
    if (response == NULL) {
        stream_end(stream);
    }
    return answer(connection, MHD_HTTP_OK, "text/event-stream", response);
}

/* --- requests --- */

static const char *header(struct MHD_Connection *connection, const char *name) {
    return MHD_lookup_connection_value(connection, MHD_HEADER_KIND, name);
}

/* Of the header, or NULL. */
static const char *bearer(struct MHD_Connection *connection) {
    const char *text = header(connection, MHD_HTTP_HEADER_AUTHORIZATION);
    return text != NULL && strncmp(text, BEARER, sizeof BEARER - 1) == 0 ? text + sizeof BEARER - 1 : NULL;
}

static enum MHD_Result get_session(struct view_server *server, struct MHD_Connection *connection) {
    char text[VIEW_TOKEN_BYTES + 32];
    if (!server->access.loopback) {
        return refuse(server, connection, MHD_HTTP_FORBIDDEN,
                      "open the page with #token=TOKEN behind its address");
    }
    (void)snprintf(text, sizeof text, "{\"token\":\"%s\"}", server->access.token);
    return answer_text(connection, MHD_HTTP_OK, text);
}

static enum MHD_Result get_asset(struct MHD_Connection *connection, const struct view_asset *asset) {
    return answer(connection, MHD_HTTP_OK, asset->type,
                  MHD_create_response_from_buffer(asset->size, (void *)(uintptr_t)asset->bytes,
                                                  MHD_RESPMEM_PERSISTENT));
}

static enum MHD_Result serve_get(struct view_server *server, struct MHD_Connection *connection,
                                 const char *path) {
    const struct view_asset *asset = view_asset_find(path);
    const bool is_module = strcmp(path, "/module") == 0, is_events = strcmp(path, "/events") == 0;
    if (asset != NULL) {
        return get_asset(connection, asset);
    }
    if (strcmp(path, "/session") == 0) {
        return get_session(server, connection);
    }
    if (!is_module && !is_events) {
        return refuse(server, connection, MHD_HTTP_NOT_FOUND, "there is nothing here");
    }
    /* an EventSource sends no headers of its own */
    const char *given = bearer(connection);
    given = given != NULL ? given : MHD_lookup_connection_value(connection, MHD_GET_ARGUMENT_KIND, "token");
    if (!view_token_matches(&server->access, given)) {
        return refuse(server, connection, MHD_HTTP_UNAUTHORIZED, "the token is missing or wrong");
    }
    return is_module ? answer_text(connection, MHD_HTTP_OK, server->module) : get_events(server, connection);
}

static enum MHD_Result done(struct view_server *server, struct MHD_Connection *connection, bool taken,
                            const char *why) {
    return taken ? answer_text(connection, MHD_HTTP_OK, "{}")
                 : refuse(server, connection, MHD_HTTP_CONFLICT, why);
}

static enum MHD_Result post_command(struct view_server *server, struct MHD_Connection *connection,
                                    const char *body) {
    struct controller_command command;
    char page[VIEW_PAGE_BYTES], error[ERROR_BYTES];
    const char *why = "";
    if (!view_request_command(body, &server->hub->table->module, page, &command, error, sizeof error)) {
        return refuse(server, connection, MHD_HTTP_BAD_REQUEST, error);
    }
    const bool taken = view_hub_command(server->hub, page, &command, &why);
    return done(server, connection, taken, why);
}

enum page_request { REQUEST_ARM, REQUEST_DISARM, REQUEST_VENT, REQUEST_CLEAR };

static enum MHD_Result post_of_page(struct view_server *server, struct MHD_Connection *connection,
                                    enum page_request request, const char *body) {
    char page[VIEW_PAGE_BYTES], error[ERROR_BYTES];
    const char *why = "";
    bool taken = true;
    if (!view_request_page(body, page, error, sizeof error)) {
        return refuse(server, connection, MHD_HTTP_BAD_REQUEST, error);
    }
    switch (request) {
    case REQUEST_ARM:
        taken = view_hub_arm(server->hub, page, &why);
        break;
    case REQUEST_DISARM:
        view_hub_release(server->hub, page, VIEW_ARM_DISARMED);
        break;
    case REQUEST_CLEAR:
        view_hub_clear(server->hub);
        break;
    case REQUEST_VENT:
    default:
        view_hub_vent(server->hub);
        break;
    }
    return done(server, connection, taken, why);
}

static enum MHD_Result route_post(struct view_server *server, struct MHD_Connection *connection,
                                  const char *path, const char *body) {
    static const struct {
        const char *path;
        enum page_request request;
    } routes[] = {{"/arm", REQUEST_ARM},
                  {"/disarm", REQUEST_DISARM},
                  {"/vent", REQUEST_VENT},
                  {"/clear", REQUEST_CLEAR}};
    for (size_t i = 0; i < sizeof routes / sizeof routes[0]; i++) {
        if (strcmp(path, routes[i].path) == 0) {
            return post_of_page(server, connection, routes[i].request, body);
        }
    }
    return strcmp(path, "/command") == 0
               ? post_command(server, connection, body)
               : refuse(server, connection, MHD_HTTP_NOT_FOUND, "there is nothing to post to here");
}

static enum MHD_Result serve_post(struct view_server *server, struct MHD_Connection *connection,
                                  const char *path, const struct request *request) {
    if (!view_origin_is_own(header(connection, "Origin"), header(connection, MHD_HTTP_HEADER_HOST))) {
        return refuse(server, connection, MHD_HTTP_FORBIDDEN, "another site's page may not command");
    }
    if (!view_token_matches(&server->access, bearer(connection))) {
        return refuse(server, connection, MHD_HTTP_UNAUTHORIZED,
                      "the token is missing or wrong: Authorization: Bearer TOKEN");
    }
    if (request->too_large) {
        return refuse(server, connection, MHD_HTTP_CONTENT_TOO_LARGE, "a body has at most 1024 bytes");
    }
    return route_post(server, connection, path, request->body);
}

static void take_body(struct request *request, const char *data, size_t size) {
    if (size > VIEW_BODY_MOST - request->length) {
        request->too_large = true;
        return;
    }
    memcpy(request->body + request->length, data, size);
    request->length += size;
}

static enum MHD_Result serve(void *context, struct MHD_Connection *connection, const char *path,
                             const char *method, const char *version, const char *data, size_t *size,
                             void **kept) {
    struct view_server *server = context;
    (void)version;
    if (*kept == NULL) {
        *kept = calloc(1, sizeof(struct request));
        return *kept != NULL ? MHD_YES : MHD_NO;
    }
    struct request *request = *kept;
    if (*size > 0) {
        take_body(request, data, *size);
        *size = 0;
        return MHD_YES;
    }
    if (server->access.loopback && !view_host_is_loopback(header(connection, MHD_HTTP_HEADER_HOST))) {
        return refuse(server, connection, MHD_HTTP_FORBIDDEN,
                      "this page is served as 127.0.0.1 or localhost only");
    }
    if (strcmp(method, MHD_HTTP_METHOD_GET) == 0) {
        return serve_get(server, connection, path);
    }
    if (strcmp(method, MHD_HTTP_METHOD_POST) == 0) {
        return serve_post(server, connection, path, request);
    }
    return refuse(server, connection, MHD_HTTP_METHOD_NOT_ALLOWED, "GET and POST are served");
}

static void completed(void *context, struct MHD_Connection *connection, void **kept,
                      enum MHD_RequestTerminationCode code) {
    (void)context;
    (void)connection;
    (void)code;
    free(*kept);
    *kept = NULL;
}

/* --- opening and closing --- */

static bool make_address(const char *text, uint16_t port, struct sockaddr_storage *address) {
    struct sockaddr_in *four = (struct sockaddr_in *)address;
    struct sockaddr_in6 *six = (struct sockaddr_in6 *)address;
    memset(address, 0, sizeof *address);
    if (inet_pton(AF_INET, text, &four->sin_addr) == 1) {
        four->sin_family = AF_INET;
        four->sin_port = htons(port);
        return true;
    }
    six->sin6_family = AF_INET6;
    six->sin6_port = htons(port);
    return inet_pton(AF_INET6, text, &six->sin6_addr) == 1;
}

static struct MHD_Daemon *start(struct view_server *server, const struct sockaddr_storage *address) {
    const unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME |
                           (address->ss_family == AF_INET6 ? (unsigned)MHD_USE_IPv6 : 0u);
    return MHD_start_daemon(flags, 0, NULL, NULL, serve, server, MHD_OPTION_SOCK_ADDR,
                            (const struct sockaddr *)address, MHD_OPTION_CONNECTION_LIMIT,
                            VIEW_CONNECTIONS_MOST, MHD_OPTION_CONNECTION_TIMEOUT, CONNECTION_TIMEOUT_S,
                            MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)CONNECTION_BYTES,
                            MHD_OPTION_NOTIFY_COMPLETED, completed, NULL, MHD_OPTION_END);
}

bool view_server_open(struct view_server *server, struct view_hub *hub, const struct view_access *access,
                      char *module, const char *address, uint16_t port, char *error, size_t error_bytes) {
    struct sockaddr_storage where;
    memset(server, 0, sizeof *server);
    server->hub = hub;
    server->access = *access;
    server->module = module;
    if (!make_address(address, port, &where)) {
        (void)snprintf(error, error_bytes,
                       "'%s' is not an IPv4 or IPv6 address of this machine, such as 127.0.0.1", address);
        return false;
    }
    if (pthread_mutex_init(&server->lock, NULL) != 0) {
        (void)snprintf(error, error_bytes, "no lock to be had");
        return false;
    }
    errno = 0;
    server->daemon = start(server, &where);
    if (server->daemon == NULL) {
        (void)snprintf(error, error_bytes, "%s port %u: %s; --port chooses another", address, port,
                       errno != 0 ? strerror(errno) : "cannot listen");
        return false;
    }
    server->port = MHD_get_daemon_info(server->daemon, MHD_DAEMON_INFO_BIND_PORT)->port;
    return true;
}

static bool has_streams(struct view_server *server) {
    bool has = false;
    (void)pthread_mutex_lock(&server->lock);
    for (size_t i = 0; i < VIEW_STREAMS_MOST; i++) {
        has = has || server->stream[i].server != NULL;
    }
    (void)pthread_mutex_unlock(&server->lock);
    return has;
}

void view_server_close(struct view_server *server) {
    const struct timespec moment = {.tv_nsec = 10000000};
    if (server->daemon != NULL) {
        (void)pthread_mutex_lock(&server->lock);
        server->closing = true;
        (void)pthread_mutex_unlock(&server->lock);
        for (int i = 0; i < CLOSING_WAITS && has_streams(server); i++) {
            view_server_wake(server); /* none may be suspended when the daemon stops */
            (void)nanosleep(&moment, NULL);
        }
        MHD_stop_daemon(server->daemon);
        (void)pthread_mutex_destroy(&server->lock);
    }
    free(server->module);
}
