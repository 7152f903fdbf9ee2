#include "stm32g4/watchdog.h"

#include <stdint.h>

#include "stm32g4/registers.h"

/* Counts of 125 us, nominally: the oscillator is 32 kHz within 8 %. */
#define COUNTS_START 4095u
#define COUNTS_VENTED 800u
#define COUNTS_MOVING 160u

static uint32_t counts;

/* The registers are in the oscillator's domain: a second write must wait for the first, as the next step
 * does. */
static void set_counts(uint32_t wanted) {
    if (wanted != counts && (IWDG->sr & IWDG_SR_UPDATING) == 0u) {
        IWDG->kr = IWDG_KEY_WRITE;
        IWDG->rlr = wanted;
        counts = wanted;
    }
}

void watchdog_start(void) {
    IWDG->kr = IWDG_KEY_START;
    IWDG->kr = IWDG_KEY_WRITE;
    IWDG->pr = IWDG_PR_DIVIDE_4;
    IWDG->rlr = COUNTS_START;
    IWDG->kr = IWDG_KEY_FEED;
    counts = COUNTS_START;
}

void watchdog_feed(bool moving) {
    set_counts(moving ? COUNTS_MOVING : COUNTS_VENTED);
    IWDG->kr = IWDG_KEY_FEED;
}
