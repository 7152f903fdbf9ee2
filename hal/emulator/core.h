/* The Cortex-M4F: libunicorn's instruction set with its own interrupt controller, memory map and clock around
 * it. Loads an ELF file, runs it in virtual time and counts instructions by exception.
 *
 * Time passes by instructions, at one clock period each: no wait states, no pipeline. An interrupt is taken
 * at the next basic block's start. The address that a fault stacks is its block's start. Lazy stacking of
 * floating point registers, the MPU and traps of unaligned or zero divisors are not modelled. */
#ifndef TRIBEND_EMULATOR_CORE_H
#define TRIBEND_EMULATOR_CORE_H

#include <unicorn/unicorn.h>

#include "emulator/nvic.h"
#include "emulator/schedule.h"

/* A common multiple of the clocks in use (170, 160, 48, 24, 16 MHz and 32 kHz): their periods are whole
 * ticks. */
#define TICKS_PER_SECOND INT64_C(8160000000)
#define TICKS_PER_US (TICKS_PER_SECOND / 1000000)

#define CORE_FLASH 0x08000000u
#define CORE_FLASH_BYTES 0x80000u
#define CORE_RAM 0x20000000u
#define CORE_RAM_BYTES 0x20000u
#define CORE_CCM 0x10000000u /* the last 32 KiB of RAM once more */
#define CORE_CCM_BYTES 0x8000u
#define CORE_SYSTEM 0x1fff7000u /* unique id, flash size, calibration of the converters */
#define CORE_SYSTEM_BYTES 0x1000u
#define CORE_ERROR_BYTES 256u

/* What the peripherals give the core. Words, at word addresses. */
struct core_peripherals {
    void *context;
    uint32_t (*read)(void *context, uint32_t address);
    void (*write)(void *context, uint32_t address, uint32_t value);
    /* A store to flash: the emulator keeps the flash's own rules. */
    void (*flash_write)(void *context, uint32_t address, uint32_t value, uint32_t bytes);
    /* The core has locked up. */
    void (*locked_up)(void *context);
    /* A load from flash, after core_watch_flash(). */
    void (*flash_read)(void *context, uint32_t address);
};

/* Instructions of one exception number's runs, those of exceptions nested in it apart. [0] is thread mode. */
struct core_count {
    uint64_t entries;
    uint64_t instructions;
    uint64_t last, most; /* of one run */
};

/* Things that software should not do, and that the emulator lets pass; each is counted. */
struct core_oddities {
    uint32_t unknown_registers; /* of the core's private peripherals */
    uint32_t exclusive_blocks;  /* blocks with LDREX or STREX: the monitor is not cleared by exceptions */
    uint32_t partial_accesses;  /* a peripheral's register in bytes or half-words */
    uint32_t spurious_returns;  /* EXC_RETURN values that mean nothing here */
    uint32_t first_unknown;     /* address of the first unknown register; 0: none */
};

struct core;
/* Called at the start of a function of the program, its arguments still in the registers. */
typedef void (*core_probe_action)(void *context, struct core *core);
#define CORE_PROBES 16u

struct core_block; /* of the cache of instruction counts */

struct core {
    uc_engine *engine;
    struct core_peripherals peripherals;
    struct nvic nvic;
    struct schedule schedule;
    size_t systick_slot;
    uint8_t *flash, *ram, *system; /* as the core sees them; ram is kept across resets */
    int64_t now_ticks;
    int64_t deadline_ticks; /* the run ends at the first block that starts at or after it */
    int64_t ticks_per_instruction;
    uint32_t running;      /* exception number, 0: thread */
    int64_t stalled_ticks; /* the instruction bus stands still until then */
    bool sleeping;         /* in WFI */
    bool locked_up;        /* a fault within the hard fault handler: only a reset helps */
    bool semihosting;      /* BKPT 0xab talks to semihost instead of being a fault */
    bool finished;         /* semihosting: the program asked to exit, with ... */
    int exit_status;       /* ... this */
    char *console;         /* what it wrote by semihosting; console_bytes at most */
    size_t console_used, console_bytes;
    struct core_count count[NVIC_EXCEPTIONS];
    uint64_t run_instructions[NVIC_EXCEPTIONS]; /* of the present run of each active exception */
    struct core_oddities oddities;
    struct core_probe {
        uint32_t address;
        core_probe_action action;
        void *context;
    } probe[CORE_PROBES];
    size_t probes;
    struct core_count
        step; /* thread mode from one WFI to the next, where it passed the function marked as step */
    bool step_seen;
    uint64_t thread_before;
    uint32_t debug[8];
    bool watches_flash;
    bool held;                /* in reset by the supply: no instruction runs */
    struct core_block *block; /* [CORE_FLASH_BYTES / 2] */
    bool stopped;             /* by a block hook, not by the program */
    uint8_t if_then;          /* ITSTATE at the end of the block that runs, ... */
    uint32_t block_end;       /* ... which is here */
    uint8_t if_then_lost;     /* ITSTATE where the run was stopped inside an IT block */
    uint32_t event;           /* libunicorn's interrupt number, CORE_NO_EVENT: none */
    uint32_t fault_address;
    struct {
        uint32_t address, bytes;
        uint64_t old;
    } flash_undo; /* libunicorn writes to read-only memory once the hook has seen it */
};

/* False: `error` says why. */
bool core_open(struct core *core, const struct core_peripherals *peripherals, char *error,
               size_t error_bytes);
void core_close(struct core *core);
/* Erased flash, then the file's loadable segments. False: `error` names what is wrong with the file. */
bool core_load_elf(struct core *core, const char *path, char *error, size_t error_bytes);
/* As after power-on or the reset line: registers, interrupts and vectors. RAM, flash and time stay. */
void core_reset(struct core *core);
void core_set_clock(struct core *core, uint32_t hertz);
/* Run until then (or, by up to one block, later), a reset request, or the program's end. */
void core_run(struct core *core, int64_t until_ticks);
/* The instruction bus stands still until then: an operation on the flash bank that the code is in. */
void core_stall(struct core *core, int64_t until_ticks);
/* Flash was written: what was counted there no longer holds. */
void core_forget_code(struct core *core);
/* Where in flash the code that runs is. */
uint32_t core_code_offset(const struct core *core);
/* From now on call the peripherals' `flash_read` on every load from flash. It costs speed. */
bool core_watch_flash(struct core *core);
/* A peripheral's request line, by exception number. */
void core_line(struct core *core, uint32_t exception, bool level);
/* Look at interrupts and requests before the next block. */
void core_attend(struct core *core);

/* False: no room. */
bool core_probe(struct core *core, uint32_t address, core_probe_action action, void *context);
/* The control step's function: its runs are counted in `step`. */
bool core_mark_step(struct core *core, uint32_t address);
/* Write to memory behind the program's back, code included. False: no memory there. */
bool core_patch(struct core *core, uint32_t address, const void *bytes, size_t size);

uint32_t core_register(const struct core *core, int which);
void core_set_register(struct core *core, int which, uint32_t value);
/* Memory of the program; false: none there. */
bool core_read(const struct core *core, uint32_t address, void *bytes, size_t size);
bool core_write(struct core *core, uint32_t address, const void *bytes, size_t size);

#endif
