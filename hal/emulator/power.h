/* The supply and what watches over it: PWR's detector and range, EXTI's line of the detector, SYSCFG's breaks
 * of TIM1, and the brown-out reset. RM0440, chapters 6, 10 and 15; levels from the STM32G474 datasheet,
 * falling edge. */
#ifndef TRIBEND_EMULATOR_POWER_H
#define TRIBEND_EMULATOR_POWER_H

#include "emulator/core.h"

struct power {
    struct core *core;
    double supply_v;
    double brown_out_v;                            /* from the option bytes */
    uint32_t control[2], control_5, configuration; /* CR1, CR2, CR5; SYSCFG CFGR2 */
    uint32_t lines_enabled, lines_events, lines_rising, lines_falling, lines_pending;
    bool low;                     /* the detector's output */
    void (*broke)(void *context); /* a break of TIM1 */
    void (*range_changed)(void *context);
    void *context;
};

void power_init(struct power *power, struct core *core);
void power_reset(struct power *power);
bool power_read(void *context, uint32_t offset, uint32_t *value);
bool power_write(void *context, uint32_t offset, uint32_t value);
bool power_syscfg_read(void *context, uint32_t offset, uint32_t *value);
bool power_syscfg_write(void *context, uint32_t offset, uint32_t value);
bool power_exti_read(void *context, uint32_t offset, uint32_t *value);
bool power_exti_write(void *context, uint32_t offset, uint32_t value);
/* The supply's voltage changes. */
void power_supply(struct power *power, double volts);
/* Under the brown-out level. */
bool power_is_out(const struct power *power);
bool power_is_boosted(const struct power *power);
/* The core has locked up: breaks TIM1 where SYSCFG says so. */
void power_lock_up(struct power *power);

#endif
