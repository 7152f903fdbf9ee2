/* Man pages and bash completion, from what the subcommands themselves give to argp: there is no second list
 * of options.
 *
 * The generator is linked with a program's own objects. The linker hands it their calls of program_run(),
 * argp_parse() and execv()
 * (--wrap), so that it walks every table of subcommands and sees each parser. Built and run by the Makefile,
 * not installed. */
#ifndef TRIBEND_MANUAL_H
#define TRIBEND_MANUAL_H

#include <argp.h>
#include <stdbool.h>
#include <stdio.h>

#define MANUAL_COMMANDS_MAX 64u
#define MANUAL_OPTIONS_MAX 48u
#define MANUAL_PATH_BYTES 64u

struct manual_command {
    char path[MANUAL_PATH_BYTES]; /* "tribend gap plan" */
    const char *what;             /* one line; NULL of the program itself */
    const char *doc;              /* argp's, with its \v; NULL where there are only further subcommands */
    const char *arguments;
    struct argp_option option[MANUAL_OPTIONS_MAX]; /* of the parser and its children, in order */
    size_t options;
};

struct manual {
    struct manual_command command[MANUAL_COMMANDS_MAX]; /* a parent before its children */
    size_t commands;
};

/* Walk the program's subcommands. False, with a message: one of them gave no parser. */
bool manual_collect(struct manual *manual);
/* The option has more names than its first: the next entries. */
bool manual_is_alias(const struct argp_option *option);
/* An entry that is an option at all, and not a group's title. */
bool manual_is_option(const struct argp_option *option);
/* The command's parent is `parent`. */
bool manual_is_below(const struct manual_command *command, const struct manual_command *parent);
/* Next line of text at `*at`, which moves on; false: there is none left. */
bool manual_line(const char **at, char *line, size_t bytes);

/* roff's man macros. */
void manual_write_page(FILE *out, const struct manual *manual, const struct manual_command *command);
void manual_write_completion(FILE *out, const struct manual *manual);

#endif
