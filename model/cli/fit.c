/* tribend-tables fit: a material law from tensile tests, with its error, strain range and stability; or every law, with
 * Akaike's criterion to choose between them. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/cli.h"
#include "cli/material_report.h"
#include "material/material_fit.h"
#include "program/gnuplot.h"

#define TESTS_MAX 8

struct law_choice {
    const char *name;
    enum material_law law;
    size_t terms;
};

static const struct law_choice laws[] = {{"neo-hookean", MATERIAL_NEO_HOOKEAN, 1},
                                         {"reduced-polynomial-2", MATERIAL_REDUCED_POLYNOMIAL, 2},
                                         {"yeoh", MATERIAL_YEOH, 3},
                                         {"ogden-1", MATERIAL_OGDEN, 1},
                                         {"ogden-2", MATERIAL_OGDEN, 2},
                                         {"ogden-3", MATERIAL_OGDEN, 3}};
#define LAWS (sizeof laws / sizeof laws[0])
#define LAW_NAMES "neo-hookean, reduced-polynomial-2, yeoh, ogden-1, ogden-2, ogden-3"

struct arguments {
    const char *path[TESTS_MAX];
    enum deformation_mode mode[TESTS_MAX];
    size_t tests;
    const char *output;
    const char *plot;
    const char *name;
    const struct law_choice *law; /* NULL: all */
    double strain_max;
    bool free;
};

/* What was fitted: `fit[k]` is of `laws[law[k]]`. */
struct results {
    struct material_fit fit[LAWS];
    size_t law[LAWS];
    size_t count;
    size_t best;
};

static const struct argp_option options[] = {
    {"law", 'l', "LAW", 0, LAW_NAMES ", or all, which compares them and keeps the best (default yeoh)", 0},
    {"strain-max", 's', "PERCENT", 0, "fit up to this strain, such as 300% (default 300%)", 0},
    {"free", 'f', NULL, 0, "drop the bounds that keep the law stable at every stretch", 0},
    {"output", 'o', "FILE", 0, "write the material as YAML", 0},
    {"name", 'n', "NAME", 0, "the material's name in that file (default: the file's)", 0},
    {"plot", 'p', "FILE", 0, "draw tests and fits as PNG", 0},
    {0}};

static void parse_law(struct argp_state *state, struct arguments *arguments, const char *text) {
    arguments->law = NULL;
    for (size_t i = 0; i < LAWS; i++) {
        if (strcmp(text, laws[i].name) == 0) {
            arguments->law = &laws[i];
        }
    }
    if (arguments->law == NULL && strcmp(text, "all") != 0) {
        argp_error(state, "--law: '%s' is none of " LAW_NAMES ", all", text);
    }
}

/* FILE or FILE:shear or FILE:equibiaxial */
static void parse_test(struct argp_state *state, struct arguments *arguments, char *text) {
    static const char *const suffix[DEFORMATION_MODES] = {":uniaxial", ":shear", ":equibiaxial"};
    if (arguments->tests == TESTS_MAX) {
        argp_error(state, "at most %d tests at a time, '%s' is too much", TESTS_MAX, text);
        return;
    }
    enum deformation_mode mode = DEFORMATION_UNIAXIAL;
    for (int m = 0; m < DEFORMATION_MODES; m++) {
        const size_t length = strlen(text), tail = strlen(suffix[m]);
        if (length > tail && strcmp(text + length - tail, suffix[m]) == 0) {
            text[length - tail] = '\0';
            mode = (enum deformation_mode)m;
        }
    }
    arguments->mode[arguments->tests] = mode;
    arguments->path[arguments->tests++] = text;
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
    case 'f':
        arguments->free = true;
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
        parse_test(state, arguments, argument);
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which TENSILE.csv?");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "TENSILE.csv[:MODE]...",
                                   "Fit a material law to tensile tests by least squares of the nominal stress. MODE says "
                                   "how a specimen was pulled: uniaxial (default), shear or equibiaxial.\v"
                                   "Example: tribend-tables fit TENSILE.csv --law all -o my-material.yaml",
                                   NULL, NULL, NULL};

static void print_fit(const struct material_fit *fit) {
    const struct material *material = &fit->material;
    for (size_t i = 0; i < material->terms; i++) {
        if (material->law == MATERIAL_OGDEN) {
            printf("c%zu, a%zu         %12.5g Pa, %.5g\n", i + 1, i + 1, material->coefficient_pa[i],
                   material->exponent[i]);
        } else {
            printf("C%zu0            %12.5g Pa\n", i + 1, material->coefficient_pa[i]);
        }
    }
    printf("points         %zu, strain %.1f to %.1f %%\n", fit->points, 100.0 * material->strain_min,
           100.0 * material->strain_max);
    printf("fit error      %.1f Pa rms (%.2f %% of the greatest stress), at most %.1f Pa at %.1f %% strain\n",
           fit->rms_pa, 100.0 * fit->rms_relative, fit->most_pa, 100.0 * fit->most_strain);
    material_report_stability(material);
}

static void print_comparison(const struct results *results) {
    printf("%-22s %10s %12s %12s %12s\n", "law", "parameters", "rms / %", "most / Pa", "AIC - best");
    for (size_t k = 0; k < results->count; k++) {
        const struct material_fit *fit = &results->fit[k];
        printf("%-22s %10zu %12.3f %12.1f %12.1f%s\n", laws[results->law[k]].name, fit->parameters,
               100.0 * fit->rms_relative, fit->most_pa, fit->aic - results->fit[results->best].aic,
               k == results->best ? "  best" : "");
    }
    printf("\nlaw            %s\n", laws[results->law[results->best]].name);
}

static bool write_yaml(const struct arguments *arguments, struct material_fit *fit, char *error, size_t bytes) {
    struct material *material = &fit->material;
    (void)snprintf(material->source, sizeof material->source,
                   "measured: %.200s%s, least squares of the nominal stress over 0 to %.0f %% strain%s, rms %.2f %% of the "
                   "greatest stress; density and bulk modulus assumed",
                   cli_base_name(arguments->path[0]), arguments->tests > 1 ? " and others" : "",
                   100.0 * material->strain_max, arguments->free ? "" : " with bounds that keep the law stable",
                   100.0 * fit->rms_relative);
    return cli_write_material(arguments->output, arguments->name, material, error, bytes);
}

static bool draw(const struct arguments *arguments, const struct tensile_test *tests, const struct results *results,
                 char *error, size_t bytes) {
    struct gnuplot plot;
    const double strain_max = results->fit[results->best].material.strain_max;
    if (!gnuplot_open(&plot, arguments->plot, 1000, 700, error, bytes)) {
        return false;
    }
    fprintf(plot.script,
            "set title '%s' noenhanced\nset grid\nset key left top\nset xlabel 'engineering strain / %%'\n"
            "set ylabel 'nominal stress / kPa'\nset xrange [0:%.3f]\nplot ",
            cli_base_name(arguments->path[0]), 102.0 * strain_max);
    for (size_t t = 0; t < arguments->tests; t++) {
        fprintf(plot.script, "'-' w p pt 6 ps 0.6 lc %zu t 'test, %s', ", t + 1, deformation_mode_name[tests[t].mode]);
    }
    for (size_t k = 0; k < results->count; k++) {
        for (size_t t = 0; t < arguments->tests; t++) {
            fprintf(plot.script, "'-' w l lw 2 lc %zu t '%s, %.2f %%'%s", arguments->tests + k + 1,
                    t == 0 ? laws[results->law[k]].name : "", 100.0 * results->fit[k].rms_relative,
                    k + 1 == results->count && t + 1 == arguments->tests ? "\n" : ", ");
        }
    }
    for (size_t t = 0; t < arguments->tests; t++) {
        for (size_t i = 0; i < tests[t].count; i++) {
            if (tests[t].strain[i] <= strain_max) {
                fprintf(plot.script, "%.5f %.6f\n", 100.0 * tests[t].strain[i], 1e-3 * tests[t].stress_pa[i]);
            }
        }
        fputs("e\n", plot.script);
    }
    for (size_t k = 0; k < results->count; k++) {
        for (size_t t = 0; t < arguments->tests; t++) {
            for (int i = 0; i <= 200; i++) {
                const double strain = strain_max * i / 200;
                fprintf(plot.script, "%.5f %.6f\n", 100.0 * strain,
                        1e-3 * material_nominal_stress_pa(&results->fit[k].material, tests[t].mode, 1.0 + strain));
            }
            fputs("e\n", plot.script);
        }
    }
    return gnuplot_close(&plot, error, bytes);
}

static bool fit_laws(const struct arguments *arguments, const struct tensile_test *tests, struct results *results,
                     char *error, size_t bytes) {
    for (size_t i = 0; i < LAWS; i++) {
        const struct material_fit_options how = {laws[i].law, laws[i].terms, arguments->strain_max, !arguments->free};
        if (arguments->law != NULL && arguments->law != &laws[i]) {
            continue;
        }
        if (!material_fit(tests, arguments->tests, &how, &results->fit[results->count], error, bytes)) {
            return false;
        }
        if (results->fit[results->count].aic < results->fit[results->best].aic) {
            results->best = results->count;
        }
        results->law[results->count++] = i;
    }
    return true;
}

static int run(const struct arguments *arguments, const struct tensile_test *tests) {
    struct results results = {.count = 0};
    char message[PROGRAM_ERROR_BYTES];
    if (!fit_laws(arguments, tests, &results, message, sizeof message)) {
        return program_fail(EXIT_BAD_INPUT, "%s: %s", arguments->path[0], message);
    }
    struct material_fit *best = &results.fit[results.best];
    if (results.count > 1) {
        print_comparison(&results);
    }
    print_fit(best);
    if ((arguments->output != NULL && !write_yaml(arguments, best, message, sizeof message)) ||
        (arguments->plot != NULL && !draw(arguments, tests, &results, message, sizeof message))) {
        return program_fail(EXIT_OUTPUT, "%s", message);
    }
    return EXIT_OK;
}

int cli_fit(int argc, char **argv) {
    struct arguments arguments = {.law = &laws[2], .strain_max = 3.0};
    struct tensile_test tests[TESTS_MAX];
    char message[PROGRAM_ERROR_BYTES];
    size_t read = 0;
    int code = EXIT_OK;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    while (code == EXIT_OK && read < arguments.tests) {
        if (tensile_test_read(arguments.path[read], &tests[read], message, sizeof message)) {
            tests[read].mode = arguments.mode[read];
            read++;
        } else {
            code = program_fail(EXIT_BAD_INPUT, "%s", message);
        }
    }
    if (code == EXIT_OK) {
        code = run(&arguments, tests);
    }
    while (read > 0) {
        tensile_test_free(&tests[--read]);
    }
    return code;
}
