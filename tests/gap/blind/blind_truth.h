/* The sealed truth of a case, as JSON. */
#ifndef TRIBEND_BLIND_TRUTH_H
#define TRIBEND_BLIND_TRUTH_H

#include "blind_case.h"

/* False: out of memory or the file could not be written. */
bool blind_truth_write(const char *path, const struct blind_case *blind);

#endif
