/* IWDG on the 32 kHz oscillator, which runs on whatever happens to the rest. RM0440, chapter 42. */
#ifndef TRIBEND_EMULATOR_WATCHDOG_H
#define TRIBEND_EMULATOR_WATCHDOG_H

#include "emulator/core.h"

struct watchdog {
    struct core *core;
    void (*bites)(void *context);
    void *context;
    uint32_t oscillator_hz; /* 32,000, within the chip's 5 % where a test wants so */
    uint32_t divider, reload;
    bool running, unlocked;
    int64_t updated_ticks; /* PR and RLR have reached the slow clock */
    size_t slot;
    uint32_t feeds;
};

/* Of one core; then as after its reset, and its registers. False: there is none at that offset. */
void watchdog_init(struct watchdog *watchdog, struct core *core);
void watchdog_reset(struct watchdog *watchdog);
bool watchdog_read(void *context, uint32_t offset, uint32_t *value);
bool watchdog_write(void *context, uint32_t offset, uint32_t value);

#endif
