#include "report/run_plot.h"

#include <math.h>
#include <string.h>

#include "control/tip_loop.h"
#include "program/gnuplot.h"

#define DEGREES (180.0 / M_PI)
#define DIRECTION_LEAST_BEND_RAD 0.01 /* of a straighter tip the direction is noise */
#define POINTS_MOST 4000

static double cell(const struct run_log *log, size_t row, int column) {
    return column < 0 ? NAN : log->value[row * log->columns + (size_t)column];
}

static size_t stride(const struct run_log *log) {
    return 1 + log->rows / POINTS_MOST;
}

static void draw_column(FILE *script, const struct run_log *log, const char *name, double factor) {
    const int time = run_log_column(log, "time_s"), column = run_log_column(log, name);
    for (size_t row = 0; row < log->rows; row += stride(log)) {
        if (!isnan(cell(log, row, column))) {
            fprintf(script, "%.6f %.6g\n", cell(log, row, time), factor * cell(log, row, column));
        }
    }
    fputs("e\n", script);
}

/* Measured bend (which = 0) or direction (1), degrees, from the tip's orientation. */
static void draw_measured(FILE *script, const struct run_log *log, int which) {
    const int time = run_log_column(log, "time_s");
    const int first = run_log_column(log, "tip_qw");
    const int columns[4] = {first, run_log_column(log, "tip_qx"), run_log_column(log, "tip_qy"),
                            run_log_column(log, "tip_qz")};
    for (size_t row = 0; row < log->rows; row++) {
        float quaternion[4], bend[2];
        for (size_t k = 0; k < 4; k++) {
            quaternion[k] = (float)cell(log, row, columns[k]);
        }
        if (isnan(quaternion[0]) || !tip_loop_bend_of(quaternion, bend)) {
            continue;
        }
        const double size = hypot((double)bend[0], (double)bend[1]);
        if (which == 0) {
            fprintf(script, "%.6f %.5f\n", cell(log, row, time), size * DEGREES);
        } else if (size > DIRECTION_LEAST_BEND_RAD) {
            fprintf(script, "%.6f %.5f\n", cell(log, row, time), atan2((double)bend[1], (double)bend[0]) * DEGREES);
        }
    }
    fputs("e\n", script);
}

static bool has_values(const struct run_log *log, const char *name) {
    const int column = run_log_column(log, name);
    for (size_t row = 0; column >= 0 && row < log->rows; row++) {
        if (!isnan(cell(log, row, column))) {
            return true;
        }
    }
    return false;
}

static void draw_chambers(FILE *script, const struct run_log *log) {
    static const char *const measured[3] = {"p1_pa", "p2_pa", "p3_pa"};
    static const char *const wanted[3] = {"p1_cmd_pa", "p2_cmd_pa", "p3_cmd_pa"};
    static const char *const duty[3] = {"valve1", "valve2", "valve3"};
    const bool has_wanted = run_log_column(log, wanted[0]) >= 0;
    fputs("set ylabel 'pressure / kPa'\nplot ", script);
    for (int c = 1; c <= 3; c++) {
        fprintf(script, "'-' w l lw 0.5 lc %d t 'chamber %d',", c, c);
    }
    for (int c = 1; c <= 3 && has_wanted; c++) {
        fprintf(script, "'-' w l lw 1.5 dt 2 lc %d t 'target %d',", c, c);
    }
    fputs("\n", script);
    for (size_t c = 0; c < 3; c++) {
        draw_column(script, log, measured[c], 1e-3);
    }
    for (size_t c = 0; c < 3 && has_wanted; c++) {
        draw_column(script, log, wanted[c], 1e-3);
    }
    if (run_log_column(log, duty[0]) < 0) {
        fputs("set multiplot next\n", script);
        return;
    }
    fputs("set ylabel 'duty / 1'\nset yrange [-0.05:1.05]\n"
          "plot for [c=1:3] '-' w steps lw 1 lc c t sprintf('valve %d', c)\n",
          script);
    for (size_t c = 0; c < 3; c++) {
        draw_column(script, log, duty[c], 1.0);
    }
    fputs("set autoscale y\n", script);
}

static void draw_tip(FILE *script, const struct run_log *log) {
    const bool commanded = has_values(log, "bend_cmd_rad");
    const char *plot = commanded ? "plot '-' w p pt 7 ps 0.25 t 'measured', '-' w l lw 1.5 dt 2 lc rgb 'black' t 'commanded'\n"
                                 : "plot '-' w p pt 7 ps 0.25 t 'measured'\n";
    fprintf(script, "set ylabel 'bend / deg'\n%s", plot);
    draw_measured(script, log, 0);
    if (commanded) {
        draw_column(script, log, "bend_cmd_rad", DEGREES);
    }
    fprintf(script, "set xlabel 'time / s'\nset ylabel 'direction / deg'\nset yrange [-185:185]\nset ytics 90\n%s", plot);
    draw_measured(script, log, 1);
    if (commanded) {
        draw_column(script, log, "direction_cmd_rad", DEGREES);
    }
}

enum run_plot_result run_plot(const struct run_log *log, const char *log_path, const char *png_path, char *error,
                              size_t error_bytes) {
    static const char *const needed[] = {"time_s", "p1_pa", "p2_pa", "p3_pa", "tip_qw", "tip_qx", "tip_qy", "tip_qz"};
    struct gnuplot plot;
    for (size_t i = 0; i < sizeof needed / sizeof needed[0]; i++) {
        if (run_log_column(log, needed[i]) < 0) {
            (void)snprintf(error, error_bytes, "%s: the column %s is missing; this picture needs it", log_path,
                           needed[i]);
            return RUN_PLOT_COLUMN_MISSING;
        }
    }
    if (!gnuplot_open(&plot, png_path, 1100, 1300, error, error_bytes)) {
        return RUN_PLOT_NOT_WRITTEN;
    }
    const int time = run_log_column(log, "time_s");
    fprintf(plot.script,
            "set multiplot layout 4,1 title 'Run of %s'\nset grid\nset key outside right top\nset lmargin 9\n"
            "set rmargin 20\nset xrange [%.6f:%.6f]\n",
            log->module[0] == '\0' || strchr(log->module, '\'') != NULL ? "an unnamed module" : log->module,
            cell(log, 0, time), fmax(cell(log, log->rows - 1, time), cell(log, 0, time) + 1e-3));
    draw_chambers(plot.script, log);
    draw_tip(plot.script, log);
    fputs("unset multiplot\n", plot.script);
    return gnuplot_close(&plot, error, error_bytes) ? RUN_PLOT_DRAWN : RUN_PLOT_NOT_WRITTEN;
}
