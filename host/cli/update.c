/* tribend update: another bend table for a board, over the bus. Checked here before it goes and by the board
 * before it counts; the old one is kept until the new one is whole. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/report_json.h"
#include "cli/transfer.h"
#include "link/can_board.h"
#include "program/input_file.h"

#define HASH_BYTES 17

enum { ANY_MODULE = 0x100, UNCHECKED, NO_RESET };

struct arguments {
    struct bus_options bus;
    const char *path;
    bool any_module;
    bool unchecked;
    bool no_reset;
};

static const struct argp_option options[] = {
    {"any-module", ANY_MODULE, NULL, 0, "also a table of another module than the one that runs", 0},
    {"unchecked", UNCHECKED, NULL, 0, "leave it to the board alone to judge the table", 0},
    {"json", 'j', NULL, 0, "for programs: one JSON object", 0},
    {"no-reset", NO_RESET, NULL, 0, "the board uses it from its next start on, whenever that is", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'j':
        arguments->bus.json = true;
        return 0;
    case ANY_MODULE:
        arguments->any_module = true;
        return 0;
    case UNCHECKED:
        arguments->unchecked = true;
        return 0;
    case NO_RESET:
        arguments->no_reset = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one table at a time, '%s' is too much", argument);
        }
        arguments->path = argument;
        return 0;
    case ARGP_KEY_END:
        if (arguments->path == NULL) {
            argp_error(state, "with which table? For example tables/paper-semicircle.tbt");
        }
        if (strcmp(arguments->bus.bus, "sim") == 0) {
            argp_error(state, "the simulation in this process takes --table: --bus says where the board is");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {
    options,
    parse,
    "TABLE.tbt",
    "Send a bend table to a board, which must be vented, and start the board anew with it.\v"
    "Example: tribend update tables/paper-semicircle.tbt --bus can0",
    children,
    NULL,
    NULL};

/* The board that came back must run what was sent. */
static int start_anew(struct bus *bus, uint64_t hash) {
    if (!can_board_reset(bus->can, &bus->identity)) {
        return program_fail(EXIT_BUS,
                            "the board has the table, but did not start anew: switch it off and on");
    }
    if (hash != 0 && bus->identity.table_hash != hash) {
        return program_fail(EXIT_MISMATCH,
                            "the board started with table %016" PRIx64 ", not with %016" PRIx64,
                            bus->identity.table_hash, hash);
    }
    return EXIT_OK;
}

static int print_json(const struct bus *bus, uint64_t before, bool restarted) {
    char was[HASH_BYTES], runs[HASH_BYTES];
    (void)snprintf(was, sizeof was, "%016" PRIx64, before);
    (void)snprintf(runs, sizeof runs, "%016" PRIx64, restarted ? bus->identity.table_hash : before);
    return report_json_print(json_pack("{s:s,s:s,s:s,s:b}", "table_before", was, "table", runs, "module",
                                       restarted ? bus->identity.module : bus->module_name, "restarted", restarted));
}

static int update(struct bus *bus, const struct arguments *arguments, const uint8_t *image, size_t bytes,
                  uint64_t hash) {
    const uint64_t before = bus->table_hash;
    const bool restarts = !arguments->no_reset;
    fprintf(arguments->bus.json ? stderr : stdout, "board     table %016" PRIx64 " of module %s\n", before,
            bus->module_name);
    int code = transfer_image(bus, &arguments->bus, TRANSFER_KIND_TABLE, image, (uint32_t)bytes,
                              arguments->any_module);
    if (code == EXIT_OK && restarts) {
        code = start_anew(bus, hash);
    }
    if (code == EXIT_OK && arguments->bus.json) {
        return print_json(bus, before, restarts);
    }
    if (code == EXIT_OK && restarts) {
        printf("runs      table %016" PRIx64 " of module %s\n", bus->identity.table_hash, bus->identity.module);
    }
    return code;
}

int cli_update(int argc, char **argv) {
    static struct bus bus;
    struct arguments arguments = {.path = NULL};
    struct table_file file;
    char error[PROGRAM_ERROR_BYTES];
    size_t bytes = 0;
    bus_options_init(&arguments.bus);
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    uint64_t hash = 0;
    if (!arguments.unchecked) {
        const int judged = table_file_open(&file, arguments.path, NULL);
        if (judged != EXIT_OK) {
            return judged;
        }
        hash = file.table.module.inputs_hash;
        table_file_close(&file);
    }
    uint8_t *image = input_file_read(arguments.path, &bytes, error, sizeof error);
    if (image == NULL) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    int code = bus_open(&bus, &arguments.bus);
    if (code == EXIT_OK) {
        code = update(&bus, &arguments, image, bytes, hash);
        bus_close(&bus);
    }
    free(image);
    return code;
}
