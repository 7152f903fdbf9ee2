/* Columns of a run log that are in another unit than their name says: bar, kPa, mbar or psi for Pa, mm for m, ms for s, percent
 * for a duty, degrees for radians or for quaternions, degC for K, absolute pressures for gauge. Works on the numbers alone;
 * whether they fit a module is log_check's. */
#ifndef TRIBEND_GAP_UNIT_CHECK_H
#define TRIBEND_GAP_UNIT_CHECK_H

#include "log/run_log.h"

/* False: `error` names file, line, column and remedy. */
bool unit_check(const char *path, const struct run_log *log, char *error, size_t error_bytes);

#endif
