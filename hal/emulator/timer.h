/* TIM1, TIM2 and TIM3 as up-counters: prescaler, reload, compare with preload, update interrupt, one trigger
 * output, and TIM1's break and main output enable. RM0440, chapters 28 and 29. Capture, complementary
 * outputs, repetition and other counting modes are not modelled. The count is worked out when somebody asks;
 * only updates and triggers are events. */
#ifndef TRIBEND_EMULATOR_TIMER_H
#define TRIBEND_EMULATOR_TIMER_H

#include "emulator/core.h"

#define TIMER_CHANNELS 4u

struct timer {
    struct core *core;
    uint32_t irq;                                     /* 0: none */
    uint32_t most;                                    /* of the counter: 0xffff or 0xffffffff */
    bool advanced;                                    /* outputs need MOE */
    bool gated;                                       /* the bus clock is off: registers do nothing */
    void (*updated)(void *context, int64_t at_ticks); /* a period starts */
    void (*outputs_changed)(void *context);           /* MOE, enables or compare values, within the period */
    void (*triggered)(void *context, int64_t at_ticks); /* rising edge of the trigger output */
    void *context;
    uint32_t control[2], enables, status, modes[2], outputs, prescaler, reload, compare[TIMER_CHANNELS],
        dead_time, alternate;
    uint32_t active_prescaler, active_reload, active_compare[TIMER_CHANNELS];
    uint32_t clock_hz;
    uint32_t count; /* at base_ticks */
    int64_t base_ticks;
    size_t update_slot, trigger_slot;
    uint32_t breaks;
};

void timer_init(struct timer *timer, struct core *core, uint32_t irq, uint32_t most, bool advanced);
void timer_reset(struct timer *timer, uint32_t clock_hz);
bool timer_read(void *context, uint32_t offset, uint32_t *value);
bool timer_write(void *context, uint32_t offset, uint32_t value);
/* The clock changes: before() with the old one, after() with the new one. */
void timer_before_clock(struct timer *timer);
void timer_after_clock(struct timer *timer, uint32_t clock_hz);
uint32_t timer_count(const struct timer *timer);
/* Channel 1 to 4 is on for that share of the period that runs; 0 where the outputs are off. */
double timer_duty(const struct timer *timer, uint32_t channel);
/* What is left of the channel's pulse, as a share of the period. */
double timer_duty_left(const struct timer *timer, uint32_t channel);
/* A break input became active. */
void timer_break(struct timer *timer);

#endif
