/* tribend-tables stiffness: fit the stiffness of a real module to half the plateaus of a run, judge it on the others. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "calibration/stiffness_fit.h"
#include "cli/cli.h"
#include "program/gnuplot.h"
#include "program/output_file.h"

#define DEGREES (180.0 / M_PI)

struct arguments {
    const char *module;
    const char *run;
    const char *material;
    const char *output;
    const char *plot;
};

static const struct argp_option options[] = {
    {"material", 'm', "NAME", 0, "a material from tables/materials, or the path of a YAML file", 0},
    {"output", 'o', "FILE", 0, "write the material with the fitted stiffness as YAML", 0},
    {"plot", 'p', "FILE", 0, "draw measured and computed bends as PNG", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'm':
        arguments->material = argument;
        return 0;
    case 'o':
        arguments->output = argument;
        return 0;
    case 'p':
        arguments->plot = argument;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num == 0) {
            arguments->module = argument;
        } else if (state->arg_num == 1) {
            arguments->run = argument;
        } else {
            argp_error(state, "a module and a run, '%s' is too much", argument);
        }
        return 0;
    case ARGP_KEY_END:
        if (state->arg_num < 2) {
            argp_error(state, "a MODULE and a RUN.csv are wanted");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "MODULE RUN.csv",
                                   "Fit the stiffness of MODULE's rubber to every second pressure plateau of a run without "
                                   "load, and judge it on the others, beside a straight line of bend to pressure.\v"
                                   "Example: tribend-tables stiffness stiff-flop RUN.csv",
                                   NULL, NULL, NULL};

static void print_fit(const struct plateau *plateaus, size_t count, const struct stiffness_fit *fit) {
    printf("%8s %10s %10s %10s %10s  %s\n", "row", "pressure", "measured", "computed", "gap", "used to");
    printf("%8s %10s %10s %10s %10s\n", "", "kPa", "deg", "deg", "deg");
    for (size_t i = 0; i < count; i++) {
        const double *p = plateaus[i].pressure_pa;
        printf("%8zu %10.2f %10.2f %10.2f %+10.2f  %s\n", plateaus[i].first_row, 1e-3 * fmax(p[0], fmax(p[1], p[2])),
               plateaus[i].bend_rad * DEGREES, fit->model_rad[i] * DEGREES,
               (fit->model_rad[i] - plateaus[i].bend_rad) * DEGREES, fit->used[i] ? "fit" : "judge");
    }
    printf("stiffness x %.4f of the material's\n", fit->factor);
    printf("rms gap   %.2f deg on the %zu fitted plateaus, %.2f deg on the %zu held out\n", fit->rms_fitted_rad * DEGREES,
           fit->fitted, fit->rms_held_out_rad * DEGREES, fit->held_out);
    printf("beside    %.2f deg of a straight line a + b p, %.2f deg of a proportion b p, fitted to the same plateaus\n",
           fit->rms_line_rad * DEGREES, fit->rms_proportion_rad * DEGREES);
}

static bool draw(const char *path, const struct module_description *module, const struct plateau *plateaus, size_t count,
                 const struct stiffness_fit *fit, char *error, size_t bytes) {
    struct gnuplot plot;
    if (!gnuplot_open(&plot, path, 1000, 700, error, bytes)) {
        return false;
    }
    fprintf(plot.script,
            "set title '%s: plateaus of one chamber' noenhanced\nset grid\nset key top left\nset xlabel 'pressure / kPa'\n"
            "set ylabel 'bend / deg'\nset offsets graph 0.05, graph 0.05, graph 0.05, graph 0.05\n"
            "plot '-' w p pt 7 ps 1.5 t 'measured, fitted', '-' w p pt 6 ps 1.5 t 'measured, held out', "
            "'-' w p pt 2 ps 1.5 t 'computed'\n",
            module->name);
    for (int series = 0; series < 3; series++) {
        for (size_t i = 0; i < count; i++) {
            const double *p = plateaus[i].pressure_pa;
            if (series == 2 || fit->used[i] == (series == 0)) {
                fprintf(plot.script, "%.6g %.6g\n", 1e-3 * fmax(p[0], fmax(p[1], p[2])),
                        DEGREES * (series == 2 ? fit->model_rad[i] : plateaus[i].bend_rad));
            }
        }
        fputs("e\n", plot.script);
    }
    return gnuplot_close(&plot, error, bytes);
}

int cli_stiffness(int argc, char **argv) {
    static struct plateau plateaus[PLATEAUS_MAX];
    static struct stiffness_fit fit;
    static const struct plateau_options how = {.jump_pa = 3000.0, .rows_least = 20, .loaded_pa = 5000.0};
    struct arguments arguments = {.module = NULL};
    char path[PROGRAM_PATH_BYTES], message[PROGRAM_ERROR_BYTES];
    struct module_description module;
    struct description_error error;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    cli_table_path("modules", arguments.module, path);
    if (!module_description_read(path, arguments.material, &module, &error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error.text);
    }
    const size_t count = plateaus_read(arguments.run, &how, plateaus, message, sizeof message);
    if (count == 0) {
        return program_fail(EXIT_BAD_INPUT, "%s", message);
    }
    cli_print_material(&module.material);
    if (!stiffness_fit(&module, plateaus, count, &fit, &error)) {
        return program_fail(EXIT_SOLVER, "%s: %s", arguments.run, error.text);
    }
    print_fit(plateaus, count, &fit);
    for (size_t k = 0; k < module.material.terms; k++) {
        module.material.coefficient_pa[k] *= fit.factor;
    }
    (void)snprintf(message, sizeof message,
                   "%.100s with its stiffness x %.4f, fitted to %zu plateaus of %.80s; rms gap %.2f deg on %zu others",
                   module.material.name, fit.factor, fit.fitted, cli_base_name(arguments.run),
                   fit.rms_held_out_rad * DEGREES, fit.held_out);
    (void)snprintf(module.material.source, sizeof module.material.source, "%.500s", message);
    if (arguments.output != NULL && !cli_write_material(arguments.output, NULL, &module.material, message, sizeof message)) {
        return program_fail(EXIT_OUTPUT, "%s", message);
    }
    if (arguments.plot != NULL && !draw(arguments.plot, &module, plateaus, count, &fit, message, sizeof message)) {
        return program_fail(EXIT_OUTPUT, "%s", message);
    }
    return EXIT_OK;
}
