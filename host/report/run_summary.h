/* How well a command was followed, from the reports as they come: steady error, settling time. */
#ifndef TRIBEND_RUN_SUMMARY_H
#define TRIBEND_RUN_SUMMARY_H

#include "link/link.h"

/* Errors of the last second before the command ended. */
#define RUN_SUMMARY_WINDOW_US 1000000
/* Settled: the bend vector stays this close to the command, the pressures this close to their targets. A single tip
 * sample's noise is a good part of the band, so the error is smoothed first (first order). */
#define RUN_SUMMARY_SMOOTHING_US 50000.0
#define RUN_SUMMARY_BEND_BAND_RAD 0.017453293 /* 1 degree */
#define RUN_SUMMARY_PRESSURE_BAND_PA 200.0

struct run_summary {
    struct controller_command command;
    int64_t start_us;
    int64_t end_us;          /* of the command: when the window ends */
    int64_t last_outside_us; /* last report outside the band; -1: never inside */
    int64_t last_inside_us;
    uint32_t samples_seen;
    int64_t smoothed_us;
    double smoothed_error_rad[2];
    /* over the window */
    uint32_t samples;
    double bend_sum_rad;
    double bend_square_rad2; /* of the error */
    double direction_sum_rad;
    double direction_square_rad2; /* of the error */
    uint32_t pressure_samples;
    double pressure_sum_pa[3];
    double pressure_square_pa2[3]; /* of the error */
    double pressure_most_pa;       /* of any chamber over the whole run */
};

void run_summary_start(struct run_summary *summary, const struct controller_command *command, int64_t start_us,
                       int64_t end_us);
void run_summary_add(struct run_summary *summary, const struct link_report *report);
/* The time from the start after which the error stayed inside the band, s; negative: it did not settle. */
double run_summary_settling_s(const struct run_summary *summary);

#endif
