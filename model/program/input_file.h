/* A whole file in memory. */
#ifndef TRIBEND_INPUT_FILE_H
#define TRIBEND_INPUT_FILE_H

#include <stddef.h>

/* The caller frees; aligned as malloc's. NULL: `error` names the file and the reason. */
unsigned char *input_file_read(const char *path, size_t *size, char *error, size_t error_bytes);

#endif
