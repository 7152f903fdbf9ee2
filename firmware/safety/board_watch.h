/* Watches what the chambers share: the time between control steps, the supply, and what the board says of
 * itself. Not here: chambers and their sensors (sensor_watch.h, flow_watch.h). Units: Pa gauge, us. */
#ifndef TRIBEND_BOARD_WATCH_H
#define TRIBEND_BOARD_WATCH_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

struct board_watch_parameters {
    int64_t step_late_us; /* between two steps: a warning */
    int64_t step_most_us; /* a fault */
    int64_t jump_most_us; /* no lateness makes this: a fault of the clock */
    uint32_t late_most;   /* late steps within a second */
    float supply_least_pa;
    float supply_most_pa;
    float over_supply_pa;   /* a chamber cannot stand so far over its supply */
    uint32_t supply_steps;  /* control steps that it must last */
    int64_t supply_rise_us; /* the rail is not judged for so long after it was opened */
};

struct board_watch {
    bool running;
    int64_t step_us;   /* time of the last step, */
    int64_t late_us;   /* of the last late one, */
    int64_t window_us; /* and of the start of the second in which they are counted */
    uint32_t late;
    uint32_t steps_late; /* as the board counted last */
    uint32_t low_steps;  /* in a row */
    uint32_t high_steps;
    uint32_t over_steps;
    int64_t shut_us; /* when the supply was last shut */
};

/* The board in one control step. */
struct board_watch_view {
    int64_t time_us;
    float supply_pa;
    bool supply_ok;
    bool supply_enabled; /* in the step before */
    bool moving;         /* ACTIVE or HOLD */
    float highest_pa;    /* estimate of the fullest chamber */
    const struct hal_health *health;
    bool outputs_refused;
    bool bus_off;
};

void board_watch_default_parameters(struct board_watch_parameters *parameters, float nominal_supply_pa,
                                    float working_pressure_pa);
void board_watch_init(struct board_watch *watch);
/* Each control step. Returns bits of enum supervisor_fault. */
uint32_t board_watch_step(struct board_watch *watch, const struct board_watch_parameters *parameters,
                          const struct board_watch_view *view);
/* A step was late within the last second. */
bool board_watch_was_late(const struct board_watch *watch, int64_t time_us);

#endif
