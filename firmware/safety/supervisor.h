/* The supervisor: which state the controller is in, which faults are latched, and therefore whether air may flow.
 *
 * Pure: conditions and time in, state out. Not here: how a fault is detected (limits.h), what the valves do about it
 * (controller.h). */
#ifndef TRIBEND_SUPERVISOR_H
#define TRIBEND_SUPERVISOR_H

#include <stdbool.h>
#include <stdint.h>

enum supervisor_state {
    SUPERVISOR_BOOT = 0,
    SUPERVISOR_SELFTEST,
    SUPERVISOR_SAFE,   /* vented, waiting for a command */
    SUPERVISOR_ACTIVE, /* following a pressure or bend command */
    SUPERVISOR_HOLD,   /* keeping the present pressures */
    SUPERVISOR_FAULT,  /* vented, latched until cleared on purpose */
    SUPERVISOR_STATE_COUNT
};

/* Faults that latch: bit numbers. One row each in the fault table of supervisor.c. */
enum supervisor_fault {
    FAULT_OVERPRESSURE = 0,
    FAULT_SENSOR_RANGE,
    FAULT_COMMAND_TIMEOUT,
    FAULT_TABLE_CORRUPT,
    FAULT_COUNT
};

/* Conditions that are reported and degrade, without venting: bit numbers. */
enum supervisor_warning {
    WARNING_TIP_LOST = 0, /* bend runs open loop */
    WARNING_NO_TABLE,     /* pressure commands only */
    WARNING_COMMAND_LIMITED,
    WARNING_MODEL_GAP, /* the gap monitor raised a stage (gap_monitor.h) */
    WARNING_COUNT
};

/* A row of the fault table: what people need to know of each fault. */
struct supervisor_fault_row {
    const char *name;
    const char *detector;
    const char *reaction;
    const char *clear;
};

/* What the controller wants; refused by the state where it must be. */
enum supervisor_request {
    SUPERVISOR_REQUEST_NONE = 0,
    SUPERVISOR_REQUEST_VENT,
    SUPERVISOR_REQUEST_HOLD,
    SUPERVISOR_REQUEST_MOVE,
    SUPERVISOR_REQUEST_CLEAR
};

struct supervisor {
    enum supervisor_state state;
    uint32_t faults;        /* latched, bit = enum supervisor_fault */
    int64_t entered_us;     /* when the state was entered */
};

#define SUPERVISOR_SELFTEST_US 20000

void supervisor_init(struct supervisor *supervisor);
/* One step. `present` are the faults that are detected now (bits); `healthy` says that the self-test sees what it must.
 * Returns false when a request was refused. */
bool supervisor_step(struct supervisor *supervisor, int64_t time_us, uint32_t present, bool healthy,
                     enum supervisor_request request);
/* May the valves be energised? Only in ACTIVE and HOLD. */
bool supervisor_valves_enabled(const struct supervisor *supervisor);
/* May the supply be open? Not in BOOT and FAULT. */
bool supervisor_supply_enabled(const struct supervisor *supervisor);
const char *supervisor_state_name(enum supervisor_state state);
const struct supervisor_fault_row *supervisor_fault_describe(enum supervisor_fault fault);
const char *supervisor_warning_text(enum supervisor_warning warning);

#endif
