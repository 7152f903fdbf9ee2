/* A Cortex-M4F core on libunicorn that runs functions of an ELF and counts their instructions.
 *
 * No interrupts, no peripherals: this measures the pure part of the firmware. Counts are of instructions, not cycles,
 * the same in every run; instructions of an IT block count whether their condition holds or not. */
#ifndef TRIBEND_CALL_COUNTER_H
#define TRIBEND_CALL_COUNTER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CALL_COUNTER_FUNCTIONS 48

/* Instructions of one function, those that it calls included, over all calls since call_counter_reset_counts(). */
struct call_counter_function {
    char name[48];
    uint64_t calls;
    uint64_t total;
    uint64_t worst;
};

struct call_counter;

/* NULL, with the reason in `why`, if the ELF cannot be read or the core not made. */
struct call_counter *call_counter_open(const char *elf_path, char *why, size_t why_bytes);
void call_counter_close(struct call_counter *counter);
/* Address of a symbol, 0: there is none. */
uint32_t call_counter_symbol(const struct call_counter *counter, const char *name);
bool call_counter_write(struct call_counter *counter, uint32_t address, const void *bytes, size_t size);
bool call_counter_read(struct call_counter *counter, uint32_t address, void *bytes, size_t size);
/* Calls the function without arguments at `entry`. False: it faulted or did not return within `most` instructions. */
bool call_counter_call(struct call_counter *counter, uint32_t entry, uint64_t most, uint64_t *instructions);
/* The same, counted by a hook at each instruction: slow, the check of call_counter_call()'s count. */
bool call_counter_call_slowly(struct call_counter *counter, uint32_t entry, uint64_t most, uint64_t *instructions);
/* Follow the calls of a function by name; false: there is no such function, or no room. */
bool call_counter_follow(struct call_counter *counter, const char *name);
size_t call_counter_followed(const struct call_counter *counter, const struct call_counter_function **functions);
void call_counter_reset_counts(struct call_counter *counter);

#endif
