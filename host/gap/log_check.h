/* Does a recording fit the module of the table? Tips where that module cannot reach, chambers that are numbered otherwise in
 * one group of columns than in another, a tip frame that is turned. Looks at what no effect of the catalogue comes near. */
#ifndef TRIBEND_GAP_LOG_CHECK_H
#define TRIBEND_GAP_LOG_CHECK_H

#include "gap/gap_data.h"
#include "sim/plant.h"

/* False: `error` names the file, the columns and the remedy. Without memory nothing is found. */
bool log_check(const struct gap_data *data, const struct bend_table *table, const struct plant_parameters *nominal, char *error,
               size_t error_bytes);

#endif
