/* The flash controller in dual-bank mode: keys, page erase and double-word programming that take their time,
 * the errors of wrong sequences, ECC of words whose writing was cut off, and a power cut at a chosen
 * operation. RM0440, chapter 3. An operation on the bank that the code runs from stops the core. Options,
 * mass erase and fast programming are not modelled; reading the bank that is being written is not stopped. */
#ifndef TRIBEND_EMULATOR_FLASH_H
#define TRIBEND_EMULATOR_FLASH_H

#include "emulator/core.h"

#define FLASH_PAGE_BYTES 0x800u
#define FLASH_WORD_BYTES 8u
#define FLASH_WORDS (CORE_FLASH_BYTES / FLASH_WORD_BYTES)

enum flash_operation { FLASH_NOTHING, FLASH_ERASING, FLASH_PROGRAMMING };

struct flash {
    struct core *core;
    void (*lost_power)(void *context); /* the cut that was asked for */
    void (*wait_states_changed)(void *context);
    void *context;
    uint32_t access, status, control, ecc, options;
    uint32_t key_step; /* 0 locked, 1 first key given, 2 open, 3 locked until reset */
    enum flash_operation operation;
    uint32_t address; /* offset of the page or double word under way */
    uint32_t half[2];
    bool have_low;
    size_t slot;
    uint32_t erasures, words;  /* done */
    uint32_t operations;       /* begun */
    uint32_t cut_at_operation; /* power fails within this one, counted from 1; 0: never */
    uint64_t cut_random;       /* what a cut leaves behind */
    uint8_t *broken;           /* [FLASH_WORDS] double words with two wrong bits */
    uint32_t broken_count;
    uint32_t refused; /* writes against the rules; SR has the bit */
};

/* False: no memory. */
bool flash_init(struct flash *flash, struct core *core);
void flash_free(struct flash *flash);
void flash_reset(struct flash *flash);
bool flash_read(void *context, uint32_t offset, uint32_t *value);
bool flash_write(void *context, uint32_t offset, uint32_t value);
/* A store of the program's to an address in flash. */
void flash_store(struct flash *flash, uint32_t address, uint32_t value, uint32_t bytes);
/* The program reads from a double word with two wrong bits: ECCR and the NMI. */
void flash_read_broken(struct flash *flash, uint32_t address);
uint32_t flash_wait_states(const struct flash *flash);

#endif
