/* What the subcommands of `tribend` share: their options and the course of a run. */
#ifndef TRIBEND_HOST_CLI_H
#define TRIBEND_HOST_CLI_H

#include <argp.h>

#include "gap/calibration_use.h"
#include "link/can_link.h"
#include "link/sim_drill.h"
#include "link/sim_link.h"
#include "program/program.h"
#include "program/table_file.h"

/* Each returns an exit code. `argv[0]` is the name of the program with the subcommand. */
int cli_bend(int argc, char **argv);
int cli_pressure(int argc, char **argv);
int cli_vent(int argc, char **argv);
int cli_hold(int argc, char **argv);
int cli_clear(int argc, char **argv);
int cli_params(int argc, char **argv);
int cli_update(int argc, char **argv);
int cli_monitor(int argc, char **argv);
int cli_status(int argc, char **argv);
int cli_plot(int argc, char **argv);
int cli_record(int argc, char **argv);
int cli_import(int argc, char **argv);
int cli_gap(int argc, char **argv);
int cli_effects(int argc, char **argv);
int cli_run(int argc, char **argv);
int cli_decode(int argc, char **argv);
int cli_dbc(int argc, char **argv);
int cli_board(int argc, char **argv);
int cli_view(int argc, char **argv);
int cli_bridge(int argc, char **argv);
/* `tribend gap plan` */
int gap_plan_run(int argc, char **argv);
/* `tribend gap close` */
int gap_close_run(int argc, char **argv);

/* Options of every subcommand that talks to a controller. */
struct bus_options {
    const char *bus;
    uint32_t node; /* of the board on it */
    const char
        *table; /* NULL: $TRIBEND_TABLE, else the reference table; on a real bus: whatever the board has */
    const char *module; /* the module that the table must be of; NULL: any */
    const char *record;
    uint64_t seed;
    double duration_s;
    bool quiet;
    bool json;              /* one object for programs in place of words, where the subcommand has it */
    bool hold_on_interrupt; /* Ctrl-C holds the pressures, a second one vents */
    bool needs_table;       /* of the board, in a file on this computer */
    bool vent_at_once;      /* before anything is known of the board, whatever its version */
    const char *sim_only;   /* an option that makes sense in the simulation only; NULL: none was given */
    struct effect effect[PLANT_EFFECTS_MAX];
    size_t effect_count;
    const char *calibration;            /* the simulated module is as this file says; NULL: nominal */
    const char *controller_calibration; /* the controller is told of this one; NULL: of none */
    struct sim_drill drill;
};

/* For argp's children; its input is a struct bus_options. */
extern const struct argp bus_options_parser;
void bus_options_init(struct bus_options *options);
/* argp's key for every argument of ours that is a quantity: parse or say what was expected. */
void cli_quantity(struct argp_state *state, const char *what, int kind, const char *text, double *value);

/* A whole number, or a message that names the option and its bounds. */
int cli_whole_number(struct argp_state *state, const char *option, const char *text, int least, int most);
/* Whether each of the files could be written, NULL where there is none; an exit code, with the message
 * printed. */
int cli_check_outputs(const char *const *path, size_t count);
/* Worker threads of --threads. */
int cli_threads(struct argp_state *state, const char *text);

/* A controller that is reached, and the table that goes with it. */
struct bus {
    struct table_file file;
    struct sim_link sim;
    struct link link;
    struct calibrated_controller controller;
    bool controller_calibrated;
    unsigned char *controller_image; /* of the controller's table, for drills */
    const char *table_path;
    char found[PROGRAM_PATH_BYTES];
    struct can_link *can; /* NULL: simulated */
    struct can_link_identity identity;
    const char *module_name;
    uint64_t table_hash;
    double rate_hz; /* of reports */
};

/* The table that is meant: `table`, else $TRIBEND_TABLE, else the reference table. */
const char *bus_table_path(const char *table, char found[PROGRAM_PATH_BYTES]);
/* Returns an exit code, with the message printed. */
int bus_open(struct bus *bus, const struct bus_options *options);
/* The same of a bus that is not simulated. */
int bus_open_can(struct bus *bus, const struct bus_options *options);
void bus_close(struct bus *bus);
/* Open the bus of `options`, `work` on it, close it; returns an exit code. */
int bus_run(const struct bus_options *options, int (*work)(struct bus *bus, void *input), void *input);
/* The arguments of a subcommand that has the options of a bus and --json alone; returns an exit code. `usage`:
 * argp's text after them. */
int bus_parse_alone(const char *name, const char *usage, int argc, char **argv, struct bus_options *options);
/* Faults that a drill puts into the simulation. */
void bus_drill(struct bus *bus, const struct bus_options *options);
/* The message that nothing comes any more; returns the exit code. */
int bus_gone(struct bus *bus, const struct bus_options *options);

/* Follow `command` for the options' duration, vent, say how it went; returns an exit code. */
int run_command(const struct bus_options *options, const struct controller_command *command);
/* "overpressure, command timeout": the faults' or warnings' words into `text`. A gap between module and model
 * is said with the stage and the chamber that the gap monitor found. */
void cli_describe_faults(uint32_t faults, char *text, size_t bytes);
void cli_describe_warnings(const struct controller_status *status, char *text, size_t bytes);

#endif
