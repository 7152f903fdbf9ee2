/* Another program's text table into a run log, by a mapping. */
#ifndef TRIBEND_MAPPING_IMPORT_H
#define TRIBEND_MAPPING_IMPORT_H

#include "log/mapping.h"
#include "log/run_log.h"

/* The value of a column that the source lacks, in SI. */
struct mapping_setting {
    const char *column;
    double value;
};

/* The log starts at 0 s. A setting fills a constant of the mapping that has no value, or adds a constant
 * column. Metadata: what was taken off at rest, when steps were found, where segments start. False: `error`
 * says why. */
bool mapping_import(const struct mapping *mapping, const char *path, const struct mapping_setting *settings,
                    size_t count, struct run_log *log, char *error, size_t error_bytes);

#endif
