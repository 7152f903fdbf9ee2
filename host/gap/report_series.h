/* What the pictures of the HTML report are drawn from: a table for each run, a row for each block over which
 * residuals are averaged, with what was measured and what two models say, one before and one after (nominal and
 * best, unless others are asked for). Pressures in kPa, positions in mm, angles in degrees; NAN: nothing was measured. */
#ifndef TRIBEND_GAP_REPORT_SERIES_H
#define TRIBEND_GAP_REPORT_SERIES_H

#include "gap/search.h"

#define REPORT_CHANNELS 5 /* of a pressure block: chambers 1 to 3, supply; of a tip block: as below */
#define REPORT_RESIDUALS 6

enum report_tip_channel { REPORT_TIP_BEND, REPORT_TIP_DIRECTION, REPORT_TIP_X, REPORT_TIP_Y, REPORT_TIP_Z };

/* Tip residuals in the frame that moves with the tip: along is where the nominal tip stands off the axis. */
enum report_tip_residual {
    REPORT_OFF_ALONG, /* mm */
    REPORT_OFF_ACROSS,
    REPORT_OFF_HEIGHT,
    REPORT_TURNED_ALONG, /* deg */
    REPORT_TURNED_ACROSS,
    REPORT_TWISTED
};

enum report_column {
    REPORT_TIME, /* s since the run's start */
    REPORT_HELD_OUT,
    REPORT_PRESSURE_1,
    REPORT_PRESSURE_2,
    REPORT_PRESSURE_3,
    REPORT_RATE_1, /* kPa/s */
    REPORT_RATE_2,
    REPORT_RATE_3,
    REPORT_RATE_MEAN,
    REPORT_BEND,         /* deg, or mm off the axis where no orientation was measured */
    REPORT_DIRECTION,    /* deg; NAN for a tip that is nearly straight */
    REPORT_APART_BEFORE, /* mm between the tip's places, measured and simulated */
    REPORT_APART_AFTER,
    REPORT_MEASURED,
    REPORT_BEFORE = REPORT_MEASURED + REPORT_CHANNELS,
    REPORT_AFTER = REPORT_BEFORE + REPORT_CHANNELS,
    REPORT_RESIDUAL_BEFORE = REPORT_AFTER + REPORT_CHANNELS,
    REPORT_RESIDUAL_AFTER = REPORT_RESIDUAL_BEFORE + REPORT_RESIDUALS,
    REPORT_COLUMNS = REPORT_RESIDUAL_AFTER + REPORT_RESIDUALS
};

struct report_table {
    size_t rows;
    double *cell; /* [rows * REPORT_COLUMNS] */
};

struct report_run {
    struct report_table pressure;
    struct report_table tip;
    double duration_s;
};

struct report_series {
    size_t runs;
    struct report_run run[GAP_RUNS_MAX];
};

/* False: out of memory; nothing is left open. */
bool report_series_open(struct report_series *series, const struct search *search);
/* The same of two other models. */
bool report_series_open_models(struct report_series *series, const struct search *search,
                               const struct gap_model *before, const struct gap_model *after);
void report_series_close(struct report_series *series);
bool report_table_has(const struct report_table *table, size_t column);
/* Root mean square of a column; NAN: it is empty. */
double report_table_rms(const struct report_table *table, size_t column);

#endif
