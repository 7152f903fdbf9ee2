/* tribend run: follow a plan, an experiment that is written down. */
#include <stdio.h>
#include <string.h>

#include "cli/run_course.h"
#include "plan/plan_file.h"

#define NOTE_BYTES 256

struct arguments {
    struct bus_options bus;
    const char *plan;
};

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
        if (state->arg_num > 0) {
            argp_error(state, "one plan at a time, '%s' is too much", argument);
        }
        arguments->plan = argument;
        return 0;
    case ARGP_KEY_END:
        if (arguments->plan == NULL) {
            argp_error(state, "which plan? For example PLAN.yaml, as `tribend gap plan` writes one");
        } else if (arguments->bus.duration_s > 0.0) {
            argp_error(state, "--for: the plan says how long each of its steps takes");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option options[] = {
    {"json", 'j', NULL, 0, "for programs: one JSON object, in place of the words", 0},
    {0}};
static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {options,
                                   parse,
                                   "PLAN.yaml",
                                   "Follow a plan step by step, then vent.\v"
                                   "Example: tribend run PLAN.yaml --record RUN.csv",
                                   children,
                                   NULL,
                                   NULL};

static int read_checked(const struct arguments *arguments, struct plan *plan) {
    char error[PLAN_ERROR_BYTES], found[PROGRAM_PATH_BYTES];
    struct table_file file;
    int code = table_file_open(&file, bus_table_path(arguments->bus.table, found), arguments->bus.module);
    if (code != EXIT_OK) {
        return code;
    }
    if (!plan_read(arguments->plan, &file.table, plan, error, sizeof error)) {
        code = program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    table_file_close(&file);
    return code;
}

static void command_at(const void *context, double since_s, struct controller_command *command) {
    plan_command_at(context, since_s, command);
}

int cli_run(int argc, char **argv) {
    static struct plan plan;
    struct arguments arguments = {.plan = NULL};
    char note[NOTE_BYTES];
    bus_options_init(&arguments.bus);
    arguments.bus.duration_s = 0.0; /* so that --for is noticed */
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    const int code = read_checked(&arguments, &plan);
    if (code != EXIT_OK) {
        return code;
    }
    arguments.bus.duration_s = plan_length_s(&plan);
    (void)snprintf(note, sizeof note, "plan %.200s, ", arguments.plan);
    if (!arguments.bus.json) {
        printf("plan      %zu steps, %.4g s%s%s\n", plan.steps, arguments.bus.duration_s,
               *plan.note != '\0' ? ": " : "", plan.note);
    }
    const struct run_course course = {
        .context = &plan, .command_at = command_at, .plan = arguments.plan, .note = note};
    return run_course(&arguments.bus, &course);
}
