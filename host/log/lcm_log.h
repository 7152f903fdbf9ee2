/* Event logs of LCM's logger: our channels into a run log, without liblcm. Format: lcm-proj/lcm, eventlog.c.
 */
#ifndef TRIBEND_LCM_LOG_H
#define TRIBEND_LCM_LOG_H

#include "log/run_log.h"

struct lcm_log_counts {
    size_t events; /* whole ones in the file */
    size_t decoded;
    size_t other_channel;
    size_t other_version; /* the fingerprint is not the type's */
    size_t wrong_size;
    size_t wrong_time;    /* before 1970 or after 2096 */
    size_t skipped_bytes; /* that belong to no event */
    size_t cut_off_bytes; /* of an event that the file's end cuts off */
};

/* False: `error` names the file and why nothing came of it; what was skipped is counted and noted in the
 * metadata. */
bool lcm_log_read(const char *path, struct run_log *log, struct lcm_log_counts *counts, char *error,
                  size_t error_bytes);

#endif
