/* tribend params: the board's parameters, one by one, or all of them to and from a file. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/parameter_file.h"
#include "cli/report_json.h"
#include "cli/transfer.h"
#include "link/can_board.h"

#define WORDS_MOST 3

struct arguments {
    struct bus_options bus;
    bool json;
    int words;
    const char *word[WORDS_MOST];
};

struct action {
    const char *name;
    int words; /* after it */
    const char *usage;
    int (*run)(struct bus *bus, const struct arguments *arguments);
};

/* --- one parameter */

static int refused(const char *name, enum parameter_status status) {
    return program_fail(EXIT_REFUSED, "%s: the board refused it: %s", name, parameter_status_text(status));
}

static int get(struct bus *bus, const struct arguments *arguments, enum parameter_index p, uint32_t *value) {
    const enum can_board_result result = can_board_get(bus->can, p, value);
    return result == CAN_BOARD_OK       ? EXIT_OK
           : result == CAN_BOARD_SILENT ? transfer_no_board(&arguments->bus)
                                        : refused(parameter_words(p)->name, PARAMETER_UNKNOWN);
}

static int named(const char *name, enum parameter_index *p) {
    return parameter_by_name(name, p)
               ? EXIT_OK
               : program_fail(EXIT_USAGE, "there is no parameter '%s' (tribend params list shows them)",
                              name);
}

static void print_one(const struct arguments *arguments, enum parameter_index p, uint32_t value, bool last) {
    const struct parameter_words *words = parameter_words(p);
    if (arguments->json) {
        printf("  \"%s\": %.9g%s\n", words->name, parameter_number(p, value), last ? "" : ",");
    } else {
        printf("%-24s %14.9g%-9s %s\n", words->name, parameter_number(p, value), parameter_unit(p), words->comment);
    }
}

static int run_get(struct bus *bus, const struct arguments *arguments) {
    enum parameter_index p;
    uint32_t value = 0;
    int code = named(arguments->word[1], &p);
    code = code == EXIT_OK ? get(bus, arguments, p, &value) : code;
    if (code == EXIT_OK) {
        fputs(arguments->json ? "{\n" : "", stdout);
        print_one(arguments, p, value, true);
        fputs(arguments->json ? "}\n" : "", stdout);
    }
    return code;
}

static int run_set(struct bus *bus, const struct arguments *arguments) {
    enum parameter_status status = PARAMETER_OK;
    enum parameter_index p;
    uint32_t value = 0;
    char error[PROGRAM_ERROR_BYTES], *end = NULL;
    const double number = strtod(arguments->word[2], &end);
    const int code = named(arguments->word[1], &p);
    if (code != EXIT_OK) {
        return code;
    }
    const struct parameter_words *words = parameter_words(p);
    if (end == arguments->word[2] || *end != '\0') {
        return program_fail(EXIT_USAGE, "'%s' is no number: %s takes one%s%s, without the unit",
                            arguments->word[2], words->name, *parameter_unit(p) != '\0' ? " in" : "",
                            parameter_unit(p));
    }
    if (!parameter_from_number(p, number, &value, error, sizeof error)) {
        return program_fail(EXIT_USAGE, "%s", error);
    }
    const enum can_board_result result = can_board_set(bus->can, p, &value, &status);
    if (result == CAN_BOARD_SILENT) {
        return transfer_no_board(&arguments->bus);
    }
    if (result == CAN_BOARD_REFUSED) {
        return refused(arguments->word[1], status);
    }
    printf("%s %s %.9g%s %s tribend params save keeps it\n", words->name,
           words->holds_from_start ? "will be" : "is", parameter_number(p, value), parameter_unit(p),
           words->holds_from_start ? "from the board's next start on, if" : "until the board's next start;");
    return EXIT_OK;
}

/* --- all of them */

static int get_all(struct bus *bus, const struct arguments *arguments, struct parameter_values *values) {
    int code = EXIT_OK;
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT && code == EXIT_OK; p++) {
        code = get(bus, arguments, (enum parameter_index)p, &values->value[p]);
        values->given[p] = true;
    }
    return code;
}

static int run_list(struct bus *bus, const struct arguments *arguments) {
    struct parameter_values values = {.given = {false}};
    const int code = get_all(bus, arguments, &values);
    fputs(arguments->json && code == EXIT_OK ? "{\n" : "", stdout);
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT && code == EXIT_OK; p++) {
        print_one(arguments, (enum parameter_index)p, values.value[p], p + 1 == (uint32_t)PARAMETER_COUNT);
    }
    fputs(arguments->json && code == EXIT_OK ? "}\n" : "", stdout);
    return code;
}

static int act(struct bus *bus, const struct arguments *arguments, enum node_action action,
               const char *done) {
    enum parameter_status status = PARAMETER_OK;
    const enum can_board_result result = can_board_act(bus->can, action, &status);
    if (result == CAN_BOARD_SILENT) {
        return transfer_no_board(&arguments->bus);
    }
    if (result == CAN_BOARD_REFUSED) {
        return refused(arguments->word[0], status);
    }
    printf("%s\n", done);
    return EXIT_OK;
}

static int run_save(struct bus *bus, const struct arguments *arguments) {
    return act(bus, arguments, NODE_ACTION_SAVE, "saved: the parameters outlast a new start");
}

static int run_defaults(struct bus *bus, const struct arguments *arguments) {
    return act(bus, arguments, NODE_ACTION_DEFAULTS,
               "defaults, until the board's next start; tribend params save keeps them");
}

static int run_backup(struct bus *bus, const struct arguments *arguments) {
    struct parameter_values values = {.given = {false}};
    char error[PROGRAM_ERROR_BYTES];
    const int code = get_all(bus, arguments, &values);
    if (code != EXIT_OK) {
        return code;
    }
    if (!parameter_file_write(arguments->word[1], bus->module_name, &values, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    printf("wrote     %u parameters to %s\n", (unsigned)PARAMETER_COUNT, arguments->word[1]);
    return EXIT_OK;
}

static int print_differences_json(const struct parameter_values *file, const struct parameter_values *board) {
    json_t *object = json_object();
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT; p++) {
        const enum parameter_index index = (enum parameter_index)p;
        if (file->given[p] && file->value[p] != board->value[p]) {
            (void)json_object_set_new(object, parameter_words(index)->name,
                                      json_pack("{s:f,s:f}", "board", parameter_number(index, board->value[p]), "file",
                                                parameter_number(index, file->value[p])));
        }
    }
    return report_json_print(object);
}

/* Only the file's differences are printed; with none, nothing is. */
static int run_diff(struct bus *bus, const struct arguments *arguments) {
    struct parameter_values file, board = {.given = {false}};
    char error[PROGRAM_ERROR_BYTES];
    if (!parameter_file_read(arguments->word[1], &file, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    const int code = get_all(bus, arguments, &board);
    if (code == EXIT_OK && arguments->json) {
        return print_differences_json(&file, &board);
    }
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT && code == EXIT_OK; p++) {
        if (file.given[p] && file.value[p] != board.value[p]) {
            const enum parameter_index index = (enum parameter_index)p;
            printf("%-24s board %.9g, file %.9g%s\n", parameter_words(index)->name,
                   parameter_number(index, board.value[p]), parameter_number(index, file.value[p]),
                   parameter_unit(index));
        }
    }
    return code;
}

/* As one image, which the board takes whole or not at all. What the file leaves out keeps its value. */
static int run_restore(struct bus *bus, const struct arguments *arguments) {
    struct parameter_values file, board = {.given = {false}};
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    char error[PROGRAM_ERROR_BYTES];
    if (!parameter_file_read(arguments->word[1], &file, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    int code = get_all(bus, arguments, &board);
    for (uint32_t p = 0; p < (uint32_t)PARAMETER_COUNT; p++) {
        board.value[p] = file.given[p] ? file.value[p] : board.value[p];
    }
    if (code == EXIT_OK) {
        const uint32_t bytes = parameter_values_image(&board, image);
        code = transfer_image(bus, &arguments->bus, TRANSFER_KIND_PARAMETERS, image, bytes, false);
    }
    if (code == EXIT_OK) {
        printf("restored  from %s, in use and saved\n", arguments->word[1]);
    }
    return code;
}

static const struct action actions[] = {{"list", 0, "list", run_list},
                                        {"get", 1, "get NAME", run_get},
                                        {"set", 2, "set NAME VALUE", run_set},
                                        {"save", 0, "save", run_save},
                                        {"defaults", 0, "defaults", run_defaults},
                                        {"diff", 1, "diff FILE", run_diff},
                                        {"backup", 1, "backup FILE", run_backup},
                                        {"restore", 1, "restore FILE", run_restore}};

/* --- the command line */

static const struct argp_option options[] = {
    {"json", 'j', NULL, 0, "list, get and diff: for programs, one JSON object", 0}, {0}};

static const struct action *find_action(const char *name) {
    for (size_t i = 0; name != NULL && i < sizeof actions / sizeof actions[0]; i++) {
        if (strcmp(actions[i].name, name) == 0) {
            return &actions[i];
        }
    }
    return NULL;
}

static void check_words(struct argp_state *state, const struct arguments *arguments) {
    const struct action *action = find_action(arguments->word[0]);
    if (action == NULL) {
        argp_error(state, "what about them? list, get, set, save, defaults, diff, backup or restore");
    } else if (arguments->words != 1 + action->words) {
        argp_error(state, "it is: %s", action->usage);
    }
    if (strcmp(arguments->bus.bus, "sim") == 0) {
        argp_error(state,
                   "the simulation in this process keeps no parameters: --bus says where the board is");
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'j':
        arguments->json = true;
        return 0;
    case ARGP_KEY_ARG:
        if (arguments->words == WORDS_MOST) {
            argp_error(state, "'%s' is too much", argument);
            return 0;
        }
        arguments->word[arguments->words++] = argument;
        return 0;
    case ARGP_KEY_END:
        check_words(state, arguments);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {
    options,
    parse,
    "list\nget NAME\nset NAME VALUE\nsave\ndefaults\ndiff FILE\nbackup FILE\nrestore FILE",
    "Read and change the board's parameters. A change lasts until the board's next start, unless it is "
    "saved; most are "
    "taken only while vented. restore takes a file whole, or leaves everything as it was.\v"
    "Examples:\n"
    "  tribend params list --bus can0\n"
    "  tribend params set tip_gain 0.15 --bus can0\n"
    "  tribend params backup board.json --bus can0",
    children,
    NULL,
    NULL};

static int run_action(struct bus *bus, void *input) {
    const struct arguments *arguments = input;
    return find_action(arguments->word[0])->run(bus, arguments);
}

int cli_params(int argc, char **argv) {
    struct arguments arguments = {.words = 0};
    bus_options_init(&arguments.bus);
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    return bus_run(&arguments.bus, run_action, &arguments);
}
