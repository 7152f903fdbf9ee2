/* The supervisor: which state the controller is in, which faults are latched, and therefore whether air may
 * flow.
 *
 * Pure: conditions and time in, state out. A fault is left on purpose only: by a clear, once its cause has
 * been gone for a while, that does not belong to a stream of clears; it leads through the self-test, and a
 * stream of motion commands that went on through all of that is refused until it has paused. So is one that was
 * flying when the board started: until it has been SAFE once, the self-test lasts as long as that pause, so that
 * such a stream has been heard. Not here: how a fault is detected (watch.h), what the valves do about it
 * (controller.h). */
#ifndef TRIBEND_SUPERVISOR_H
#define TRIBEND_SUPERVISOR_H

#include <stdbool.h>
#include <stdint.h>

enum supervisor_state {
    SUPERVISOR_BOOT = 0,
    SUPERVISOR_SELFTEST, /* the supply comes on, no chamber may rise */
    SUPERVISOR_SAFE,     /* vented, waiting for a command */
    SUPERVISOR_ACTIVE,   /* following a pressure or bend command */
    SUPERVISOR_HOLD,     /* keeping the present pressures */
    SUPERVISOR_FAULT,    /* vented, latched until cleared on purpose */
    SUPERVISOR_STATE_COUNT
};

/* Faults that latch: bit numbers, rows of faults.def. */
enum supervisor_fault {
#define FAULT(NAME, title, sees, detector, limit, time, clear, remedy, why) FAULT_##NAME,
#include "safety/faults.def"
    FAULT_COUNT
};

/* Conditions that are reported and degrade, without venting: bit numbers, rows of faults.def. */
enum supervisor_warning {
#define WARNING(NAME, title, sees, detector, limit, time, reaction, remedy, why) WARNING_##NAME,
#include "safety/faults.def"
    WARNING_COUNT
};

/* A row of the fault table: what people need to know of each fault. */
struct supervisor_fault_row {
    const char *name;
    const char *detector;
    const char *reaction;
    const char *clear;
    const char *remedy;
};

/* What the controller wants; refused by the state where it must be. */
enum supervisor_request {
    SUPERVISOR_REQUEST_NONE = 0,
    SUPERVISOR_REQUEST_VENT,
    SUPERVISOR_REQUEST_HOLD,
    SUPERVISOR_REQUEST_MOVE,
    SUPERVISOR_REQUEST_MOVE_ON, /* a motion command said again: keeps a motion alive, never starts one */
    SUPERVISOR_REQUEST_CLEAR,
    SUPERVISOR_REQUEST_COUNT
};

struct supervisor {
    enum supervisor_state state;
    uint32_t faults;    /* latched, bit = enum supervisor_fault */
    bool armed;         /* a motion command that began after the last self-test was taken */
    bool started;       /* has been SAFE since it was switched on */
    int64_t entered_us; /* when the state was entered */
    int64_t cause_us;   /* when a cause of a fault was last present */
    int64_t motion_us;  /* when a motion command last came, taken or not */
    int64_t clear_us;   /* when a clear last came, taken or not */
};

#define SUPERVISOR_SELFTEST_US 20000
#define SUPERVISOR_ABSENT_US 100000 /* a cause must have been gone for so long to be cleared */
#define SUPERVISOR_PAUSE_US 500000  /* the slowest stream that the command timeout allows comes more often */

void supervisor_init(struct supervisor *supervisor);
/* One step. `present` are the faults that are detected now (bits); `healthy` says that the self-test sees
 * what it must. Returns false when a request was refused. */
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
