/* `tribend decode`: CAN frames as text into what they say. */
#include <argp.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands.h"
#include "log/can_text.h"
#include "messages/message_decode.h"

#define TEXT_BYTES 4096

struct arguments {
    const char *source; /* NULL: standard input */
    int node;           /* 0: all */
    bool json;
    bool strict_log;
};

struct counts {
    size_t decoded;
    size_t others;
    size_t wrong_length;
    size_t malformed;
    size_t first_malformed; /* line */
    const char *what;
};

static const struct argp_option options[] = {
    {"log", 'l', NULL, 0, "the lines are those of candump -L, and nothing else will do", 0},
    {"node", 'n', "NODE", 0, "only what goes to or comes from this board, 1 to 15, or what goes to all", 0},
    {"json", 'j', NULL, 0, "a JSON object a line", 0},
    {0}};

static error_t parse(int key, char *text, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'l':
        arguments->strict_log = true;
        return 0;
    case 'n':
        arguments->node = cli_whole_number(state, "--node", text, 1, (int)MESSAGE_NODE_MOST);
        return 0;
    case 'j':
        arguments->json = true;
        return 0;
    case ARGP_KEY_ARG:
        if (arguments->source != NULL) {
            argp_error(state, "one file at a time: '%s' is the second", text);
        }
        arguments->source = text;
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static bool print_json(const struct can_text *line, const struct message_decoded *decoded) {
    json_t *object = message_decoded_json(decoded);
    bool made = object != NULL;
    if (made && line->has_time) {
        made = json_object_set_new(object, "time_us", json_integer((json_int_t)line->time_us)) == 0;
    }
    if (made && line->interface[0] != '\0') {
        made = json_object_set_new(object, "bus", json_string(line->interface)) == 0;
    }
    made = made && json_dumpf(object, stdout, JSON_COMPACT | JSON_REAL_PRECISION(10)) == 0;
    json_decref(object);
    return made && putchar('\n') != EOF;
}

static bool print_text(const struct can_text *line, const struct message_decoded *decoded) {
    char text[TEXT_BYTES];
    message_decoded_text(decoded, text, sizeof text);
    if (line->has_time) {
        printf("(%lld.%06lld) ", (long long)(line->time_us / 1000000), (long long)(line->time_us % 1000000));
    }
    return printf("%s%s%s\n", line->interface, line->interface[0] != '\0' ? " " : "", text) > 0;
}

static bool take(const struct arguments *arguments, const struct can_text *line, struct counts *counts) {
    struct message_decoded decoded;
    const enum message_decode_status status =
        line->remote ? MESSAGE_OF_OTHERS : message_decode(&line->frame, &decoded);
    if (status != MESSAGE_DECODED) {
        counts->others += status == MESSAGE_OF_OTHERS ? 1u : 0u;
        counts->wrong_length += status == MESSAGE_WRONG_LENGTH ? 1u : 0u;
        return true;
    }
    if (arguments->node != 0 && decoded.node != MESSAGE_NODE_ALL && (int)decoded.node != arguments->node) {
        counts->others++;
        return true;
    }
    counts->decoded++;
    return arguments->json ? print_json(line, &decoded) : print_text(line, &decoded);
}

static bool take_line(const struct arguments *arguments, char *line, size_t number, struct counts *counts) {
    struct can_text text;
    line[strcspn(line, "\r\n")] = '\0';
    if (line[strspn(line, " ")] == '\0') {
        return true;
    }
    const char *wrong = arguments->strict_log ? can_text_parse_log(line, &text) : can_text_parse(line, &text);
    if (wrong == NULL) {
        return take(arguments, &text, counts);
    }
    if (counts->malformed++ == 0u) {
        counts->first_malformed = number;
        counts->what = wrong;
    }
    return true;
}

/* What was not printed is said on standard error, so that nothing is lost unseen. */
static int report(const struct counts *counts, const char *name) {
    if (counts->decoded == 0u && counts->malformed > 0u) {
        return program_fail(EXIT_BAD_INPUT, "%s:%zu: no CAN frame: %s", name, counts->first_malformed,
                            counts->what);
    }
    if (counts->others + counts->wrong_length > 0u) {
        (void)fprintf(stderr,
                      "%s: %zu frames decoded, %zu of others, %zu of another length than this protocol's\n",
                      name, counts->decoded, counts->others, counts->wrong_length);
    }
    if (counts->malformed > 0u) {
        return program_fail(EXIT_BAD_INPUT, "%s: %zu lines skipped, the first is line %zu: %s", name,
                            counts->malformed, counts->first_malformed, counts->what);
    }
    return EXIT_OK;
}

static int decode(FILE *file, const char *name, const struct arguments *arguments) {
    struct counts counts = {0};
    char *line = NULL;
    size_t room = 0;
    bool written = true;
    (void)setvbuf(stdout, NULL, _IOLBF, 0); /* lines come out as frames come in */
    for (size_t number = 1; written && getline(&line, &room, file) >= 0; number++) {
        written = take_line(arguments, line, number, &counts);
    }
    free(line);
    if (!written || fflush(stdout) != 0) {
        return program_fail(EXIT_OUTPUT, "standard output: %s", strerror(errno));
    }
    return report(&counts, name);
}

int cli_decode(int argc, char **argv) {
    static const char doc[] =
        "Say what CAN frames mean: a line a frame, from FILE or standard input, as candump, candump -L or "
        "cansend have it.\v"
        "Examples:\n  candump can0 | tribend decode\n  tribend decode -l candump.log\n"
        "  echo 011# | tribend decode";
    const struct argp parser = {options, parse, "[FILE]", doc, NULL, NULL, NULL};
    struct arguments arguments = {.source = NULL};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    if (arguments.source == NULL || strcmp(arguments.source, "-") == 0) {
        return decode(stdin, "standard input", &arguments);
    }
    FILE *file = fopen(arguments.source, "r");
    if (file == NULL) {
        return program_fail(EXIT_BAD_INPUT, "%s: %s", arguments.source, strerror(errno));
    }
    const int status = decode(file, arguments.source, &arguments);
    (void)fclose(file);
    return status;
}
