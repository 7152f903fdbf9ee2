/* tribend bridge: a board on CAN, as LCM channels. Sockets, options and the loop; what is said is host/lcm's.
 */
#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "cli/commands.h"
#include "lcm/bridge.h"
#include "lcm/bridge_logs.h"
#include "units/units.h"

#define URL_DEFAULT "udpm://239.255.76.67:7667?ttl=0"
#define PREFIX_DEFAULT "TRIBEND_"
#define CHANNEL_BYTES 64
#define PREFIX_MOST (CHANNEL_BYTES - 24)
#define WAKE_MS 20
#define FRAMES_A_TURN 64 /* then LCM has its turn */
#define MESSAGES_A_TURN 64
#define REOPEN_LEAST_US 100000
#define REOPEN_MOST_US 2000000
#define DURATION_MOST_S 86400.0

struct settings {
    const char *bus, *url, *prefix, *table;
    struct bridge_logs_paths logs;
    int node;
    double duration_s; /* 0: until Ctrl-C */
    bool quiet, json;
};

static const struct argp_option options[] = {
    {"bus", 'b', "BUS", 0,
     "where the board is: an interface such as can0, slcan:DEVICE or unix:PATH (default can0)", 1},
    {"lcm-url", 'u', "URL", 0, "of LCM (default $LCM_DEFAULT_URL, else " URL_DEFAULT ")", 1},
    {"prefix", 'p', "TEXT", 0, "of the channels (default " PREFIX_DEFAULT ")", 1},
    {"node", 'n', "N", 0, "of the board on the bus, 1 to 15 (default 1)", 1},
    {"for", 'f', "TIME", 0, "how long (default: until Ctrl-C)", 1},
    {"lcm-log", 'L', "FILE", 0, "write the messages down as lcm-logger does", 2},
    {"can-log", 'C', "FILE", 0, "write the frames down as candump -L does", 2},
    {"record", 'r', "FILE", 0, "write a run log (CSV); FILE.part until the end", 2},
    {"table", 't', "FILE", 0, "the board's bend table, named in the run log", 2},
    {"quiet", 'q', NULL, 0, "only the summary", 2},
    {"json", 'j', NULL, 0, "for programs: only the summary, as one JSON object", 2},
    {0}};

static void parse_duration(struct argp_state *state, const char *text, struct settings *settings) {
    cli_quantity(state, "--for", UNITS_TIME, text, &settings->duration_s);
    if (!(settings->duration_s > 0.0) || settings->duration_s > DURATION_MOST_S) {
        argp_error(state, "--for: %s is not between 0 and a day", text);
    }
}

static void parse_prefix(struct argp_state *state, const char *text, struct settings *settings) {
    settings->prefix = text;
    if (strlen(text) > PREFIX_MOST) {
        argp_error(state, "--prefix: '%s' is longer than %d characters", text, PREFIX_MOST);
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct settings *settings = state->input;
    switch (key) {
    case 'b':
        settings->bus = argument;
        return 0;
    case 'u':
        settings->url = argument;
        return 0;
    case 'p':
        parse_prefix(state, argument, settings);
        return 0;
    case 'n':
        settings->node = cli_whole_number(state, "--node", argument, 1, (int)MESSAGE_NODE_MOST);
        return 0;
    case 'f':
        parse_duration(state, argument, settings);
        return 0;
    case 'L':
        settings->logs.lcm = argument;
        return 0;
    case 'C':
        settings->logs.can = argument;
        return 0;
    case 'r':
        settings->logs.run = argument;
        return 0;
    case 't':
        settings->table = argument;
        return 0;
    case 'j':
        settings->json = settings->quiet = true;
        return 0;
    case 'q':
        settings->quiet = true;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "bridge takes no argument, '%s' is too much", argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    options,
    parse,
    "",
    "Carry a board's telemetry to LCM, and commands from LCM to the board (types in host/lcm/, see "
    "docs/lcm.md).\v"
    "Examples:\n"
    "  tribend bridge --bus can0\n"
    "  tribend bridge --bus can0 --lcm-log mission.lcm --record mission.csv\n"
    "Commands that are already flying when the bridge starts are refused until they pause for a second or an "
    "arm comes. "
    "Nothing is kept alive: a sender that falls silent has the module vented. So does Ctrl-C.",
    NULL,
    NULL,
    NULL};

/* --- sockets --- */

struct session {
    const struct settings *settings;
    struct bridge bridge;
    struct bridge_logs logs;
    struct transport bus;
    bool connected;
    bool more;        /* frames are waiting that poll does not see */
    int64_t frame_us; /* when the frame under way came; 0: none is */
    int64_t reopen_us, pause_us;
    uint64_t overflowed, malformed; /* of buses that were closed */
    lcm_t *lcm;
    bool was_heard, was_open;
    uint32_t protocol; /* of the board, as last said */
};

static int64_t clock_us(clockid_t clock) {
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static struct bridge_now present(void) {
    return (struct bridge_now){clock_us(CLOCK_REALTIME), clock_us(CLOCK_MONOTONIC)};
}

static void channel_name(const struct session *session, enum bridge_channel channel,
                         char name[CHANNEL_BYTES]) {
    (void)snprintf(name, CHANNEL_BYTES, "%s%s", session->settings->prefix, bridge_channel_name(channel));
}

static bool publish(void *context, enum bridge_channel channel, const void *data, uint32_t bytes) {
    struct session *session = context;
    char name[CHANNEL_BYTES];
    channel_name(session, channel, name);
    const bool published = lcm_publish(session->lcm, name, data, bytes) == 0;
    const int64_t host_us = clock_us(CLOCK_REALTIME);
    if (published && session->frame_us > 0) {
        latency_add(&session->bridge.latency, host_us - session->frame_us);
    }
    session->bridge.counters.log_errors += bridge_logs_message(&session->logs, name, data, bytes, host_us);
    return published;
}

static bool send_frame(void *context, const struct hal_can_frame *frame) {
    struct session *session = context;
    if (!session->connected || session->bus.send(&session->bus, frame) != TRANSPORT_DONE) {
        return false;
    }
    session->bridge.counters.log_errors += bridge_logs_frame(&session->logs, frame, clock_us(CLOCK_REALTIME));
    return true;
}

static void on_message(struct session *session, enum bridge_channel channel, const lcm_recv_buf_t *buffer,
                       const char *name) {
    const struct bridge_now now = present();
    session->bridge.counters.log_errors +=
        bridge_logs_message(&session->logs, name, buffer->data, buffer->data_size, now.host_us);
    bridge_take_message(&session->bridge, channel, buffer->data, buffer->data_size, &now);
}

static void on_command(const lcm_recv_buf_t *buffer, const char *channel, void *session) {
    on_message(session, BRIDGE_CHANNEL_COMMAND, buffer, channel);
}

static void on_request(const lcm_recv_buf_t *buffer, const char *channel, void *session) {
    on_message(session, BRIDGE_CHANNEL_PARAMETER_REQUEST, buffer, channel);
}

static bool subscribe(struct session *session) {
    char command[CHANNEL_BYTES], request[CHANNEL_BYTES];
    channel_name(session, BRIDGE_CHANNEL_COMMAND, command);
    channel_name(session, BRIDGE_CHANNEL_PARAMETER_REQUEST, request);
    return lcm_subscribe(session->lcm, command, on_command, session) != NULL &&
           lcm_subscribe(session->lcm, request, on_request, session) != NULL;
}

/* --- the loop --- */

/* A CAN log has every frame; else those of other nodes need not come here at all. */
static bool open_bus(struct session *session, char *error, size_t error_bytes) {
    session->connected = transport_open(&session->bus, session->settings->bus, error, error_bytes);
    if (session->connected && session->settings->logs.can == NULL && session->bus.listen_to != NULL) {
        session->bus.listen_to(&session->bus, (uint32_t)session->settings->node);
    }
    return session->connected;
}

static void note_transport(struct session *session) {
    session->bridge.counters.frames_overflowed = session->overflowed + session->bus.overflowed;
    session->bridge.counters.frames_malformed = session->malformed + session->bus.malformed;
}

static void lose_bus(struct session *session, const struct bridge_now *now) {
    note_transport(session);
    session->overflowed += session->bus.overflowed;
    session->malformed += session->bus.malformed;
    transport_close(&session->bus);
    session->bus.overflowed = session->bus.malformed = 0;
    session->connected = false;
    session->pause_us = REOPEN_LEAST_US;
    session->reopen_us = now->monotonic_us + session->pause_us;
    bridge_lose_bus(&session->bridge, now);
    if (!session->settings->quiet) {
        printf("bus        %s is gone: %s; trying again\n", session->settings->bus, strerror(errno));
    }
}

static void reopen(struct session *session, const struct bridge_now *now) {
    char error[PROGRAM_ERROR_BYTES];
    if (session->connected || now->monotonic_us < session->reopen_us) {
        return;
    }
    if (open_bus(session, error, sizeof error)) {
        session->bridge.counters.bus_reopened++;
        if (!session->settings->quiet) {
            printf("bus        %s is back\n", session->settings->bus);
        }
    } else {
        session->pause_us = 2 * session->pause_us < REOPEN_MOST_US ? 2 * session->pause_us : REOPEN_MOST_US;
        session->reopen_us = now->monotonic_us + session->pause_us;
    }
}

static void log_report(struct session *session) {
    struct bridge *bridge = &session->bridge;
    if (bridge->report_is_new) {
        bridge->report_is_new = false;
        bridge->counters.log_errors +=
            bridge_logs_report(&session->logs, &bridge->assembly.report, &bridge->followed);
    }
}

static void take_frame(struct session *session, const struct transport_frame *frame,
                       const struct bridge_now *now) {
    session->frame_us = frame->time_us;
    bridge_take_frame(&session->bridge, frame, now);
    session->frame_us = 0;
    if (!frame->is_error) {
        session->bridge.counters.log_errors +=
            bridge_logs_frame(&session->logs, &frame->frame, frame->time_us);
    }
    log_report(session);
}

/* True: there are more. The clock is read once for all that is read in one go, and again for each that is
 * published. */
static bool take_frames(struct session *session) {
    const struct bridge_now now = present();
    struct transport_frame frame;
    enum transport_result result = session->connected ? TRANSPORT_DONE : TRANSPORT_NOTHING;
    for (int i = 0; result == TRANSPORT_DONE && i < FRAMES_A_TURN; i++) {
        result = session->bus.receive(&session->bus, &frame);
        if (result == TRANSPORT_DONE) {
            take_frame(session, &frame, &now);
        }
    }
    if (result == TRANSPORT_GONE) {
        lose_bus(session, &now);
    }
    return result == TRANSPORT_DONE;
}

static void take_messages(struct session *session) {
    for (int i = 0; i < MESSAGES_A_TURN && lcm_handle_timeout(session->lcm, 0) > 0; i++) {
    }
}

static void say_changes(struct session *session) {
    const struct bridge *bridge = &session->bridge;
    if (session->settings->quiet) {
        return;
    }
    if (session->was_heard != bridge->board_is_heard) {
        printf("board      %s\n", bridge->board_is_heard ? "is heard" : "fell silent");
    }
    if (session->protocol != bridge->protocol && bridge->protocol != MESSAGE_PROTOCOL) {
        printf("board      speaks version %u of the messages, this program %u: update one of them; until "
               "then the board "
               "refuses commands\n",
               bridge->protocol, MESSAGE_PROTOCOL);
    }
    session->protocol = bridge->protocol;
    if (session->was_open != bridge->gate.is_open) {
        printf("commands   %s\n",
               bridge->gate.is_open ? "pass" : "are refused until they pause or an arm comes");
    }
    session->was_heard = bridge->board_is_heard;
    session->was_open = bridge->gate.is_open;
    (void)fflush(stdout);
}

static void turn(struct session *session) {
    struct pollfd wait[2] = {{.fd = lcm_get_fileno(session->lcm), .events = POLLIN},
                             {.fd = session->connected ? session->bus.descriptor : -1, .events = POLLIN}};
    (void)poll(wait, 2, session->more ? 0 : WAKE_MS);
    session->more = (session->more || wait[1].revents != 0) && take_frames(session);
    if (wait[0].revents != 0) {
        take_messages(session);
    }
    const struct bridge_now now = present();
    reopen(session, &now);
    note_transport(session);
    bridge_step(&session->bridge, &now);
    session->bridge.counters.log_errors += bridge_logs_flush(&session->logs, now.monotonic_us);
    say_changes(session);
}

static void summarise(const struct session *session) {
    const struct bridge *bridge = &session->bridge;
#define BRIDGE_COUNTER(name, text) printf("%-20s %10" PRIu64 "  " text "\n", #name, bridge->counters.name);
    BRIDGE_COUNTERS(BRIDGE_COUNTER)
#undef BRIDGE_COUNTER
    printf("latency    median %" PRId64 " us, p99 %" PRId64
           " us from the kernel's time stamp until LCM has it\n",
           latency_of(&bridge->latency, 0.5), latency_of(&bridge->latency, 0.99));
    printf("clock      %zu windows, drift %.1f ppm\n", bridge->clock.windows, 1e6 * bridge->clock.drift);
}

static int print_json(const struct bridge *bridge) {
    json_t *object = json_object(), *counters = json_object();
#define BRIDGE_COUNTER(name, text)                                                                           \
    (void)json_object_set_new(counters, #name, json_integer((json_int_t)bridge->counters.name));
    BRIDGE_COUNTERS(BRIDGE_COUNTER)
#undef BRIDGE_COUNTER
    (void)json_object_set_new(object, "counters", counters);
    (void)json_object_set_new(object, "latency_median_us", json_integer(latency_of(&bridge->latency, 0.5)));
    (void)json_object_set_new(object, "latency_p99_us", json_integer(latency_of(&bridge->latency, 0.99)));
    (void)json_object_set_new(object, "clock_windows", json_integer((json_int_t)bridge->clock.windows));
    (void)json_object_set_new(object, "clock_drift_ppm", json_real(1e6 * bridge->clock.drift));
    const int failed = json_dumpf(object, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(object);
    printf("\n");
    return failed == 0 ? EXIT_OK : program_fail(EXIT_OUTPUT, "cannot write to standard output");
}

static int run(struct session *session) {
    const int64_t end_us = session->settings->duration_s > 0.0
                               ? clock_us(CLOCK_MONOTONIC) + (int64_t)(1e6 * session->settings->duration_s)
                               : INT64_MAX;
    char error[PROGRAM_ERROR_BYTES];
    program_catch_interrupt();
    while (program_interrupted == 0 && clock_us(CLOCK_MONOTONIC) < end_us) {
        turn(session);
    }
    const struct bridge_now now = present();
    bridge_vent(&session->bridge, &now);
    const bool whole = bridge_logs_close(&session->logs, error, sizeof error);
    if (!whole) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    if (!session->settings->json) {
        summarise(session);
    } else if (print_json(&session->bridge) != EXIT_OK) {
        return EXIT_OUTPUT;
    }
    return session->settings->duration_s > 0.0 && program_interrupted != 0 ? EXIT_INTERRUPTED : EXIT_OK;
}

/* --- opening --- */

static int open_logs(struct session *session) {
    const struct settings *settings = session->settings;
    struct run_log_metadata metadata = {.module = "", .rate_hz = 200.0, .note = "bridge"};
    char error[PROGRAM_ERROR_BYTES], found[PROGRAM_PATH_BYTES];
    struct table_file table;
    if (settings->logs.run != NULL) {
        const int code = table_file_open(&table, bus_table_path(settings->table, found), NULL);
        if (code != EXIT_OK) {
            return code;
        }
        metadata.module = table.table.module.name;
        metadata.table_hash = table.table.module.inputs_hash;
    }
    const bool open =
        bridge_logs_open(&session->logs, &settings->logs, settings->bus, &metadata, error, sizeof error);
    if (settings->logs.run != NULL) {
        table_file_close(&table);
    }
    return open ? EXIT_OK : program_fail(EXIT_OUTPUT, "%s", error);
}

static int open_lcm(struct session *session) {
    session->lcm = lcm_create(session->settings->url);
    if (session->lcm == NULL || !subscribe(session)) {
        return program_fail(EXIT_BUS,
                            "LCM at %s: cannot be opened. An URL looks like " URL_DEFAULT
                            "; multicast needs a route (as root: ip route add 224.0.0.0/4 dev lo)",
                            session->settings->url != NULL ? session->settings->url : "its default URL");
    }
    return EXIT_OK;
}

static int use(struct session *session) {
    const struct bridge_out out = {session, publish, send_frame};
    const struct bridge_now now = present();
    char error[PROGRAM_ERROR_BYTES];
    bridge_init(&session->bridge, (uint32_t)session->settings->node, &out, &now);
    if (!open_bus(session, error, sizeof error)) {
        return program_fail(EXIT_BUS, "%s", error);
    }
    int code = open_logs(session);
    code = code == EXIT_OK ? open_lcm(session) : code;
    code = code == EXIT_OK ? run(session) : code;
    if (session->lcm != NULL) {
        lcm_destroy(session->lcm);
    }
    transport_close(&session->bus);
    return code;
}

int cli_bridge(int argc, char **argv) {
    static struct session session;
    struct settings settings = {.bus = "can0", .prefix = PREFIX_DEFAULT, .node = 1};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &settings) != 0) {
        return EXIT_USAGE;
    }
    memset(&session, 0, sizeof session);
    session.settings = &settings;
    return use(&session);
}
