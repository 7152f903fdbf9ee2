#include "stm32g4/flash.h"

#include <stddef.h>

#include "stm32g4/core.h"
#include "stm32g4/linker.h"
#include "stm32g4/registers.h"
#include "stm32g4/valves.h"

#define BANK_1 0x08000000u
#define BANK_BYTES 0x40000u
#define BANK_2 (BANK_1 + BANK_BYTES)
#define PAGE_BYTES 2048u
#define TABLE_BYTES 188416u /* 92 pages */
#define PARAMETERS_BYTES PAGE_BYTES

struct area {
    const uint8_t *bytes;
    uint32_t size;
};

static const struct area areas[HAL_STORAGE_AREA_COUNT] = {
    [HAL_STORAGE_PARAMETERS_A] = {linker_parameters_a, PARAMETERS_BYTES},
    [HAL_STORAGE_PARAMETERS_B] = {linker_parameters_b, PARAMETERS_BYTES},
    [HAL_STORAGE_TABLE_A] = {linker_table_a, TABLE_BYTES},
    [HAL_STORAGE_TABLE_B] = {linker_table_b, TABLE_BYTES},
};

static bool usable;
static bool running; /* an operation was started and its end not seen yet */
static bool failed;  /* the operation that ended last did */
static bool stalled;

static uint32_t address_of(enum hal_storage_area area, uint32_t offset) {
    return (uint32_t)(uintptr_t)areas[area].bytes + offset;
}

static const uint8_t *flash_map(void *context, enum hal_storage_area area, uint32_t *bytes) {
    (void)context;
    if ((uint32_t)area >= (uint32_t)HAL_STORAGE_AREA_COUNT) {
        *bytes = 0u;
        return NULL;
    }
    *bytes = areas[area].size;
    return areas[area].bytes;
}

/* What was read before must not be read from the data cache again (RM0440, 3.3.4). */
static void forget_cached_data(void) {
    FLASH->acr &= ~FLASH_ACR_DCEN;
    FLASH->acr |= FLASH_ACR_DCRST;
    FLASH->acr &= ~FLASH_ACR_DCRST;
    FLASH->acr |= FLASH_ACR_DCEN;
}

static void finish(void) {
    failed = (FLASH->sr & FLASH_SR_ERRORS) != 0u;
    FLASH->sr = FLASH_SR_ERRORS | FLASH_SR_EOP;
    FLASH->cr = FLASH_CR_LOCK;
    forget_cached_data();
    running = false;
}

static enum hal_storage_status flash_status(void *context) {
    (void)context;
    if (running && (FLASH->sr & FLASH_SR_BSY) != 0u) {
        return HAL_STORAGE_BUSY;
    }
    if (running) {
        finish();
    }
    return failed ? HAL_STORAGE_FAILED : HAL_STORAGE_IDLE;
}

/* Unlocked, with what an earlier operation left cleared. */
static bool begin(enum hal_storage_area area, uint32_t offset) {
    if (!usable || (uint32_t)area >= (uint32_t)HAL_STORAGE_AREA_COUNT || offset >= areas[area].size ||
        flash_status(NULL) == HAL_STORAGE_BUSY) {
        return false;
    }
    const bool own_bank = address_of(area, offset) < BANK_2;
    if (own_bank && valves_enabled()) {
        return false; /* nobody would look after the chambers for 25 ms */
    }
    FLASH->keyr = FLASH_KEY_1;
    FLASH->keyr = FLASH_KEY_2;
    FLASH->sr = FLASH_SR_ERRORS | FLASH_SR_EOP;
    stalled = stalled || own_bank;
    running = true;
    return true;
}

static bool flash_erase_page(void *context, enum hal_storage_area area, uint32_t offset) {
    (void)context;
    if (!begin(area, offset)) {
        return false;
    }
    const uint32_t from_start = address_of(area, offset) - BANK_1;
    const uint32_t bank = from_start < BANK_BYTES ? 0u : FLASH_CR_BKER;
    const uint32_t page = (from_start % BANK_BYTES) / PAGE_BYTES;
    FLASH->cr = FLASH_CR_PER | bank | (page << FLASH_CR_PNB_SHIFT);
    FLASH->cr = FLASH_CR_PER | bank | (page << FLASH_CR_PNB_SHIFT) | FLASH_CR_STRT;
    return true;
}

static uint32_t word_of(const uint8_t bytes[4]) {
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) |
           ((uint32_t)bytes[3] << 24);
}

static bool flash_program(void *context, enum hal_storage_area area, uint32_t offset,
                          const uint8_t word[HAL_STORAGE_WORD_BYTES]) {
    (void)context;
    if (offset % HAL_STORAGE_WORD_BYTES != 0u || !begin(area, offset)) {
        return false;
    }
    reg32 *target = (reg32 *)(uintptr_t)address_of(area, offset);
    FLASH->cr = FLASH_CR_PG;
    const uint32_t mask = core_mask(); /* the two halves in one go */
    target[0] = word_of(&word[0]);
    target[1] = word_of(&word[4]);
    core_unmask(mask);
    return true;
}

bool flash_start(struct hal_storage *storage) {
    usable = (FLASH->optr & FLASH_OPTR_DBANK) != 0u;
    *storage = (struct hal_storage){.context = NULL,
                                    .map = flash_map,
                                    .erase_page = flash_erase_page,
                                    .program = flash_program,
                                    .status = flash_status,
                                    .page_bytes = PAGE_BYTES};
    return usable;
}

bool flash_take_stall(void) {
    const bool was_stalled = stalled;
    stalled = running && stalled;
    return was_stalled;
}

bool flash_is_storage(bool second_bank, uint32_t offset) {
    const uint32_t address = (second_bank ? BANK_2 : BANK_1) + offset;
    for (uint32_t i = 0; i < (uint32_t)HAL_STORAGE_AREA_COUNT; i++) {
        const uint32_t first = (uint32_t)(uintptr_t)areas[i].bytes;
        if (address >= first && address < first + areas[i].size) {
            return true;
        }
    }
    return false;
}
