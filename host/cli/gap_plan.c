/* `tribend gap plan`: the experiment that tells the candidates of a diagnosis apart. */
#include <argp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli/commands.h"
#include "gap/gap_data.h"
#include "gap/plan_report.h"
#include "plan/plan_file.h"

#define NAMES_BYTES 1024

struct arguments {
    const char *report;
    const char *table;
    const char *module;
    const char *run;
    const char *output;
    const char *json;
    const char *candidate[PLAN_CANDIDATES_MAX];
    size_t candidates;
    char names[NAMES_BYTES]; /* of --group, cut into words */
    int threads;
    bool quiet;
};

static const struct argp_option option_list[] = {
    {"output", 'o', "PLAN.yaml", 0, "the plan to write (required)", 1},
    {"group", 'g', "NAME,NAME..", 0, "candidates at typical parameters, in place of a report's", 1},
    {"candidate", 'c', "NAME[:P=V,..]", 0, "one more candidate; may be repeated", 1},
    {"run", 'r', "RUN.csv", 0, "what has been recorded, to compare with (default: a constant hold)", 1},
    {"table", 't', "FILE", 0, "bend table of the module (default $TRIBEND_TABLE, else the reference table)",
     1},
    {"module", 'm', "NAME", 0, "refuse a table of any other module", 1},
    {"json", 'j', "FILE", 0, "write the comparison as JSON", 2},
    {"threads", 'T', "N", 0, "worker threads (default all cores)", 2},
    {"quiet", 'q', NULL, 0, "no progress, no table", 2},
    {0}};

static void add_candidate(struct argp_state *state, struct arguments *arguments, const char *text) {
    if (arguments->candidates == PLAN_CANDIDATES_MAX) {
        argp_error(state, "at most %d candidates", PLAN_CANDIDATES_MAX);
    } else {
        arguments->candidate[arguments->candidates++] = text;
    }
}

static void parse_group(struct argp_state *state, struct arguments *arguments, const char *text) {
    char *rest = NULL;
    if (*arguments->names != '\0' || strlen(text) >= sizeof arguments->names) {
        argp_error(state, "--group: give it once, with names and commas between them; --candidate adds more");
        return;
    }
    (void)snprintf(arguments->names, sizeof arguments->names, "%s", text);
    for (char *name = strtok_r(arguments->names, ", ", &rest); name != NULL;
         name = strtok_r(NULL, ", ", &rest)) {
        add_candidate(state, arguments, name);
    }
}

static void check_whole(struct argp_state *state, const struct arguments *arguments) {
    if (arguments->report == NULL && arguments->candidates == 0) {
        argp_error(
            state,
            "between which effects? Give the report of tribend gap diagnose --json, or --group NAME,NAME");
    } else if (arguments->output == NULL) {
        argp_error(state, "where to? Give -o PLAN.yaml");
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'o':
        arguments->output = argument;
        return 0;
    case 'g':
        parse_group(state, arguments, argument);
        return 0;
    case 'c':
        add_candidate(state, arguments, argument);
        return 0;
    case 'r':
        arguments->run = argument;
        return 0;
    case 't':
        arguments->table = argument;
        return 0;
    case 'm':
        arguments->module = argument;
        return 0;
    case 'j':
        arguments->json = argument;
        return 0;
    case 'T':
        arguments->threads = cli_threads(state, argument);
        return 0;
    case 'q':
        arguments->quiet = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one report at a time, '%s' is too much", argument);
        }
        arguments->report = argument;
        return 0;
    case ARGP_KEY_END:
        check_whole(state, arguments);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    option_list,
    parse,
    "[REPORT.json]",
    "Choose the experiment that tells the remaining candidates apart best, within the "
    "module's limits, and write it as a plan.\v"
    "Example: tribend gap plan report.json --run RUN.csv -o PLAN.yaml",
    NULL,
    NULL,
    NULL};

static void show_progress(void *context, const char *what, size_t done, size_t total) {
    (void)context;
    fprintf(stderr, "\r  %3zu of %3zu  %-44.44s", done, total > done ? total : done, what);
}

static void end_progress(void) {
    fprintf(stderr, "\r%*s\r", 64, "");
}

/* From the report and the command line. */
static int take_candidates(const struct arguments *arguments, const struct bend_table *table,
                           struct plan_candidates *candidates) {
    char error[PROGRAM_ERROR_BYTES], module[PLAN_LABEL_BYTES] = "";
    plan_candidates_init(candidates);
    if (arguments->report != NULL &&
        !plan_candidates_read(candidates, arguments->report, module, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    if (*module != '\0' && strcmp(module, table->module.name) != 0) {
        return program_fail(
            EXIT_BAD_INPUT,
            "%s is of module %s, but the table is of module %s: give that module's table with --table",
            arguments->report, module, table->module.name);
    }
    for (size_t i = 0; i < arguments->candidates; i++) {
        if (!plan_candidates_add(candidates, arguments->candidate[i], error, sizeof error)) {
            return program_fail(EXIT_USAGE, "%s", error);
        }
    }
    if (!plan_candidates_finish(candidates, error, sizeof error)) {
        const bool from_report = arguments->report != NULL;
        return program_fail(from_report ? EXIT_BAD_INPUT : EXIT_USAGE, "%s%s%s",
                            from_report ? arguments->report : "", from_report ? ": " : "", error);
    }
    return EXIT_OK;
}

static int write_plan(const struct arguments *arguments, const struct plan_search *search,
                      const struct plan_candidates *candidates) {
    char error[PROGRAM_ERROR_BYTES];
    if (!plan_write(arguments->output, &search->trial[0]->experiment.plan, error, sizeof error) ||
        (arguments->json != NULL &&
         !plan_report_json(search, candidates, arguments->output, arguments->json, error, sizeof error))) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    if (!arguments->quiet) {
        plan_report_text(search, candidates, stdout);
        printf("wrote     %s; follow it with: tribend run %s --record RUN.csv\n", arguments->output,
               arguments->output);
    }
    return EXIT_OK;
}

static int search_and_write(const struct arguments *arguments, const struct bend_table *table,
                            struct plan_candidates *candidates, const struct gap_run *run) {
    static struct plan_search search;
    struct plan_bench bench = {.table = table};
    const bool shows = !arguments->quiet && isatty(2);
    const struct plan_search_options options = {.run = run,
                                                .threads = arguments->threads,
                                                .stop = &program_interrupted,
                                                .progress = shows ? show_progress : NULL};
    int code;
    plant_default_parameters(&bench.nominal);
    program_catch_interrupt();
    const enum plan_outcome outcome = plan_search_run(&search, &bench, candidates, &options);
    if (shows) {
        end_progress();
    }
    switch (outcome) {
    case PLAN_FOUND:
        code = write_plan(arguments, &search, candidates);
        break;
    case PLAN_INTERRUPTED:
        code = EXIT_INTERRUPTED;
        break;
    case PLAN_UNSAFE:
        code = program_fail(EXIT_SOLVER,
                            "no experiment stays within the limits of module %s under every candidate; leave "
                            "out the one that moves it most",
                            table->module.name);
        break;
    case PLAN_NO_MEMORY:
    default:
        code = program_fail(EXIT_SOLVER, "out of memory for the search");
        break;
    }
    plan_search_close(&search);
    return code;
}

/* With the recorded run, where one is given. */
static int run_on_table(const struct arguments *arguments, const struct bend_table *table) {
    static struct plan_candidates candidates;
    static struct gap_data data;
    char error[PROGRAM_ERROR_BYTES];
    int code = take_candidates(arguments, table, &candidates);
    if (code != EXIT_OK || arguments->run == NULL) {
        return code != EXIT_OK ? code : search_and_write(arguments, table, &candidates, NULL);
    }
    if (!gap_data_read(&data, &arguments->run, 1, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    if (!data.run[0].has_duty) {
        code =
            program_fail(EXIT_BAD_INPUT,
                         "%s has no duties (valve1..3): leave --run out, and a constant hold stands for it",
                         arguments->run);
    } else {
        code = search_and_write(arguments, table, &candidates, &data.run[0]);
    }
    gap_data_free(&data);
    return code;
}

int gap_plan_run(int argc, char **argv) {
    static struct arguments arguments;
    struct table_file file;
    char found[PROGRAM_PATH_BYTES];
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    const char *const output[] = {arguments.output, arguments.json};
    int code = table_file_open(&file, bus_table_path(arguments.table, found), arguments.module);
    if (code == EXIT_OK) {
        code = cli_check_outputs(output, sizeof output / sizeof output[0]);
        code = code != EXIT_OK ? code : run_on_table(&arguments, &file.table);
        table_file_close(&file);
    }
    return code;
}
