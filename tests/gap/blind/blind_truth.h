/* The sealed truth of a case, as JSON. */
#ifndef TRIBEND_BLIND_TRUTH_H
#define TRIBEND_BLIND_TRUTH_H

#include "blind_case.h"

/* False: out of memory or the file could not be written. */
bool blind_truth_write(const char *path, const struct blind_case *blind);
/* From what the case was drawn, and its name. False: `error` names file and remedy. */
bool blind_truth_read(const char *path, struct blind_draw *draw, char id[BLIND_ID_BYTES], char *error, size_t error_bytes);

#endif
