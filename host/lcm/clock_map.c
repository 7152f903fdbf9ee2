#include "lcm/clock_map.h"

#include <math.h>
#include <string.h>

#define ASTRAY_US 250000 /* more than a busy host delays a report */
#define ASTRAY_MOST 20

void clock_map_init(struct clock_map *map) {
    memset(map, 0, sizeof *map);
}

void clock_map_restart(struct clock_map *map) {
    const uint64_t resets = map->resets + 1;
    clock_map_init(map);
    map->resets = resets;
}

/* Least squares about the newest point, so that large times lose no digits. */
static void fit(struct clock_map *map) {
    const struct clock_point newest = map->window[(map->next + CLOCK_WINDOWS - 1) % CLOCK_WINDOWS];
    const double count = (double)map->windows;
    double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
    for (size_t w = 0; w < map->windows; w++) {
        const double at = (double)(map->window[w].board_us - newest.board_us),
                     lag = (double)(map->window[w].lag_us - newest.lag_us);
        x += at;
        y += lag;
        xx += at * at;
        xy += at * lag;
    }
    const double spread = count * xx - x * x;
    map->drift = map->windows >= CLOCK_DRIFT_AFTER && spread > 0.0 ? (count * xy - x * y) / spread : 0.0;
    const double level = map->windows >= CLOCK_DRIFT_AFTER ? (y - map->drift * x) / count : 0.0;
    map->origin = (struct clock_point){newest.board_us, newest.lag_us + llround(level)};
}

static void close_window(struct clock_map *map) {
    map->window[map->next] = map->soonest;
    map->next = (map->next + 1) % CLOCK_WINDOWS;
    map->windows += map->windows < CLOCK_WINDOWS ? 1 : 0;
    fit(map);
}

static void open_window(struct clock_map *map, const struct clock_point *point) {
    map->window_us = point->board_us;
    map->soonest = *point;
    if (map->windows == 0) {
        map->origin = *point;
    }
    map->started = true;
}

static int64_t lag_at(const struct clock_map *map, int64_t board_us) {
    return map->origin.lag_us + llround(map->drift * (double)(board_us - map->origin.board_us));
}

/* Whether the clocks no longer are where the mapping has them. */
static bool is_lost(struct clock_map *map, const struct clock_point *point) {
    const int64_t off_us = point->lag_us - lag_at(map, point->board_us);
    map->astray = off_us > ASTRAY_US || off_us < -ASTRAY_US ? map->astray + 1 : 0;
    return map->astray > ASTRAY_MOST;
}

void clock_map_take(struct clock_map *map, int64_t board_us, int64_t host_us) {
    const struct clock_point point = {board_us, host_us - board_us};
    if (map->started && (board_us < map->window_us || is_lost(map, &point))) {
        clock_map_restart(map);
    }
    if (!map->started) {
        open_window(map, &point);
        return;
    }
    if (board_us - map->window_us >= CLOCK_WINDOW_US) {
        close_window(map);
        open_window(map, &point);
    } else if (point.lag_us < map->soonest.lag_us) {
        map->soonest = point;
        map->origin = map->windows == 0 ? point : map->origin;
    }
}

bool clock_map_host_us(const struct clock_map *map, int64_t board_us, int64_t *host_us) {
    *host_us = board_us + lag_at(map, board_us);
    return map->started;
}
