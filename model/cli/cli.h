/* What the subcommands of `tribend-tables` share: exit codes, finding files, complaining. */
#ifndef TRIBEND_TABLES_CLI_H
#define TRIBEND_TABLES_CLI_H

#include <signal.h>

#include "description/module_description.h"

enum exit_code { EXIT_OK = 0, EXIT_USAGE = 2, EXIT_BAD_INPUT = 3, EXIT_SOLVER = 4, EXIT_OUTPUT = 5 };

#define CLI_PATH_BYTES 4096
#define CLI_ERROR_BYTES 1024

/* Each returns an exit code. `argv[0]` is the name of the program with the subcommand. */
int cli_solve(int argc, char **argv);
int cli_build(int argc, char **argv);
int cli_show(int argc, char **argv);
int cli_plot(int argc, char **argv);
int cli_fit(int argc, char **argv);
int cli_published(int argc, char **argv);

/* Print "tribend-tables: message" to standard error and return `code`. */
int cli_fail(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* The file of a module: `name` itself where it is a path, else tables/modules/NAME.yaml below the working directory or
 * beside the program. */
void cli_module_path(const char *name, char path[CLI_PATH_BYTES]);
/* Set by Ctrl-C or SIGTERM once cli_catch_interrupt() was called. */
extern volatile sig_atomic_t cli_interrupted;
void cli_catch_interrupt(void);
/* Whole file into memory, 8-byte aligned; NULL with a message. */
unsigned char *cli_read_file(const char *path, size_t *size, char *error, size_t error_bytes);
void cli_print_material(const struct material *material);

#endif
