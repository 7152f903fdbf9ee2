#include <ctype.h>
#include <string.h>

#include "manual/manual.h"
#include "program/program.h"
#include "program/version.h"

#define LINE_BYTES 2048

/* Text as roff takes it: no request at a line's start, no hyphen for a minus. */
static void put_text(FILE *out, const char *text) {
    if (*text == '.' || *text == '\'') {
        fputs("\\&", out);
    }
    for (; *text != '\0'; text++) {
        switch (*text) {
        case '\\':
            fputs("\\e", out);
            break;
        case '-':
            fputs("\\-", out);
            break;
        default:
            fputc(*text, out);
        }
    }
}

static void put_page_name(FILE *out, const char *path, bool upper) {
    for (; *path != '\0'; path++) {
        const char letter = *path == ' ' ? '-' : *path;
        fputc(upper ? toupper((unsigned char)letter) : letter, out);
    }
}

static void put_head(FILE *out, const struct manual_command *command) {
    fputs(".TH ", out);
    put_page_name(out, command->path, true);
    fputs(" 1 " TRIBEND_VERSION_DATE " \"tribend " TRIBEND_VERSION "\" \"User Commands\"\n.SH NAME\n", out);
    put_page_name(out, command->path, false);
    fputs(" \\- ", out);
    put_text(out, command->what != NULL ? command->what
                  : strcmp(command->path, "tribend") == 0
                      ? "command a soft pneumatic module, watch it, say why it differs from its model"
                      : "solve cross-sections, fit materials, make bend tables");
    fputs("\n", out);
}

static void put_name_of_option(FILE *out, const struct argp_option *option, const char *value) {
    if (option->key > 0 && option->key < 0x80 && isgraph(option->key)) {
        fprintf(out, "\\fB\\-%c\\fR, ", option->key);
    }
    fputs("\\fB\\-\\-", out);
    put_text(out, option->name);
    fputs("\\fR", out);
    if (value != NULL) {
        fputs("=\\fI", out);
        put_text(out, value);
        fputs("\\fR", out);
    }
}

static void put_options(FILE *out, const struct manual_command *command) {
    for (size_t i = 0; i < command->options; i++) {
        const struct argp_option *option = &command->option[i];
        if (!manual_is_option(option) || manual_is_alias(option)) {
            continue;
        }
        fputs(".TP\n", out);
        put_name_of_option(out, option, option->arg);
        for (size_t k = i + 1; k < command->options && manual_is_alias(&command->option[k]); k++) {
            fputs(", ", out);
            put_name_of_option(out, &command->option[k], option->arg);
        }
        fputs("\n", out);
        put_text(out, option->doc != NULL ? option->doc : "");
        fputs("\n", out);
    }
    fputs(".TP\n\\fB\\-?\\fR, \\fB\\-\\-help\\fR\nprint the options and an example\n", out);
}

static void put_synopsis(FILE *out, const struct manual_command *command) {
    fputs(".SH SYNOPSIS\n.B ", out);
    put_text(out, command->path);
    if (command->doc == NULL) {
        fputs("\n.I SUBCOMMAND\n\\&...\n", out);
        return;
    }
    fputs("\n[\\fIOPTION\\fR...]\n", out);
    if (*command->arguments != '\0') {
        fputs(".I ", out);
        put_text(out, command->arguments);
        fputs("\n", out);
    }
}

static void put_subcommands(FILE *out, const struct manual *manual, const struct manual_command *parent) {
    fputs(".SH SUBCOMMANDS\n", out);
    for (size_t i = 0; i < manual->commands; i++) {
        const struct manual_command *command = &manual->command[i];
        if (manual_is_below(command, parent)) {
            fputs(".TP\n.BR ", out);
            put_page_name(out, command->path, false);
            fputs(" (1)\n", out);
            put_text(out, command->what);
            fputs("\n", out);
        }
    }
}

/* What stands before argp's \v. */
static void put_description(FILE *out, const char *doc) {
    fputs(".SH DESCRIPTION\n", out);
    char line[LINE_BYTES];
    (void)snprintf(line, sizeof line, "%.*s", (int)strcspn(doc, "\v"), doc);
    const char *at = line;
    char part[LINE_BYTES];
    while (manual_line(&at, part, sizeof part)) {
        put_text(out, part);
        fputs("\n", out);
    }
}

/* "Example: COMMAND", or an indented line after "Examples:". NULL: the line is neither. */
static const char *example_of(const char *line) {
    static const char one[] = "Example: ";
    return strncmp(line, one, sizeof one - 1) == 0 ? line + sizeof one - 1
           : strncmp(line, "  ", 2) == 0           ? line + 2
                                                   : NULL;
}

static void put_lines_after(FILE *out, const char *doc, const char *title, bool examples) {
    const char *after = strchr(doc, '\v'), *at = after;
    char line[LINE_BYTES];
    bool any = false;
    if (after == NULL) {
        return;
    }
    at++;
    while (manual_line(&at, line, sizeof line)) {
        const char *example = example_of(line);
        if ((example != NULL) != examples || *line == '\0' || strcmp(line, "Examples:") == 0) {
            continue;
        }
        if (!any) {
            fprintf(out, ".SH %s\n%s", title, examples ? ".nf\n" : "");
        }
        any = true;
        put_text(out, examples ? example : line);
        fputs("\n", out);
    }
    fputs(any && examples ? ".fi\n" : "", out);
}

static void put_exit_status(FILE *out) {
    static const struct {
        int code;
        const char *text;
    } exits[] = {
#define ROW(name, code, text) {code, text},
        PROGRAM_EXITS(ROW)
#undef ROW
    };
    fputs(".SH \"EXIT STATUS\"\n", out);
    for (size_t i = 0; i < sizeof exits / sizeof exits[0]; i++) {
        fprintf(out, ".TP\n.B %d\n", exits[i].code);
        put_text(out, exits[i].text);
        fputs("\n", out);
    }
}

static void put_see_also(FILE *out, const struct manual *manual, const struct manual_command *command) {
    fputs(".SH \"SEE ALSO\"\n.BR ", out);
    if (command != &manual->command[0]) {
        put_page_name(out, manual->command[0].path, false);
        fputs(" (1)\n", out);
        return;
    }
    fputs(strcmp(command->path, "tribend") == 0 ? "tribend-tables" : "tribend", out);
    fputs(" (1)\n", out);
}

static void put_whole_program(FILE *out, const struct manual *manual) {
    const bool is_host = strcmp(manual->command[0].path, "tribend") == 0;
    fputs(".SH DESCRIPTION\nQuantities carry their unit: 80mbar, 8kPa, 60deg, 12mm, 3s.\n", out);
    fputs("Each subcommand has a page of its own, and prints its options with\n.BR \\-\\-help .\n", out);
    put_subcommands(out, manual, &manual->command[0]);
    put_exit_status(out);
    if (is_host) {
        fputs(".SH ENVIRONMENT\n.TP\n.B TRIBEND_TABLE\nthe bend table, where \\fB\\-\\-table\\fR does not "
              "name one\n",
              out);
    }
}

void manual_write_page(FILE *out, const struct manual *manual, const struct manual_command *command) {
    put_head(out, command);
    put_synopsis(out, command);
    if (command == &manual->command[0]) {
        put_whole_program(out, manual);
    } else if (command->doc == NULL) {
        put_subcommands(out, manual, command);
        put_exit_status(out);
    } else {
        put_description(out, command->doc);
        fputs(".SH OPTIONS\n", out);
        put_options(out, command);
        put_lines_after(out, command->doc, "NOTES", false);
        put_lines_after(out, command->doc, "EXAMPLES", true);
        put_exit_status(out);
    }
    put_see_also(out, manual, command);
}
