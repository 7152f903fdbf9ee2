#include "gap/report_axes.h"

#include <math.h>
#include <string.h>

#define AIR 0.06  /* of a range, at either end */
#define EDGE 10.0 /* px */
#define LABEL_BYTES 48
#define ROUNDING 1e-9 /* of a step: a tick at the very end of an axis is drawn */

static double kept_within(double value, double low, double high) {
    return fmin(fmax(value, low), high);
}

double axes_x(const struct axes *axes, double x) {
    const double share = (x - axes->x_low) / (axes->x_high - axes->x_low);
    return axes->left + kept_within(share, 0.0, 1.0) * axes->width;
}

double axes_y(const struct axes *axes, double y) {
    const double share = (y - axes->y_low) / (axes->y_high - axes->y_low);
    return axes->top + (1.0 - kept_within(share, 0.0, 1.0)) * axes->height;
}

void axes_widen(double *low, double *high, double least) {
    const double missing = least - (*high - *low);
    const double more = fmax(AIR * (*high - *low), 0.5 * missing);
    *low -= more;
    *high += more;
}

void axes_frame(FILE *out, const struct axes *axes) {
    fprintf(out, "<rect class=\"frame\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n", axes->left,
            axes->top, axes->width, axes->height);
}

/* 1, 2 or 5 times a power of ten (Heckbert 1990). */
static double nice_step(double span, size_t about) {
    const double rough = span / (double)about;
    const double power = pow(10.0, floor(log10(rough)));
    const double lead = rough / power;
    return power * (lead < 1.5 ? 1.0 : lead < 3.5 ? 2.0 : lead < 7.5 ? 5.0 : 10.0);
}

/* In steps from zero. */
static long first_tick(double low, double step) {
    return lround(ceil(low / step - ROUNDING));
}

static long last_tick(double high, double step) {
    return lround(floor(high / step + ROUNDING));
}

static void write_label(FILE *out, double value, double step) {
    char text[LABEL_BYTES];
    const int decimals = (int)kept_within(ceil(-log10(step) - ROUNDING), 0.0, 9.0);
    (void)snprintf(text, sizeof text, "%.*f", decimals, fabs(value));
    const bool is_zero = strspn(text, "0.") == strlen(text);
    fprintf(out, "%s%s", value < 0.0 && !is_zero ? "\xe2\x88\x92" : "", text);
}

void axes_ticks_x(FILE *out, const struct axes *axes, size_t about, bool labelled) {
    const double step = axes->x_step > 0.0 ? axes->x_step : nice_step(axes->x_high - axes->x_low, about);
    for (long i = first_tick(axes->x_low, step); i <= last_tick(axes->x_high, step); i++) {
        const double x = step * (double)i, at = axes_x(axes, x);
        fprintf(out, "<path class=\"grid\" d=\"M%.1f %.1fv%.1f\"/>", at, axes->top, axes->height);
        if (labelled) {
            /* a label at the very edge stays over its own picture */
            const bool left = at<axes->left + EDGE, right = at> axes->left + axes->width - EDGE;
            fprintf(out, "<text class=\"tick%s\" x=\"%.1f\" y=\"%.1f\">",
                    left    ? ""
                    : right ? " end"
                            : " middle",
                    at, axes->top + axes->height + 15.0);
            write_label(out, x, step);
            fputs("</text>\n", out);
        }
    }
}

void axes_ticks_y(FILE *out, const struct axes *axes, size_t about, bool labelled) {
    const double step = axes->y_step > 0.0 ? axes->y_step : nice_step(axes->y_high - axes->y_low, about);
    for (long i = first_tick(axes->y_low, step); i <= last_tick(axes->y_high, step); i++) {
        const double y = step * (double)i, at = axes_y(axes, y);
        const bool zero = i == 0;
        fprintf(out, "<path class=\"%s\" d=\"M%.1f %.1fh%.1f\"/>", zero ? "zero" : "grid", axes->left, at,
                axes->width);
        if (labelled) {
            fprintf(out, "<text class=\"tick end\" x=\"%.1f\" y=\"%.1f\">", axes->left - 6.0, at + 4.0);
            write_label(out, y, step);
            fputs("</text>\n", out);
        }
    }
}

/* --- lines --- */

struct pen {
    FILE *out;
    const struct axes *axes;
    double gap;
    double x; /* of the last point; NAN: none */
    double y;
};

static void draw_to(struct pen *pen, double x, double y) {
    const double turn = pen->axes->turn;
    const bool joined = x - pen->x <= pen->gap && !(turn > 0.0 && fabs(y - pen->y) > 0.5 * turn);
    fprintf(pen->out, "%c%.1f %.1f", joined ? 'L' : 'M', axes_x(pen->axes, x), axes_y(pen->axes, y));
    pen->x = x;
    pen->y = y;
}

/* Least and greatest of the points [first, end), in their order. */
static void draw_extremes(struct pen *pen, const struct axes_points *points, size_t first, size_t end) {
    size_t least = end, most = end;
    for (size_t i = first; i < end; i++) {
        const double y = points->y[i * points->stride];
        if (!isnan(y)) {
            least = least == end || y < points->y[least * points->stride] ? i : least;
            most = most == end || y > points->y[most * points->stride] ? i : most;
        }
    }
    const size_t order[2] = {least < most ? least : most, least < most ? most : least};
    for (size_t k = 0; k < 2 && order[k] < end && (k == 0 || order[0] != order[1]); k++) {
        draw_to(pen, points->x[order[k] * points->stride], points->y[order[k] * points->stride]);
    }
}

void axes_line(FILE *out, const struct axes *axes, const char *class, const struct axes_points *points,
               size_t most, double gap) {
    struct pen pen = {out, axes, gap, NAN, NAN};
    const size_t each = points->count <= most ? 1 : (2 * points->count + most - 1) / most;
    fprintf(out, "<path class=\"%s\" d=\"", class);
    for (size_t first = 0; first < points->count; first += each) {
        draw_extremes(&pen, points, first, first + each < points->count ? first + each : points->count);
    }
    fputs("\"/>\n", out);
}

void axes_band(FILE *out, const struct axes *axes, const char *class, const struct axes_points *low,
               const double *high) {
    if (low->count < 2) {
        return;
    }
    fprintf(out, "<path class=\"%s\" d=\"", class);
    for (size_t i = 0; i < low->count; i++) {
        const double x = low->x[i * low->stride], y = low->y[i * low->stride];
        fprintf(out, "%c%.1f %.1f", i == 0 ? 'M' : 'L', axes_x(axes, x), axes_y(axes, y));
    }
    for (size_t i = low->count; i-- > 0;) {
        fprintf(out, "L%.1f %.1f", axes_x(axes, low->x[i * low->stride]),
                axes_y(axes, high[i * low->stride]));
    }
    fputs("Z\"/>\n", out);
}
