/* tribend-tables rod: where the tip goes under gravity, a payload and a force at the tip. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/cli.h"
#include "program/output_file.h"
#include "rod/rod.h"
#include "units/units.h"

#define DEGREES (180.0 / M_PI)
#define GRAVITY_MPS2 9.80665
#define STATIONS 17

enum option_key { KEY_DOWN = 256, KEY_FORCE, KEY_TOWARD };

struct arguments {
    const char *module;
    const char *material;
    const char *csv;
    double pressure_pa[3];
    size_t pressures;
    double payload_kg;
    double mount_rad;
    double down_rad;
    double force_n;
    double toward_rad;
};

static const struct argp_option options[] = {
    {"payload", 'l', "MASS", 0, "at the middle of the tip face, such as 20g (default 0g)", 0},
    {"mount", 'a', "ANGLE", 0, "between the module's axis at its base and down: 0deg hangs (default), 90deg is level, 180deg "
                               "stands", 0},
    {"down", KEY_DOWN, "ANGLE", 0, "towards which side of the base down leans, from +x (default 0deg)", 0},
    {"force", KEY_FORCE, "FORCE", 0, "at the tip, square to the base axis, such as 50mN (default 0N)", 0},
    {"toward", KEY_TOWARD, "ANGLE", 0, "where that force points, from +x (default 0deg)", 0},
    {"material", 'm', "NAME", 0, "a material from tables/materials, or the path of a YAML file", 0},
    {"csv", 'o', "FILE", 0, "write the shape under load as CSV", 0},
    {0}};

static void read_quantity(struct argp_state *state, const char *option, enum units_kind kind, const char *text,
                          double *value) {
    char error[PROGRAM_ERROR_BYTES];
    if (!units_parse(kind, text, value, error, sizeof error)) {
        argp_error(state, "%s: %s", option, error);
    }
}

static void take_word(struct argp_state *state, struct arguments *arguments, const char *word) {
    if (arguments->module == NULL) {
        arguments->module = word;
    } else if (arguments->pressures < 3) {
        read_quantity(state, "pressure", UNITS_PRESSURE, word, &arguments->pressure_pa[arguments->pressures++]);
    } else {
        argp_error(state, "a module and three pressures, '%s' is too much", word);
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'l':
        read_quantity(state, "--payload", UNITS_MASS, argument, &arguments->payload_kg);
        if (arguments->payload_kg < 0.0) {
            argp_error(state, "--payload: '%s' is negative", argument);
        }
        return 0;
    case 'a':
        read_quantity(state, "--mount", UNITS_ANGLE, argument, &arguments->mount_rad);
        return 0;
    case KEY_DOWN:
        read_quantity(state, "--down", UNITS_ANGLE, argument, &arguments->down_rad);
        return 0;
    case KEY_FORCE:
        read_quantity(state, "--force", UNITS_FORCE, argument, &arguments->force_n);
        return 0;
    case KEY_TOWARD:
        read_quantity(state, "--toward", UNITS_ANGLE, argument, &arguments->toward_rad);
        return 0;
    case 'm':
        arguments->material = argument;
        return 0;
    case 'o':
        arguments->csv = argument;
        return 0;
    case ARGP_KEY_ARG:
        take_word(state, arguments, argument);
        return 0;
    case ARGP_KEY_END:
        if (arguments->pressures != 3) {
            argp_error(state, "a MODULE and three pressures are wanted, such as paper-semicircle 80mbar 0mbar 0mbar");
        }
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "MODULE P1 P2 P3",
                                   "Where the tip of MODULE goes at three chamber pressures under its own weight, a payload "
                                   "and a force at the tip, beside the pose without any. Ends are rigid, without end "
                                   "correction.\v"
                                   "Example: tribend-tables rod paper-semicircle 60mbar 0mbar 0mbar --payload 2g",
                                   NULL, NULL, NULL};

static void print_pose(const char *name, const struct rod_state *rod) {
    printf("%-10s bend %7.2f deg toward %7.2f deg, tip at %7.2f %7.2f %7.2f mm\n", name, rod->bend_rad * DEGREES,
           rod->bend_rad > 1e-6 ? rod->direction_rad * DEGREES : 0.0, 1e3 * rod->tip_position_m[0],
           1e3 * rod->tip_position_m[1], 1e3 * rod->tip_position_m[2]);
}

static bool write_csv(const char *path, const struct module_description *module, const struct rod_state *rod, char *error,
                      size_t bytes) {
    struct output_file file;
    if (!output_file_open(&file, path, error, bytes)) {
        return false;
    }
    fputs("arc_m,x_m,y_m,z_m\n", file.stream);
    for (size_t i = 0; i < rod->stations; i++) {
        const double *at_m = rod->position_m[i];
        fprintf(file.stream, "%.9g,%.9g,%.9g,%.9g\n",
                module->chamber_length_m * (double)i / (double)(rod->stations - 1), at_m[0], at_m[1], at_m[2]);
    }
    return output_file_commit(&file, error, bytes);
}

static int solve(const struct arguments *arguments, const struct module_description *module,
                 struct section_solver *solver) {
    struct description_error error;
    struct rod_state rod;
    char message[PROGRAM_ERROR_BYTES];
    struct rod_load load = {.payload_kg = 0.0};
    memcpy(load.pressure_pa, arguments->pressure_pa, sizeof load.pressure_pa);
    if (!rod_solve(module, solver, &load, STATIONS, &rod, &error)) {
        return program_fail(EXIT_SOLVER, "%s: %s", module->name, error.text);
    }
    print_pose("unloaded", &rod);
    load.payload_kg = arguments->payload_kg;
    load.gravity_mps2[0] = GRAVITY_MPS2 * sin(arguments->mount_rad) * cos(arguments->down_rad);
    load.gravity_mps2[1] = GRAVITY_MPS2 * sin(arguments->mount_rad) * sin(arguments->down_rad);
    load.gravity_mps2[2] = GRAVITY_MPS2 * cos(arguments->mount_rad);
    load.force_n[0] = arguments->force_n * cos(arguments->toward_rad);
    load.force_n[1] = arguments->force_n * sin(arguments->toward_rad);
    if (!rod_solve(module, solver, &load, STATIONS, &rod, &error)) {
        return program_fail(EXIT_SOLVER, "%s: %s", module->name, error.text);
    }
    print_pose("loaded", &rod);
    printf("moment    at most %.3f mN m; weight of the chambered part %.3f N; %d iterations\n", 1e3 * rod.moment_most_nm,
           module->material.density_kgpm3 * rod_section_area_m2(module) * module->chamber_length_m * GRAVITY_MPS2,
           rod.iterations);
    if (arguments->csv != NULL) {
        if (!write_csv(arguments->csv, module, &rod, message, sizeof message)) {
            return program_fail(EXIT_OUTPUT, "%s", message);
        }
        printf("wrote     %s\n", arguments->csv);
    }
    return EXIT_OK;
}

int cli_rod(int argc, char **argv) {
    struct arguments arguments = {.module = NULL};
    char path[PROGRAM_PATH_BYTES];
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
    struct section_mesh *mesh = section_mesh_create(&module, NULL, &error);
    struct section_solver *solver = mesh == NULL ? NULL : section_solver_create(mesh, &module, &error);
    const int code =
        solver == NULL ? program_fail(EXIT_SOLVER, "%s", error.text) : solve(&arguments, &module, solver);
    section_solver_free(solver);
    section_mesh_free(mesh);
    return code;
}
