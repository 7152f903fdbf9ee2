/* A run log out of events that come one by one, each with its own time and a few columns: messages of a bus.
 * Events of the same control step share a row; columns that no event fills are left out. */
#ifndef TRIBEND_EVENT_ROWS_H
#define TRIBEND_EVENT_ROWS_H

#include "log/run_log.h"

struct event_value {
    const char *column; /* one of log/run_columns.h */
    double value;       /* SI */
};

struct event_rows {
    struct run_log *log;
    size_t room;
    int64_t zero_us;  /* the first event's */
    int64_t merge_us; /* events that are later than a row by no more than this may share it */
    int64_t row_us;   /* of the last row */
};

/* `log` is whole after event_rows_finish(); the caller frees it, also after false, which is for no memory. */
void event_rows_start(struct event_rows *events, struct run_log *log, int64_t merge_us);
bool event_rows_add(struct event_rows *events, int64_t time_us, const struct event_value *values,
                    size_t count);
/* Sort by time, start at 0 s, drop empty columns. */
bool event_rows_finish(struct event_rows *events);

#endif
