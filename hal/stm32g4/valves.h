/* The three valve outputs (TIM1) and the supply shut-off (PB5): low until they are told otherwise, and at
 * once when shut. */
#ifndef TRIBEND_STM32G4_VALVES_H
#define TRIBEND_STM32G4_VALVES_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

#define VALVES_PERIOD_US 10000u

/* Outputs low, timer set but not counting. False: no such period from this clock. */
bool valves_start(uint32_t clock_hz);
/* False: a duty is no number, or the outputs are held off by the chip (a break). They are then off. */
bool valves_write(const struct hal_outputs *outputs);
/* All off by register writes alone: for fault handlers, in any state of the firmware. */
void valves_shut(void);
/* Whether a coil may be energised now. */
bool valves_enabled(void);

#endif
