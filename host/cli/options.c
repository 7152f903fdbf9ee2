/* Options and the opening of a bus, common to the subcommands that talk to a controller. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands.h"
#include "program/output_file.h"
#include "units/units.h"

#define REFERENCE_TABLE "tables/paper-semicircle.tbt"
#define THREADS_MOST 1024
#define DURATION_MOST_S 86400.0

static const struct argp_option option_list[] = {
    {"for", 'f', "TIME", 0, "how long, such as 5s (default 5s)", 1},
    {"bus", 'b', "BUS", 0,
     "where the controller is: sim, controller and plant in this process (default); can0 or another CAN "
     "interface; "
     "slcan:/dev/ttyACM0[@BITRATE]; unix:PATH, an emulated board",
     1},
    {"node", 'n', "N", 0, "node id of the board on the bus, 1 to 15 (default 1)", 1},
    {"on-interrupt", 'I', "vent|hold", 0,
     "what Ctrl-C does: vent (default), or hold until it is pressed again", 1},
    {"table", 't', "FILE", 0, "bend table (default $TRIBEND_TABLE, else " REFERENCE_TABLE ")", 1},
    {"module", 'm', "NAME", 0, "refuse a table of any other module", 1},
    {"record", 'r', "FILE", 0, "write a run log (CSV)", 1},
    {"seed", 's', "N", 0, "of the simulation's noise (default 1)", 2},
    {"effect", 'e', "NAME[:P=V,..]", 0, "add a real-world effect to the plant; may be repeated", 2},
    {"calibration", 'k', "FILE", 0,
     "the simulated module is as this calibration says (see docs/calibration.md)", 2},
    {"controller-calibration", 'K', "FILE", 0, "the controller is told of this calibration", 2},
    {"drill", 'd', "FAULT@TIME", 0, "put a fault into the simulation, such as tip-lost@2s", 2},
    {"quiet", 'q', NULL, 0, "no progress lines", 1},
    {0}};

void cli_quantity(struct argp_state *state, const char *what, int kind, const char *text, double *value) {
    char error[PROGRAM_ERROR_BYTES];
    if (!units_parse((enum units_kind)kind, text, value, error, sizeof error)) {
        argp_error(state, "%s: %s", what, error);
    }
}

int cli_whole_number(struct argp_state *state, const char *option, const char *text, int least, int most) {
    char *end = NULL;
    const long number = strtol(text, &end, 10);
    if (end == text || *end != '\0' || number < least || number > most) {
        argp_error(state, "%s: '%s' is not a whole number from %d to %d", option, text, least, most);
        return least;
    }
    return (int)number;
}

int cli_check_outputs(const char *const *path, size_t count) {
    char error[PROGRAM_ERROR_BYTES];
    for (size_t i = 0; i < count; i++) {
        if (path[i] != NULL && !output_file_can_write(path[i], error, sizeof error)) {
            return program_fail(EXIT_OUTPUT, "%s", error);
        }
    }
    return EXIT_OK;
}

int cli_threads(struct argp_state *state, const char *text) {
    return cli_whole_number(state, "--threads", text, 1, THREADS_MOST);
}

static void parse_duration(struct argp_state *state, const char *text, struct bus_options *options) {
    cli_quantity(state, "--for", UNITS_TIME, text, &options->duration_s);
    if (!(options->duration_s > 0.0) || !(options->duration_s <= DURATION_MOST_S)) {
        argp_error(state, "--for: %s is not between 0 and a day", text);
    }
}

static void parse_seed(struct argp_state *state, const char *text, struct bus_options *options) {
    char *end = NULL;
    errno = 0;
    options->seed = strtoull(text, &end, 10);
    if (errno != 0 || end == text || *end != '\0' || strchr(text, '-') != NULL) {
        argp_error(state, "--seed: '%s' is not a whole number from 0 on", text);
    }
}

static void parse_effect(struct argp_state *state, const char *text, struct bus_options *options) {
    char error[PROGRAM_ERROR_BYTES];
    if (options->effect_count == PLANT_EFFECTS_MAX) {
        argp_error(state, "--effect: at most %d effects", PLANT_EFFECTS_MAX);
    } else if (!effect_parse(text, &options->effect[options->effect_count++], error, sizeof error)) {
        argp_error(state, "--effect: %s", error);
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct bus_options *options = state->input;
    char error[PROGRAM_ERROR_BYTES];
    switch (key) {
    case 'f':
        parse_duration(state, argument, options);
        return 0;
    case 'b':
        options->bus = argument;
        return 0;
    case 'n':
        options->node = (uint32_t)cli_whole_number(state, "--node", argument, 1, (int)MESSAGE_NODE_MOST);
        return 0;
    case 'I':
        options->hold_on_interrupt = strcmp(argument, "hold") == 0;
        if (!options->hold_on_interrupt && strcmp(argument, "vent") != 0) {
            argp_error(state, "--on-interrupt: '%s' is neither vent nor hold", argument);
        }
        return 0;
    case 't':
        options->table = argument;
        return 0;
    case 'm':
        options->module = argument;
        return 0;
    case 'r':
        options->record = argument;
        return 0;
    case 's':
        options->sim_only = "--seed";
        parse_seed(state, argument, options);
        return 0;
    case 'e':
        options->sim_only = "--effect";
        parse_effect(state, argument, options);
        return 0;
    case 'k':
        options->sim_only = "--calibration";
        options->calibration = argument;
        return 0;
    case 'K':
        options->sim_only = "--controller-calibration";
        options->controller_calibration = argument;
        return 0;
    case 'd':
        options->sim_only = "--drill";
        if (!sim_drill_parse(argument, &options->drill, error, sizeof error)) {
            argp_error(state, "--drill: %s", error);
        }
        return 0;
    case 'q':
        options->quiet = true;
        return 0;
    case ARGP_KEY_END:
        if (options->sim_only != NULL && strcmp(options->bus, "sim") != 0) {
            argp_error(state, "%s is for the simulation: it does nothing on bus %s", options->sim_only,
                       options->bus);
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

const struct argp bus_options_parser = {.options = option_list, .parser = parse};

void bus_options_init(struct bus_options *options) {
    memset(options, 0, sizeof *options);
    options->bus = "sim";
    options->node = CAN_LINK_NODE_DEFAULT;
    options->seed = 1;
    options->duration_s = 5.0;
}

const char *bus_table_path(const char *table, char found[PROGRAM_PATH_BYTES]) {
    const char *path = table != NULL ? table : getenv("TRIBEND_TABLE");
    if (path == NULL || *path == '\0') {
        program_find(REFERENCE_TABLE, found);
        path = found;
    }
    return path;
}

/* The module as --calibration says. Returns an exit code. */
static int calibrate_module(const struct bus *bus, const struct bus_options *options,
                            struct calibration *calibration, struct sim_link_setup *setup) {
    char error[PROGRAM_ERROR_BYTES];
    if (options->calibration == NULL) {
        return EXIT_OK;
    }
    if (!calibration_read(options->calibration, bus->file.table.module.name, calibration, error,
                          sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    calibration_scale_plant(calibration, &setup->sim.plant);
    return EXIT_OK;
}

/* The controller as --controller-calibration says. Returns an exit code. */
static int calibrate_controller(struct bus *bus, const struct bus_options *options,
                                struct sim_link_setup *setup) {
    const char *path = options->controller_calibration;
    char error[PROGRAM_ERROR_BYTES];
    struct calibration calibration;
    if (path == NULL) {
        return EXIT_OK;
    }
    if (!calibration_read(path, bus->file.table.module.name, &calibration, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    if (!calibrated_controller_make(&bus->controller, &calibration, &bus->file.table, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s: %s", path, error);
    }
    bus->controller_calibrated = true;
    bus->controller_image = bus->controller.table.image;
    setup->controller_table = &bus->controller.table.table;
    setup->controller = bus->controller.parameters;
    for (size_t i = 0; i < bus->controller.notes; i++) {
        fprintf(stderr, "note      %s\n", bus->controller.note[i]);
    }
    return EXIT_OK;
}

static int add_effects(struct bus *bus, const struct bus_options *options,
                       const struct calibration *calibration) {
    struct sim *sim = &bus->sim.sim;
    if (!calibration_add_effects(calibration, 0.0, sim)) {
        return program_fail(EXIT_USAGE, "the simulation has no room for the %zu effects of %s",
                            calibration->effects, options->calibration);
    }
    for (size_t i = 0; i < options->effect_count; i++) {
        if (!sim_add_effect(sim, &options->effect[i])) {
            return program_fail(EXIT_USAGE, "the simulation has no room for effect '%s'",
                                options->effect[i].kind->name);
        }
    }
    return EXIT_OK;
}

int bus_open(struct bus *bus, const struct bus_options *options) {
    struct sim_link_setup setup;
    struct calibration calibration = {.effects = 0};
    memset(bus, 0, sizeof *bus);
    if (strcmp(options->bus, "sim") != 0) {
        return bus_open_can(bus, options);
    }
    bus->rate_hz = 1e6 / (double)CONTROLLER_STEP_US;
    bus->table_path = bus_table_path(options->table, bus->found);
    int code = table_file_open(&bus->file, bus->table_path, options->module);
    if (code != EXIT_OK) {
        return code;
    }
    bus->module_name = bus->file.table.module.name;
    bus->table_hash = bus->file.table.module.inputs_hash;
    sim_link_default_setup(&setup, &bus->file.table, options->seed);
    bus->controller_image = bus->file.bytes;
    code = calibrate_module(bus, options, &calibration, &setup);
    code = code == EXIT_OK ? calibrate_controller(bus, options, &setup) : code;
    sim_link_open_setup(&bus->sim, &setup, &bus->link);
    code = code == EXIT_OK ? add_effects(bus, options, &calibration) : code;
    if (code != EXIT_OK) {
        bus_close(bus);
    }
    return code;
}

void bus_close(struct bus *bus) {
    bus->link.close(bus->link.context);
    if (bus->controller_calibrated) {
        calibrated_controller_free(&bus->controller);
    }
    if (bus->file.bytes != NULL) {
        table_file_close(&bus->file);
    }
}

int bus_run(const struct bus_options *options, int (*work)(struct bus *bus, void *input), void *input) {
    static struct bus bus; /* with a simulation in it: too large for the stack */
    int code = bus_open(&bus, options);
    if (code == EXIT_OK) {
        code = work(&bus, input);
        bus_close(&bus);
    }
    return code;
}

struct alone {
    const char *name;
    struct bus_options *options;
};

static error_t parse_alone(int key, char *argument, struct argp_state *state) {
    const struct alone *alone = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = alone->options;
        return 0;
    case 'j':
        alone->options->json = true;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "%s takes no argument, '%s' is too much", alone->name, argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

int bus_parse_alone(const char *name, const char *usage, int argc, char **argv, struct bus_options *options) {
    const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
    const struct argp_option option[] = {{"json", 'j', NULL, 0, "for programs: one JSON object", 0}, {0}};
    const struct argp parser = {option, parse_alone, "", usage, children, NULL, NULL};
    struct alone alone = {name, options};
    argp_err_exit_status = EXIT_USAGE;
    return argp_parse(&parser, argc, argv, 0, NULL, &alone) == 0 ? EXIT_OK : EXIT_USAGE;
}

void bus_drill(struct bus *bus, const struct bus_options *options) {
    if (bus->can == NULL) {
        sim_drill_apply(&options->drill, &bus->sim, bus->controller_image, bus->file.size);
    }
}

int bus_gone(struct bus *bus, const struct bus_options *options) {
    const double silence_s = bus->can == NULL ? 0.0 : 1e-6 * (double)can_link_silence_us(bus->can);
    return program_fail(
        EXIT_BUS,
        "the board on bus %s went away: nothing came for %.1f s. While it hears nothing, it vents by "
        "itself on its command timeout",
        options->bus, silence_s);
}

static void append(char *text, size_t bytes, const char *word) {
    const size_t used = strlen(text);
    (void)snprintf(text + used, bytes - used, "%s%s", used > 0 ? ", " : "", word);
}

void cli_describe_faults(uint32_t faults, char *text, size_t bytes) {
    *text = '\0';
    for (int f = 0; f < (int)FAULT_COUNT; f++) {
        if ((faults & (1u << (unsigned)f)) != 0u) {
            append(text, bytes, supervisor_fault_describe((enum supervisor_fault)f)->name);
        }
    }
    if (*text == '\0') {
        append(text, bytes, "none");
    }
}

static void append_gap(char *text, size_t bytes, const struct gap_monitor_report *gap) {
    char words[256], chamber[32] = "";
    if (gap->chamber > 0) {
        (void)snprintf(chamber, sizeof chamber, "chamber %u, ", gap->chamber);
    }
    (void)snprintf(words, sizeof words, "gap between module and model in %s%s", chamber,
                   gap_monitor_stage_text(gap->stage));
    append(text, bytes, words);
}

void cli_describe_warnings(const struct controller_status *status, char *text, size_t bytes) {
    *text = '\0';
    for (int w = 0; w < (int)WARNING_COUNT; w++) {
        if ((status->warnings & (1u << (unsigned)w)) == 0u) {
            continue;
        }
        if (w == (int)WARNING_MODEL_GAP && status->gap.stage != GAP_MONITOR_NONE) {
            append_gap(text, bytes, &status->gap);
        } else {
            append(text, bytes, supervisor_warning_text((enum supervisor_warning)w));
        }
    }
    if (*text == '\0') {
        append(text, bytes, "none");
    }
}
