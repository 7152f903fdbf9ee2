/* `tribend gap`: why the real module differs from its model. */
#include <argp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/commands.h"
#include "gap/baseline.h"
#include "gap/diagnosis.h"
#include "gap/log_check.h"
#include "gap/report.h"
#include "gap/report_html.h"

#define WITHOUT_MAX 32

enum { TRUST_COLUMNS = 0x100 };

struct arguments {
    const char *logs[GAP_RUNS_MAX];
    size_t count;
    const char *table;
    const char *module;
    const char *json;
    const char *html;
    const char *calibration_out;
    const char *without[WITHOUT_MAX];
    size_t without_count;
    int threads;
    bool own_baseline;
    bool trust_columns;
    bool quiet;
};

static const struct argp_option option_list[] = {
    {"table", 't', "FILE", 0, "bend table of the module (default $TRIBEND_TABLE, else the reference table)", 1},
    {"module", 'm', "NAME", 0, "refuse logs and tables of any other module", 1},
    {"json", 'j', "FILE", 0, "write the report as JSON", 1},
    {"html", 'H', "FILE", 0, "write the report as a web page", 1},
    {"calibration-out", 'c', "FILE", 0, "write what was found as a calibration (YAML)", 1},
    {"without", 'w', "NAME", 0, "do not try this effect; may be repeated", 2},
    {"threads", 'T', "N", 0, "worker threads (default all cores)", 2},
    {"baseline", 'b', "WHICH", 0,
     "log: what another simulator wrote into the log's sim_ columns, where there are any (default); table: our own replay", 1},
    {"trust-columns", TRUST_COLUMNS, NULL, 0, "diagnose even a log whose chambers or frame do not fit the module", 2},
    {"quiet", 'q', NULL, 0, "no progress, no summary", 1},
    {0}};

static void parse_without(struct argp_state *state, const char *name, struct arguments *arguments) {
    if (effect_kind_find(name) == NULL) {
        argp_error(state, "--without: there is no effect '%s' (see tribend effects)", name);
    } else if (arguments->without_count == WITHOUT_MAX) {
        argp_error(state, "--without: at most %d effects", WITHOUT_MAX);
    } else {
        arguments->without[arguments->without_count++] = name;
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 't':
        arguments->table = argument;
        return 0;
    case 'm':
        arguments->module = argument;
        return 0;
    case 'j':
        arguments->json = argument;
        return 0;
    case 'H':
        arguments->html = argument;
        return 0;
    case 'c':
        arguments->calibration_out = argument;
        return 0;
    case 'w':
        parse_without(state, argument, arguments);
        return 0;
    case 'T':
        arguments->threads = cli_threads(state, argument);
        return 0;
    case 'b':
        arguments->own_baseline = strcmp(argument, "table") == 0;
        if (!arguments->own_baseline && strcmp(argument, "log") != 0) {
            argp_error(state, "--baseline: '%s' is neither log nor table", argument);
        }
        return 0;
    case TRUST_COLUMNS:
        arguments->trust_columns = true;
        return 0;
    case 'q':
        arguments->quiet = true;
        return 0;
    case ARGP_KEY_ARG:
        if (arguments->count == GAP_RUNS_MAX) {
            argp_error(state, "at most %d run logs", GAP_RUNS_MAX);
        } else {
            arguments->logs[arguments->count++] = argument;
        }
        return 0;
    case ARGP_KEY_END:
        if (arguments->count == 0) {
            argp_error(state, "which run logs? (tribend bend .. --record RUN.csv makes one)");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static void show_progress(void *context, const char *what, size_t done, size_t total) {
    (void)context;
    fprintf(stderr, "\r  %3zu of %3zu  %-32s", done, total, what);
    if (done == total) {
        fprintf(stderr, "\r%*s\r", 52, "");
    }
}

static int write_reports(const struct arguments *arguments, const struct diagnosis *diagnosis,
                         const struct search *search, const struct gap_data *data) {
    char error[PROGRAM_ERROR_BYTES];
    if (!arguments->quiet) {
        gap_report_text(diagnosis, data, stdout);
    }
    if (arguments->json != NULL && !gap_report_json(diagnosis, data, arguments->json, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    if (arguments->html != NULL && !gap_report_html(diagnosis, search, arguments->html, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    if (arguments->calibration_out != NULL &&
        !gap_report_calibration(diagnosis, data, arguments->calibration_out, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    return EXIT_OK;
}

static int diagnose(const struct arguments *arguments, const struct gap_data *data, const struct bend_table *table) {
    struct search *search = calloc(1, sizeof *search);
    struct diagnosis *diagnosis = calloc(1, sizeof *diagnosis);
    struct plant_parameters nominal;
    const struct search_options options = {.without = arguments->without,
                                           .without_count = arguments->without_count,
                                           .threads = arguments->threads,
                                           .stop = &program_interrupted,
                                           .progress = !arguments->quiet && isatty(2) ? show_progress : NULL};
    int code = EXIT_OK;
    plant_default_parameters(&nominal);
    program_catch_interrupt();
    char error[PROGRAM_ERROR_BYTES];
    if (search != NULL && diagnosis != NULL && !arguments->trust_columns &&
        !log_check(data, table, &nominal, error, sizeof error)) {
        code = program_fail(EXIT_BAD_INPUT, "%s", error);
    } else if (search == NULL || diagnosis == NULL || !search_run(search, data, table, &nominal, &options) ||
        !diagnosis_conclude(diagnosis, search)) {
        code = program_interrupted ? EXIT_INTERRUPTED : program_fail(EXIT_SOLVER, "out of memory for the diagnosis");
    } else {
        code = write_reports(arguments, diagnosis, search, data);
        code = code == EXIT_OK && search->interrupted ? EXIT_INTERRUPTED : code;
    }
    if (search != NULL) {
        search_close(search);
    }
    free(search);
    free(diagnosis);
    return code;
}

/* Other simulators' columns, where there are any and they are wanted. */
static int choose_baseline(const struct arguments *arguments, struct gap_data *data) {
    char error[PROGRAM_ERROR_BYTES];
    if (arguments->own_baseline || !gap_baseline_present(data)) {
        return EXIT_OK;
    }
    if (arguments->calibration_out != NULL) {
        return program_fail(EXIT_BAD_INPUT,
                            "--calibration-out: the gap is another simulator's (%s has sim_ columns), and a calibration is of our own "
                            "model: add --baseline table, or leave the option out",
                            data->run[0].path);
    }
    return gap_baseline_use(data, error, sizeof error) ? EXIT_OK : program_fail(EXIT_BAD_INPUT, "%s", error);
}

static int run_diagnose(int argc, char **argv) {
    struct arguments arguments = {.count = 0};
    const struct argp parser = {option_list, parse, "RUN.csv...",
                                "Say where the gap between model and module lies, which effect causes it, and how far it "
                                "shrinks once that effect is added.\v"
                                "Example: tribend gap diagnose RUN.csv --html GAP.html --calibration-out FOUND.yaml",
                                NULL, NULL, NULL};
    static struct gap_data data;
    struct table_file file;
    char error[PROGRAM_ERROR_BYTES], found[PROGRAM_PATH_BYTES];
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    const char *const output[] = {arguments.json, arguments.html, arguments.calibration_out};
    const int writable = cli_check_outputs(output, sizeof output / sizeof output[0]);
    if (writable != EXIT_OK) {
        return writable;
    }
    const char *path = bus_table_path(arguments.table, found);
    if (!gap_data_read(&data, arguments.logs, arguments.count, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    int code = table_file_open(&file, path, arguments.module);
    if (code == EXIT_OK) {
        if (*data.module == '\0') {
            (void)snprintf(data.module, sizeof data.module, "%s", file.table.module.name);
        }
        if (strcmp(data.module, file.table.module.name) != 0 && *data.module != '\0') {
            code = program_fail(EXIT_BAD_INPUT, "%s is of module %s, but the table %s is of module %s: give that module's table with --table",
                                arguments.logs[0], data.module, path, file.table.module.name);
        } else {
            code = choose_baseline(&arguments, &data);
            code = code == EXIT_OK ? diagnose(&arguments, &data, &file.table) : code;
        }
        table_file_close(&file);
    }
    gap_data_free(&data);
    return code;
}

int cli_gap(int argc, char **argv) {
    static const struct program_subcommand subcommands[] = {
        {"diagnose", run_diagnose, "where the gap lies, which effect causes it, how far it shrinks"},
        {"close", gap_close_run, "how far a calibration closes the gap in closed loop"},
        {"plan", gap_plan_run, "which experiment tells the remaining candidates apart"}};
    return program_run(argv[0], subcommands, sizeof subcommands / sizeof subcommands[0], argc, argv);
}
