/* tribend-tables fit: a material law from a tensile test, with its error, strain range and stability. */
#include <argp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/cli.h"
#include "material/material_fit.h"
#include "program/gnuplot.h"
#include "program/output_file.h"

struct law_choice {
    const char *name;
    enum material_law law;
    size_t terms;
};

static const struct law_choice laws[] = {{"neo-hookean", MATERIAL_NEO_HOOKEAN, 1},
                                         {"reduced-polynomial-2", MATERIAL_REDUCED_POLYNOMIAL, 2},
                                         {"yeoh", MATERIAL_YEOH, 3}};

struct arguments {
    const char *path;
    const char *output;
    const char *plot;
    const char *name;
    const struct law_choice *law;
    double strain_max;
};

static const struct argp_option options[] = {
    {"law", 'l', "LAW", 0, "neo-hookean, reduced-polynomial-2 or yeoh (default yeoh)", 0},
    {"strain-max", 's', "PERCENT", 0, "fit up to this strain, such as 300% (default 300%)", 0},
    {"output", 'o', "FILE", 0, "write the material as YAML", 0},
    {"name", 'n', "NAME", 0, "the material's name in that file (default: the file's)", 0},
    {"plot", 'p', "FILE", 0, "draw test and fit as PNG", 0},
    {0}};

static void parse_law(struct argp_state *state, struct arguments *arguments, const char *text) {
    for (size_t i = 0; i < sizeof laws / sizeof laws[0]; i++) {
        if (strcmp(text, laws[i].name) == 0) {
            arguments->law = &laws[i];
            return;
        }
    }
    argp_error(state, "--law: '%s' is not neo-hookean, reduced-polynomial-2 or yeoh", text);
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    char *end = NULL;
    switch (key) {
    case 'l':
        parse_law(state, arguments, argument);
        return 0;
    case 's':
        arguments->strain_max = 0.01 * strtod(argument, &end);
        if (end == argument || strcmp(end, "%") != 0 || !(arguments->strain_max > 0.0)) {
            argp_error(state, "--strain-max: '%s' is not a strain in percent such as 300%%", argument);
        }
        return 0;
    case 'o':
        arguments->output = argument;
        return 0;
    case 'n':
        arguments->name = argument;
        return 0;
    case 'p':
        arguments->plot = argument;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one test at a time, '%s' is too much", argument);
        }
        arguments->path = argument;
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which TENSILE.csv?");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "TENSILE.csv",
                                   "Fit a material law to a uniaxial tensile test by least squares of the nominal "
                                   "stress.",
                                   NULL, NULL, NULL};

static const char *base_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash == NULL ? path : slash + 1;
}

static void print_fit(const struct material_fit *fit) {
    static const char *const modes[DEFORMATION_MODES] = {"uniaxial", "pure shear", "equibiaxial"};
    const struct material *material = &fit->material;
    for (size_t i = 0; i < material->terms; i++) {
        printf("C%zu0            %12.5g Pa\n", i + 1, material->coefficient_pa[i]);
    }
    printf("points         %zu, strain %.1f to %.1f %%\n", fit->points, 100.0 * material->strain_min,
           100.0 * material->strain_max);
    printf("fit error      %.1f Pa rms (%.2f %% of the greatest stress), at most %.1f Pa at %.1f %% strain\n",
           fit->rms_pa, 100.0 * fit->rms_relative, fit->most_pa, 100.0 * fit->most_strain);
    for (int mode = 0; mode < DEFORMATION_MODES; mode++) {
        const double end = 1.0 + material->strain_max;
        const double stable = material_stable_stretch(material, (enum deformation_mode)mode, end);
        if (stable >= end) {
            printf("%-14s stable over the whole range\n", modes[mode]);
        } else {
            printf("%-14s UNSTABLE: the nominal stress falls beyond stretch %.3f\n", modes[mode], stable);
        }
    }
}

static bool write_yaml(const struct arguments *arguments, const struct material_fit *fit, char *error, size_t bytes) {
    struct output_file file;
    const struct material *material = &fit->material;
    char name[MATERIAL_NAME_BYTES];
    (void)snprintf(name, sizeof name, "%s", arguments->name != NULL ? arguments->name : base_name(arguments->output));
    name[strcspn(name, ".")] = '\0';
    if (!output_file_open(&file, arguments->output, error, bytes)) {
        return false;
    }
    fprintf(file.stream, "name: %s\nlaw: %s\ncoefficients_pa: [", name,
            material->law == MATERIAL_REDUCED_POLYNOMIAL ? "reduced-polynomial" : arguments->law->name);
    for (size_t i = 0; i < material->terms; i++) {
        fprintf(file.stream, "%s%.6g", i == 0 ? "" : ", ", material->coefficient_pa[i]);
    }
    fprintf(file.stream,
            "]\ndensity_kgpm3: %.6g\nbulk_modulus_pa: %.3e\nstrain_min: %.6g\nstrain_max: %.6g\n"
            "source: \"measured: %.200s, least squares of the nominal stress over 0 to %.0f %% strain, rms %.2f %% of the "
            "greatest stress; density and bulk modulus assumed\"\n",
            material->density_kgpm3, material->bulk_modulus_pa, material->strain_min, material->strain_max,
            base_name(arguments->path), 100.0 * material->strain_max, 100.0 * fit->rms_relative);
    return output_file_commit(&file, error, bytes);
}

static bool draw(const struct arguments *arguments, const struct tensile_test *test, const struct material_fit *fit,
                 char *error, size_t bytes) {
    struct gnuplot plot;
    if (!gnuplot_open(&plot, arguments->plot, 1000, 700, error, bytes)) {
        return false;
    }
    fprintf(plot.script,
            "set title '%s, %s'\nset grid\nset key left top\nset xlabel 'engineering strain / %%'\n"
            "set ylabel 'nominal stress / kPa'\nset xrange [0:%.3f]\n"
            "plot '-' w p pt 6 ps 0.6 t 'test', '-' w l lw 2 t 'fit'\n",
            base_name(arguments->path), arguments->law->name, 102.0 * fit->material.strain_max);
    for (size_t i = 0; i < test->count; i++) {
        if (test->strain[i] <= fit->material.strain_max) {
            fprintf(plot.script, "%.5f %.6f\n", 100.0 * test->strain[i], 1e-3 * test->stress_pa[i]);
        }
    }
    fputs("e\n", plot.script);
    for (int i = 0; i <= 200; i++) {
        const double strain = fit->material.strain_max * i / 200;
        fprintf(plot.script, "%.5f %.6f\n", 100.0 * strain,
                1e-3 * material_nominal_stress_pa(&fit->material, DEFORMATION_UNIAXIAL, 1.0 + strain));
    }
    fputs("e\n", plot.script);
    return gnuplot_close(&plot, error, bytes);
}

int cli_fit(int argc, char **argv) {
    struct arguments arguments = {.law = &laws[2], .strain_max = 3.0};
    struct tensile_test test;
    struct material_fit fit;
    char message[PROGRAM_ERROR_BYTES];
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    if (!tensile_test_read(arguments.path, &test, message, sizeof message)) {
        return program_fail(EXIT_BAD_INPUT, "%s", message);
    }
    int code = EXIT_OK;
    if (!material_fit(&test, arguments.law->law, arguments.law->terms, arguments.strain_max, &fit, message,
                      sizeof message)) {
        code = program_fail(EXIT_BAD_INPUT, "%s: %s", arguments.path, message);
    } else {
        print_fit(&fit);
        if ((arguments.output != NULL && !write_yaml(&arguments, &fit, message, sizeof message)) ||
            (arguments.plot != NULL && !draw(&arguments, &test, &fit, message, sizeof message))) {
            code = program_fail(EXIT_OUTPUT, "%s", message);
        }
    }
    tensile_test_free(&test);
    return code;
}
