/* tribend import: the log of another program as a run log. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands.h"
#include "cli/report_json.h"
#include "log/candump.h"
#include "log/lcm_log.h"
#include "log/mapping_import.h"
#include "log/run_columns.h"

#define SETTINGS_MAX 16

#define NODE_MOST 15

enum import_format { FORMAT_NONE, FORMAT_MAPPING, FORMAT_LCM, FORMAT_CANDUMP };

struct arguments {
    enum import_format format;
    const char *mapping;
    int node;
    bool json;
    const char *module;
    const char *source;
    const char *output;
    struct mapping_setting setting[SETTINGS_MAX];
    size_t settings;
};

static const struct argp_option options[] = {
    {"mapping", 'M', "NAME", 0,
     "a delimited text file, by a mapping: a name from tables/mappings, or a YAML file", 0},
    {"lcm", 'L', NULL, 0,
     "an event log of lcm-logger, channels TRIBEND_STATUS, TRIBEND_TIP and TRIBEND_COMMAND", 0},
    {"candump", 'C', NULL, 0, "a log of candump -L", 0},
    {"node", 'n', "N", 0,
     "of a candump, the controller with this node number (default: the first that speaks)", 1},
    {"set", 's', "COLUMN=VALUE", 0, "what the file does not say, such as p1_cmd_pa=300mbar; may be repeated",
     1},
    {"module", 'm', "NAME", 0, "the module that was recorded", 1},
    {"json", 'j', NULL, 0, "for programs: the summary as one JSON object", 1},
    {"output", 'o', "RUN.csv", 0, "the run log to write (required)", 1},
    {0}};

static void choose(struct argp_state *state, struct arguments *arguments, enum import_format format) {
    if (arguments->format != FORMAT_NONE) {
        argp_error(state, "a file has one format: give one of --mapping, --lcm, --candump");
    }
    arguments->format = format;
}

static void parse_setting(struct argp_state *state, char *text, struct arguments *arguments) {
    char error[PROGRAM_ERROR_BYTES + 1024];
    char *equals = strchr(text, '=');
    if (equals == NULL || arguments->settings == SETTINGS_MAX) {
        argp_error(state, "--set: '%s' is not COLUMN=VALUE, or there are more than %d of them", text,
                   SETTINGS_MAX);
        return;
    }
    struct mapping_setting *setting = &arguments->setting[arguments->settings++];
    *equals = '\0';
    setting->column = text;
    if (!run_column_parse(text, equals + 1, &setting->value, error, sizeof error)) {
        argp_error(state, "--set: %s", error);
    }
}

static void check_whole(struct argp_state *state, const struct arguments *arguments) {
    if (arguments->source == NULL || arguments->output == NULL) {
        argp_error(state,
                   "which file, and where to? For example: log.csv --mapping kcl_stiff_flop -o run.csv");
    } else if (arguments->format == FORMAT_NONE) {
        argp_error(state, "what is %s? Give --mapping, --lcm or --candump", arguments->source);
    } else if (arguments->format != FORMAT_MAPPING && arguments->settings > 0) {
        argp_error(state, "--set fills columns of a mapping; --lcm and --candump carry their own");
    } else if (arguments->format != FORMAT_CANDUMP && arguments->node != CANDUMP_FIRST_NODE) {
        argp_error(state, "--node is for --candump");
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'M':
        choose(state, arguments, FORMAT_MAPPING);
        arguments->mapping = argument;
        return 0;
    case 'L':
        choose(state, arguments, FORMAT_LCM);
        return 0;
    case 'C':
        choose(state, arguments, FORMAT_CANDUMP);
        return 0;
    case 'n':
        arguments->node = cli_whole_number(state, "--node", argument, 0, NODE_MOST);
        return 0;
    case 's':
        parse_setting(state, argument, arguments);
        return 0;
    case 'j':
        arguments->json = true;
        return 0;
    case 'm':
        arguments->module = argument;
        return 0;
    case 'o':
        arguments->output = argument;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one file at a time, '%s' is too much", argument);
        }
        arguments->source = argument;
        return 0;
    case ARGP_KEY_END:
        check_whole(state, arguments);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options,
                                   parse,
                                   "FILE",
                                   "Turn the log of another program into a run log.\v"
                                   "Example: tribend import NoLoad.csv --mapping kcl_stiff_flop -o run.csv",
                                   NULL,
                                   NULL,
                                   NULL};

/* A name without a slash or .yaml is one of tables/mappings. */
static void find_mapping(const char *name, char path[PROGRAM_PATH_BYTES]) {
    const size_t length = strlen(name);
    if (strchr(name, '/') != NULL || (length > 5 && strcmp(name + length - 5, ".yaml") == 0)) {
        (void)snprintf(path, PROGRAM_PATH_BYTES, "%s", name);
        return;
    }
    char relative[PROGRAM_PATH_BYTES];
    (void)snprintf(relative, sizeof relative, "tables/mappings/%s.yaml", name);
    program_find(relative, path);
}

static bool read_mapped(const struct arguments *arguments, struct run_log *log, char *error,
                        size_t error_bytes) {
    char path[PROGRAM_PATH_BYTES];
    struct description_error why;
    find_mapping(arguments->mapping, path);
    struct mapping *mapping = mapping_read(path, &why);
    if (mapping == NULL) {
        (void)snprintf(error, error_bytes, "%s", why.text);
        return false;
    }
    const bool sound = mapping_import(mapping, arguments->source, arguments->setting, arguments->settings,
                                      log, error, error_bytes);
    mapping_free(mapping);
    return sound;
}

static bool read_source(const struct arguments *arguments, struct run_log *log, char *error,
                        size_t error_bytes) {
    struct lcm_log_counts lcm;
    struct candump_counts candump;
    switch (arguments->format) {
    case FORMAT_LCM:
        return lcm_log_read(arguments->source, log, &lcm, error, error_bytes);
    case FORMAT_CANDUMP:
        return candump_read(arguments->source, arguments->node, log, &candump, error, error_bytes);
    case FORMAT_NONE:
    case FORMAT_MAPPING:
    default:
        return read_mapped(arguments, log, error, error_bytes);
    }
}

static double last_s_of(const struct run_log *log) {
    return log->value[(log->rows - 1) * log->columns + (size_t)run_log_column(log, "time_s")];
}

static int print_json(const struct arguments *arguments, const struct run_log *log) {
    json_t *object = json_object(), *columns = json_array(), *metadata = json_object();
    for (size_t c = 0; c < log->columns; c++) {
        (void)json_array_append_new(columns, json_string(log->name[c]));
    }
    for (size_t p = 0; p < log->metadata_count; p++) {
        (void)json_object_set_new(metadata, log->metadata[p].key, json_string(log->metadata[p].value));
    }
    (void)json_object_set_new(object, "rows", json_integer((json_int_t)log->rows));
    (void)json_object_set_new(object, "last_s", json_real(last_s_of(log)));
    (void)json_object_set_new(object, "columns", columns);
    (void)json_object_set_new(object, "metadata", metadata);
    (void)json_object_set_new(object, "wrote", json_string(arguments->output));
    return report_json_print(object);
}

static void print_summary(const struct arguments *arguments, const struct run_log *log) {
    printf("rows      %zu over %.3f s\ncolumns  ", log->rows, last_s_of(log));
    for (size_t c = 0; c < log->columns; c++) {
        printf(" %s", log->name[c]);
    }
    printf("\n");
    for (size_t p = 0; p < log->metadata_count; p++) {
        printf("%-9s %s\n", log->metadata[p].key, log->metadata[p].value);
    }
    printf("wrote     %s\n", arguments->output);
}

int cli_import(int argc, char **argv) {
    struct arguments arguments = {.format = FORMAT_NONE, .node = CANDUMP_FIRST_NODE};
    struct run_log log;
    char error[PROGRAM_ERROR_BYTES];
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    if (!read_source(&arguments, &log, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    int code = EXIT_OK;
    if (arguments.module != NULL && !run_log_set_metadata(&log, "module", arguments.module)) {
        code = program_fail(EXIT_OUTPUT, "out of memory");
    } else if (!run_log_write(arguments.output, &log, error, sizeof error)) {
        code = program_fail(EXIT_OUTPUT, "%s", error);
    } else if (arguments.json) {
        code = print_json(&arguments, &log);
    } else {
        print_summary(&arguments, &log);
    }
    run_log_free(&log);
    return code;
}
