/* Events of the emulated hardware in virtual time: one slot for each thing that can happen next. Not a queue:
 * a slot that is set again forgets its earlier time. Slots due at the same time run in the order in which
 * they were added. */
#ifndef TRIBEND_EMULATOR_SCHEDULE_H
#define TRIBEND_EMULATOR_SCHEDULE_H

#include <stddef.h>
#include <stdint.h>

#define SCHEDULE_SLOTS 48
#define SCHEDULE_NEVER INT64_MAX

/* Called at or, by up to one basic block, after its time; `at_ticks` is when it was due. */
typedef void (*schedule_action)(void *context, int64_t at_ticks);

struct schedule {
    struct schedule_slot {
        int64_t at_ticks;
        schedule_action action;
        void *context;
    } slot[SCHEDULE_SLOTS];
    size_t count;
    int64_t next_ticks;      /* earliest of all slots */
    int64_t *deadline_ticks; /* of who runs meanwhile: drawn back when an earlier event is set */
};

void schedule_init(struct schedule *schedule, int64_t *deadline_ticks);
/* Returns the slot. Aborts when there is no room: the number of slots is fixed by the hardware. */
size_t schedule_add(struct schedule *schedule, schedule_action action, void *context);
/* SCHEDULE_NEVER: not at all. */
void schedule_set(struct schedule *schedule, size_t slot, int64_t at_ticks);
/* Run what is due, in the order of time. */
void schedule_run(struct schedule *schedule, int64_t now_ticks);

#endif
