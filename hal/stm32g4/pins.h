/* Pins: what each is used as. A valve's pin is low from the first instruction on; before that, and in reset,
 * it floats and the gate's pull-down holds it low (WIRING.md). */
#ifndef TRIBEND_STM32G4_PINS_H
#define TRIBEND_STM32G4_PINS_H

#include <stdint.h>

#include "stm32g4/registers.h"

/* Turn on the ports' clocks. */
void pins_start(void);
void pins_output_low(struct gpio_registers *port, uint32_t pin);
void pins_alternate(struct gpio_registers *port, uint32_t pin, uint32_t function, uint32_t pull);
void pins_analog(struct gpio_registers *port, uint32_t pin);

#endif
