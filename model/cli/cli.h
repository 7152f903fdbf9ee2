/* What the subcommands of `tribend-tables` share. */
#ifndef TRIBEND_TABLES_CLI_H
#define TRIBEND_TABLES_CLI_H

#include <argp.h>

#include "description/module_description.h"
#include "program/program.h"

/* Each returns an exit code. `argv[0]` is the name of the program with the subcommand. */
int cli_solve(int argc, char **argv);
int cli_build(int argc, char **argv);
int cli_rod(int argc, char **argv);
int cli_show(int argc, char **argv);
int cli_plot(int argc, char **argv);
int cli_fit(int argc, char **argv);
int cli_material(int argc, char **argv);
int cli_stiffness(int argc, char **argv);
int cli_study(int argc, char **argv);
int cli_published(int argc, char **argv);

/* The file of a module or material: `name` itself where it is a path, else tables/FOLDER/NAME.yaml. */
void cli_table_path(const char *folder, const char *name, char path[PROGRAM_PATH_BYTES]);
/* An element size from the command line, or argp's complaint. */
void cli_mesh_size(struct argp_state *state, const char *argument, double *size_m);
/* For the progress of sweeps: `context` is a struct cli_progress. */
struct cli_progress {
    const char *what; /* is counted */
};
void cli_show_progress(void *context, size_t done, size_t total);
const char *cli_base_name(const char *path);
/* A material file; its name is `name`, or the file's where that is NULL. */
bool cli_write_material(const char *path, const char *name, const struct material *material, char *error, size_t bytes);
void cli_print_material(const struct material *material);

#endif
