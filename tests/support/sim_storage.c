#include "support/sim_storage.h"

#include <stddef.h>
#include <string.h>

static uint8_t *area_of(struct sim_storage *storage, enum hal_storage_area area, uint32_t *bytes) {
    const bool is_table = area == HAL_STORAGE_TABLE_A || area == HAL_STORAGE_TABLE_B;
    const unsigned second = area == HAL_STORAGE_PARAMETERS_B || area == HAL_STORAGE_TABLE_B ? 1u : 0u;
    *bytes = is_table ? storage->table_bytes : SIM_STORAGE_PARAMETERS_BYTES;
    return is_table ? storage->table[second] : storage->parameters[second];
}

static const uint8_t *map(void *context, enum hal_storage_area area, uint32_t *bytes) {
    return area_of(context, area, bytes);
}

static uint8_t next_random(struct sim_storage *storage) {
    storage->random = storage->random * 6364136223846793005u + 1442695040888963407u;
    return (uint8_t)(storage->random >> 56);
}

/* The bytes at `target` become `wanted`, or whatever the tear makes of them. */
static void put(struct sim_storage *storage, uint8_t *target, const uint8_t *wanted, uint32_t bytes) {
    storage->operations++;
    storage->busy = storage->polls;
    storage->off = storage->cut_after != 0u && storage->operations >= storage->cut_after;
    if (!storage->off || storage->tear == SIM_TEAR_WHOLE) {
        memcpy(target, wanted, bytes);
    } else if (storage->tear == SIM_TEAR_HALF) {
        memcpy(target, wanted, bytes / 2u);
    } else if (storage->tear == SIM_TEAR_GARBAGE) {
        for (uint32_t i = 0; i < bytes; i++) {
            target[i] = next_random(storage);
        }
    }
}

static bool may_start(const struct sim_storage *storage) {
    return !storage->off && !storage->refuses && storage->busy == 0u;
}

static bool erase_page(void *context, enum hal_storage_area area, uint32_t offset) {
    struct sim_storage *storage = context;
    uint8_t erased[SIM_STORAGE_PAGE];
    uint32_t bytes = 0;
    uint8_t *start = area_of(storage, area, &bytes);
    if (offset >= bytes) {
        storage->misuses++;
        return false;
    }
    if (!may_start(storage)) {
        return false;
    }
    memset(erased, 0xff, sizeof erased);
    put(storage, start + offset / SIM_STORAGE_PAGE * SIM_STORAGE_PAGE, erased, SIM_STORAGE_PAGE);
    return true;
}

static bool program(void *context, enum hal_storage_area area, uint32_t offset,
                    const uint8_t word[HAL_STORAGE_WORD_BYTES]) {
    struct sim_storage *storage = context;
    uint8_t erased[HAL_STORAGE_WORD_BYTES];
    uint32_t bytes = 0;
    uint8_t *start = area_of(storage, area, &bytes);
    memset(erased, 0xff, sizeof erased);
    if (offset % HAL_STORAGE_WORD_BYTES != 0u || offset >= bytes) {
        storage->misuses++;
        return false;
    }
    if (!may_start(storage)) {
        return false;
    }
    storage->misuses += memcmp(start + offset, erased, sizeof erased) != 0 ? 1u : 0u;
    put(storage, start + offset, word, HAL_STORAGE_WORD_BYTES);
    return true;
}

static enum hal_storage_status status(void *context) {
    struct sim_storage *storage = context;
    if (storage->off) {
        return HAL_STORAGE_BUSY;
    }
    if (storage->busy > 0u) {
        storage->busy--;
        return HAL_STORAGE_BUSY;
    }
    return storage->fails ? HAL_STORAGE_FAILED : HAL_STORAGE_IDLE;
}

void sim_storage_power_up(struct sim_storage *storage) {
    storage->off = false;
    storage->busy = 0u;
    storage->operations = 0u;
    storage->cut_after = 0u;
}

void sim_storage_init(struct sim_storage *storage, uint32_t table_bytes) {
    memset(storage, 0, offsetof(struct sim_storage, parameters));
    memset(storage->parameters, 0xff, sizeof storage->parameters);
    memset(storage->table[0], 0xff, table_bytes);
    memset(storage->table[1], 0xff, table_bytes);
    storage->table_bytes = table_bytes;
    storage->random = 1u;
    storage->hal = (struct hal_storage){.context = storage,
                                        .map = map,
                                        .erase_page = erase_page,
                                        .program = program,
                                        .status = status,
                                        .page_bytes = SIM_STORAGE_PAGE};
}
