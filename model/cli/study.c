/* tribend-tables study: the founding paper's parametric studies as CSV and picture, beside what the paper says. */
#include <argp.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/cli.h"
#include "program/gnuplot.h"
#include "program/output_file.h"
#include "study/study.h"
#include "units/units.h"

#define DEGREES (180.0 / M_PI)

struct arguments {
    enum study_kind kind;
    bool chosen;
    const char *material;
    const char *prefix;
    double bend_rad;
    bool quiet;
    bool resume;
};

static const struct argp_option options[] = {
    {"output", 'o', "PREFIX", 0, "write PREFIX.csv and PREFIX.png (default study-KIND)", 0},
    {"material", 'm', "NAME", 0, "a material from tables/materials, or a YAML file (default ecoflex-0030-positive)", 0},
    {"bend", 'b', "ANGLE", 0, "the bend at which modules are compared (default 90deg)", 0},
    {"resume", 'r', NULL, 0, "keep finished points in PREFIX.points, and go on from those that are there", 0},
    {"quiet", 'q', NULL, 0, "no progress", 0},
    {0}};

static void parse_kind(struct argp_state *state, struct arguments *arguments, const char *text) {
    for (int kind = 0; kind < STUDY_KINDS && !arguments->chosen; kind++) {
        if (strcmp(text, study_of[kind].name) == 0) {
            arguments->kind = (enum study_kind)kind;
            arguments->chosen = true;
            return;
        }
    }
    argp_error(state, arguments->chosen ? "one study at a time, '%s' is too much"
                                        : "there is no study '%s'; there are wall, length, area and shape",
               text);
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    char error[PROGRAM_ERROR_BYTES];
    switch (key) {
    case 'o':
        arguments->prefix = argument;
        return 0;
    case 'm':
        arguments->material = argument;
        return 0;
    case 'b':
        if (!units_parse(UNITS_ANGLE, argument, &arguments->bend_rad, error, sizeof error)) {
            argp_error(state, "--bend: %s", error);
        } else if (!(arguments->bend_rad > 0.0 && arguments->bend_rad < M_PI)) {
            argp_error(state, "--bend: '%s' is not between 0 and 180 degrees", argument);
        }
        return 0;
    case 'r':
        arguments->resume = true;
        return 0;
    case 'q':
        arguments->quiet = true;
        return 0;
    case ARGP_KEY_ARG:
        parse_kind(state, arguments, argument);
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which study? wall, length, area or shape");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "wall|length|area|shape",
                                   "Reproduce a parametric study of Elsayed et al. 2014, figure 6: the pressure of one "
                                   "chamber for a bend, and how much the section balloons.\v"
                                   "Example: tribend-tables study wall -o study-wall",
                                   NULL, NULL, NULL};

/* One shape's points lie together. */
static size_t series_length(const struct study_point *points, size_t count, size_t from) {
    size_t length = 1;
    while (from + length < count && strcmp(points[from + length].module.name, points[from].module.name) == 0) {
        length++;
    }
    return length;
}

static bool write_csv(const char *path, enum study_kind kind, const struct study_point *points,
                      const struct study_answer *answers, size_t count, char *error, size_t bytes) {
    struct output_file file;
    if (!output_file_open(&file, path, error, bytes)) {
        return false;
    }
    fputs("study,shape,ratio,found,pressure_pa,bend_rad,width_bend_plane_m,width_across_m,balloon_area_m2,"
          "von_mises_apex_pa,stretch_max,stable,contact\n",
          file.stream);
    for (size_t i = 0; i < count; i++) {
        const struct section_state *state = &answers[i].state;
        fprintf(file.stream, "%s,%s,%.6g,%d,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%d,%d\n", study_of[kind].name,
                points[i].module.name, points[i].x, answers[i].found, state->pressure_pa[0],
                study_bend_rad(&points[i], &answers[i]), state->width_bend_plane_m, state->width_across_m,
                study_balloon_area_m2(&points[i], &answers[i]), state->von_mises_apex_pa, state->stretch_max,
                state->stable, state->contact);
    }
    return output_file_commit(&file, error, bytes);
}

static void plot_series(FILE *script, const struct study_point *points, const struct study_answer *answers, size_t count,
                        bool width) {
    fputs("plot ", script);
    for (size_t from = 0; from < count; from += series_length(points, count, from)) {
        fprintf(script, "%s'-' w lp lw 2 pt 7 t '%s'", from == 0 ? "" : ", ", points[from].module.name);
    }
    fputc('\n', script);
    for (size_t from = 0; from < count; from += series_length(points, count, from)) {
        for (size_t i = from; i < from + series_length(points, count, from); i++) {
            if (answers[i].found) {
                fprintf(script, "%.6g %.6g\n", points[i].x,
                        width ? 1e3 * answers[i].state.width_bend_plane_m : 1e-5 * answers[i].state.pressure_pa[0]);
            }
        }
        fputs("e\n", script);
    }
}

static bool draw(const char *path, enum study_kind kind, const struct study_point *points,
                 const struct study_answer *answers, size_t count, char *error, size_t bytes) {
    struct gnuplot plot;
    const struct study *study = &study_of[kind];
    if (!gnuplot_open(&plot, path, 1400, 650, error, bytes)) {
        return false;
    }
    fprintf(plot.script,
            "set multiplot layout 1,2 title \"Paper, pressure: %s.\\nPaper, ballooning: %s.\"\nset grid\n"
            "set key top right\nset xlabel '%s'\nset offsets graph 0.05, graph 0.05, graph 0.15, graph 0.05\n"
            "set ylabel 'pressure of chamber 1 / bar'\n",
            study->paper_says, study->paper_adds, study->x_label);
    plot_series(plot.script, points, answers, count, false);
    fputs("set key bottom right\nset ylabel 'outer width in the bending plane / mm'\n", plot.script);
    plot_series(plot.script, points, answers, count, true);
    fputs("unset multiplot\n", plot.script);
    return gnuplot_close(&plot, error, bytes);
}

static void print_answers(enum study_kind kind, const struct arguments *arguments, const struct study_point *points,
                          const struct study_answer *answers, size_t count) {
    const struct study *study = &study_of[kind];
    printf("study     %s at %.0f deg of bend, one chamber\npaper     pressure %s;\n          %s\n\n", study->name,
           arguments->bend_rad * DEGREES, study->paper_says, study->paper_adds);
    printf("%-12s %8s %12s %10s %12s %12s\n%-12s %8s %12s %10s %12s %12s\n", "shape", "ratio", "pressure", "width",
           "balloon", "von Mises", "", "", "bar", "mm", "mm2", "apex MPa");
    for (size_t i = 0; i < count; i++) {
        const struct section_state *state = &answers[i].state;
        if (answers[i].found) {
            printf("%-12s %8.3f %12.5f %10.2f %12.1f %12.3f%s\n", points[i].module.name, points[i].x,
                   1e-5 * state->pressure_pa[0], 1e3 * state->width_bend_plane_m,
                   1e6 * study_balloon_area_m2(&points[i], &answers[i]), 1e-6 * state->von_mises_apex_pa,
                   state->contact ? "  walls touch" : "");
        } else {
            printf("%-12s %8.3f not reached: %s\n", points[i].module.name, points[i].x, answers[i].why);
        }
    }
}

/* One line a series: how pressure and width go with what is varied. */
static void print_trends(const struct study_point *points, const struct study_answer *answers, size_t count) {
    putchar('\n');
    for (size_t from = 0; from < count; from += series_length(points, count, from)) {
        double x[STUDY_POINTS_MAX], pressure[STUDY_POINTS_MAX], width[STUDY_POINTS_MAX];
        size_t used = 0;
        for (size_t i = from; i < from + series_length(points, count, from); i++) {
            if (answers[i].found) {
                x[used] = points[i].x;
                pressure[used] = answers[i].state.pressure_pa[0];
                width[used++] = answers[i].state.width_bend_plane_m;
            }
        }
        if (used > 2) {
            printf("%-12s correlation with the ratio: pressure %+.3f, width %+.3f\n", points[from].module.name,
                   study_correlation(x, pressure, used), study_correlation(x, width, used));
        }
    }
}

static int report(const struct arguments *arguments, const struct study_point *points, const struct study_answer *answers,
                  size_t count) {
    char prefix[64], path[PROGRAM_PATH_BYTES], message[PROGRAM_ERROR_BYTES];
    (void)snprintf(prefix, sizeof prefix, "study-%s", study_of[arguments->kind].name);
    print_answers(arguments->kind, arguments, points, answers, count);
    print_trends(points, answers, count);
    (void)snprintf(path, sizeof path, "%s.csv", arguments->prefix != NULL ? arguments->prefix : prefix);
    if (!write_csv(path, arguments->kind, points, answers, count, message, sizeof message)) {
        return program_fail(EXIT_OUTPUT, "%s", message);
    }
    printf("wrote     %s\n", path);
    (void)snprintf(path, sizeof path, "%s.png", arguments->prefix != NULL ? arguments->prefix : prefix);
    if (!draw(path, arguments->kind, points, answers, count, message, sizeof message)) {
        return program_fail(EXIT_OUTPUT, "%s", message);
    }
    printf("wrote     %s\n", path);
    return EXIT_OK;
}

static int run(const struct arguments *arguments, bool first_rank) {
    static struct study_point points[STUDY_POINTS_MAX];
    static struct study_answer answers[STUDY_POINTS_MAX];
    char path[PROGRAM_PATH_BYTES], keep[PROGRAM_PATH_BYTES];
    struct material material;
    struct description_error error = {""};
    cli_table_path("materials", arguments->material, path);
    if (!material_read(path, &material, &error)) {
        return first_rank ? program_fail(EXIT_BAD_INPUT, "%s", error.text) : EXIT_BAD_INPUT;
    }
    if (first_rank) {
        cli_print_material(&material);
        (void)fflush(stdout);
    }
    (void)snprintf(keep, sizeof keep, "%s%s.points", arguments->prefix != NULL ? arguments->prefix : "study-",
                   arguments->prefix != NULL ? "" : study_of[arguments->kind].name);
    const size_t count = study_points(arguments->kind, &material, arguments->bend_rad, points);
    struct cli_progress progress = {.what = "points"};
    const struct study_options how = {.progress = arguments->quiet || !first_rank ? NULL : cli_show_progress,
                                      .context = &progress,
                                      .stop = &program_interrupted,
                                      .keep_path = arguments->resume ? keep : NULL};
    program_catch_interrupt();
    switch (study_solve(points, count, &how, answers, &error)) {
    case SWEEP_DONE:
        return report(arguments, points, answers, count);
    case SWEEP_HELPED:
        return EXIT_OK;
    case SWEEP_STOPPED:
        return program_fail(EXIT_INTERRUPTED, "%s", error.text);
    default:
        return program_fail(EXIT_SOLVER, "%s", error.text);
    }
}

int cli_study(int argc, char **argv) {
    struct arguments arguments = {.material = "ecoflex-0030-positive", .bend_rad = 0.5 * M_PI};
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    const bool first_rank = sweep_join();
    const int code = run(&arguments, first_rank);
    sweep_leave();
    return code;
}
