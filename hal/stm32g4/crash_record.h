/* What is kept across a reset: the crash record that a fault handler wrote, and the mark of a firmware that
 * was running.
 *
 * Pure: seals and checks memory that nobody initialises, which after power-on holds anything. Not here: where
 * that memory lies and who writes it (faults.h). */
#ifndef TRIBEND_STM32G4_CRASH_RECORD_H
#define TRIBEND_STM32G4_CRASH_RECORD_H

#include <stdbool.h>
#include <stdint.h>

/* The numbers are the exception's where there is one. */
enum crash_cause {
    CRASH_NONE = 0,
    CRASH_FLASH_CORRUPT = 2, /* two wrong bits in the firmware's own flash */
    CRASH_HARD_FAULT = 3,
    CRASH_MEMORY_FAULT = 4,
    CRASH_BUS_FAULT = 5,
    CRASH_USAGE_FAULT = 6,
    CRASH_SUPPLY_DIP = 16, /* the supply of the electronics fell under 2.9 V */
    CRASH_CLOCK_LOST = 17, /* the crystal failed, and the PLL did not start from the internal oscillator */
    CRASH_UNEXPECTED = 18, /* an interrupt that nobody asked for; its number is in `address` */
    CRASH_SETUP = 19       /* a peripheral did not start; its place in the order of start is in `address` */
};

struct crash_record {
    uint32_t magic;
    uint32_t cause; /* enum crash_cause */
    uint32_t pc;
    uint32_t lr;
    uint32_t xpsr;
    uint32_t sp;
    uint32_t cfsr;
    uint32_t hfsr;
    uint32_t address; /* that the fault was about, where the core knows it */
    uint32_t step;    /* control steps completed since start */
    uint32_t state;   /* enum supervisor_state at the last completed step */
    uint32_t crc;     /* CRC-32 of all before */
};

/* Of the step completed last; also what tells a brown-out from power-on. */
struct running_mark {
    uint32_t step;
    uint32_t state;
    uint32_t check;
};

/* Sets magic and CRC; every other member stands. */
void crash_record_seal(struct crash_record *record);
bool crash_record_is_sound(const struct crash_record *record);
void running_mark_set(struct running_mark *mark, uint32_t step, uint32_t state);
bool running_mark_is_sound(const struct running_mark *mark);

#endif
