/* tribend status: what the controller sees and which faults it has; commands nothing. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"

#define DEGREES (180.0 / M_PI)
#define LISTEN_S 0.1 /* unless --for says otherwise */
#define WORDS_BYTES 512

static error_t parse(int key, char *argument, struct argp_state *state) {
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = state->input;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "status takes no argument, '%s' is too much", argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {NULL, parse, "",
                                   "Say what the controller sees, which faults it has, and where the module does not do what its model "
                                   "says. It listens for 0.1 s, unless --for says otherwise.",
                                   children, NULL, NULL};

static void print_status(const struct bus *bus, const struct bus_options *options, const struct link_report *report) {
    const struct controller_status *status = &report->status;
    const struct bend_table_module *module = &bus->file.table.module;
    char words[WORDS_BYTES];
    printf("bus        %s\n", options->bus);
    printf("table      %s, module %s, up to %.0f deg and %.1f kPa\n", bus->table_path, module->name,
           DEGREES * (double)module->bend_limit_rad, 1e-3 * (double)module->working_pressure_pa);
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
           1e3 * (double)report->tip_position_m[1], 1e3 * (double)report->tip_position_m[2], status->tip_samples,
           status->tip_rejected);
}

int cli_status(int argc, char **argv) {
    static struct bus bus;
    struct bus_options options;
    struct link_report report;
    bus_options_init(&options);
    options.duration_s = LISTEN_S;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &options) != 0) {
        return EXIT_USAGE;
    }
    const int code = bus_open(&bus, &options);
    if (code != EXIT_OK) {
        return code;
    }
    memset(&report, 0, sizeof report);
    do {
        sim_drill_apply(&options.drill, &bus.sim, bus.controller_image, bus.file.size);
        if (!bus.link.receive(bus.link.context, &report)) {
            bus_close(&bus);
            return program_fail(EXIT_OUTPUT, "the controller on bus %s went away", options.bus);
        }
    } while (1e-6 * (double)report.time_us < options.duration_s);
    print_status(&bus, &options, &report);
    bus_close(&bus);
    return report.status.faults == 0u ? EXIT_OK : EXIT_FAULT;
}
