/* `tribend-tables`: from a material to a bend table. One file a subcommand. */
#include <gsl/gsl_errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cli/cli.h"
#include "program/output_file.h"
#include "units/units.h"

#define MESH_SIZE_LEAST_M 1e-4
#define BAR_WIDTH 40

static const struct program_subcommand subcommands[] = {
    {"solve", cli_solve, "follow a module's equilibria under pressure, up to a pressure or a bend"},
    {"build", cli_build, "build a module's bend table"},
    {"rod", cli_rod, "find the tip under gravity, a payload and a force"},
    {"show", cli_show, "print what a bend table holds"},
    {"plot", cli_plot, "draw a bend table"},
    {"fit", cli_fit, "fit material laws to tensile tests"},
    {"material", cli_material, "say over which stretch a material law may be used"},
    {"stiffness", cli_stiffness, "fit the stiffness of a real module to the plateaus of a run"},
    {"study", cli_study, "reproduce a parametric study of the founding paper"},
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

/* A bar that redraws itself on a terminal, a line for each tenth elsewhere. */
void cli_show_progress(void *context, size_t done, size_t total) {
    const struct cli_progress *progress = context;
    if (isatty(STDERR_FILENO) != 0) {
        const int filled = (int)(done * BAR_WIDTH / total);
        fprintf(stderr, "\r[%.*s%*s] %3zu %% (%zu of %zu %s)%s", filled, "########################################",
                BAR_WIDTH - filled, "", 100 * done / total, done, total, progress->what, done == total ? "\n" : "");
    } else if (done > 0 && done * 10 / total != (done - 1) * 10 / total) {
        fprintf(stderr, "%3zu %% (%zu of %zu %s)\n", 100 * done / total, done, total, progress->what);
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

const char *cli_base_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash == NULL ? path : slash + 1;
}

static void write_list(FILE *stream, const char *key, const double *value, size_t count) {
    fprintf(stream, "%s: [", key);
    for (size_t i = 0; i < count; i++) {
        fprintf(stream, "%s%.6g", i == 0 ? "" : ", ", value[i]);
    }
    fputs("]\n", stream);
}

bool cli_write_material(const char *path, const char *name, const struct material *material, char *error, size_t bytes) {
    static const char *const law[] = {"neo-hookean", "reduced-polynomial", "yeoh", "ogden"};
    struct output_file file;
    char own[MATERIAL_NAME_BYTES];
    (void)snprintf(own, sizeof own, "%s", name != NULL ? name : cli_base_name(path));
    own[strcspn(own, ".")] = '\0';
    if (!output_file_open(&file, path, error, bytes)) {
        return false;
    }
    fprintf(file.stream, "name: %s\nlaw: %s\n", own, law[material->law]);
    write_list(file.stream, "coefficients_pa", material->coefficient_pa, material->terms);
    if (material->law == MATERIAL_OGDEN) {
        write_list(file.stream, "exponents", material->exponent, material->terms);
    }
    fprintf(file.stream,
            "density_kgpm3: %.6g\nbulk_modulus_pa: %.3e\nstrain_min: %.6g\nstrain_max: %.6g\nsource: \"%s\"\n",
            material->density_kgpm3, material->bulk_modulus_pa, material->strain_min, material->strain_max,
            material->source);
    return output_file_commit(&file, error, bytes);
}

int main(int argc, char **argv) {
    (void)gsl_set_error_handler_off(); /* by default it aborts; every status is looked at instead */
    return program_run("tribend-tables", subcommands, sizeof subcommands / sizeof subcommands[0], argc, argv);
}
