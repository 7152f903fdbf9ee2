/* What both programs share: subcommands, exit codes, finding files of the repository, complaining, being interrupted. */
#ifndef TRIBEND_PROGRAM_H
#define TRIBEND_PROGRAM_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>

enum program_exit {
    EXIT_OK = 0,
    EXIT_USAGE = 2,
    EXIT_BAD_INPUT = 3,
    EXIT_SOLVER = 4,
    EXIT_OUTPUT = 5,
    EXIT_FAULT = 6, /* the controller latched a fault */
    EXIT_INTERRUPTED = 130
};

#define PROGRAM_PATH_BYTES 4096
#define PROGRAM_ERROR_BYTES 1024

struct program_subcommand {
    const char *name;
    /* Returns an exit code; argv[0] is the program's name with the subcommand's. */
    int (*run)(int argc, char **argv);
    const char *what;
};

/* Run the subcommand that argv[1] names; returns its exit code. */
int program_run(const char *name, const struct program_subcommand *subcommands, size_t count, int argc, char **argv);
/* Print "PROGRAM: message" to standard error and return `code`. */
int program_fail(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Set by Ctrl-C or SIGTERM once program_catch_interrupt() was called. A second one ends the program at once. */
extern volatile sig_atomic_t program_interrupted;
void program_catch_interrupt(void);
/* A file that comes with tribend: `relative` below the working directory, else below the folder above the program's. */
void program_find(const char *relative, char path[PROGRAM_PATH_BYTES]);

#endif
