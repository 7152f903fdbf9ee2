#include "safety/board_watch.h"

#include "control/real_math.h"
#include "safety/supervisor.h"

#define SECOND_US 1000000

void board_watch_default_parameters(struct board_watch_parameters *parameters, float nominal_supply_pa,
                                    float working_pressure_pa) {
    *parameters = (struct board_watch_parameters){
        .step_late_us = 1500,
        .step_most_us = 10000, /* a valve period without control */
        .jump_most_us = SECOND_US,
        .late_most = 10u,
        .supply_least_pa =
            working_pressure_pa + 1000.0f, /* below, a chamber cannot be brought to its limit */
        .supply_most_pa = 1.25f * nominal_supply_pa,
        .over_supply_pa = 1000.0f,
        .supply_steps = 20u,
        .supply_rise_us = 300000,
    };
}

void board_watch_init(struct board_watch *watch) {
    *watch = (struct board_watch){.late_us = -SECOND_US, .window_us = -SECOND_US};
}

bool board_watch_was_late(const struct board_watch *watch, int64_t time_us) {
    return time_us - watch->late_us < SECOND_US;
}

static void count_late(struct board_watch *watch, int64_t time_us, uint32_t steps) {
    if (time_us - watch->window_us >= SECOND_US) {
        watch->window_us = time_us;
        watch->late = 0u;
    }
    watch->late += steps;
    watch->late_us = time_us;
}

static uint32_t watch_time(struct board_watch *watch, const struct board_watch_parameters *parameters,
                           const struct board_watch_view *view) {
    const int64_t since_us = view->time_us - watch->step_us;
    const uint32_t counted = view->health->steps_late - watch->steps_late;
    const bool first = !watch->running;
    watch->running = true;
    watch->step_us = view->time_us;
    watch->steps_late = view->health->steps_late;
    if (first) {
        return 0u;
    }
    if (since_us <= 0 || since_us > parameters->jump_most_us) {
        return 1u << FAULT_CLOCK;
    }
    if (since_us >= parameters->step_late_us || counted > 0u) {
        count_late(watch, view->time_us, counted > 0u ? counted : 1u);
    }
    const bool often = watch->late >= parameters->late_most && view->time_us - watch->window_us < SECOND_US;
    /* vented, a core may stand still while its flash is written */
    return view->moving && (since_us >= parameters->step_most_us || often) ? 1u << FAULT_STEP_OVERRUN : 0u;
}

static bool lasts(uint32_t *steps, bool now, uint32_t most) {
    *steps = now ? *steps + 1u : 0u;
    *steps = *steps > most ? most : *steps;
    return *steps >= most;
}

static uint32_t watch_supply(struct board_watch *watch, const struct board_watch_parameters *parameters,
                             const struct board_watch_view *view) {
    const bool known = view->supply_ok && real_is_finite(view->supply_pa);
    uint32_t faults = 0u;
    if (!view->supply_enabled) {
        watch->shut_us = view->time_us;
    }
    const bool settled = known && view->time_us - watch->shut_us >= parameters->supply_rise_us;
    if (lasts(&watch->low_steps, settled && view->supply_pa < parameters->supply_least_pa,
              parameters->supply_steps)) {
        faults |= 1u << FAULT_SUPPLY_LOST;
    }
    if (lasts(&watch->high_steps, known && view->supply_pa > parameters->supply_most_pa,
              parameters->supply_steps)) {
        faults |= 1u << FAULT_SUPPLY_HIGH;
    }
    if (lasts(&watch->over_steps, settled && view->highest_pa > view->supply_pa + parameters->over_supply_pa,
              parameters->supply_steps)) {
        faults |= 1u << FAULT_SENSORS_DISAGREE;
    }
    return faults;
}

uint32_t board_watch_step(struct board_watch *watch, const struct board_watch_parameters *parameters,
                          const struct board_watch_view *view) {
    const bool starts = !watch->running;
    uint32_t faults = watch_time(watch, parameters, view) | watch_supply(watch, parameters, view);
    if (starts && (view->health->watchdog_reset || view->health->crashed)) {
        faults |= 1u << FAULT_WATCHDOG_RESET;
    }
    if (starts && view->health->brown_out_reset) {
        faults |= 1u << FAULT_BROWN_OUT;
    }
    if (view->outputs_refused) {
        faults |= 1u << FAULT_OUTPUTS_REFUSED;
    }
    if (view->moving && view->bus_off) {
        faults |= 1u << FAULT_CAN_BUS_OFF;
    }
    return faults;
}
