/* tribend pressure: hold three chamber pressures. */
#include <stdio.h>

#include "cli/commands.h"
#include "units/units.h"

struct arguments {
    struct bus_options bus;
    double pressure_pa[3];
};

static const struct argp_option options[] = {
    {"json", 'j', NULL, 0, "for programs: one JSON object, in place of the words", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'j':
        arguments->bus.json = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 2) {
            argp_error(state, "three pressures, one a chamber: '%s' is too much", argument);
            return 0;
        }
        cli_quantity(state, "a pressure", UNITS_PRESSURE, argument, &arguments->pressure_pa[state->arg_num]);
        if (!(arguments->pressure_pa[state->arg_num] >= 0.0)) {
            argp_error(state, "a pressure: %s is below ambient; the valves can fill and vent only", argument);
        }
        return 0;
    case ARGP_KEY_END:
        if (state->arg_num < 3) {
            argp_error(state, "three pressures, one a chamber, for example: 40mbar 0mbar 0mbar");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {options, parse, "P1 P2 P3",
                                   "Hold the pressures P1, P2 and P3 in chambers 1, 2 and 3, then vent.\v"
                                   "Example: tribend pressure 40mbar 0mbar 0mbar --for 3s",
                                   children, NULL, NULL};

int cli_pressure(int argc, char **argv) {
    struct arguments arguments = {.pressure_pa = {0.0, 0.0, 0.0}};
    bus_options_init(&arguments.bus);
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    struct controller_command command = {.kind = COMMAND_PRESSURE};
    for (size_t c = 0; c < 3; c++) {
        command.pressure_pa[c] = (float)arguments.pressure_pa[c];
    }
    return run_command(&arguments.bus, &command);
}
