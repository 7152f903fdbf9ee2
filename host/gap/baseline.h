/* Another simulator's output as the baseline of a diagnosis, in place of our own replay: the columns sim_tip_x_m .. sim_tip_qz
 * and sim_p1_pa .. sim_p3_pa of a run log. They hold what it says at the row's time, in the base frame; orientation, pose or
 * pressures may be missing. Its poses may also be as old as the sensor's in the same row: what fits better is taken. */
#ifndef TRIBEND_GAP_BASELINE_H
#define TRIBEND_GAP_BASELINE_H

#include "gap/gap_data.h"
#include "log/run_log.h"
#include "sim/effect.h"

/* Keeps a log's sim_ columns in `run`, if there are any. False: `error` names file, line, column and remedy. */
bool gap_baseline_take(struct gap_run *run, const struct run_log *log, char *error, size_t error_bytes);
/* Has any of the logs such columns? */
bool gap_baseline_present(const struct gap_data *data);
/* Make them the baseline, once. Readings and tip samples for which the simulator says nothing are dropped, the supply too,
 * which it does not predict. False: `error` says what is missing. */
bool gap_baseline_use(struct gap_data *data, char *error, size_t error_bytes);
/* Why an effect cannot act on the other simulator's outputs; NULL: it can. */
const char *gap_baseline_why_not(const struct gap_data *data, const struct effect_kind *kind);
void gap_baseline_free(struct gap_run *run);

#endif
