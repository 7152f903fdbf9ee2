/* Files of a test's own, below TMPDIR (else the system's temporary folder). */
#ifndef TRIBEND_TEST_SCRATCH_H
#define TRIBEND_TEST_SCRATCH_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#define SCRATCH_BYTES 128
#define SCRATCH_WITHIN_BYTES (SCRATCH_BYTES + 64) /* of a file inside a scratch folder */

static inline bool scratch_name(char path[SCRATCH_BYTES]) {
    const char *root = getenv("TMPDIR");
    const int length = snprintf(path, SCRATCH_BYTES, "%s/tribend-test-XXXXXX",
                                root != NULL && *root != '\0' ? root : P_tmpdir);
    return length > 0 && length < SCRATCH_BYTES;
}

/* An empty folder; the test removes it. */
static inline bool scratch_folder(char path[SCRATCH_BYTES]) {
    return scratch_name(path) && mkdtemp(path) != NULL;
}

/* An empty file, open for writing: its descriptor, or -1. */
static inline int scratch_file(char path[SCRATCH_BYTES]) {
    return scratch_name(path) ? mkstemp(path) : -1;
}

#endif
