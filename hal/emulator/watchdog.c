#include "emulator/watchdog.h"

#include <string.h>

#include "emulator/rcc.h"

#define KEY_START 0xccccu
#define KEY_WRITE 0x5555u
#define KEY_FEED 0xaaaau
#define UPDATE_CYCLES 5
#define UPDATING 3u

static int64_t cycle_ticks(const struct watchdog *watchdog) {
    return TICKS_PER_SECOND / watchdog->oscillator_hz;
}

static void count_down(struct watchdog *watchdog) {
    const int64_t counts = (int64_t)(watchdog->reload + 1u) * (4 << watchdog->divider);
    if (watchdog->running) {
        schedule_set(&watchdog->core->schedule, watchdog->slot,
                     watchdog->core->now_ticks + counts * cycle_ticks(watchdog));
    }
}

static void on_end(void *context, int64_t at_ticks) {
    struct watchdog *watchdog = context;
    (void)at_ticks;
    watchdog->bites(watchdog->context);
}

void watchdog_init(struct watchdog *watchdog, struct core *core) {
    memset(watchdog, 0, sizeof *watchdog);
    watchdog->core = core;
    watchdog->oscillator_hz = RCC_LSI_HZ;
    watchdog->slot = schedule_add(&core->schedule, on_end, watchdog);
}

void watchdog_reset(struct watchdog *watchdog) {
    watchdog->running = watchdog->unlocked = false;
    watchdog->divider = 0u;
    watchdog->reload = 0xfffu;
    watchdog->updated_ticks = 0;
    schedule_set(&watchdog->core->schedule, watchdog->slot, SCHEDULE_NEVER);
}

bool watchdog_read(void *context, uint32_t offset, uint32_t *value) {
    const struct watchdog *watchdog = context;
    const uint32_t status = watchdog->core->now_ticks < watchdog->updated_ticks ? UPDATING : 0u;
    const uint32_t word[4] = {0u, watchdog->divider, watchdog->reload, status};
    *value = offset < sizeof word ? word[offset / 4u] : 0u;
    return offset < sizeof word;
}

static void take_key(struct watchdog *watchdog, uint32_t key) {
    watchdog->unlocked = key == KEY_WRITE;
    if (key == KEY_START) {
        watchdog->running = true;
        count_down(watchdog);
    } else if (key == KEY_FEED) {
        watchdog->feeds++;
        count_down(watchdog);
    }
}

bool watchdog_write(void *context, uint32_t offset, uint32_t value) {
    struct watchdog *watchdog = context;
    if (offset == 0x00u) {
        take_key(watchdog, value & 0xffffu);
    } else if (offset == 0x04u && watchdog->unlocked) {
        watchdog->divider = value & 7u;
    } else if (offset == 0x08u && watchdog->unlocked) {
        watchdog->reload = value & 0xfffu;
    }
    if (offset == 0x04u || offset == 0x08u) {
        watchdog->updated_ticks = watchdog->core->now_ticks + UPDATE_CYCLES * cycle_ticks(watchdog);
    }
    return offset <= 0x08u;
}
