/* tribend-tables material: a law, its stress curves, and over which stretch it may be used. */
#include "cli/material_report.h"

#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/cli.h"
#include "description/module_description.h"
#include "program/gnuplot.h"

#define STRETCH_MOST 8.0
#define CURVE_POINTS 300

static const struct argp_option options[] = {{"plot", 'p', "FILE", 0, "draw the stress in three ways of pulling as PNG", 0},
                                             {0}};

struct arguments {
    const char *material;
    const char *plot;
};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'p':
        arguments->plot = argument;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one material at a time, '%s' is too much", argument);
        }
        arguments->material = argument;
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which MATERIAL? For example ecoflex-0030-measured");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "MATERIAL",
                                   "Say over which stretch the law of MATERIAL (a name from tables/materials or a YAML "
                                   "file) may be used.\v"
                                   "Example: tribend-tables material ecoflex-0030-measured",
                                   NULL, NULL, NULL};

void material_report_stability(const struct material *material) {
    const double fitted = 1.0 + material->strain_max;
    double usable = fitted;
    printf("%-14s %22s %22s\n", "up to stretch", "nominal stress rises", "elliptic");
    for (int m = 0; m < DEFORMATION_MODES; m++) {
        const enum deformation_mode mode = (enum deformation_mode)m;
        const double rising = material_stable_stretch(material, mode, STRETCH_MOST);
        const double elliptic = material_elliptic_stretch(material, mode, STRETCH_MOST);
        printf("%-14s %20s%.2f %20s%.2f\n", deformation_mode_name[m], rising < STRETCH_MOST ? "" : "over ", rising,
               elliptic < STRETCH_MOST ? "" : "over ", elliptic);
        usable = fmin(usable, fmin(rising, elliptic));
    }
    if (usable < fitted) {
        printf("UNSTABLE       beyond stretch %.2f, inside the %.2f that it is meant for: a path may break down there\n",
               usable, fitted);
    } else {
        printf("usable         up to stretch %.2f, as far as it is meant for\n", usable);
    }
}

static bool draw(const char *path, const struct material *material, char *error, size_t bytes) {
    struct gnuplot plot;
    if (!gnuplot_open(&plot, path, 1000, 700, error, bytes)) {
        return false;
    }
    fprintf(plot.script, "set title '%s' noenhanced\nset grid\nset key left top\nset xlabel 'stretch'\n"
                         "set ylabel 'nominal stress / kPa'\nplot ",
            material->name);
    for (int m = 0; m < DEFORMATION_MODES; m++) {
        fprintf(plot.script, "'-' w l lw 2 t '%s'%s", deformation_mode_name[m], m + 1 < DEFORMATION_MODES ? ", " : "\n");
    }
    for (int m = 0; m < DEFORMATION_MODES; m++) {
        for (int i = 0; i <= CURVE_POINTS; i++) {
            const double stretch = 1.0 + material->strain_max * i / CURVE_POINTS;
            fprintf(plot.script, "%.5f %.6f\n", stretch,
                    1e-3 * material_nominal_stress_pa(material, (enum deformation_mode)m, stretch));
        }
        fputs("e\n", plot.script);
    }
    return gnuplot_close(&plot, error, bytes);
}

int cli_material(int argc, char **argv) {
    struct arguments arguments = {.material = NULL};
    char path[PROGRAM_PATH_BYTES], message[PROGRAM_ERROR_BYTES];
    struct material material;
    struct description_error error;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    cli_table_path("materials", arguments.material, path);
    if (!material_read(path, &material, &error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error.text);
    }
    cli_print_material(&material);
    material_report_stability(&material);
    if (arguments.plot != NULL && !draw(arguments.plot, &material, message, sizeof message)) {
        return program_fail(EXIT_OUTPUT, "%s", message);
    }
    return EXIT_OK;
}
