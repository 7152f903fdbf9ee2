/* Logs of can-utils' `candump -L`, such as `(1700000000.123456) can0 101#0102030405060708`, CAN FD with `##`:
 * our messages into a run log. Time is when the host received a frame. */
#ifndef TRIBEND_CANDUMP_H
#define TRIBEND_CANDUMP_H

#include "log/run_log.h"

struct candump_counts {
    size_t frames; /* well-formed lines */
    size_t decoded;
    size_t other_message; /* identifiers that are none of ours, remote and error frames */
    size_t other_node;
    size_t short_frames; /* fewer bytes than the message has */
    size_t malformed;
    int first_malformed_line;
};

#define CANDUMP_FIRST_NODE (-1)

/* `node`: 0 to 15, or that of the first message. False: `error` names file, line and why nothing came of it;
 * what was skipped is counted and noted in the metadata. */
bool candump_read(const char *path, int node, struct run_log *log, struct candump_counts *counts, char *error,
                  size_t error_bytes);

#endif
