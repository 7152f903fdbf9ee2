#include "gap/report_file.h"

#include <stdio.h>

#include "program/output_file.h"

bool report_file_write(json_t *report, const char *path, char *error, size_t error_bytes) {
    struct output_file file;
    if (report == NULL) {
        (void)snprintf(error, error_bytes, "%s: the report could not be put together", path);
        return false;
    }
    if (!output_file_open(&file, path, error, error_bytes)) {
        json_decref(report);
        return false;
    }
    const int status = json_dumpf(report, file.stream, JSON_INDENT(2) | JSON_REAL_PRECISION(8));
    fputc('\n', file.stream);
    json_decref(report);
    if (status != 0) {
        output_file_discard(&file);
        (void)snprintf(error, error_bytes, "%s: the report could not be written", path);
        return false;
    }
    return output_file_commit(&file, error, error_bytes);
}
