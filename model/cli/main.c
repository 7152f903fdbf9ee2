/* `tribend-tables`: from a material to a bend table. One file a subcommand. */
#include <gsl/gsl_errno.h>
#include <stdio.h>
#include <string.h>

#include "cli/cli.h"
#include "units/units.h"

#define MESH_SIZE_LEAST_M 1e-4

static const struct program_subcommand subcommands[] = {
    {"solve", cli_solve, "follow a module's equilibria under pressure, up to a pressure or a bend"},
    {"build", cli_build, "build a module's bend table"},
    {"show", cli_show, "print what a bend table holds"},
    {"plot", cli_plot, "draw a bend table"},
    {"fit", cli_fit, "fit material laws to tensile tests"},
    {"material", cli_material, "say over which stretch a material law may be used"},
    {"published", cli_published, "hold the solver against the founding paper's figures"}};

void cli_table_path(const char *folder, const char *name, char path[PROGRAM_PATH_BYTES]) {
    const size_t length = strlen(name);
    if (strchr(name, '/') != NULL || (length > 5 && strcmp(name + length - 5, ".yaml") == 0)) {
        (void)snprintf(path, PROGRAM_PATH_BYTES, "%s", name);
    } else {
        char relative[PROGRAM_PATH_BYTES];
        (void)snprintf(relative, sizeof relative, "tables/%s/%s.yaml", folder, name);
        program_find(relative, path);
    }
}

void cli_mesh_size(struct argp_state *state, const char *argument, double *size_m) {
    char error[PROGRAM_ERROR_BYTES];
    if (!units_parse(UNITS_LENGTH, argument, size_m, error, sizeof error)) {
        argp_error(state, "--mesh-size: %s", error);
    } else if (!(*size_m >= MESH_SIZE_LEAST_M)) {
        argp_error(state, "--mesh-size: %s is under 0.1mm", argument);
    }
}

void cli_print_material(const struct material *material) {
    static const char *const laws[] = {"neo-Hookean", "reduced polynomial", "Yeoh", "Ogden"};
    printf("material  %s (%s:", material->name, laws[material->law]);
    for (size_t i = 0; i < material->terms; i++) {
        if (material->law == MATERIAL_OGDEN) {
            printf(" c%zu = %.6g Pa, a%zu = %.6g%s", i + 1, material->coefficient_pa[i], i + 1, material->exponent[i],
                   i + 1 < material->terms ? "," : "");
        } else {
            printf(" C%zu0 = %.6g Pa%s", i + 1, material->coefficient_pa[i], i + 1 < material->terms ? "," : "");
        }
    }
    printf("; bulk modulus %.3g Pa)\n          %s\n", material->bulk_modulus_pa, material->source);
}

int main(int argc, char **argv) {
    (void)gsl_set_error_handler_off(); /* by default it aborts; every status is looked at instead */
    return program_run("tribend-tables", subcommands, sizeof subcommands / sizeof subcommands[0], argc, argv);
}
