/* A plotting area of an SVG picture: scales, ticks, lines and bands. Pixels, y downward; colours are the
 * page's classes. */
#ifndef TRIBEND_GAP_REPORT_AXES_H
#define TRIBEND_GAP_REPORT_AXES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

struct axes {
    double left;
    double top;
    double width;
    double height;
    double x_low;
    double x_high;
    double y_low;
    double y_high;
    double x_step; /* between ticks; 0: as it suits */
    double y_step;
    double turn; /* 360 where y is an angle in degrees: no line joins +180 and -180; else 0 */
};

/* Points of a line or band: values that lie `stride` apart in memory. */
struct axes_points {
    const double *x;
    const double *y;
    size_t stride;
    size_t count;
};

double axes_x(const struct axes *axes, double x);
double axes_y(const struct axes *axes, double y);
/* A range that holds both ends with some air, and is at least `least` wide. */
void axes_widen(double *low, double *high, double least);
/* Frame, grid and tick labels; about so many ticks. Labels are left out where `labelled` says so. */
void axes_frame(FILE *out, const struct axes *axes);
void axes_ticks_x(FILE *out, const struct axes *axes, size_t about, bool labelled);
void axes_ticks_y(FILE *out, const struct axes *axes, size_t about, bool labelled);
/* A line of at most `most` points that keeps extremes; it is broken where nothing was seen for `gap` in x. */
void axes_line(FILE *out, const struct axes *axes, const char *class, const struct axes_points *points,
               size_t most, double gap);
/* The area between two lines over the same x. */
void axes_band(FILE *out, const struct axes *axes, const char *class, const struct axes_points *low,
               const double *high);

#endif
