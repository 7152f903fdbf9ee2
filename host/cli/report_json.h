/* A report as JSON, for every subcommand that prints one. SI units, null for what was not measured. */
#ifndef TRIBEND_REPORT_JSON_H
#define TRIBEND_REPORT_JSON_H

#include <jansson.h>

#include "cli/commands.h"
#include "report/run_summary.h"

/* The caller drops the reference. */
json_t *report_json(struct bus *bus, const struct link_report *report);
/* Names of faults, one a bit. */
json_t *report_faults_json(uint32_t faults);

/* How a command or a plan was followed. */
struct run_outcome {
    const struct link_report *last; /* before the module was vented */
    const struct run_summary *summary;
    const char *plan;     /* its file; NULL: one command all the time, the summary's */
    const char *record;   /* NULL: not recorded */
    double followed_s;    /* how long, on the controller's clock */
    double vented_s;      /* how long venting took; negative: it did not come to an end */
    bool interrupted;
};

/* The last report with "command", "followed", "followed_s", "vented_s", "interrupted" and "record". */
json_t *run_outcome_json(struct bus *bus, const struct run_outcome *outcome);
/* Prints the object and drops the reference; an exit code. */
int report_json_print(json_t *object);

#endif
