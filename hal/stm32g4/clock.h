/* The clock tree: 170 MHz from the crystal, else from the internal oscillator, else that oscillator's 16 MHz
 * as it is. Every wait has an end. */
#ifndef TRIBEND_STM32G4_CLOCK_H
#define TRIBEND_STM32G4_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

/* From reset, once. Returns the frequency reached by core and buses, Hz. */
uint32_t clock_start(void);
/* The crystal did not start, or stopped since. */
bool clock_crystal_failed(void);
/* In the NMI: true if it was the crystal, which failed; the clock is at 170 MHz again unless `*lost`. */
bool clock_take_failure(bool *lost);

#endif
