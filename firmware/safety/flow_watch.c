/* At 10 kPa a stuck valve brings some 3 Pa and a shut one keeps some 1.5 Pa a step, against 10 Pa rms by which noise moves
 * the observer's sum however long it is: a sum of 300 Pa is 30 sigma. What sets it is the model, not noise: volumes that the
 * neighbours pull, capacities that a sensor's offset makes wrong by up to their own size, readings that lag. In ten hours of
 * random missions of the nominal module the sums stay under half of their limits (tests/campaign). */
#include "safety/flow_watch.h"

#include "safety/supervisor.h"

#define KEPT 0.9995f /* of a sum in each step: it fades within 2 s */
#define KEPT_WEAK 0.9997f
#define MOST 1.5f        /* sums stop growing there, so that a fault that is gone can be cleared */
#define OWED_STEPS 25.0f /* of the present fall, that a reading which lags by 0.1 s still shows */
#define LAG_STEPS 80.0f /* with lag_share: a reading or a valve that is up to 50 ms late */

void flow_watch_default_parameters(struct flow_watch_parameters *parameters) {
    *parameters = (struct flow_watch_parameters){.most_pa = 300.0f,
                                                 .missing_pa = 700.0f,
                                                 .fills_share = 0.35f,
                                                 .model_share = 0.6f,
                                                 .blocked_share = 0.8f,
                                                 .other_share = 1.0f,
                                                 .lag_share = 1.5f,
                                                 .vents_above_pa = 2000.0f,
                                                 .weak_share = 0.1f,
                                                 .weak_pa = 500.0f,
                                                 .steady_share = 0.12f,
                                                 .steady_pa = 800.0f,
                                                 .steady_from_pa = 3000.0f};
}

void flow_watch_init(struct flow_watch *watch) {
    *watch = (struct flow_watch){.gained_pa = 0.0f};
}

/* Here, for the compiler to see: called from another file they take half of the time. */
static inline float positive(float x) {
    return x > 0.0f ? x : 0.0f;
}

static inline bool sum_up(float *sum_pa, float kept, float change_pa, float most_pa) {
    const float sum = positive(kept * *sum_pa + change_pa), highest_pa = MOST * most_pa;
    *sum_pa = sum < highest_pa ? sum : highest_pa;
    return *sum_pa > most_pa;
}

/* What a wrong conductance owes in a rise it gets back in the fall, so only what is missing without either counts. */
static void watch_steady(struct flow_watch *watch, const struct flow_watch_parameters *parameters,
                         const struct flow_watch_view *view, float filled_pa, float vented_pa) {
    const float change_pa = filled_pa - vented_pa + view->unmodelled_pa;
    watch->moved_pa += (change_pa - watch->moved_pa) * (1.0f / LAG_STEPS);
    if (view->estimate_pa < parameters->steady_from_pa) {
        watch->steady_pa = 0.0f;
        return;
    }
    const float moved_pa = positive(watch->moved_pa) + positive(-watch->moved_pa);
    const float allowed_pa = parameters->steady_share * (filled_pa + vented_pa) + parameters->lag_share * moved_pa;
    (void)sum_up(&watch->steady_pa, KEPT_WEAK, -view->unmodelled_pa - allowed_pa, parameters->steady_pa);
}

uint32_t flow_watch_step(struct flow_watch *watch, const struct flow_watch_parameters *parameters,
                         const struct flow_watch_view *view) {
    const float fill_pa = positive(view->fill_pa), vent_pa = positive(view->vent_pa);
    const float rest = 1.0f - view->filled_share;
    const float filled_pa = view->filled_share * fill_pa, vented_pa = rest * vent_pa;
    const float change_pa = view->unmodelled_pa, most_pa = parameters->most_pa, other = parameters->other_share;
    const float weak_pa = parameters->weak_share * (filled_pa + vented_pa);
    watch->net_pa += (filled_pa - vented_pa - watch->net_pa) * (1.0f / LAG_STEPS);
    const float rises_pa = parameters->lag_share * positive(watch->net_pa);
    const float falls_pa = parameters->lag_share * positive(-watch->net_pa);
    const float beyond_pa = parameters->fills_share * rest * (fill_pa + vent_pa) + parameters->model_share * filled_pa;
    const float keeps_pa = parameters->blocked_share * vented_pa + other * filled_pa;
    const float misses_pa = parameters->blocked_share * filled_pa + other * vented_pa;
    uint32_t faults = 0u;
    if (sum_up(&watch->gained_pa, KEPT, change_pa - beyond_pa - rises_pa, most_pa)) {
        faults |= 1u << FAULT_VALVE_STUCK_FILLING;
    }
    if (view->estimate_pa < parameters->vents_above_pa) {
        watch->kept_pa = 0.0f;
    } else if (sum_up(&watch->kept_pa, KEPT, change_pa - keeps_pa - rises_pa,
                      most_pa + OWED_STEPS * positive(-watch->net_pa))) {
        faults |= 1u << FAULT_VALVE_NOT_VENTING;
    }
    if (sum_up(&watch->missing_pa, KEPT, -change_pa - misses_pa - falls_pa, parameters->missing_pa)) {
        faults |= 1u << FAULT_VALVE_NOT_FILLING;
    }
    (void)sum_up(&watch->lost_pa, KEPT_WEAK, -change_pa - weak_pa - falls_pa, parameters->weak_pa);
    (void)sum_up(&watch->left_pa, KEPT_WEAK, change_pa - weak_pa - rises_pa, parameters->weak_pa);
    watch_steady(watch, parameters, view, filled_pa, vented_pa);
    return faults;
}

bool flow_watch_doubts(const struct flow_watch *watch, const struct flow_watch_parameters *parameters) {
    return watch->steady_pa > parameters->steady_pa;
}

bool flow_watch_loses(const struct flow_watch *watch, const struct flow_watch_parameters *parameters) {
    return watch->lost_pa > parameters->weak_pa;
}

bool flow_watch_keeps(const struct flow_watch *watch, const struct flow_watch_parameters *parameters) {
    return watch->left_pa > parameters->weak_pa;
}
