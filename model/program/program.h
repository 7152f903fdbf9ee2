/* What both programs share: subcommands, exit codes, finding files of the repository, complaining, being interrupted. */
#ifndef TRIBEND_PROGRAM_H
#define TRIBEND_PROGRAM_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What an exit code means, a row each; the man page's table comes from here. */
#define PROGRAM_EXITS(X)                                                                                                  \
    X(OK, 0, "done")                                                                                                      \
    X(USAGE, 2, "the command line makes no sense")                                                                        \
    X(BAD_INPUT, 3, "a file or other input cannot be used")                                                               \
    X(SOLVER, 4, "the solver found no solution")                                                                          \
    X(OUTPUT, 5, "an output cannot be written")                                                                           \
    X(FAULT, 6, "the controller latched a fault, or the chambers did not vent")                                           \
    X(BUS, 7, "the bus or the board cannot be reached, or went away")                                                     \
    X(MISMATCH, 8, "the board speaks another version, or has another module or table, than was asked for")                \
    X(REFUSED, 9, "the board refused what it was told")                                                                   \
    X(INTERRUPTED, 130, "interrupted by Ctrl-C or SIGTERM")
enum program_exit {
#define PROGRAM_EXIT_ENUM(NAME, code, text) EXIT_##NAME = (code),
    PROGRAM_EXITS(PROGRAM_EXIT_ENUM)
#undef PROGRAM_EXIT_ENUM
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
/* Microseconds of a clock that nobody sets. */
int64_t program_now_us(void);
/* A file that comes with tribend: `relative` below the working directory, else below the program's folder, the folder above, or
 * share/tribend there, where it is installed. */
void program_find(const char *relative, char path[PROGRAM_PATH_BYTES]);

#endif
