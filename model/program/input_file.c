#include "program/input_file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

unsigned char *input_file_read(const char *path, size_t *size, char *error, size_t error_bytes) {
    FILE *file = fopen(path, "rb");
    unsigned char *bytes = NULL;
    long end = -1;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
        end = ftell(file);
        rewind(file);
    }
    if (end >= 0) {
        bytes = malloc((size_t)end + 1);
    }
    if (bytes != NULL) {
        *size = fread(bytes, 1, (size_t)end, file);
        if (ferror(file) != 0 || *size != (size_t)end) {
            free(bytes);
            bytes = NULL;
        }
    }
    if (bytes == NULL) {
        (void)snprintf(error, error_bytes, "cannot read %s: %s", path, strerror(errno));
    }
    if (file != NULL) {
        (void)fclose(file);
    }
    return bytes;
}
