/* tribend status: what the controller sees and which faults it has; commands nothing. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"
#include "cli/report_json.h"

#define DEGREES (180.0 / M_PI)
#define LISTEN_S 0.1     /* unless --for says otherwise */
#define LISTEN_BUS_S 0.6 /* the slowest telemetry comes every 0.5 s */
#define WORDS_BYTES 512

struct arguments {
    struct bus_options bus;
    bool json;
};

static const struct argp_option options[] = {{"json", 'j', NULL, 0, "for programs: one JSON object", 0}, {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'j':
        arguments->json = true;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "status takes no argument, '%s' is too much", argument);
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
    "Say what the controller sees, which faults it has, and where the module does not do what its model "
    "says. It listens for 0.1 s (0.6 s on a bus), unless --for says otherwise.\v"
    "Examples:\n"
    "  tribend status --bus can0 --node 2\n"
    "  tribend status --json",
    children,
    NULL,
    NULL};

static void print_table(const struct bus *bus) {
    const struct bend_table_module *module = &bus->file.table.module;
    if (bus->can == NULL) {
        printf("table      %s, module %s, up to %.0f deg and %.1f kPa\n", bus->table_path, module->name,
               DEGREES * (double)module->bend_limit_rad, 1e-3 * (double)module->working_pressure_pa);
    } else {
        printf("board      node %u, protocol %u, firmware %08" PRIx32 "\n", bus->can->node,
               bus->identity.protocol, bus->identity.firmware);
        printf("table      on the board, module %s, %016" PRIx64 "\n",
               *bus->module_name != '\0' ? bus->module_name : "none", bus->table_hash);
    }
}

/* What was lost and left: only what is not zero, but for how much came. */
static void print_counters(struct bus *bus) {
    struct can_link_counters counters;
    can_link_count(bus->can, &counters);
    printf("bus        %" PRIu64 " frames received, %" PRIu64 " sent", counters.received, counters.sent);
#define PRINT_COUNTER(name, text)                                                                            \
    if (counters.name > 0 && strcmp(#name, "received") != 0 && strcmp(#name, "sent") != 0 &&                 \
        strcmp(#name, "decoded") != 0) {                                                                     \
        printf("\n           %" PRIu64 " %s", counters.name, text);                                          \
    }
    CAN_LINK_COUNTERS(PRINT_COUNTER)
#undef PRINT_COUNTER
    printf("\n");
}

static void print_status(struct bus *bus, const struct bus_options *bus_options,
                         const struct link_report *report) {
    const struct controller_status *status = &report->status;
    char words[WORDS_BYTES];
    printf("bus        %s\n", bus_options->bus);
    print_table(bus);
    printf("state      %s\n", supervisor_state_name(status->state));
    cli_describe_faults(status->faults, words, sizeof words);
    printf("faults     %s\n", words);
    cli_describe_warnings(status, words, sizeof words);
    printf("warnings   %s\n", words);
    printf("pressures  %.3f %.3f %.3f kPa, supply %.2f kPa\n", 1e-3 * (double)report->pressure_pa[0],
           1e-3 * (double)report->pressure_pa[1], 1e-3 * (double)report->pressure_pa[2],
           1e-3 * (double)report->supply_pa);
    printf("bend       %.2f deg toward %.1f deg, %s\n", DEGREES * (double)status->bend_rad,
           DEGREES * (double)status->direction_rad,
           status->bend_is_measured ? "measured" : "predicted from the pressures");
    printf("tip        %.2f %.2f %.2f mm, %u samples, %u rejected\n", 1e3 * (double)report->tip_position_m[0],
           1e3 * (double)report->tip_position_m[1], 1e3 * (double)report->tip_position_m[2],
           status->tip_samples, status->tip_rejected);
    if (bus->can != NULL) {
        print_counters(bus);
    }
}

static int print_json(struct bus *bus, const struct link_report *report) {
    return report_json_print(report_json(bus, report));
}

/* Until the time is over; an exit code. */
static int listen_for(struct bus *bus, const struct bus_options *bus_options, struct link_report *report) {
    int64_t until_us = INT64_MAX;
    do {
        bus_drill(bus, bus_options);
        if (!bus->link.receive(bus->link.context, report)) {
            return bus_gone(bus, bus_options);
        }
        if (until_us == INT64_MAX) {
            const int64_t start_us = bus->can != NULL ? report->time_us : 0;
            until_us = start_us + (int64_t)(1e6 * bus_options->duration_s);
        }
    } while (report->time_us < until_us);
    return EXIT_OK;
}

static int show(struct bus *bus, void *input) {
    struct arguments *arguments = input;
    if (arguments->bus.duration_s <= 0.0) {
        arguments->bus.duration_s = bus->can != NULL ? LISTEN_BUS_S : LISTEN_S;
    }
    struct link_report report;
    memset(&report, 0, sizeof report);
    int code = listen_for(bus, &arguments->bus, &report);
    if (code == EXIT_OK && arguments->json) {
        code = print_json(bus, &report);
    } else if (code == EXIT_OK) {
        print_status(bus, &arguments->bus, &report);
    }
    return code == EXIT_OK && report.status.faults != 0u ? EXIT_FAULT : code;
}

int cli_status(int argc, char **argv) {
    struct arguments arguments = {.json = false};
    bus_options_init(&arguments.bus);
    arguments.bus.duration_s = 0.0;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    return bus_run(&arguments.bus, show, &arguments);
}
