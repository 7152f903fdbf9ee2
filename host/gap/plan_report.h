/* What a search for an experiment found, for people and for programs. */
#ifndef TRIBEND_GAP_PLAN_REPORT_H
#define TRIBEND_GAP_PLAN_REPORT_H

#include <stdio.h>

#include "gap/plan_search.h"

void plan_report_text(const struct plan_search *search, const struct plan_candidates *candidates, FILE *out);
/* `plan_path` is where the plan went. The file appears whole or not at all; false: `error` says why. */
bool plan_report_json(const struct plan_search *search, const struct plan_candidates *candidates,
                      const char *plan_path, const char *path, char *error, size_t error_bytes);

#endif
