#include "gap/report_runs.h"

#include <math.h>

#include "gap/report_axes.h"
#include "gap/report_markup.h"

#define FIGURE_WIDTH 1064.0
#define COLUMN_LEFT 52.0
#define COLUMN_WIDTH 468.0
#define COLUMN_PITCH 540.0
#define PANEL_HEIGHT 92.0
#define PANEL_PITCH 122.0
#define TITLE_ROOM 20.0
#define FOOT_ROOM 26.0
#define COLUMN_PANELS 5
#define POINTS_MOST 1200 /* of a line */
#define POINTS_LEAST 240
#define POINTS_ALL_RUNS 9600 /* of one line over all runs: keeps the page of many runs small */
#define JOIN_S 0.6           /* samples further apart are not joined by a line */
#define RUNS_UNFOLDED 4

struct panel {
    const char *title;
    const char *unit;
    bool tip;        /* drawn from the table of the tip */
    size_t measured; /* columns of the table; NOTHING: no such line */
    size_t before;
    size_t after;
    double least; /* range that is worth showing */
    double turn;  /* 360: an angle all round */
};

#define NOTHING REPORT_COLUMNS
#define CHANNEL(k) REPORT_MEASURED + (k), REPORT_BEFORE + (k), REPORT_AFTER + (k)

static const struct panel panels[2][COLUMN_PANELS] = {
    {{"chamber 1", "kPa", false, CHANNEL(0), 0.5, 0.0},
     {"chamber 2", "kPa", false, CHANNEL(1), 0.5, 0.0},
     {"chamber 3", "kPa", false, CHANNEL(2), 0.5, 0.0},
     {"supply", "kPa", false, CHANNEL(3), 0.5, 0.0},
     {"tip, from measured to simulated place", "mm", true, NOTHING, REPORT_APART_BEFORE, REPORT_APART_AFTER,
      0.2, 0.0}},
    {{"tip bend", "deg", true, CHANNEL(REPORT_TIP_BEND), 2.0, 0.0},
     {"tip direction", "deg", true, CHANNEL(REPORT_TIP_DIRECTION), 2.0, 360.0},
     {"tip x", "mm", true, CHANNEL(REPORT_TIP_X), 0.5, 0.0},
     {"tip y", "mm", true, CHANNEL(REPORT_TIP_Y), 0.5, 0.0},
     {"tip z, along the axis", "mm", true, CHANNEL(REPORT_TIP_Z), 0.5, 0.0}}};

static const struct report_table *table_of(const struct report_run *run, const struct panel *panel) {
    return panel->tip ? &run->tip : &run->pressure;
}

static bool is_drawn(const struct report_run *run, const struct panel *panel) {
    return report_table_has(table_of(run, panel),
                            panel->measured != NOTHING ? panel->measured : panel->before);
}

static void find_range(const struct report_table *table, const struct panel *panel, double *low,
                       double *high) {
    const size_t lines[3] = {panel->measured, panel->before, panel->after};
    *low = INFINITY;
    *high = -INFINITY;
    for (size_t row = 0; row < table->rows; row++) {
        for (size_t k = 0; k < 3; k++) {
            const double value = lines[k] == NOTHING ? NAN : table->cell[row * REPORT_COLUMNS + lines[k]];
            *low = fmin(*low, value);
            *high = fmax(*high, value);
        }
    }
}

static struct axes panel_axes(const struct report_run *run, const struct panel *panel, double left,
                              double top) {
    struct axes axes = {.left = left,
                        .top = top,
                        .width = COLUMN_WIDTH,
                        .height = PANEL_HEIGHT,
                        .x_high = run->duration_s,
                        .turn = panel->turn};
    if (panel->turn > 0.0) {
        axes.y_low = -0.5 * panel->turn;
        axes.y_high = 0.5 * panel->turn;
        axes.y_step = 0.25 * panel->turn;
    } else {
        find_range(table_of(run, panel), panel, &axes.y_low, &axes.y_high);
        axes_widen(&axes.y_low, &axes.y_high, panel->least);
        axes.y_low = panel->measured == NOTHING ? 0.0 : axes.y_low; /* a distance */
    }
    return axes;
}

static void shade(FILE *out, const struct axes *axes, double from_s, double to_s) {
    const double left = axes_x(axes, from_s);
    fprintf(out, "<rect class=\"held\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>", left,
            axes->top, axes_x(axes, to_s) - left, axes->height);
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

static void draw_lines(FILE *out, const struct axes *axes, const struct panel *panel,
                       const struct report_table *table, size_t points_most) {
    const struct {
        size_t column;
        const char *class;
    } lines[3] = {
        {panel->measured, "line measured"}, {panel->before, "line before"}, {panel->after, "line after"}};
    for (size_t k = 0; k < 3; k++) {
        if (lines[k].column != NOTHING) {
            const struct axes_points points = {table->cell + REPORT_TIME, table->cell + lines[k].column,
                                               REPORT_COLUMNS, table->rows};
            axes_line(out, axes, lines[k].class, &points, points_most, JOIN_S);
        }
    }
}

static void draw_panel(FILE *out, const struct axes *axes, const struct panel *panel,
                       const struct report_table *table, bool last, size_t points_most) {
    fprintf(out, "<text class=\"title\" x=\"%.1f\" y=\"%.1f\">%s / %s</text>\n", axes->left, axes->top - 6.0,
            panel->title, panel->unit);
    shade_held_out(out, axes, table);
    axes_ticks_x(out, axes, 6, last);
    axes_ticks_y(out, axes, 4, true);
    draw_lines(out, axes, panel, table, points_most);
    axes_frame(out, axes);
    if (last) {
        fprintf(out, "<text class=\"tick end\" x=\"%.1f\" y=\"%.1f\">time / s</text>\n",
                axes->left + axes->width, axes->top + axes->height + 30.0);
    }
}

static size_t count_panels(const struct report_run *run, size_t column) {
    size_t count = 0;
    for (size_t p = 0; p < COLUMN_PANELS; p++) {
        count += is_drawn(run, &panels[column][p]);
    }
    return count;
}

static void draw_column(FILE *out, const struct report_run *run, size_t column, size_t points_most) {
    const size_t count = count_panels(run, column);
    size_t drawn = 0;
    for (size_t p = 0; p < COLUMN_PANELS; p++) {
        const struct panel *panel = &panels[column][p];
        if (is_drawn(run, panel)) {
            const struct axes axes = panel_axes(run, panel, COLUMN_LEFT + (double)column * COLUMN_PITCH,
                                                TITLE_ROOM + PANEL_PITCH * (double)drawn);
            drawn++;
            draw_panel(out, &axes, panel, table_of(run, panel), drawn == count, points_most);
        }
    }
}

static void draw_run(FILE *out, const struct report_run *run, size_t points_most) {
    const size_t left = count_panels(run, 0), right = count_panels(run, 1);
    const double height = (double)(left > right ? left : right) * PANEL_PITCH + FOOT_ROOM;
    fprintf(
        out,
        "<div class=\"scroll\"><svg width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" "
        "aria-label=\"measured and simulated pressures and tip against time\">\n",
        FIGURE_WIDTH, height, FIGURE_WIDTH, height);
    draw_column(out, run, 0, points_most);
    draw_column(out, run, 1, points_most);
    fputs("</svg></div>\n", out);
}

/* Over the three chambers. */
static double pressure_rms(const struct report_table *table, size_t first) {
    double sum = 0.0;
    for (size_t c = 0; c < 3; c++) {
        const double rms = report_table_rms(table, first + c);
        sum += isnan(rms) ? 0.0 : rms * rms / 3.0;
    }
    return sqrt(sum);
}

static void write_change(FILE *out, const char *what, double before, double after, const char *unit) {
    fprintf(out, ", %s off by ", what);
    markup_number(out, before, 0.0);
    fputs(" \xe2\x86\x92 ", out);
    markup_number(out, after, 0.0);
    fprintf(out, " %s rms", unit);
}

static void write_summary(FILE *out, const struct report_run *run, const char *path) {
    fputs("<summary><b>", out);
    markup_text(out, path);
    fputs("</b> <span class=\"muted\">", out);
    markup_number(out, run->duration_s, 1.0);
    fputs(" s", out);
    if (report_table_has(&run->pressure, REPORT_RESIDUAL_BEFORE)) {
        write_change(out, "pressure", pressure_rms(&run->pressure, REPORT_RESIDUAL_BEFORE),
                     pressure_rms(&run->pressure, REPORT_RESIDUAL_AFTER), "kPa");
    }
    if (report_table_has(&run->tip, REPORT_APART_BEFORE)) {
        write_change(out, "tip", report_table_rms(&run->tip, REPORT_APART_BEFORE),
                     report_table_rms(&run->tip, REPORT_APART_AFTER), "mm");
    }
    fputs("</span></summary>\n", out);
}

void report_runs(FILE *out, const struct report_series *series, const struct gap_data *data) {
    const size_t shared = POINTS_ALL_RUNS / (series->runs > 0 ? series->runs : 1);
    const size_t most = shared > POINTS_MOST ? POINTS_MOST : shared < POINTS_LEAST ? POINTS_LEAST : shared;
    fputs("<p class=\"legend\"><span class=\"key measured\"></span>measured <span class=\"key "
          "before\"></span>nominal model, "
          "before <span class=\"key after\"></span>best model, after <span class=\"swatch held\"></span>held "
          "out from the "
          "fit</p>\n",
          out);
    for (size_t i = 0; i < series->runs; i++) {
        fprintf(out, "<details%s>", i < RUNS_UNFOLDED ? " open=\"open\"" : "");
        write_summary(out, &series->run[i], data->run[i].path);
        draw_run(out, &series->run[i], most);
        fputs("</details>\n", out);
    }
}
