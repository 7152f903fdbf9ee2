/* The independent watchdog: its own oscillator, not to be stopped once started, fed by a completed control
 * step alone. */
#ifndef TRIBEND_STM32G4_WATCHDOG_H
#define TRIBEND_STM32G4_WATCHDOG_H

#include <stdbool.h>

/* Start with the longest time, 0.5 s, for the start of everything else. */
void watchdog_start(void);
/* A step is complete. While no coil may be energised (not `moving`) a page of the core's own flash bank may
 * be erased, for 25 ms at most, so the time is then 100 ms; else 20 ms. */
void watchdog_feed(bool moving);

#endif
