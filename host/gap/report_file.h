/* A JSON report as a file: whole under its name, or not there. */
#ifndef TRIBEND_GAP_REPORT_FILE_H
#define TRIBEND_GAP_REPORT_FILE_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

/* Takes the report over; NULL: it could not be put together, which is said. False: `error` names the file. */
bool report_file_write(json_t *report, const char *path, char *error, size_t error_bytes);

#endif
