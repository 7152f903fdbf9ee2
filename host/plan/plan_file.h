/* Plans as YAML:
 *
 *     module: paper-semicircle
 *     note: a slow loop, then a wave
 *     steps:
 *       - { for: 3s, pressure: [40mbar, 0mbar, 0mbar] }
 *       - { for: 10s, ramp_to: [80mbar, 0mbar, 0mbar] }
 *       - { for: 5s, bend: 60deg, toward: 30deg, co_contraction: 5mbar }
 *       - { for: 20s, sine: { chambers: [1, 2], amplitude: 20mbar, mean: 30mbar, period: 4s, phase: -90deg }
 * }
 *       - { for: 2s, vent: true }
 *
 * `sines` takes a list of what `sine` takes, and adds them up. `toward` and `phase` are 0deg,
 * `co_contraction` is 0mbar where they are left out. */
#ifndef TRIBEND_PLAN_FILE_H
#define TRIBEND_PLAN_FILE_H

#include "plan/plan.h"

#define PLAN_ERROR_BYTES 1024

/* Read, and check against the table's module. False: `error` names file, line, key, what is wrong and the
 * limit. */
bool plan_read(const char *path, const struct bend_table *table, struct plan *plan, char *error,
               size_t error_bytes);
/* The file appears whole or not at all. False: `error` says why. */
bool plan_write(const char *path, const struct plan *plan, char *error, size_t error_bytes);

#endif
