/* What the bridge writes down while it runs: LCM messages as lcm-logger does, CAN frames as candump -L does,
 * and a run log. The first two are whole at any moment; all are flushed every BRIDGE_LOGS_FLUSH_US, so that a
 * killed recorder loses less than a second. The run log stands at PATH.part until the end. A file that is
 * there already is not touched. */
#ifndef TRIBEND_BRIDGE_LOGS_H
#define TRIBEND_BRIDGE_LOGS_H

#include <lcm/lcm.h>

#include "link/transport.h"
#include "log/run_log.h"

#define BRIDGE_LOGS_FLUSH_US 250000
#define BRIDGE_LOGS_BUFFER_BYTES                                                                             \
    (1 << 18) /* more than a full bus fills between two flushes, so that lines stay whole */

/* NULL: not wanted. */
struct bridge_logs_paths {
    const char *lcm;
    const char *can;
    const char *run;
};

struct bridge_logs {
    lcm_eventlog_t *lcm;
    FILE *can;
    struct run_log_writer run;
    bool run_open;
    char interface[64]; /* in candump's lines */
    int64_t flush_us;
};

/* False: `error` names the file and the reason. */
bool bridge_logs_open(struct bridge_logs *logs, const struct bridge_logs_paths *paths, const char *bus,
                      const struct run_log_metadata *metadata, char *error, size_t error_bytes);
/* Each returns how many writes failed. */
unsigned bridge_logs_message(struct bridge_logs *logs, const char *channel, const void *data, uint32_t bytes,
                             int64_t host_us);
unsigned bridge_logs_frame(struct bridge_logs *logs, const struct hal_can_frame *frame, int64_t host_us);
unsigned bridge_logs_report(struct bridge_logs *logs, const struct link_report *report,
                            const struct controller_command *command);
unsigned bridge_logs_flush(struct bridge_logs *logs, int64_t monotonic_us);
/* False: the run log could not be finished. */
bool bridge_logs_close(struct bridge_logs *logs, char *error, size_t error_bytes);

#endif
