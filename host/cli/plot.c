/* tribend plot: a recorded run as a picture. */
#include <stdio.h>

#include "cli/commands.h"
#include "report/run_plot.h"

struct arguments {
    const char *log;
    const char *png;
};

static const struct argp_option options[] = {{"output", 'o', "FILE", 0, "the PNG file to write (required)", 0}, {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'o':
        arguments->png = argument;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one run log at a time, '%s' is too much", argument);
        }
        arguments->log = argument;
        return 0;
    case ARGP_KEY_END:
        if (arguments->log == NULL || arguments->png == NULL) {
            argp_error(state, "which run log, and where to? For example: run.csv -o run.png");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "RUN.csv", "Draw a recorded run.\vExample: tribend plot RUN.csv -o RUN.png", NULL, NULL, NULL};

int cli_plot(int argc, char **argv) {
    struct arguments arguments = {.log = NULL};
    struct run_log log;
    char error[PROGRAM_ERROR_BYTES];
    int code = EXIT_OK;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    if (!run_log_read(arguments.log, &log, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    switch (run_plot(&log, arguments.log, arguments.png, error, sizeof error)) {
    case RUN_PLOT_DRAWN:
        printf("wrote %s\n", arguments.png);
        break;
    case RUN_PLOT_COLUMN_MISSING:
        code = program_fail(EXIT_BAD_INPUT, "%s", error);
        break;
    case RUN_PLOT_NOT_WRITTEN:
    default:
        code = program_fail(EXIT_OUTPUT, "%s", error);
        break;
    }
    run_log_free(&log);
    return code;
}
