/* The file of finished tasks: a header with the job's key, then records, each with its length and CRC-32. A record that a
 * kill cut short is dropped when the file is opened again. Internal to model/sweep. */
#ifndef TRIBEND_SWEEP_FILE_H
#define TRIBEND_SWEEP_FILE_H

#include <stdio.h>

#include "sweep/sweep.h"

struct sweep_file {
    FILE *stream; /* NULL: nothing is kept */
    char path[4096];
};

/* Reads what is there into `results` and goes on behind it. False: `error` says why. A NULL path keeps nothing. */
bool sweep_file_open(struct sweep_file *file, const char *path, uint64_t key, struct sweep_result *results, size_t count,
                     char *error, size_t error_bytes);
bool sweep_file_append(struct sweep_file *file, uint64_t task, const struct sweep_result *result);
/* Removes it where the job is complete. */
void sweep_file_close(struct sweep_file *file, bool complete);

#endif
