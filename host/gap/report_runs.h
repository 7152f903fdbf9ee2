/* Figures of measured against simulated, one a run: pressures on the left, tip on the right, time across. */
#ifndef TRIBEND_GAP_REPORT_RUNS_H
#define TRIBEND_GAP_REPORT_RUNS_H

#include <stdio.h>

#include "gap/report_series.h"

/* As HTML with SVG in it. */
void report_runs(FILE *out, const struct report_series *series, const struct gap_data *data);

#endif
