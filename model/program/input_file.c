#include "program/input_file.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* Of a regular file, a pipe or a folder has no size to rely on. */
static bool find_size(FILE *file, size_t *size) {
    struct stat status;
    if (fstat(fileno(file), &status) != 0) {
        return false;
    }
    if (!S_ISREG(status.st_mode)) {
        errno = S_ISDIR(status.st_mode) ? EISDIR : EINVAL;
        return false;
    }
    *size = (size_t)status.st_size;
    return true;
}

unsigned char *input_file_read(const char *path, size_t *size, char *error, size_t error_bytes) {
    FILE *file = fopen(path, "rb");
    unsigned char *bytes = NULL;
    if (file != NULL && find_size(file, size)) {
        bytes = malloc(*size + 1);
    }
    if (bytes != NULL && fread(bytes, 1, *size, file) != *size) {
        free(bytes);
        bytes = NULL;
    }
    if (bytes == NULL) {
        (void)snprintf(error, error_bytes, "cannot read %s: %s", path, strerror(errno));
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return bytes;
}
