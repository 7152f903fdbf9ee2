#include "gap/report_residuals.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/report_axes.h"
#include "gap/report_markup.h"

#define BINS 20
#define BIN_LEAST 8 /* values below which a bin is not drawn */
#define TAIL 0.01   /* of a variable's values, left out at either end of its axis */
#define FIGURE_WIDTH 1064.0
#define LABEL_WIDTH 146.0
#define CELL_WIDTH 122.0
#define CELL_PITCH 132.0
#define CELL_HEIGHT 78.0
#define ROW_PITCH 104.0
#define HEAD_ROOM 58.0
#define FOOT_ROOM 30.0
#define VARIABLES_MAX 7
#define CHAMBERS_APART_DEG 120.0
#define STRIKING 0.2 /* share explained that is worth a look */

struct variable {
    const char *name;
    const char *unit;
    size_t column;
};

struct residual {
    const char *name;
    const char *of;
    const char *unit;
    size_t offset; /* from REPORT_RESIDUAL_BEFORE or REPORT_RESIDUAL_AFTER */
    size_t rate;   /* column of the pressure rate that it is held against */
    double least;  /* range that is worth showing */
};

/* One kind of table: its residuals against the same variables. */
struct matrix {
    bool tip;
    size_t residuals;
    struct residual residual[REPORT_RESIDUALS];
};

static const struct matrix pressures = {
    .tip = false,
    .residuals = 3,
    .residual = {{"chamber 1", "pressure", "kPa", 0, REPORT_RATE_1, 0.04},
                 {"chamber 2", "pressure", "kPa", 1, REPORT_RATE_2, 0.04},
                 {"chamber 3", "pressure", "kPa", 2, REPORT_RATE_3, 0.04}}};
static const struct matrix tips = {
    .tip = true,
    .residuals = 6,
    .residual = {{"tip position", "along the bend", "mm", REPORT_OFF_ALONG, REPORT_RATE_MEAN, 0.1},
                 {"tip position", "across the bend", "mm", REPORT_OFF_ACROSS, REPORT_RATE_MEAN, 0.1},
                 {"tip position", "along the axis", "mm", REPORT_OFF_HEIGHT, REPORT_RATE_MEAN, 0.1},
                 {"tip bend", "orientation", "deg", REPORT_TURNED_ALONG, REPORT_RATE_MEAN, 0.1},
                 {"tip direction", "sideways turn", "deg", REPORT_TURNED_ACROSS, REPORT_RATE_MEAN, 0.1},
                 {"tip twist", "about its own axis", "deg", REPORT_TWISTED, REPORT_RATE_MEAN, 0.1}}};

/* Median and quartiles of a residual over one bin of a variable. */
struct curve {
    size_t count;
    double x[BINS];
    double low[BINS];
    double middle[BINS];
    double high[BINS];
};

struct cell {
    struct curve curve[2]; /* before, after */
    double explained[2];   /* of the variance before: what a function of the variable alone would take off */
    bool empty;
};

struct triple {
    double x;
    double off[2];
};

/* All runs' values of one cell. */
struct sample {
    size_t count;
    struct triple *value;
    double *room; /* for sorting */
};

static const struct report_table *table_of(const struct report_series *series, size_t run, bool tip) {
    return tip ? &series->run[run].tip : &series->run[run].pressure;
}

static bool sample_open(struct sample *sample, const struct report_series *series, bool tip) {
    size_t rows = 1;
    for (size_t i = 0; i < series->runs; i++) {
        rows += table_of(series, i, tip)->rows;
    }
    sample->count = 0;
    sample->value = malloc(rows * sizeof *sample->value);
    sample->room = malloc(rows * sizeof *sample->room);
    return sample->value != NULL && sample->room != NULL;
}

static void sample_close(struct sample *sample) {
    free(sample->value);
    free(sample->room);
}

static void collect(struct sample *sample, const struct report_series *series, bool tip, size_t column,
                    size_t offset) {
    sample->count = 0;
    for (size_t i = 0; i < series->runs; i++) {
        const struct report_table *table = table_of(series, i, tip);
        for (size_t row = 0; row < table->rows; row++) {
            const double *cell = table->cell + row * REPORT_COLUMNS;
            const struct triple value = {
                cell[column], {cell[REPORT_RESIDUAL_BEFORE + offset], cell[REPORT_RESIDUAL_AFTER + offset]}};
            if (!isnan(value.x + value.off[0] + value.off[1])) {
                sample->value[sample->count++] = value;
            }
        }
    }
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double quantile(const double *sorted, size_t count, double share) {
    return sorted[(size_t)(share * (double)(count - 1) + 0.5)];
}

static void find_span(struct sample *sample, double span[2]) {
    for (size_t i = 0; i < sample->count; i++) {
        sample->room[i] = sample->value[i].x;
    }
    qsort(sample->room, sample->count, sizeof *sample->room, ascending);
    span[0] = quantile(sample->room, sample->count, TAIL);
    span[1] = quantile(sample->room, sample->count, 1.0 - TAIL);
}

static size_t bin_of(double x, const double span[2]) {
    const double share = (x - span[0]) / (span[1] - span[0]);
    return share < 0.0 ? BINS : share >= 1.0 ? (x > span[1] ? BINS : BINS - 1) : (size_t)(share * BINS);
}

static void fill_curve(struct sample *sample, const double span[2], size_t which, struct curve *curve) {
    curve->count = 0;
    for (size_t bin = 0; bin < BINS; bin++) {
        size_t count = 0;
        for (size_t i = 0; i < sample->count; i++) {
            if (bin_of(sample->value[i].x, span) == bin) {
                sample->room[count++] = sample->value[i].off[which];
            }
        }
        if (count >= BIN_LEAST) {
            const size_t at = curve->count++;
            qsort(sample->room, count, sizeof *sample->room, ascending);
            curve->x[at] = span[0] + ((double)bin + 0.5) / BINS * (span[1] - span[0]);
            curve->low[at] = quantile(sample->room, count, 0.25);
            curve->middle[at] = quantile(sample->room, count, 0.5);
            curve->high[at] = quantile(sample->room, count, 0.75);
        }
    }
}

/* Sum of squares about the mean, and the part of it that lies between the bins' means, less what chance puts
 * there. */
static void split_squares(const struct sample *sample, const double span[2], size_t which, double *all,
                          double *between) {
    double sum[BINS + 1] = {0.0}, count[BINS + 1] = {0.0}, total = 0.0;
    for (size_t i = 0; i < sample->count; i++) {
        const size_t bin = bin_of(sample->value[i].x, span);
        sum[bin] += sample->value[i].off[which];
        count[bin] += 1.0;
        total += sample->value[i].off[which];
    }
    const double mean = total / (double)sample->count;
    *all = 0.0;
    for (size_t i = 0; i < sample->count; i++) {
        *all += pow(sample->value[i].off[which] - mean, 2.0);
    }
    *between = 0.0;
    for (size_t bin = 0; bin <= BINS; bin++) {
        *between += count[bin] > 0.0 ? count[bin] * pow(sum[bin] / count[bin] - mean, 2.0) : 0.0;
    }
    const double degrees = (double)sample->count - BINS - 1.0;
    *between = degrees > 0.0 ? fmax(*between - BINS * (*all - *between) / degrees, 0.0) : 0.0;
}

static void fill_cell(struct sample *sample, const double span[2], struct cell *cell) {
    double all[2] = {0.0, 0.0}, between[2] = {0.0, 0.0};
    cell->empty = sample->count < BIN_LEAST || !(span[1] > span[0]);
    for (size_t which = 0; which < 2 && !cell->empty; which++) {
        fill_curve(sample, span, which, &cell->curve[which]);
        split_squares(sample, span, which, &all[which], &between[which]);
    }
    for (size_t which = 0; which < 2; which++) {
        cell->explained[which] = all[0] > 0.0 ? between[which] / all[0] : 0.0;
    }
}

/* --- drawing --- */

static double cell_left(size_t v) {
    return LABEL_WIDTH + CELL_PITCH * (double)v;
}

static size_t list_variables(const struct report_series *series, const struct gap_data *data, bool tip,
                             struct variable variable[VARIABLES_MAX]) {
    const bool angle = data->run[0].has_orientation;
    const struct variable all[VARIABLES_MAX] = {
        {"time", "s", REPORT_TIME},
        {"chamber 1", "pressure, kPa", REPORT_PRESSURE_1},
        {"chamber 2", "pressure, kPa", REPORT_PRESSURE_2},
        {"chamber 3", "pressure, kPa", REPORT_PRESSURE_3},
        {"pressure rate", tip ? "kPa/s, mean of three" : "kPa/s, own chamber", REPORT_RATE_MEAN},
        {angle ? "tip bend" : "tip off axis", angle ? "deg" : "mm", REPORT_BEND},
        {"tip direction", "deg", REPORT_DIRECTION}};
    size_t count = 0;
    for (size_t v = 0; v < VARIABLES_MAX; v++) {
        bool any = false;
        for (size_t i = 0; i < series->runs; i++) {
            any = any || report_table_has(table_of(series, i, tip), all[v].column);
        }
        if (any) {
            variable[count++] = all[v];
        }
    }
    return count;
}

static size_t column_for(const struct variable *variable, const struct residual *residual) {
    return variable->column == REPORT_RATE_MEAN ? residual->rate : variable->column;
}

/* The same span for a column of cells; the widest rate. */
static void span_of(struct sample *sample, const struct report_series *series, const struct matrix *matrix,
                    const struct variable *variable, double span[2]) {
    span[0] = INFINITY;
    span[1] = -INFINITY;
    for (size_t r = 0; r < matrix->residuals; r++) {
        double mine[2];
        collect(sample, series, matrix->tip, column_for(variable, &matrix->residual[r]),
                matrix->residual[r].offset);
        if (sample->count >= BIN_LEAST) {
            find_span(sample, mine);
            span[0] = fmin(span[0], mine[0]);
            span[1] = fmax(span[1], mine[1]);
        }
    }
    if (variable->column == REPORT_DIRECTION) {
        span[0] = -180.0;
        span[1] = 180.0;
    }
}

static void include_curve(const struct curve *curve, double range[2]) {
    for (size_t i = 0; i < curve->count; i++) {
        range[0] = fmin(range[0], curve->low[i]);
        range[1] = fmax(range[1], curve->high[i]);
    }
}

static void draw_curve(FILE *out, const struct axes *axes, const struct curve *curve, const char *band,
                       const char *line) {
    const struct axes_points low = {curve->x, curve->low, 1, curve->count};
    const struct axes_points middle = {curve->x, curve->middle, 1, curve->count};
    axes_band(out, axes, band, &low, curve->high);
    axes_line(out, axes, line, &middle, BINS, INFINITY);
}

static void draw_cell(FILE *out, const struct axes *axes, const struct cell *cell, bool first, bool last) {
    fprintf(out,
            "<g><rect class=\"tint\" fill-opacity=\"%.2f\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" "
            "height=\"%.1f\"/>\n",
            0.3 * fmin(cell->explained[0], 1.0), axes->left, axes->top, axes->width, axes->height);
    fprintf(out, "<text class=\"tick%s\" x=\"%.1f\" y=\"%.1f\">",
            cell->explained[0] >= STRIKING ? " striking" : "", axes->left, axes->top - 5.0);
    markup_percent(out, cell->explained[0]);
    fputs(" \xe2\x86\x92 ", out);
    markup_percent(out, cell->explained[1]);
    fputs("</text>\n", out);
    axes_ticks_x(out, axes, 3, last);
    axes_ticks_y(out, axes, 3, first);
    draw_curve(out, axes, &cell->curve[0], "band before", "line before");
    draw_curve(out, axes, &cell->curve[1], "band after", "line after");
    axes_frame(out, axes);
    fputs("</g>\n", out);
}

static void draw_row(FILE *out, struct sample *sample, const struct report_series *series,
                     const struct matrix *matrix, size_t r, const struct variable *variable,
                     double (*span)[2], size_t variables, double top, bool last) {
    const struct residual *residual = &matrix->residual[r];
    struct cell cell[VARIABLES_MAX];
    double range[2] = {0.0, 0.0};
    memset(cell, 0, sizeof cell);
    for (size_t v = 0; v < variables; v++) {
        collect(sample, series, matrix->tip, column_for(&variable[v], residual), residual->offset);
        fill_cell(sample, span[v], &cell[v]);
        include_curve(&cell[v].curve[0], range);
        include_curve(&cell[v].curve[1], range);
    }
    axes_widen(&range[0], &range[1], residual->least);
    fprintf(
        out,
        "<text class=\"title\" x=\"0\" y=\"%.1f\">%s</text><text class=\"tick\" x=\"0\" y=\"%.1f\">%s</text>"
        "<text class=\"tick\" x=\"0\" y=\"%.1f\">/ %s</text>\n",
        top + 0.5 * CELL_HEIGHT - 12.0, residual->name, top + 0.5 * CELL_HEIGHT + 5.0, residual->of,
        top + 0.5 * CELL_HEIGHT + 22.0, residual->unit);
    for (size_t v = 0; v < variables; v++) {
        const bool turns = variable[v].column == REPORT_DIRECTION;
        const struct axes axes = {cell_left(v), top,        CELL_WIDTH,
                                  CELL_HEIGHT,  span[v][0], span[v][1],
                                  range[0],     range[1],   turns ? CHAMBERS_APART_DEG : 0.0,
                                  0.0,          0.0};
        if (!cell[v].empty) {
            draw_cell(out, &axes, &cell[v], v == 0, last);
        }
    }
}

static void draw_heads(FILE *out, const struct variable *variable, size_t variables) {
    for (size_t v = 0; v < variables; v++) {
        fprintf(out,
                "<text class=\"title\" x=\"%.1f\" y=\"13\">%s</text><text class=\"tick\" x=\"%.1f\" "
                "y=\"28\">%s</text>\n",
                cell_left(v), variable[v].name, cell_left(v), variable[v].unit);
    }
}

/* Which residuals there is enough of. */
static size_t list_rows(struct sample *sample, const struct report_series *series,
                        const struct matrix *matrix, size_t shown[REPORT_RESIDUALS]) {
    size_t rows = 0;
    for (size_t r = 0; r < matrix->residuals; r++) {
        collect(sample, series, matrix->tip, REPORT_TIME, matrix->residual[r].offset);
        if (sample->count >= BIN_LEAST) {
            shown[rows++] = r;
        }
    }
    return rows;
}

static void draw_matrix(FILE *out, struct sample *sample, const struct report_series *series,
                        const struct gap_data *data, const struct matrix *matrix) {
    struct variable variable[VARIABLES_MAX];
    double span[VARIABLES_MAX][2];
    size_t shown[REPORT_RESIDUALS];
    const size_t rows = list_rows(sample, series, matrix, shown);
    if (rows == 0) {
        fprintf(out, "<p class=\"muted\">%s</p>\n",
                matrix->tip ? "The logs have no tip samples to compare."
                            : "Pressures are compared only where duties and readings were logged.");
        return;
    }
    const size_t variables = list_variables(series, data, matrix->tip, variable);
    for (size_t v = 0; v < variables; v++) {
        span_of(sample, series, matrix, &variable[v], span[v]);
    }
    const double height = HEAD_ROOM + (double)rows * ROW_PITCH + FOOT_ROOM - (ROW_PITCH - CELL_HEIGHT);
    fprintf(
        out,
        "<div class=\"scroll\"><svg width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" "
        "aria-label=\"%s residuals against each variable\">\n",
        FIGURE_WIDTH, height, FIGURE_WIDTH, height, matrix->tip ? "tip" : "pressure");
    draw_heads(out, variable, variables);
    for (size_t k = 0; k < rows; k++) {
        draw_row(out, sample, series, matrix, shown[k], variable, span, variables,
                 HEAD_ROOM + ROW_PITCH * (double)k, k + 1 == rows);
    }
    fputs("</svg></div>\n", out);
}

static bool draw(FILE *out, const struct report_series *series, const struct gap_data *data,
                 const struct matrix *matrix) {
    struct sample sample;
    const bool sound = sample_open(&sample, series, matrix->tip);
    if (sound) {
        draw_matrix(out, &sample, series, data, matrix);
    }
    sample_close(&sample);
    return sound;
}

bool report_residuals(FILE *out, const struct report_series *series, const struct gap_data *data) {
    fputs("<p class=\"legend\"><span class=\"swatch before\"></span>nominal model, before <span "
          "class=\"swatch after\"></span>"
          "best model, after \xe2\x80\x94 line: median, band: middle half. The figures over each picture: "
          "the share of the "
          "residual\xe2\x80\x99s variance that a function of this variable alone takes off, before "
          "\xe2\x86\x92 after; the "
          "deeper the ground, the more.</p>\n",
          out);
    return draw(out, series, data, &pressures) && draw(out, series, data, &tips);
}
