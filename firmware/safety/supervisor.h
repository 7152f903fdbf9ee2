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
    WARNING_COUNT
};

#endif
