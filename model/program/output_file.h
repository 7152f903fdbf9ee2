/* A file that appears whole or not at all: written beside its place as PATH.part, renamed when complete. */
#ifndef TRIBEND_OUTPUT_FILE_H
#define TRIBEND_OUTPUT_FILE_H

#include <stdbool.h>
#include <stdio.h>

#define OUTPUT_PATH_BYTES 4096

struct output_file {
    FILE *stream; /* NULL when not open */
    char path[OUTPUT_PATH_BYTES];
    char aside[OUTPUT_PATH_BYTES];
};

/* False: `error` names the path and the reason. */
bool output_file_open(struct output_file *file, const char *path, char *error, size_t error_bytes);
/* Whether one could be written there, before the work that it takes: what is there stays. False: `error` says why
 * not. */
bool output_file_can_write(const char *path, char *error, size_t error_bytes);
/* Flush, sync and rename. False: the part is removed and what stood at the path before is untouched. */
bool output_file_commit(struct output_file *file, char *error, size_t error_bytes);
/* Drop what was written. */
void output_file_discard(struct output_file *file);

#endif
