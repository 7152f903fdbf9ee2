/* tribend bend: bend the tip by an angle in a direction, in closed loop. */
#include <stdio.h>

#include "cli/commands.h"
#include "units/units.h"

struct arguments {
    struct bus_options bus;
    double bend_rad;
    double direction_rad;
    double co_contraction_pa;
};

static const struct argp_option options[] = {
    {"toward", 'w', "ANGLE", 0, "where the tip moves, from +x counter-clockwise (default 0deg)", 0},
    {"co-contraction", 'c', "PRESSURE", 0, "least pressure of every chamber (default 0kPa)", 0},
    {"json", 'j', NULL, 0, "for programs: one JSON object, in place of the words", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'w':
        cli_quantity(state, "--toward", UNITS_ANGLE, argument, &arguments->direction_rad);
        return 0;
    case 'c':
        cli_quantity(state, "--co-contraction", UNITS_PRESSURE, argument, &arguments->co_contraction_pa);
        if (!(arguments->co_contraction_pa >= 0.0)) {
            argp_error(state, "--co-contraction: %s is negative", argument);
        }
        return 0;
    case 'j':
        arguments->bus.json = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one bend at a time, '%s' is too much", argument);
        }
        cli_quantity(state, "the bend", UNITS_ANGLE, argument, &arguments->bend_rad);
        if (!(arguments->bend_rad >= 0.0)) {
            argp_error(state, "the bend: %s is negative; a bend the other way is --toward an angle turned by 180deg",
                       argument);
        }
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "how far? For example 60deg");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {options, parse, "BEND",
                                   "Bend the tip to BEND in a direction and keep it there in closed loop, then vent.\v"
                                   "Examples:\n"
                                   "  tribend bend 60deg --toward 30deg --for 5s\n"
                                   "  tribend bend 60deg --json",
                                   children, NULL, NULL};

int cli_bend(int argc, char **argv) {
    struct arguments arguments = {.bend_rad = 0.0};
    bus_options_init(&arguments.bus);
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    const struct controller_command command = {.kind = COMMAND_BEND,
                                               .bend_rad = (float)arguments.bend_rad,
                                               .direction_rad = (float)arguments.direction_rad,
                                               .co_contraction_pa = (float)arguments.co_contraction_pa};
    return run_command(&arguments.bus, &command);
}
