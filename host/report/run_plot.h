/* A picture of a run: pressures, valve duties, bend and direction against time. */
#ifndef TRIBEND_RUN_PLOT_H
#define TRIBEND_RUN_PLOT_H

#include "log/run_log.h"

enum run_plot_result { RUN_PLOT_DRAWN, RUN_PLOT_COLUMN_MISSING, RUN_PLOT_NOT_WRITTEN };

/* Into a PNG file, by gnuplot. Else than drawn: `error` says which column or file, and why. */
enum run_plot_result run_plot(const struct run_log *log, const char *log_path, const char *png_path, char *error,
                              size_t error_bytes);

#endif
