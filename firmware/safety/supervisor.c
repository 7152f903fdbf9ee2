#include "safety/supervisor.h"

#include <stddef.h>

static const struct supervisor_fault_row fault_table[FAULT_COUNT] = {
    [FAULT_OVERPRESSURE] = {"overpressure", "one sample of a chamber over the hard limit of limits.h",
                            "all valves vent, supply shut, latched", "clear once every chamber is below the limit"},
    [FAULT_SENSOR_RANGE] = {"pressure sensor out of range",
                            "a channel that cannot be read, is not finite or lies outside the sensor's range",
                            "all valves vent, supply shut, latched", "clear once every channel reads within range"},
    [FAULT_COMMAND_TIMEOUT] = {"command timeout", "no command for the timeout while ACTIVE or HOLD",
                               "all valves vent, supply shut, latched", "clear, then command again"},
    [FAULT_TABLE_CORRUPT] = {"bend table corrupt", "CRC-32 over the table, a part in each step, all of it every second",
                             "all valves vent, supply shut, latched", "load a sound table and restart"},
};

void supervisor_init(struct supervisor *supervisor) {
    *supervisor = (struct supervisor){.state = SUPERVISOR_BOOT, .faults = 0u, .entered_us = 0};
}

static void enter(struct supervisor *supervisor, enum supervisor_state state, int64_t time_us) {
    if (supervisor->state != state) {
        supervisor->state = state;
        supervisor->entered_us = time_us;
    }
}

static bool obey(struct supervisor *supervisor, int64_t time_us, uint32_t present, enum supervisor_request request) {
    const enum supervisor_state state = supervisor->state;
    const bool runs = state == SUPERVISOR_SAFE || state == SUPERVISOR_ACTIVE || state == SUPERVISOR_HOLD;
    switch (request) {
    case SUPERVISOR_REQUEST_MOVE:
        if (runs) {
            enter(supervisor, SUPERVISOR_ACTIVE, time_us);
        }
        return runs;
    case SUPERVISOR_REQUEST_HOLD:
        if (state == SUPERVISOR_ACTIVE) {
            enter(supervisor, SUPERVISOR_HOLD, time_us);
        }
        return state == SUPERVISOR_ACTIVE || state == SUPERVISOR_HOLD;
    case SUPERVISOR_REQUEST_VENT:
        if (runs) {
            enter(supervisor, SUPERVISOR_SAFE, time_us);
        }
        return true; /* elsewhere the module is vented already */
    case SUPERVISOR_REQUEST_CLEAR:
        if (state == SUPERVISOR_FAULT && present == 0u) {
            supervisor->faults = 0u;
            enter(supervisor, SUPERVISOR_SAFE, time_us);
        }
        return state != SUPERVISOR_FAULT || present == 0u;
    case SUPERVISOR_REQUEST_NONE:
    default:
        return true;
    }
}

bool supervisor_step(struct supervisor *supervisor, int64_t time_us, uint32_t present, bool healthy,
                     enum supervisor_request request) {
    if (present != 0u) {
        supervisor->faults |= present;
        enter(supervisor, SUPERVISOR_FAULT, time_us);
    } else if (supervisor->state == SUPERVISOR_BOOT) {
        enter(supervisor, SUPERVISOR_SELFTEST, time_us);
    } else if (supervisor->state == SUPERVISOR_SELFTEST && healthy &&
               time_us - supervisor->entered_us >= SUPERVISOR_SELFTEST_US) {
        enter(supervisor, SUPERVISOR_SAFE, time_us);
    }
    return obey(supervisor, time_us, present, request);
}

bool supervisor_valves_enabled(const struct supervisor *supervisor) {
    return supervisor->state == SUPERVISOR_ACTIVE || supervisor->state == SUPERVISOR_HOLD;
}

bool supervisor_supply_enabled(const struct supervisor *supervisor) {
    return supervisor->state != SUPERVISOR_BOOT && supervisor->state != SUPERVISOR_FAULT;
}

const char *supervisor_state_name(enum supervisor_state state) {
    static const char *const names[SUPERVISOR_STATE_COUNT] = {"BOOT", "SELFTEST", "SAFE", "ACTIVE", "HOLD", "FAULT"};
    return (uint32_t)state < (uint32_t)SUPERVISOR_STATE_COUNT ? names[state] : "unknown";
}

const struct supervisor_fault_row *supervisor_fault_describe(enum supervisor_fault fault) {
    return (uint32_t)fault < (uint32_t)FAULT_COUNT ? &fault_table[fault] : NULL;
}

const char *supervisor_warning_text(enum supervisor_warning warning) {
    static const char *const texts[WARNING_COUNT] = {
        [WARNING_TIP_LOST] = "tip sensor lost: the bend runs open loop",
        [WARNING_NO_TABLE] = "no valid bend table: pressure commands only",
        [WARNING_COMMAND_LIMITED] = "the command was out of reach: the nearest reachable one is followed",
        [WARNING_MODEL_GAP] = "the module does not do what its model says: the gap monitor names the stage"};
    return (uint32_t)warning < (uint32_t)WARNING_COUNT ? texts[warning] : "unknown";
}
