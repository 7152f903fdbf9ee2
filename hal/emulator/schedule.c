#include "emulator/schedule.h"

#include <stdlib.h>
#include <string.h>

void schedule_init(struct schedule *schedule, int64_t *deadline_ticks) {
    memset(schedule, 0, sizeof *schedule);
    schedule->next_ticks = SCHEDULE_NEVER;
    schedule->deadline_ticks = deadline_ticks;
}

size_t schedule_add(struct schedule *schedule, schedule_action action, void *context) {
    if (schedule->count == SCHEDULE_SLOTS) {
        abort();
    }
    schedule->slot[schedule->count] =
        (struct schedule_slot){.at_ticks = SCHEDULE_NEVER, .action = action, .context = context};
    return schedule->count++;
}

static size_t earliest(const struct schedule *schedule) {
    size_t first = 0;
    for (size_t i = 1; i < schedule->count; i++) {
        first = schedule->slot[i].at_ticks < schedule->slot[first].at_ticks ? i : first;
    }
    return first;
}

static void find_next(struct schedule *schedule) {
    schedule->next_ticks = schedule->count > 0 ? schedule->slot[earliest(schedule)].at_ticks : SCHEDULE_NEVER;
}

void schedule_set(struct schedule *schedule, size_t slot, int64_t at_ticks) {
    schedule->slot[slot].at_ticks = at_ticks;
    find_next(schedule);
    if (schedule->next_ticks < *schedule->deadline_ticks) {
        *schedule->deadline_ticks = schedule->next_ticks;
    }
}

void schedule_run(struct schedule *schedule, int64_t now_ticks) {
    while (schedule->next_ticks <= now_ticks) {
        struct schedule_slot *due = &schedule->slot[earliest(schedule)];
        const int64_t at_ticks = due->at_ticks;
        due->at_ticks = SCHEDULE_NEVER;
        due->action(due->context, at_ticks);
        find_next(schedule);
    }
}
