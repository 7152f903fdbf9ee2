#include "safety/supervisor.h"

#include <stddef.h>

#define REACTION "all valves vent, supply shut, latched"

static const struct supervisor_fault_row fault_table[FAULT_COUNT] = {
#define FAULT(NAME, title, sees, detector, limit, time, clear, remedy, why)                                  \
    [FAULT_##NAME] = {title, detector, REACTION, clear, remedy},
#include "safety/faults.def"
};

void supervisor_init(struct supervisor *supervisor) {
    *supervisor = (struct supervisor){.state = SUPERVISOR_BOOT,
                                      .cause_us = -SUPERVISOR_ABSENT_US,
                                      .motion_us = -SUPERVISOR_PAUSE_US,
                                      .clear_us = -SUPERVISOR_PAUSE_US};
}

static void enter(struct supervisor *supervisor, enum supervisor_state state, int64_t time_us) {
    if (supervisor->state != state) {
        supervisor->state = state;
        supervisor->entered_us = time_us;
    }
}

/* One of these at most starts the module after a self-test: a stream that was flying before must pause first.
 */
static bool move(struct supervisor *supervisor, int64_t time_us, bool said_again) {
    const enum supervisor_state state = supervisor->state;
    const bool fresh = !said_again && time_us - supervisor->motion_us >= SUPERVISOR_PAUSE_US;
    const bool runs = state == SUPERVISOR_ACTIVE || state == SUPERVISOR_HOLD;
    supervisor->motion_us = time_us;
    if (said_again) {
        return state == SUPERVISOR_ACTIVE;
    }
    if (!runs && !(state == SUPERVISOR_SAFE && (supervisor->armed || fresh))) {
        return false;
    }
    supervisor->armed = true;
    enter(supervisor, SUPERVISOR_ACTIVE, time_us);
    return true;
}

static bool hold(struct supervisor *supervisor, int64_t time_us) {
    if (supervisor->state == SUPERVISOR_ACTIVE) {
        enter(supervisor, SUPERVISOR_HOLD, time_us);
    }
    return supervisor->state == SUPERVISOR_HOLD;
}

static bool clear(struct supervisor *supervisor, int64_t time_us) {
    const bool alone = time_us - supervisor->clear_us >= SUPERVISOR_PAUSE_US;
    const bool gone = time_us - supervisor->cause_us >= SUPERVISOR_ABSENT_US;
    supervisor->clear_us = time_us;
    if (supervisor->state != SUPERVISOR_FAULT) {
        return true; /* nothing to clear */
    }
    if (!alone || !gone) {
        return false;
    }
    supervisor->faults = 0u;
    enter(supervisor, SUPERVISOR_SELFTEST, time_us);
    return true;
}

static bool obey(struct supervisor *supervisor, int64_t time_us, enum supervisor_request request) {
    switch (request) {
    case SUPERVISOR_REQUEST_MOVE:
        return move(supervisor, time_us, false);
    case SUPERVISOR_REQUEST_MOVE_ON:
        return move(supervisor, time_us, true);
    case SUPERVISOR_REQUEST_HOLD:
        return hold(supervisor, time_us);
    case SUPERVISOR_REQUEST_VENT:
        if (supervisor_valves_enabled(supervisor)) {
            enter(supervisor, SUPERVISOR_SAFE, time_us);
        }
        return true; /* elsewhere the module is vented already */
    case SUPERVISOR_REQUEST_CLEAR:
        return clear(supervisor, time_us);
    case SUPERVISOR_REQUEST_NONE:
    case SUPERVISOR_REQUEST_COUNT:
    default:
        return true;
    }
}

static void advance(struct supervisor *supervisor, int64_t time_us, bool healthy) {
    const int64_t selftest_us = supervisor->started ? SUPERVISOR_SELFTEST_US : SUPERVISOR_PAUSE_US;
    if (supervisor->state == SUPERVISOR_BOOT) {
        enter(supervisor, SUPERVISOR_SELFTEST, time_us);
    } else if (supervisor->state == SUPERVISOR_SELFTEST && healthy &&
               time_us - supervisor->entered_us >= selftest_us) {
        supervisor->armed = false;
        supervisor->started = true;
        enter(supervisor, SUPERVISOR_SAFE, time_us);
    }
}

bool supervisor_step(struct supervisor *supervisor, int64_t time_us, uint32_t present, bool healthy,
                     enum supervisor_request request) {
    if (supervisor->state == SUPERVISOR_BOOT) {
        supervisor->motion_us = time_us; /* for all it knows, a stream is flying */
    }
    if (present != 0u) {
        supervisor->faults |= present;
        supervisor->cause_us = time_us;
        supervisor->armed = false;
        enter(supervisor, SUPERVISOR_FAULT, time_us);
    } else {
        advance(supervisor, time_us, healthy);
    }
    return obey(supervisor, time_us, request);
}

bool supervisor_valves_enabled(const struct supervisor *supervisor) {
    return supervisor->state == SUPERVISOR_ACTIVE || supervisor->state == SUPERVISOR_HOLD;
}

bool supervisor_supply_enabled(const struct supervisor *supervisor) {
    return supervisor->state != SUPERVISOR_BOOT && supervisor->state != SUPERVISOR_FAULT;
}

const char *supervisor_state_name(enum supervisor_state state) {
    static const char *const names[SUPERVISOR_STATE_COUNT] = {"BOOT",   "SELFTEST", "SAFE",
                                                              "ACTIVE", "HOLD",     "FAULT"};
    return (uint32_t)state < (uint32_t)SUPERVISOR_STATE_COUNT ? names[state] : "unknown";
}

const struct supervisor_fault_row *supervisor_fault_describe(enum supervisor_fault fault) {
    return (uint32_t)fault < (uint32_t)FAULT_COUNT ? &fault_table[fault] : NULL;
}

const char *supervisor_warning_text(enum supervisor_warning warning) {
    static const char *const texts[WARNING_COUNT] = {
#define WARNING(NAME, title, sees, detector, limit, time, reaction, remedy, why) [WARNING_##NAME] = (title),
#include "safety/faults.def"
    };
    return (uint32_t)warning < (uint32_t)WARNING_COUNT ? texts[warning] : "unknown";
}
