/* Figures of what is left, measured minus simulated, against each variable that it might depend on. */
#ifndef TRIBEND_GAP_REPORT_RESIDUALS_H
#define TRIBEND_GAP_REPORT_RESIDUALS_H

#include <stdio.h>

#include "gap/report_series.h"

/* False: out of memory. */
bool report_residuals(FILE *out, const struct report_series *series, const struct gap_data *data);

#endif
