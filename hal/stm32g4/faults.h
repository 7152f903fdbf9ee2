/* Faults of the core and of the board: vent first, keep a record across reset, start again. */
#ifndef TRIBEND_STM32G4_FAULTS_H
#define TRIBEND_STM32G4_FAULTS_H

#include <stdbool.h>
#include <stdint.h>

#include "stm32g4/crash_record.h"

/* Why the firmware started. */
struct faults_start {
    bool watchdog;
    bool brown_out; /* not power-on: the memory still knew of a running firmware */
    bool crashed;
    struct crash_record record; /* meaningful with crashed */
    struct running_mark last;   /* the last step before a reset of any kind; zeros after power-on */
};

/* Reads and clears what the reset left; faults of the core get handlers of their own. Call first. */
void faults_begin(struct faults_start *start);
/* Step number `step` is complete, in supervisor state `state`. */
void faults_mark_step(uint32_t step, uint32_t state);
/* Shuts the valves, keeps a record and resets. */
_Noreturn void faults_stop(enum crash_cause cause, uint32_t address);
/* Double words in slots and parameters that read with two wrong bits, as those do whose writing was cut off.
 */
uint32_t faults_torn_words(void);

#endif
