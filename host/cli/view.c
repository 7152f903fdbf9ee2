/* tribend view: the live view, one page for a browser. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "cli/commands.h"
#include "log/run_log.h"
#include "units/units.h"
#include "view/view_assets.h"
#include "view/view_pump.h"
#include "view/view_server.h"

#define PORT 8642
#define PORT_MOST 65535
#define LEASE_S 1.0
#define LEASE_LEAST_S 0.3
#define LEASE_MOST_S 10.0
#define IDLE_S 120.0
#define LOOK_NS 50000000
#define NOTE_BYTES 64

enum { TOKEN_FILE = 0x100, LEASE };

struct arguments {
    struct bus_options bus;
    const char *listen;
    const char *token_file;
    int port;
    double lease_s;
};

static const struct argp_option options[] = {
    {"listen", 'l', "ADDRESS", 0,
     "address to serve on (default 127.0.0.1); any but this machine's own needs a token, which is made "
     "and printed",
     0},
    {"port", 'p', "N", 0, "port to serve on, 0 for any free one (default 8642)", 0},
    {"token-file", TOKEN_FILE, "FILE", 0,
     "the token is the first line of this file, which nobody else may read", 0},
    {"lease", LEASE, "TIME", 0,
     "a page that is armed and falls silent for so long loses the arm, and the module vents (default 1s)", 0},
    {0}};

static void parse_lease(struct argp_state *state, const char *text, struct arguments *arguments) {
    cli_quantity(state, "--lease", UNITS_TIME, text, &arguments->lease_s);
    if (!(arguments->lease_s >= LEASE_LEAST_S && arguments->lease_s <= LEASE_MOST_S)) {
        argp_error(state, "--lease: %s is not between %gs and %gs", text, LEASE_LEAST_S, LEASE_MOST_S);
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'l':
        arguments->listen = argument;
        return 0;
    case 'p':
        arguments->port = cli_whole_number(state, "--port", argument, 0, PORT_MOST);
        return 0;
    case TOKEN_FILE:
        arguments->token_file = argument;
        return 0;
    case LEASE:
        parse_lease(state, argument, arguments);
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "view takes no argument, '%s' is too much", argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {
    options,
    parse,
    "",
    "Serve the live view, a page for a browser: pressures, bend and direction against command, the module "
    "in 3-D, faults, the gap monitor, and sliders behind an arm switch. Runs until Ctrl-C, or for the time "
    "of --for; vents at the end.\v"
    "Examples:\n"
    "  tribend view\n"
    "  tribend view --listen 192.168.1.20 --token-file ~/.tribend-token\n"
    "The page commands only while its arm switch is on. Where it is closed, hidden or cut off, the module "
    "vents. Traffic is not encrypted: over a network that others use, tunnel it with ssh -L.",
    children,
    NULL,
    NULL};

/* --- the link, with what the options put before and after it --- */

struct session {
    const struct arguments *arguments;
    struct bus bus;
    struct run_log_writer log;
    struct controller_command command; /* sent last, for the log */
    struct view_hub hub;
    struct view_server server;
    struct view_pump pump;
};

static bool session_receive(void *context, struct link_report *report) {
    struct session *session = context;
    struct bus *bus = &session->bus;
    bus_drill(bus, &session->arguments->bus);
    if (!bus->link.receive(bus->link.context, report)) {
        return false;
    }
    if (session->arguments->bus.record != NULL) {
        run_log_append(&session->log, report, &session->command);
    }
    return true;
}

static bool session_send(void *context, const struct controller_command *command) {
    struct session *session = context;
    if (sim_drill_silences_host(&session->arguments->bus.drill, session->pump.last.time_us)) {
        return true;
    }
    session->command = *command;
    return session->bus.link.send(session->bus.link.context, command);
}

/* --- the course of it --- */

static int make_access(const struct arguments *arguments, struct view_access *access) {
    char error[PROGRAM_ERROR_BYTES];
    access->loopback = view_address_is_loopback(arguments->listen) && arguments->token_file == NULL;
    if (arguments->token_file != NULL) {
        return view_token_read(arguments->token_file, access->token, error, sizeof error)
                   ? EXIT_OK
                   : program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    return view_token_make(access->token)
               ? EXIT_OK
               : program_fail(EXIT_OUTPUT, "the kernel gave no random bytes for a token");
}

static void print_address(const struct arguments *arguments, const struct view_server *server) {
    const bool six = strchr(arguments->listen, ':') != NULL;
    printf("view      http://%s%s%s:%u/%s%s\n", six ? "[" : "", arguments->listen, six ? "]" : "",
           server->port, server->access.loopback ? "" : "#token=",
           server->access.loopback         ? ""
           : arguments->token_file != NULL ? "TOKEN"
                                           : server->access.token);
    (void)fflush(stdout);
}

static void wait_for_the_end(const struct session *session) {
    const struct timespec look = {.tv_nsec = LOOK_NS};
    const double duration_s = session->arguments->bus.duration_s;
    const int64_t end_us = duration_s > 0.0 ? view_hub_now_us() + (int64_t)(1e6 * duration_s) : INT64_MAX;
    while (program_interrupted == 0 && !atomic_load(&session->pump.ended) && view_hub_now_us() < end_us) {
        (void)nanosleep(&look, NULL);
    }
}

static int summarise(struct session *session) {
    const struct view_pump *pump = &session->pump;
    printf("requests  %" PRIu64 " refused; events that could not be made: %" PRIu64
           "; fell behind the clock %u times, lost the "
           "board %u times\n",
           session->server.refused, session->hub.events_unmade, pump->slipped, pump->lost);
    if (pump->gone) {
        return bus_gone(&session->bus, &session->arguments->bus);
    }
    if (!pump->vented) {
        return pump->lost > 0 ? bus_gone(&session->bus, &session->arguments->bus)
                              : program_fail(EXIT_FAULT, "the chambers did not vent");
    }
    printf("vented\n");
    return program_interrupted != 0 && session->arguments->bus.duration_s > 0.0 ? EXIT_INTERRUPTED : EXIT_OK;
}

/* With the server running: the pump, until the end. */
static int pump(struct session *session) {
    const char *bus = session->arguments->bus.bus;
    session->pump.hub = &session->hub;
    session->pump.link = (struct link){.context = session, .send = session_send, .receive = session_receive};
    session->pump.comes_back = session->bus.can != NULL;
    session->pump.paced = session->bus.can == NULL;
    session->pump.wake = view_server_wake;
    session->pump.wake_context = &session->server;
    program_catch_interrupt();
    if (!view_pump_start(&session->pump)) {
        return program_fail(EXIT_OUTPUT, "no thread to be had for bus %s", bus);
    }
    print_address(session->arguments, &session->server);
    wait_for_the_end(session);
    view_pump_stop(&session->pump);
    return summarise(session);
}

static int serve(struct session *session) {
    const struct arguments *arguments = session->arguments;
    const struct bend_table *table = &session->bus.file.table;
    struct view_access access = {.loopback = false};
    char error[PROGRAM_ERROR_BYTES];
    int code = make_access(arguments, &access);
    if (code != EXIT_OK) {
        return code;
    }
    char *module = view_event_module(table, arguments->bus.bus, &session->hub.arm.parameters);
    if (module == NULL) {
        return program_fail(EXIT_OUTPUT, "out of memory");
    }
    if (view_server_open(&session->server, &session->hub, &access, module, arguments->listen,
                         (uint16_t)arguments->port, error, sizeof error)) {
        code = pump(session);
    } else {
        code = program_fail(EXIT_OUTPUT, "%s", error);
    }
    view_server_close(&session->server);
    return code;
}

static int record(struct session *session) {
    const struct bus_options *bus_options = &session->arguments->bus;
    const struct bend_table_module *module = &session->bus.file.table.module;
    char error[PROGRAM_ERROR_BYTES], note[NOTE_BYTES];
    (void)snprintf(note, sizeof note, "live view, bus %.40s", bus_options->bus);
    const struct run_log_metadata metadata = {.module = module->name,
                                              .table_hash = module->inputs_hash,
                                              .rate_hz = session->bus.rate_hz,
                                              .note = note};
    if (!run_log_create(&session->log, bus_options->record, &metadata, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    const int code = serve(session);
    if (!run_log_finish(&session->log, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    printf("wrote     %s\n", bus_options->record);
    return code;
}

static int open_and_serve(struct session *session) {
    const struct arguments *arguments = session->arguments;
    const struct view_words words = {.faults = cli_describe_faults, .warnings = cli_describe_warnings};
    const struct view_arm_parameters parameters = {.lease_us = (int64_t)(1e6 * arguments->lease_s),
                                                   .idle_us = (int64_t)(1e6 * IDLE_S)};
    int code = bus_open(&session->bus, &arguments->bus);
    if (code != EXIT_OK) {
        return code;
    }
    printf("module    %s, table %s\n", session->bus.file.table.module.name, session->bus.table_path);
    if (view_hub_open(&session->hub, &session->bus.file.table, &words, &parameters)) {
        code = arguments->bus.record != NULL ? record(session) : serve(session);
        view_hub_close(&session->hub);
    } else {
        code = program_fail(EXIT_OUTPUT, "no lock to be had");
    }
    bus_close(&session->bus);
    return code;
}

int cli_view(int argc, char **argv) {
    static struct session session;
    struct arguments arguments = {.listen = "127.0.0.1", .port = PORT, .lease_s = LEASE_S};
    bus_options_init(&arguments.bus);
    arguments.bus.needs_table = true;
    arguments.bus.duration_s = 0.0; /* until Ctrl-C */
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    if (!view_assets_complete()) {
        return program_fail(
            EXIT_OUTPUT,
            "this program was built without the page's plotting library: install npm, then make again");
    }
    session.arguments = &arguments;
    return open_and_serve(&session);
}
