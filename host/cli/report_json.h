/* A report as JSON, for every subcommand that prints one. SI units, null for what was not measured. */
#ifndef TRIBEND_REPORT_JSON_H
#define TRIBEND_REPORT_JSON_H

#include <jansson.h>

#include "cli/commands.h"

/* The caller drops the reference. */
json_t *report_json(struct bus *bus, const struct link_report *report);

#endif
