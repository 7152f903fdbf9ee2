#include "gap/report_runs.h"

#include <math.h>

#include "gap/report_axes.h"
#include "gap/report_markup.h"

#define FIGURE_WIDTH 1080.0
#define COLUMN_LEFT 52.0
#define COLUMN_WIDTH 474.0
#define COLUMN_PITCH 544.0
#define PANEL_HEIGHT 92.0
#define PANEL_PITCH 122.0
#define TITLE_ROOM 20.0
#define FOOT_ROOM 26.0
#define COLUMN_PANELS 5
#define POINTS_MOST 1200    /* of a line */
#define POINTS_LEAST 240
#define POINTS_ALL_RUNS 9600 /* of one line over all runs: keeps the page of many runs small */
#define JOIN_S 0.6          /* samples further apart are not joined by a line */
#define RUNS_UNFOLDED 4

struct panel {
    const char *title;
    const char *unit;
    double least; /* range that is worth showing */
    double turn;  /* 360: an angle all round */
};

static const struct panel panels[2][COLUMN_PANELS] = {
    {{"chamber 1", "kPa", 0.5, 0.0},
     {"chamber 2", "kPa", 0.5, 0.0},
     {"chamber 3", "kPa", 0.5, 0.0},
     {"supply", "kPa", 0.5, 0.0},
     {0}},
    {{"tip bend", "deg", 2.0, 0.0},
     {"tip direction", "deg", 2.0, 360.0},
     {"tip x", "mm", 0.5, 0.0},
     {"tip y", "mm", 0.5, 0.0},
     {"tip z, along the axis", "mm", 0.5, 0.0}}};

static bool is_drawn(const struct report_table *table, size_t column, size_t panel) {
    return panels[column][panel].title != NULL && report_table_has(table, REPORT_MEASURED + panel);
}

static void find_range(const struct report_table *table, size_t channel, double *low, double *high) {
    static const size_t lines[3] = {REPORT_MEASURED, REPORT_BEFORE, REPORT_AFTER};
    *low = INFINITY;
    *high = -INFINITY;
    for (size_t row = 0; row < table->rows; row++) {
        for (size_t k = 0; k < 3; k++) {
            const double value = table->cell[row * REPORT_COLUMNS + lines[k] + channel];
            *low = fmin(*low, value);
            *high = fmax(*high, value);
        }
    }
}

static struct axes panel_axes(const struct report_table *table, size_t column, size_t channel, double top, double duration_s) {
    const struct panel *panel = &panels[column][channel];
    struct axes axes = {.left = COLUMN_LEFT + (double)column * COLUMN_PITCH,
                        .top = top,
                        .width = COLUMN_WIDTH,
                        .height = PANEL_HEIGHT,
                        .x_high = duration_s,
                        .turn = panel->turn};
    if (panel->turn > 0.0) {
        axes.y_low = -0.5 * panel->turn;
        axes.y_high = 0.5 * panel->turn;
        axes.y_step = 0.25 * panel->turn;
    } else {
        find_range(table, channel, &axes.y_low, &axes.y_high);
        axes_widen(&axes.y_low, &axes.y_high, panel->least);
    }
    return axes;
}

static void shade(FILE *out, const struct axes *axes, double from_s, double to_s) {
    const double left = axes_x(axes, from_s);
    fprintf(out, "<rect class=\"held\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>", left, axes->top,
            axes_x(axes, to_s) - left, axes->height);
}

static void shade_held_out(FILE *out, const struct axes *axes, const struct report_table *table) {
    double from_s = NAN;
    for (size_t row = 0; row < table->rows; row++) {
        const double *cell = table->cell + row * REPORT_COLUMNS;
        const bool held = cell[REPORT_HELD_OUT] > 0.5;
        if (held && isnan(from_s)) {
            from_s = cell[REPORT_TIME];
        } else if (!held && !isnan(from_s)) {
            shade(out, axes, from_s, cell[REPORT_TIME]);
            from_s = NAN;
        }
    }
    if (!isnan(from_s)) {
        shade(out, axes, from_s, axes->x_high);
    }
    fputs("\n", out);
}

static void draw_panel(FILE *out, const struct axes *axes, const struct panel *panel, const struct report_table *table,
                       size_t channel, bool last, size_t points_most) {
    static const struct {
        size_t first;
        const char *class;
    } lines[3] = {{REPORT_MEASURED, "line measured"}, {REPORT_BEFORE, "line before"}, {REPORT_AFTER, "line after"}};
    fprintf(out, "<text class=\"title\" x=\"%.1f\" y=\"%.1f\">%s / %s</text>\n", axes->left, axes->top - 6.0, panel->title,
            panel->unit);
    shade_held_out(out, axes, table);
    axes_ticks_x(out, axes, 6, last);
    axes_ticks_y(out, axes, 4, true);
    for (size_t k = 0; k < 3; k++) {
        const struct axes_points points = {table->cell + REPORT_TIME, table->cell + lines[k].first + channel, REPORT_COLUMNS,
                                           table->rows};
        axes_line(out, axes, lines[k].class, &points, points_most, JOIN_S);
    }
    axes_frame(out, axes);
    if (last) {
        fprintf(out, "<text class=\"tick end\" x=\"%.1f\" y=\"%.1f\">time / s</text>\n", axes->left + axes->width,
                axes->top + axes->height + 30.0);
    }
}

static size_t count_panels(const struct report_table *table, size_t column) {
    size_t count = 0;
    for (size_t p = 0; p < COLUMN_PANELS; p++) {
        count += is_drawn(table, column, p);
    }
    return count;
}

static void draw_column(FILE *out, const struct report_run *run, size_t column, size_t points_most) {
    const struct report_table *table = column == 0 ? &run->pressure : &run->tip;
    const size_t count = count_panels(table, column);
    size_t drawn = 0;
    for (size_t p = 0; p < COLUMN_PANELS; p++) {
        if (is_drawn(table, column, p)) {
            const struct axes axes =
                panel_axes(table, column, p, TITLE_ROOM + PANEL_PITCH * (double)drawn, run->duration_s);
            drawn++;
            draw_panel(out, &axes, &panels[column][p], table, p, drawn == count, points_most);
        }
    }
}

static void draw_run(FILE *out, const struct report_run *run, size_t points_most) {
    const size_t left = count_panels(&run->pressure, 0), right = count_panels(&run->tip, 1);
    const double height = (double)(left > right ? left : right) * PANEL_PITCH + FOOT_ROOM;
    fprintf(out,
            "<div class=\"scroll\"><svg width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" "
            "aria-label=\"measured and simulated pressures and tip against time\">\n",
            FIGURE_WIDTH, height, FIGURE_WIDTH, height);
    draw_column(out, run, 0, points_most);
    draw_column(out, run, 1, points_most);
    fputs("</svg></div>\n", out);
}

static double pooled_rms(const struct report_table *table, size_t first) {
    double sum = 0.0;
    for (size_t k = 0; k < 3; k++) {
        const double rms = report_table_rms(table, first + k);
        sum += isnan(rms) ? 0.0 : rms * rms;
    }
    return sqrt(sum / 3.0);
}

static void write_change(FILE *out, const char *what, const struct report_table *table, const char *unit) {
    if (report_table_has(table, REPORT_RESIDUAL_BEFORE) || report_table_has(table, REPORT_RESIDUAL_BEFORE + 2)) {
        fprintf(out, ", %s off by ", what);
        markup_number(out, pooled_rms(table, REPORT_RESIDUAL_BEFORE), 0.0);
        fputs(" \xe2\x86\x92 ", out);
        markup_number(out, pooled_rms(table, REPORT_RESIDUAL_AFTER), 0.0);
        fprintf(out, " %s rms", unit);
    }
}

static void write_summary(FILE *out, const struct report_run *run, const char *path) {
    fputs("<summary><b>", out);
    markup_text(out, path);
    fputs("</b> <span class=\"muted\">", out);
    markup_number(out, run->duration_s, 1.0);
    fputs(" s", out);
    write_change(out, "pressure", &run->pressure, "kPa");
    write_change(out, "tip", &run->tip, "mm");
    fputs("</span></summary>\n", out);
}

void report_runs(FILE *out, const struct report_series *series, const struct gap_data *data) {
    const size_t shared = POINTS_ALL_RUNS / (series->runs > 0 ? series->runs : 1);
    const size_t most = shared > POINTS_MOST ? POINTS_MOST : shared < POINTS_LEAST ? POINTS_LEAST : shared;
    fputs("<p class=\"legend\"><span class=\"key measured\"></span>measured <span class=\"key before\"></span>nominal model, "
          "before <span class=\"key after\"></span>best model, after <span class=\"swatch held\"></span>held out from the "
          "fit</p>\n",
          out);
    for (size_t i = 0; i < series->runs; i++) {
        fprintf(out, "<details%s>", i < RUNS_UNFOLDED ? " open=\"open\"" : "");
        write_summary(out, &series->run[i], data->run[i].path);
        draw_run(out, &series->run[i], most);
        fputs("</details>\n", out);
    }
}
