/* tribend-tables solve: a path of equilibria, as a table, CSV and a picture of the deformed section. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/cli.h"
#include "cli/section_plot.h"
#include "program/output_file.h"
#include "section/section_bend.h"
#include "section/section_solver.h"
#include "units/units.h"

#define DEGREES (180.0 / M_PI)
#define ROWS_SHOWN_EVERY 4
enum limit { LIMIT_POINT, LIMIT_BIFURCATION, LIMIT_STRETCH, LIMIT_ELLIPTICITY, LIMIT_CONTACT, LIMITS };

struct arguments {
    const char *module;
    const char *material;
    const char *csv;
    const char *plot;
    const char *to;
    double mesh_size_m;
    bool chamber[3];
    bool quiet;
};

static const struct argp_option options[] = {
    {"material", 'm', "NAME", 0, "a material from tables/materials, or the path of a YAML file", 0},
    {"chamber", 'c', "LIST", 0, "chambers under pressure, 1 to 3, parted by commas (default 1)", 0},
    {"to", 't', "GOAL", 0, "greatest pressure or bend: 100mbar, 90deg (default 90deg)", 0},
    {"csv", 'o', "FILE", 0, "write the path as CSV", 0},
    {"plot", 'p', "FILE", 0, "draw the deformed section with its mesh as PNG", 0},
    {"mesh-size", 's', "LENGTH", 0, "element size at chamber walls (default 0.75mm)", 0},
    {"quiet", 'q', NULL, 0, "print the last point only", 0},
    {0}};

static error_t parse_chambers(struct argp_state *state, const char *list, bool chamber[3]) {
    memset(chamber, 0, 3 * sizeof *chamber);
    for (const char *c = list;; c += 2) {
        if (c[0] < '1' || c[0] > '3' || (c[1] != ',' && c[1] != '\0')) {
            argp_error(state, "'%s' names no chambers; write 1, 2, 3 or a list such as 1,2", list);
            return EINVAL;
        }
        chamber[c[0] - '1'] = true;
        if (c[1] == '\0') {
            return 0;
        }
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'm':
        arguments->material = argument;
        return 0;
    case 'c':
        return parse_chambers(state, argument, arguments->chamber);
    case 't':
        arguments->to = argument;
        return 0;
    case 'o':
        arguments->csv = argument;
        return 0;
    case 'p':
        arguments->plot = argument;
        return 0;
    case 'q':
        arguments->quiet = true;
        return 0;
    case 's':
        cli_mesh_size(state, argument, &arguments->mesh_size_m);
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one module at a time, '%s' is too much", argument);
        }
        arguments->module = argument;
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which MODULE? For example paper-semicircle");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "MODULE",
                                   "Follow the equilibria of MODULE (a name from tables/modules or a YAML file) under "
                                   "rising pressure, through limit points.\v"
                                   "Example: tribend-tables solve paper-semicircle --chamber 1 --to 90deg",
                                   NULL, NULL, NULL};

struct report {
    const struct arguments *arguments;
    const struct module_description *module;
    struct section_solver *solver;
    FILE *csv;
    double active_length_m;
    double rest_area_m2;
    size_t loaded; /* the chamber whose volume is reported */
    size_t points;
    struct section_state last;
    double greatest_pa;
    double limit_pa[LIMITS]; /* where each end of the valid range was first met, NAN: not */
};

/* What may end the range over which the answers hold. */
static const char *const limit_name[LIMITS] = {
    "limit point: the pressure turns back there, and a module snaps",
    "bifurcation: stability is lost while the pressure still rises; another branch starts there",
    "the material's fitted stretch is passed",
    "the material loses ellipticity: no answer beyond can be trusted",
    "walls touch, which is not modelled: no answer beyond can be trusted"};

static double bend_of(const struct report *report, const struct section_state *state) {
    return hypot(state->curvature_x_1pm, state->curvature_y_1pm) * report->active_length_m;
}

/* Bend of the tip, ends included. */
static double tip_bend_of(const struct report *report, const struct section_state *state) {
    double bend_rad[2];
    section_tip_bend(report->module, state, bend_rad);
    return hypot(bend_rad[0], bend_rad[1]);
}

static void print_row(const struct report *report, const struct section_state *state) {
    printf("%10.1f %8.3f %8.3f %8.4f %8.3f %9.3f %9.3f %11.1f %8.3f  %s%s%s%s\n", state->pressure_pa[report->loaded],
           bend_of(report, state) * DEGREES, tip_bend_of(report, state) * DEGREES, state->stretch,
           state->volume_m2[report->loaded] / report->rest_area_m2, 1e3 * state->width_bend_plane_m,
           1e3 * state->width_across_m, 1e-3 * state->von_mises_apex_pa, state->stretch_max,
           state->stable ? "stable" : "unstable", state->beyond_strain ? ", beyond fit" : "",
           state->contact ? ", walls touch" : "", state->elliptic ? "" : ", not elliptic");
}

static void meet(struct report *report, enum limit limit, double pressure_pa) {
    if (isnan(report->limit_pa[limit])) {
        report->limit_pa[limit] = pressure_pa;
    }
}

static void note_limits(struct report *report, const struct section_state *state) {
    const double pressure_pa = state->pressure_pa[report->loaded];
    if (!state->stable) {
        meet(report, pressure_pa < report->greatest_pa ? LIMIT_POINT : LIMIT_BIFURCATION,
             fmax(pressure_pa, report->greatest_pa));
    }
    if (state->beyond_strain) {
        meet(report, LIMIT_STRETCH, pressure_pa);
    }
    if (!state->elliptic) {
        meet(report, LIMIT_ELLIPTICITY, pressure_pa);
    }
    if (state->contact) {
        meet(report, LIMIT_CONTACT, pressure_pa);
    }
    report->greatest_pa = fmax(report->greatest_pa, pressure_pa);
}

static void print_limits(const struct report *report) {
    bool first = true;
    for (int limit = 0; limit < LIMITS; limit++) {
        /* unstable after the limit point is the falling branch, not a bifurcation */
        const bool fallen = limit == LIMIT_BIFURCATION && !isnan(report->limit_pa[LIMIT_POINT]);
        if (!isnan(report->limit_pa[limit]) && !fallen) {
            printf("%s %.0f Pa: %s\n", first ? "limits    from" : "          from", report->limit_pa[limit], limit_name[limit]);
            first = false;
        }
    }
}

static bool take_point(void *context, const struct section_state *state) {
    struct report *report = context;
    note_limits(report, state);
    report->last = *state;
    if (report->csv != NULL) {
        fprintf(report->csv, "%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%d,%d,%d,%d,%.9g\n", state->pressure_pa[report->loaded],
                bend_of(report, state), hypot(state->curvature_x_1pm, state->curvature_y_1pm), state->stretch,
                state->volume_m2[report->loaded] / report->rest_area_m2, state->width_bend_plane_m,
                state->width_across_m, state->von_mises_apex_pa, state->stretch_max, state->stable,
                state->elliptic, state->contact, state->beyond_strain, tip_bend_of(report, state));
    }
    if (!report->arguments->quiet && report->points % ROWS_SHOWN_EVERY == 0) {
        print_row(report, state);
    }
    report->points++;
    return program_interrupted == 0;
}

static bool parse_goal(const char *text, double active_length_m, enum section_goal *goal, double *value, char *error,
                       size_t error_bytes) {
    enum units_kind kind = UNITS_ANGLE;
    if (units_kind_of(text, &kind) && kind != UNITS_ANGLE && kind != UNITS_PRESSURE) {
        (void)snprintf(error, error_bytes, "'%s' is neither a pressure nor an angle; write for example 100mbar or 90deg",
                       text);
        return false;
    }
    if (!units_parse(kind, text, value, error, error_bytes)) {
        return false;
    }
    *goal = kind == UNITS_ANGLE ? SECTION_GOAL_CURVATURE : SECTION_GOAL_PRESSURE;
    *value = kind == UNITS_ANGLE ? *value / active_length_m : *value;
    if (!(*value > 0.0)) {
        (void)snprintf(error, error_bytes, "'%s' is not above zero", text);
        return false;
    }
    return true;
}

static int solve(const struct arguments *arguments, const struct module_description *module,
                 const struct section_mesh *mesh, struct section_solver *solver, FILE *csv) {
    struct report report = {.arguments = arguments,
                            .solver = solver,
                            .csv = csv,
                            .module = module,
                            .active_length_m = module->chamber_length_m};
    struct description_error error;
    double direction_pa[3], value = 0.0;
    enum section_goal goal = SECTION_GOAL_PRESSURE;
    for (size_t c = 3; c-- > 0;) {
        direction_pa[c] = arguments->chamber[c] ? 1.0 : 0.0;
        report.loaded = arguments->chamber[c] ? c : report.loaded;
    }
    report.rest_area_m2 = section_solver_chamber_area_m2(solver, report.loaded);
    char message[PROGRAM_ERROR_BYTES];
    if (!parse_goal(arguments->to, report.active_length_m, &goal, &value, message, sizeof message)) {
        return program_fail(EXIT_USAGE, "--to: %s", message);
    }
    if (csv != NULL) {
        fputs("pressure_pa,bend_rad,curvature_1pm,stretch,volume_ratio,width_bend_plane_m,width_across_m,"
              "von_mises_apex_pa,stretch_max,stable,elliptic,contact,beyond_strain,tip_bend_rad\n",
              csv);
    }
    if (!arguments->quiet) {
        cli_print_material(&module->material);
        printf("module    %s, %zu equations\n", module->name, section_solver_equations(solver));
        printf("%10s %8s %8s %8s %8s %9s %9s %11s %8s\n%10s %8s %8s %8s %8s %9s %9s %11s %8s\n", "pressure", "bend", "tip", "stretch",
               "volume", "in plane", "across", "von Mises", "greatest", "Pa", "deg", "deg", "", "ratio", "width mm", "width mm",
               "apex kPa", "stretch");
    }
    for (int limit = 0; limit < LIMITS; limit++) {
        report.limit_pa[limit] = NAN;
    }
    program_catch_interrupt();
    const bool reached = section_solver_path(solver, direction_pa, goal, value, take_point, &report, &error);
    if (arguments->quiet || (report.points - 1) % ROWS_SHOWN_EVERY != 0) {
        print_row(&report, &report.last);
    }
    if (!arguments->quiet) {
        print_limits(&report);
    }
    if (!reached) {
        (void)fflush(stdout);
        return program_fail(program_interrupted != 0 ? EXIT_INTERRUPTED : EXIT_SOLVER, "%s: %s%s%s", module->name,
                            program_interrupted != 0 ? "interrupted" : error.text, csv != NULL ? "; the points so far are in " : "",
                            csv != NULL ? arguments->csv : "");
    }
    if (arguments->plot != NULL &&
        !section_plot(arguments->plot, module, mesh, solver, message, sizeof message)) {
        return program_fail(EXIT_OUTPUT, "%s", message);
    }
    return EXIT_OK;
}

static int run(const struct arguments *arguments) {
    char path[PROGRAM_PATH_BYTES], message[PROGRAM_ERROR_BYTES];
    struct module_description module;
    struct description_error error;
    cli_table_path("modules", arguments->module, path);
    if (!module_description_read(path, arguments->material, &module, &error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error.text);
    }
    const struct section_mesh_options mesh_options = {.size_m = arguments->mesh_size_m};
    struct section_mesh *mesh = section_mesh_create(&module, &mesh_options, &error);
    struct section_solver *solver = mesh == NULL ? NULL : section_solver_create(mesh, &module, &error);
    struct output_file csv = {.stream = NULL};
    int code = EXIT_OK;
    if (solver == NULL) {
        code = program_fail(EXIT_SOLVER, "%s", error.text);
    } else if (arguments->csv != NULL && !output_file_open(&csv, arguments->csv, message, sizeof message)) {
        code = program_fail(EXIT_OUTPUT, "%s", message);
    } else {
        code = solve(arguments, &module, mesh, solver, csv.stream);
    }
    const bool solved_some = code == EXIT_OK || code == EXIT_SOLVER || code == EXIT_INTERRUPTED;
    if (solved_some && csv.stream != NULL && !output_file_commit(&csv, message, sizeof message)) {
        code = program_fail(EXIT_OUTPUT, "%s", message);
    }
    output_file_discard(&csv);
    section_solver_free(solver);
    section_mesh_free(mesh);
    return code;
}

int cli_solve(int argc, char **argv) {
    struct arguments arguments = {.to = "90deg", .chamber = {true, false, false}};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    return run(&arguments);
}
