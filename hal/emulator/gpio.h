/* Three GPIO ports: modes, pulls, output levels. A pin that is not driven takes its pull, or 0. RM0440,
 * chapter 9. */
#ifndef TRIBEND_EMULATOR_GPIO_H
#define TRIBEND_EMULATOR_GPIO_H

#include "emulator/core.h"

#define GPIO_PORTS 3u

struct gpio {
    uint32_t mode, type, speed, pull, output, lock, alternate[2];
    void (*changed)(void *context); /* a level, or who drives it */
    void *context;
};

/* All pins analog, but those of the debugger on ports A and B. */
void gpio_reset(struct gpio *gpio, uint32_t port);
bool gpio_read(void *context, uint32_t offset, uint32_t *value);
bool gpio_write(void *context, uint32_t offset, uint32_t value);
/* Driven high by software. */
bool gpio_output_high(const struct gpio *gpio, uint32_t pin);
/* Handed to this alternate function. */
bool gpio_is_alternate(const struct gpio *gpio, uint32_t pin, uint32_t function);
/* Handed to the converters. */
bool gpio_is_analog(const struct gpio *gpio, uint32_t pin);

#endif
