#include <errno.h>
#include <setjmp.h>
#include <string.h>

#include "manual/manual.h"
#include "program/program.h"

/* The programs' own: main() of host/cli or model/cli, and of host/board where `tribend` hands over to it. */
int manual_main(int argc, char **argv);
int board_main(int argc, char **argv) __attribute__((weak));

/* What the linker puts in the place of the library's. */
error_t __wrap_argp_parse(const struct argp *argp, int argc, char **argv, unsigned flags, int *index,
                          void *input);
int __wrap_program_run(const char *name, const struct program_subcommand *subcommands, size_t count, int argc,
                       char **argv);
int __wrap_execv(const char *path, char *const argv[]);

static struct manual *collected;
static struct manual_command *current;
static bool complete;
static jmp_buf handed_over;

static void add_options(struct manual_command *command, const struct argp *argp) {
    for (const struct argp_option *o = argp->options;
         o != NULL && (o->name != NULL || o->key != 0 || o->doc != NULL); o++) {
        if (command->options == MANUAL_OPTIONS_MAX) {
            complete = false;
            fprintf(stderr, "manual: %s has more than %u options\n", command->path, MANUAL_OPTIONS_MAX);
            return;
        }
        command->option[command->options++] = *o;
    }
    for (const struct argp_child *child = argp->children; child != NULL && child->argp != NULL; child++) {
        add_options(command, child->argp);
    }
}

error_t __wrap_argp_parse(const struct argp *argp, int argc, char **argv, unsigned flags, int *index,
                          void *input) {
    (void)argc, (void)argv, (void)flags, (void)index, (void)input;
    if (current != NULL && current->doc == NULL) {
        current->doc = argp->doc != NULL ? argp->doc : "";
        current->arguments = argp->args_doc != NULL ? argp->args_doc : "";
        add_options(current, argp);
    }
    return EINVAL; /* the subcommand goes no further */
}

int __wrap_execv(const char *path, char *const argv[]) {
    static char *none[] = {"board", NULL};
    (void)path, (void)argv;
    if (board_main != NULL) {
        (void)board_main(1, none);
    }
    longjmp(handed_over, 1); /* as execv() does, this does not come back */
}

static struct manual_command *add_command(const char *path, const char *what) {
    if (collected->commands == MANUAL_COMMANDS_MAX) {
        complete = false;
        fprintf(stderr, "manual: more than %u subcommands\n", MANUAL_COMMANDS_MAX);
        return NULL;
    }
    struct manual_command *command = &collected->command[collected->commands++];
    memset(command, 0, sizeof *command);
    (void)snprintf(command->path, sizeof command->path, "%s", path);
    command->what = what;
    return command;
}

static void walk(const char *name, const struct program_subcommand *subcommand) {
    char path[MANUAL_PATH_BYTES];
    (void)snprintf(path, sizeof path, "%s %s", name, subcommand->name);
    char *argv[] = {path, NULL};
    const size_t before = collected->commands;
    struct manual_command *command = add_command(path, subcommand->what);
    current = command;
    if (setjmp(handed_over) == 0) {
        (void)subcommand->run(1, argv);
    }
    if (command != NULL && command->doc == NULL && collected->commands == before + 1) {
        complete = false;
        fprintf(stderr, "manual: %s neither parses options nor has subcommands\n", path);
    }
}

int __wrap_program_run(const char *name, const struct program_subcommand *subcommands, size_t count, int argc,
                       char **argv) {
    (void)argc, (void)argv;
    if (collected->commands == 0) {
        (void)add_command(name, NULL);
    }
    for (size_t i = 0; i < count; i++) {
        walk(name, &subcommands[i]);
    }
    return EXIT_USAGE;
}

bool manual_collect(struct manual *manual) {
    static char name[] = "manual";
    char *argv[] = {name, NULL};
    collected = manual;
    complete = true;
    manual->commands = 0;
    (void)manual_main(1, argv);
    return complete && manual->commands > 1;
}

bool manual_is_alias(const struct argp_option *option) {
    return (option->flags & OPTION_ALIAS) != 0;
}

bool manual_is_option(const struct argp_option *option) {
    return option->name != NULL && (option->flags & (OPTION_DOC | OPTION_HIDDEN)) == 0;
}

bool manual_is_below(const struct manual_command *command, const struct manual_command *parent) {
    const size_t length = strlen(parent->path);
    return strncmp(command->path, parent->path, length) == 0 && command->path[length] == ' ' &&
           strchr(command->path + length + 1, ' ') == NULL;
}

bool manual_line(const char **at, char *line, size_t bytes) {
    const size_t length = strcspn(*at, "\n\v");
    if (**at == '\0') {
        return false;
    }
    (void)snprintf(line, bytes, "%.*s", (int)length, *at);
    *at += length + ((*at)[length] != '\0' ? 1u : 0u);
    return true;
}
