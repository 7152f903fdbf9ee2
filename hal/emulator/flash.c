#include "emulator/flash.h"

#include <stdlib.h>
#include <string.h>

#define KEY_1 0x45670123u
#define KEY_2 0xcdef89abu
#define SR_EOP 1u
#define SR_PROGERR 0x08u
#define SR_WRPERR 0x10u
#define SR_PGAERR 0x20u
#define SR_SIZERR 0x40u
#define SR_PGSERR 0x80u
#define SR_BSY (1u << 16)
#define SR_CLEARABLE 0xc3fbu
#define CR_PG 1u
#define CR_PER 2u
#define CR_BKER (1u << 11)
#define CR_STRT (1u << 16)
#define CR_LOCK (1u << 31)
#define ECCR_ECCD (1u << 31)
#define ECCR_BK (1u << 21)
#define BANK_BYTES (CORE_FLASH_BYTES / 2u)
#define ERASE_US 22020 /* STM32G474 datasheet, typical */
#define PROGRAM_US 82
#define OPTIONS_AS_FLASHED 0xffeffcaau /* dual bank, brown-out level 4: as `make flash` leaves them */

static uint64_t chance(struct flash *flash) {
    flash->cut_random += UINT64_C(0x9e3779b97f4a7c15); /* SplitMix64, Steele, Lea, Flood 2014 */
    uint64_t mixed = flash->cut_random;
    mixed = (mixed ^ (mixed >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    mixed = (mixed ^ (mixed >> 27)) * UINT64_C(0x94d049bb133111eb);
    return mixed ^ (mixed >> 31);
}

static void mark(struct flash *flash, uint32_t offset, bool broken) {
    uint8_t *flag = &flash->broken[offset / FLASH_WORD_BYTES];
    flash->broken_count += broken && *flag == 0 ? 1u : 0u;
    flash->broken_count -= !broken && *flag != 0 ? 1u : 0u;
    *flag = broken ? 1 : 0;
}

/* Bits on their way from `before` to `after`, each there or not; half of the time two of them are seen to be
 * wrong. */
static void leave_half_done(struct flash *flash, uint32_t offset, uint64_t before, uint64_t after) {
    const uint64_t which = chance(flash);
    const uint64_t left = (before & which) | (after & ~which);
    memcpy(flash->core->flash + offset, &left, sizeof left);
    mark(flash, offset, left != before && left != after && (chance(flash) & 1u) != 0);
}

static uint64_t word_at(const struct flash *flash, uint32_t offset) {
    uint64_t word = 0;
    memcpy(&word, flash->core->flash + offset, sizeof word);
    return word;
}

static void cut(struct flash *flash) {
    if (flash->operation == FLASH_PROGRAMMING) {
        const uint64_t after = (uint64_t)flash->half[1] << 32 | flash->half[0];
        leave_half_done(flash, flash->address, word_at(flash, flash->address), after);
    }
    for (uint32_t at = 0; flash->operation == FLASH_ERASING && at < FLASH_PAGE_BYTES;
         at += FLASH_WORD_BYTES) {
        leave_half_done(flash, flash->address + at, word_at(flash, flash->address + at), UINT64_MAX);
    }
    flash->cut_at_operation = 0u;
    flash->operation = FLASH_NOTHING;
    flash->lost_power(flash->context);
}

static void finish(struct flash *flash) {
    if (flash->operation == FLASH_ERASING) {
        memset(flash->core->flash + flash->address, 0xff, FLASH_PAGE_BYTES);
        for (uint32_t at = 0; at < FLASH_PAGE_BYTES; at += FLASH_WORD_BYTES) {
            mark(flash, flash->address + at, false);
        }
        flash->erasures++;
    } else {
        memcpy(flash->core->flash + flash->address, flash->half, FLASH_WORD_BYTES);
        flash->words++;
    }
    flash->operation = FLASH_NOTHING;
    flash->status |= SR_EOP;
    core_forget_code(flash->core);
}

static void on_done(void *context, int64_t at_ticks) {
    struct flash *flash = context;
    (void)at_ticks;
    if (flash->cut_at_operation != 0u && flash->operations >= flash->cut_at_operation) {
        cut(flash);
    } else {
        finish(flash);
    }
}

static void begin(struct flash *flash, enum flash_operation operation, uint32_t offset, int64_t duration_us) {
    const bool own_bank = (offset < BANK_BYTES) == (core_code_offset(flash->core) < BANK_BYTES);
    const int64_t end_ticks = flash->core->now_ticks + duration_us * TICKS_PER_US;
    flash->operation = operation;
    flash->address = offset;
    flash->operations++;
    if (own_bank) {
        core_stall(flash->core, end_ticks);
    }
    /* A cut comes half way through. */
    const bool is_cut = flash->cut_at_operation != 0u && flash->operations >= flash->cut_at_operation;
    schedule_set(&flash->core->schedule, flash->slot,
                 is_cut ? end_ticks - duration_us * TICKS_PER_US / 2 : end_ticks);
}

bool flash_init(struct flash *flash, struct core *core) {
    memset(flash, 0, sizeof *flash);
    flash->core = core;
    flash->options = OPTIONS_AS_FLASHED;
    flash->broken = calloc(FLASH_WORDS, 1);
    flash->slot = schedule_add(&core->schedule, on_done, flash);
    return flash->broken != NULL;
}

void flash_free(struct flash *flash) {
    free(flash->broken);
    flash->broken = NULL;
}

void flash_reset(struct flash *flash) {
    flash->access = 0x600u;
    flash->status = flash->ecc = 0u;
    flash->control = CR_LOCK;
    flash->key_step = 0u;
    flash->operation = FLASH_NOTHING;
    flash->have_low = false;
    schedule_set(&flash->core->schedule, flash->slot, SCHEDULE_NEVER);
}

uint32_t flash_wait_states(const struct flash *flash) {
    return flash->access & 15u;
}

static void refuse(struct flash *flash, uint32_t why) {
    flash->status |= why;
    flash->have_low = false;
    flash->refused++;
}

static bool may_program(struct flash *flash, uint32_t offset, uint32_t bytes) {
    const uint32_t first = offset & ~7u;
    uint32_t why = 0u;
    const bool errors_left = (flash->status & SR_CLEARABLE & ~SR_EOP) != 0;
    const bool set_to_program = (flash->control & (CR_PG | CR_PER | CR_LOCK)) == CR_PG;
    if (!set_to_program || flash->operation != FLASH_NOTHING || errors_left) {
        why = SR_PGSERR;
    } else if (bytes != 4u) {
        why = SR_SIZERR;
    } else if ((offset & 4u) != 0 && (!flash->have_low || flash->address != first)) {
        why = SR_PGAERR;
    }
    if (why != 0u) {
        refuse(flash, why);
    }
    return why == 0u;
}

void flash_store(struct flash *flash, uint32_t address, uint32_t value, uint32_t bytes) {
    const uint32_t offset = address - CORE_FLASH;
    if (!may_program(flash, offset, bytes)) {
        return;
    }
    flash->half[offset >> 2 & 1u] = value;
    if ((offset & 4u) == 0) {
        flash->have_low = true;
        flash->address = offset;
        return;
    }
    flash->have_low = false;
    const bool erased = word_at(flash, offset & ~7u) == UINT64_MAX && flash->broken[offset / 8u] == 0;
    if (!erased && (flash->half[0] | flash->half[1]) != 0u) {
        refuse(flash, SR_PROGERR);
        return;
    }
    begin(flash, FLASH_PROGRAMMING, offset & ~7u, PROGRAM_US);
}

static void take_key(struct flash *flash, uint32_t key) {
    if (flash->key_step == 0u && key == KEY_1) {
        flash->key_step = 1u;
    } else if (flash->key_step == 1u && key == KEY_2) {
        flash->key_step = 2u;
        flash->control &= ~CR_LOCK;
    } else {
        flash->key_step = 3u; /* until reset */
        flash->refused++;
    }
}

static void write_control(struct flash *flash, uint32_t value) {
    if ((flash->control & CR_LOCK) != 0) {
        return;
    }
    if (flash->operation != FLASH_NOTHING) {
        refuse(flash, SR_PGSERR);
        return;
    }
    flash->control = value & ~(CR_STRT | CR_LOCK);
    if ((value & CR_STRT) != 0 && (value & (CR_PER | CR_PG)) == CR_PER) {
        const uint32_t page = value >> 3 & 127u;
        begin(flash, FLASH_ERASING, ((value & CR_BKER) != 0 ? BANK_BYTES : 0u) + page * FLASH_PAGE_BYTES,
              ERASE_US);
    }
    if ((value & CR_LOCK) != 0) {
        flash->control |= CR_LOCK;
        flash->key_step = 0u;
    }
}

bool flash_read(void *context, uint32_t offset, uint32_t *value) {
    const struct flash *flash = context;
    switch (offset) {
    case 0x00u:
        *value = flash->access;
        return true;
    case 0x10u:
        *value = flash->status | (flash->operation != FLASH_NOTHING ? SR_BSY : 0u);
        return true;
    case 0x14u:
        *value = flash->control;
        return true;
    case 0x18u:
        *value = flash->ecc;
        return true;
    case 0x20u:
        *value = flash->options;
        return true;
    default:
        return false;
    }
}

bool flash_write(void *context, uint32_t offset, uint32_t value) {
    struct flash *flash = context;
    switch (offset) {
    case 0x00u:
        flash->access = value;
        if (flash->wait_states_changed != NULL) {
            flash->wait_states_changed(flash->context);
        }
        return true;
    case 0x08u:
        take_key(flash, value);
        return true;
    case 0x10u:
        flash->status &= ~(value & SR_CLEARABLE);
        return true;
    case 0x14u:
        write_control(flash, value);
        return true;
    case 0x18u:
        flash->ecc &= ~(value & (15u << 28));
        core_line(flash->core, EXCEPTION_NMI, (flash->ecc & ECCR_ECCD) != 0);
        return true;
    default:
        return false;
    }
}

void flash_read_broken(struct flash *flash, uint32_t address) {
    const uint32_t offset = address - CORE_FLASH;
    if (offset >= CORE_FLASH_BYTES || flash->broken[offset / FLASH_WORD_BYTES] == 0 ||
        (flash->ecc & ECCR_ECCD) != 0) {
        return;
    }
    flash->ecc = ECCR_ECCD | (offset >= BANK_BYTES ? ECCR_BK : 0u) | (offset % BANK_BYTES & ~7u);
    core_line(flash->core, EXCEPTION_NMI, true);
}
