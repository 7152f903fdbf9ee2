/* The electronics' own supply: the detector that shuts the valves at 2.9 V, above the brown-out reset at 2.8
 * V. */
#ifndef TRIBEND_STM32G4_SUPPLY_MONITOR_H
#define TRIBEND_STM32G4_SUPPLY_MONITOR_H

#include <stdbool.h>

/* After clock_start(). The detector breaks TIM1 by itself (valves.h); its interrupt shuts the supply off,
 * too, and resets. */
void supply_monitor_start(void);
/* The option bytes have the brown-out reset at 2.8 V. `make flash` sets it. */
bool supply_monitor_brown_out_is_set(void);

#endif
