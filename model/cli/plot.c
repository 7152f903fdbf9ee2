/* tribend-tables plot: bend against pressure, and the reachable bends seen from the tip. */
#include <argp.h>
#include <math.h>
#include <stdio.h>

#include "cli/cli.h"
#include "program/table_file.h"
#include "program/gnuplot.h"

#define DEGREES (180.0 / M_PI)
#define CURVE_POINTS 200
#define LABEL_DISTANCE 1.3 /* of the farthest bend */
#define GRID_POINTS 24

struct arguments {
    const char *path;
    const char *output;
};

static const struct argp_option options[] = {{"output", 'o', "FILE", 0, "the PNG to write (default FILE.png)", 0}, {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case 'o':
        arguments->output = argument;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0) {
            argp_error(state, "one table at a time, '%s' is too much", argument);
        }
        arguments->path = argument;
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "which FILE.tbt?");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {options, parse, "FILE.tbt", "Draw a bend table.\vExample: tribend-tables plot TABLE.tbt -o TABLE.png", NULL, NULL, NULL};

static void bend_at(const struct bend_table *table, double p1, double p2, double p3, double bend_deg[2]) {
    const float pressure_pa[3] = {(float)p1, (float)p2, (float)p3};
    const double factor = (double)table->module.active_length_m * DEGREES;
    struct bend_table_stencil stencil;
    bend_table_locate(table, pressure_pa, &stencil);
    bend_deg[0] = factor * (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_X);
    bend_deg[1] = factor * (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_Y);
}

static void draw_curves(FILE *script, const struct bend_table *table) {
    const double end_pa = (double)table->axis_pa[0][table->nodes[0] - 1];
    static const double share[4][2] = {{0, 0}, {1, 0}, {0.5, 0}, {0.5, 0.5}};
    fprintf(script,
            "set title 'Bend of %s'\nset xlabel 'pressure of chamber 1 / kPa'\nset ylabel 'bend / deg'\n"
            "set key left top\nset grid\nset arrow 1 from %.4f,graph 0 to %.4f,graph 1 nohead dt 2 lc rgb '#808080'\n"
            "set label 1 'working pressure' at %.4f,graph 0.03 right offset -0.5,0 tc rgb '#606060'\n"
            "plot '-' w l lw 2 t 'chamber 1 alone', '-' w l lw 2 t 'chamber 2 with the same', "
            "'-' w l lw 2 t 'chamber 2 with half', '-' w l lw 2 t 'chambers 2 and 3 with half', "
            "'-' w p pt 7 ps 0.8 lc rgb 'black' t 'nodes'\n",
            table->module.name, 1e-3 * (double)table->module.working_pressure_pa,
            1e-3 * (double)table->module.working_pressure_pa, 1e-3 * (double)table->module.working_pressure_pa);
    double bend_deg[2];
    for (size_t c = 0; c < 4; c++) {
        for (int i = 0; i <= CURVE_POINTS; i++) {
            const double p = end_pa * i / CURVE_POINTS;
            bend_at(table, p, share[c][0] * p, share[c][1] * p, bend_deg);
            fprintf(script, "%.5f %.5f\n", 1e-3 * p, hypot(bend_deg[0], bend_deg[1]));
        }
        fputs("e\n", script);
    }
    for (uint32_t i = 0; i < table->nodes[0]; i++) {
        bend_at(table, (double)table->axis_pa[0][i], 0.0, 0.0, bend_deg);
        fprintf(script, "%.5f %.5f\n", 1e-3 * (double)table->axis_pa[0][i], hypot(bend_deg[0], bend_deg[1]));
    }
    fputs("e\nunset arrow 1\nunset label 1\n", script);
}

/* Two chambers swept, the third vented: lines of constant pressure in the plane of bends. */
static void draw_plane(FILE *script, const struct bend_table *table) {
    const double limit_pa = (double)table->module.working_pressure_pa;
    fputs("set title 'Reach: one chamber vented, the others up to the working pressure'\nset size ratio -1\n"
          "set xlabel 'bend towards x / deg'\nset ylabel 'bend towards y / deg'\nset key off\n"
          "set offsets graph 0.08, graph 0.08, graph 0.05, graph 0.05\n"
          "plot for [i=0:2] '-' w l lw 1 lc i+1, for [i=1:3] '-' w labels\n",
          script);
    for (size_t vented = 0; vented < 3; vented++) {
        for (int pass = 0; pass < 2; pass++) {
            for (int i = 0; i <= 8; i++) {
                for (int j = 0; j <= GRID_POINTS; j++) {
                    double p[3] = {0.0, 0.0, 0.0}, bend_deg[2];
                    p[(vented + 1) % 3] = limit_pa * (pass == 0 ? sqrt(i / 8.0) : (double)j / GRID_POINTS);
                    p[(vented + 2) % 3] = limit_pa * (pass == 0 ? (double)j / GRID_POINTS : sqrt(i / 8.0));
                    bend_at(table, p[0], p[1], p[2], bend_deg);
                    fprintf(script, "%.4f %.4f\n", bend_deg[0], bend_deg[1]);
                }
                fputs("\n", script);
            }
        }
        fputs("e\n", script);
    }
    for (size_t c = 0; c < 3; c++) {
        double p[3] = {0.0, 0.0, 0.0}, bend_deg[2];
        p[c] = limit_pa;
        bend_at(table, p[0], p[1], p[2], bend_deg);
        fprintf(script, "%.4f %.4f \"chamber %zu\"\ne\n", LABEL_DISTANCE * bend_deg[0], LABEL_DISTANCE * bend_deg[1],
                c + 1);
    }
}

int cli_plot(int argc, char **argv) {
    struct arguments arguments = {NULL, NULL};
    struct table_file file;
    struct gnuplot plot;
    char output[PROGRAM_PATH_BYTES + 8], message[PROGRAM_ERROR_BYTES];
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    int code = table_file_open(&file, arguments.path, NULL);
    if (code != EXIT_OK) {
        return code;
    }
    (void)snprintf(output, sizeof output, "%s%s", arguments.output != NULL ? arguments.output : arguments.path,
                   arguments.output != NULL ? "" : ".png");
    if (!gnuplot_open(&plot, output, 1400, 700, message, sizeof message)) {
        code = program_fail(EXIT_OUTPUT, "%s", message);
    } else {
        fputs("set multiplot layout 1,2\n", plot.script);
        draw_curves(plot.script, &file.table);
        draw_plane(plot.script, &file.table);
        fputs("unset multiplot\n", plot.script);
        if (!gnuplot_close(&plot, message, sizeof message)) {
            code = program_fail(EXIT_OUTPUT, "%s", message);
        } else {
            printf("wrote %s\n", output);
        }
    }
    table_file_close(&file);
    return code;
}
