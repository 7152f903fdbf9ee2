/* tribend record: write down what a controller does, without commanding it. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"
#include "cli/report_json.h"
#include "log/run_log.h"

#define WORDS_BYTES 512
#define LOOK_US 100000 /* for Ctrl-C, while nothing comes */

struct arguments {
    struct bus_options bus;
    bool json;
};

static const struct argp_option options[] = {
    {"output", 'o', "RUN.csv", 0, "the run log to write (required)", 0},
    {"json", 'j', NULL, 0, "for programs: the summary as one JSON object", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'o':
        arguments->bus.record = argument;
        return 0;
    case 'j':
        arguments->json = true;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "record takes no argument, '%s' is too much", argument);
        return 0;
    case ARGP_KEY_END:
        if (arguments->bus.record == NULL) {
            argp_error(state, "where to? For example: -o run.csv --for 10s");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {options,
                                   parse,
                                   "",
                                   "Write down what the controller does, without commanding it.\v"
                                   "Example: tribend record -o run.csv --for 10s",
                                   children,
                                   NULL,
                                   NULL};

/* On a bus the clock on the wall says when it is over: the board's stands still while the board is away. */
static bool is_over(const struct bus *bus, const struct bus_options *bus_options, int64_t from_us, int64_t since_us) {
    const int64_t wall_us = program_now_us() - from_us;
    return 1e-6 * (double)(bus->can != NULL ? wall_us : since_us) >= bus_options->duration_s;
}

/* A board that is gone may come back, and its rows go on. False: the simulation ended. */
static bool take_row(struct bus *bus, const struct bus_options *bus_options, struct run_log_writer *log,
                     uint64_t *rows, struct link_report *report) {
    const struct controller_command nothing = {.kind = COMMAND_NONE};
    bus_drill(bus, bus_options);
    if (bus->can == NULL && !bus->link.receive(bus->link.context, report)) {
        return false;
    }
    if (bus->can == NULL || can_link_receive(bus->can, LOOK_US, report) == CAN_LINK_REPORT) {
        run_log_append(log, report, &nothing);
        ++*rows;
    }
    return true;
}

/* Until the time is over, or Ctrl-C; an exit code. */
static int follow(struct bus *bus, const struct bus_options *bus_options, struct run_log_writer *log,
                  uint64_t *rows, struct link_report *report) {
    const int64_t from_us = program_now_us();
    int64_t start_us = -1;
    do {
        if (!take_row(bus, bus_options, log, rows, report)) {
            return bus_gone(bus, bus_options);
        }
        start_us = start_us < 0 && *rows > 0 ? report->time_us : start_us;
    } while (!is_over(bus, bus_options, from_us, report->time_us - start_us) && program_interrupted == 0);
    return program_interrupted == 0 ? EXIT_OK : EXIT_INTERRUPTED;
}

static void print_summary(struct bus *bus, const struct bus_options *bus_options,
                          const struct link_report *report, uint64_t rows) {
    char words[WORDS_BYTES];
    printf("rows      %" PRIu64 ", until %.3f s\n", rows, 1e-6 * (double)report->time_us);
    printf("state     %s\n", supervisor_state_name(report->status.state));
    cli_describe_faults(report->status.faults, words, sizeof words);
    printf("faults    %s\n", words);
    if (bus->can != NULL) {
        struct can_link_counters counters;
        can_link_count(bus->can, &counters);
        printf("lost      %" PRIu64 " reports on the way, %" PRIu64 " here; the board fell silent %" PRIu64
               " times, started anew %" PRIu64 " times\n",
               counters.missing, counters.dropped + counters.overflowed, counters.silences,
               counters.restarts);
    }
    printf("wrote     %s\n", bus_options->record);
}

static int print_json(struct bus *bus, const struct bus_options *bus_options,
                      const struct link_report *report, uint64_t rows) {
    json_t *object = report_json(bus, report);
    (void)json_object_set_new(object, "rows", json_integer((json_int_t)rows));
    (void)json_object_set_new(object, "wrote", json_string(bus_options->record));
    return report_json_print(object);
}

static int record(struct bus *bus, void *input) {
    const struct arguments *arguments = input;
    const struct bus_options *bus_options = &arguments->bus;
    char error[PROGRAM_ERROR_BYTES], note[64];
    struct run_log_writer log;
    struct link_report report;
    uint64_t rows = 0;
    (void)snprintf(note, sizeof note, "bus %s, seed %" PRIu64, bus_options->bus, bus_options->seed);
    const struct run_log_metadata metadata = {
        .module = bus->module_name, .table_hash = bus->table_hash, .rate_hz = bus->rate_hz, .note = note};
    memset(&report, 0, sizeof report);
    if (!run_log_create(&log, bus_options->record, &metadata, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    program_catch_interrupt();
    int code = follow(bus, bus_options, &log, &rows, &report);
    if (!run_log_finish(&log, error, sizeof error)) { /* what came before the link went is worth keeping */
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    if (!arguments->json) {
        print_summary(bus, bus_options, &report, rows);
    } else if (code == EXIT_OK || code == EXIT_INTERRUPTED) {
        code = print_json(bus, bus_options, &report, rows) == EXIT_OK ? code : EXIT_OUTPUT;
    }
    return code == EXIT_OK && report.status.faults != 0u ? EXIT_FAULT : code;
}

int cli_record(int argc, char **argv) {
    struct arguments arguments = {.json = false};
    bus_options_init(&arguments.bus);
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    return bus_run(&arguments.bus, record, &arguments);
}
