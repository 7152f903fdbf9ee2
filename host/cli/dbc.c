/* `tribend dbc`: the messages on the CAN bus, for other programs. */
#include <argp.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"
#include "comms/codec.h"
#include "messages/message_text.h"

struct arguments {
    const char *output; /* NULL: standard output */
    int node;
    bool page;
};

static const struct argp_option options[] = {
    {NULL, 'o', "FILE", 0, "write it there (default: standard output)", 0},
    {"node", 'n', "NODE", 0, "identifiers of the board with this number, 1 to 15 (default 1)", 0},
    {"page", 'p', NULL, 0, "the page for people (docs/messages.md) instead", 0},
    {0}};

static error_t parse(int key, char *text, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'o':
        arguments->output = text;
        return 0;
    case 'n':
        arguments->node = cli_whole_number(state, "--node", text, 1, (int)MESSAGE_NODE_MOST);
        return 0;
    case 'p':
        arguments->page = true;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "dbc takes no argument, '%s' is too much", text);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static int write_text(FILE *file, const struct arguments *arguments) {
    const bool written =
        arguments->page ? message_page_write(file) : message_dbc_write(file, (unsigned)arguments->node);
    return fflush(file) == 0 && written ? EXIT_OK : EXIT_OUTPUT;
}

/* Aside first, so that a file that was there stays whole. */
static int write_file(const struct arguments *arguments) {
    char aside[PROGRAM_PATH_BYTES];
    if ((size_t)snprintf(aside, sizeof aside, "%s.part", arguments->output) >= sizeof aside) {
        return program_fail(EXIT_OUTPUT, "the name of the output is too long");
    }
    FILE *file = fopen(aside, "w");
    if (file == NULL) {
        return program_fail(EXIT_OUTPUT, "%s: %s", aside, strerror(errno));
    }
    const int written = write_text(file, arguments);
    const bool closed = fclose(file) == 0;
    if (written != EXIT_OK || !closed || rename(aside, arguments->output) != 0) {
        const int reason = errno;
        (void)remove(aside);
        return program_fail(EXIT_OUTPUT, "%s: %s", arguments->output, strerror(reason));
    }
    return EXIT_OK;
}

int cli_dbc(int argc, char **argv) {
    static const char doc[] =
        "Write the CAN messages of a tribend board as a DBC file, which can-utils' friends, Wireshark's "
        "relatives and python packages read.\v"
        "Examples:\n  tribend dbc -o tribend.dbc\n  tribend dbc --node 3 -o board3.dbc";
    const struct argp parser = {options, parse, NULL, doc, NULL, NULL, NULL};
    struct arguments arguments = {.node = 1};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    if (arguments.output != NULL) {
        return write_file(&arguments);
    }
    const int written = write_text(stdout, &arguments);
    return written == EXIT_OK ? EXIT_OK : program_fail(written, "standard output: %s", strerror(errno));
}
