/* From the board's clock to the host's: offset and drift, out of when reports were made and when they came.
 *
 * A report may come late, never early: of each second only the one that came soonest counts, and a straight
 * line through the last CLOCK_WINDOWS of those is the mapping. Bounded memory. A board that starts anew, or
 * clocks that jump, start the mapping anew. Not here: which report is of which time (can_assembly.h). */
#ifndef TRIBEND_CLOCK_MAP_H
#define TRIBEND_CLOCK_MAP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CLOCK_WINDOWS 32
#define CLOCK_WINDOW_US 1000000
#define CLOCK_DRIFT_AFTER 5 /* windows; before, the clocks are taken to run alike */

struct clock_point {
    int64_t board_us;
    int64_t lag_us; /* host's minus board's */
};

struct clock_map {
    struct clock_point window[CLOCK_WINDOWS]; /* a ring */
    size_t windows, next;
    struct clock_point soonest; /* of the window under way */
    int64_t window_us;          /* its start, board's clock */
    bool started;
    uint32_t astray; /* reports in a row that are far off the mapping */
    uint64_t resets;
    struct clock_point origin; /* of the line */
    double drift;              /* of the lag */
};

void clock_map_init(struct clock_map *map);
void clock_map_restart(struct clock_map *map);
void clock_map_take(struct clock_map *map, int64_t board_us, int64_t host_us);
/* False: no mapping yet. */
bool clock_map_host_us(const struct clock_map *map, int64_t board_us, int64_t *host_us);

#endif
