/* A diagnosis for people and for programs. */
#ifndef TRIBEND_GAP_REPORT_H
#define TRIBEND_GAP_REPORT_H

#include <stdio.h>

#include "gap/diagnosis.h"

/* What a tired person understands in ten seconds: verdict, where, which, how far. */
void gap_report_text(const struct diagnosis *diagnosis, const struct gap_data *data, FILE *out);
/* The report as JSON (docs/gap.md has the schema), aside and renamed. */
bool gap_report_json(const struct diagnosis *diagnosis, const struct gap_data *data, const char *path, char *error,
                     size_t error_bytes);
/* The effects and scales found, for `--calibration`. */
bool gap_report_calibration(const struct diagnosis *diagnosis, const struct gap_data *data, const char *path,
                            char *error, size_t error_bytes);

#endif
