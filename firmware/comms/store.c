/* The work under way is `phase`: a transfer of a table goes RECEIVE, CHECK_BYTES, CHECK_NUMBERS, COMMIT; one
 * of parameters RECEIVE (into the buffer), CHECK_BYTES, TAKE_RECORDS and then on like a save: COLLECT, ERASE,
 * WRITE, VERIFY. In RECEIVE of a table the buffer is a ring between `written` and `transfer.received`;
 * `erased` counts bytes of whole pages. */
#include "comms/store.h"

#include <stddef.h>
#include <string.h>

#include "control/bend_table_format.h"
#include "control/crc32.h"

#define WORD HAL_STORAGE_WORD_BYTES
#define CHUNK_BYTES 7u
#define REPORT_BYTES 70u
#define SLICE_BYTES 128u
#define COMMIT_MAGIC 0x4d4d4f43u /* "COMM" */
#define RECORDS_CRC_FROM PARAMETERS_IMAGE_HEADER_BYTES
#define TABLE_CRC_FROM (BEND_TABLE_OFFSET_CRC + 4u)

_Static_assert(PARAMETERS_IMAGE_BYTES <= STORE_BUFFER_BYTES, "a parameter image fits the buffer");
_Static_assert(STORE_BUFFER_BYTES % WORD == 0u, "words of the ring do not wrap");

/* --- areas */

static const uint8_t *map(const struct store *store, enum hal_storage_area area, uint32_t *bytes) {
    *bytes = 0u;
    return store->storage != NULL ? store->storage->map(store->storage->context, area, bytes) : NULL;
}

/* Offset of the commit record of a slot of so many bytes; 0: there is no room for one. */
static uint32_t commit_offset(uint32_t area_bytes) {
    return area_bytes > STORE_COMMIT_BYTES ? (area_bytes - STORE_COMMIT_BYTES) / WORD * WORD : 0u;
}

static uint32_t get_u32(const uint8_t *bytes, uint32_t at) {
    uint32_t value = 0u;
    (void)memcpy(&value, bytes + at, sizeof value);
    return value;
}

static void put_u32(uint8_t *bytes, uint32_t at, uint32_t value) {
    (void)memcpy(bytes + at, &value, sizeof value);
}

static enum hal_storage_area other_parameters(enum hal_storage_area area) {
    return area == HAL_STORAGE_PARAMETERS_A ? HAL_STORAGE_PARAMETERS_B : HAL_STORAGE_PARAMETERS_A;
}

static enum hal_storage_area other_slot(enum hal_storage_area area) {
    return area == HAL_STORAGE_TABLE_A ? HAL_STORAGE_TABLE_B : HAL_STORAGE_TABLE_A;
}

static bool is_newer(uint32_t sequence, uint32_t than) {
    return (int32_t)(sequence - than) > 0;
}

/* --- what is there at the start */

static bool is_sound_image(const uint8_t *image, uint32_t area_bytes) {
    const uint32_t bytes = image != NULL ? parameters_image_bytes(image, area_bytes) : 0u;
    if (bytes == 0u) {
        return false;
    }
    const uint32_t crc = crc32_update(0u, image + RECORDS_CRC_FROM, bytes - RECORDS_CRC_FROM);
    return parameters_image_check(image, bytes, crc) == PARAMETERS_IMAGE_OK;
}

static void find_parameters(struct store *store) {
    const enum hal_storage_area areas[2] = {HAL_STORAGE_PARAMETERS_A, HAL_STORAGE_PARAMETERS_B};
    for (uint32_t i = 0; i < 2u; i++) {
        uint32_t area_bytes = 0u;
        const uint8_t *image = map(store, areas[i], &area_bytes);
        if (!is_sound_image(image, area_bytes)) {
            continue;
        }
        const uint32_t sequence = parameters_image_sequence(image);
        if (!store->parameters_found || is_newer(sequence, store->parameters_sequence)) {
            store->parameters_found = true;
            store->parameters_sequence = sequence;
            store->parameters_area = areas[i];
        }
    }
}

/* A commit record that is whole; what it commits may not be. */
static bool read_commit(const uint8_t *slot, uint32_t area_bytes, uint32_t *sequence, uint32_t *bytes,
                        uint32_t *image_crc) {
    const uint32_t at = commit_offset(area_bytes);
    if (slot == NULL || at == 0u || get_u32(slot, at) != COMMIT_MAGIC) {
        return false;
    }
    const uint32_t crc = crc32_update(0u, slot + at, 16u);
    *sequence = get_u32(slot, at + 4u);
    *bytes = get_u32(slot, at + 8u);
    *image_crc = get_u32(slot, at + 12u);
    return get_u32(slot, at + 16u) == crc && get_u32(slot, at + 20u) == ~crc && *bytes <= at;
}

/* A slot's commit record, and whether the table that it commits is sound. */
struct slot {
    bool committed;
    bool sound;
    uint32_t sequence;
    uint32_t bytes;
};

static void look_at_slot(struct store *store, enum hal_storage_area area, struct slot *slot) {
    uint32_t area_bytes = 0u, image_crc = 0u;
    const uint8_t *image = map(store, area, &area_bytes);
    *slot = (struct slot){.committed = false};
    slot->committed = read_commit(image, area_bytes, &slot->sequence, &slot->bytes, &image_crc);
    if (!slot->committed) {
        *slot = (struct slot){.committed = false}; /* what was read of it means nothing */
    }
    slot->sound = slot->committed && crc32_update(0u, image, slot->bytes) == image_crc &&
                  bend_table_open(&store->buffer.table, image, slot->bytes, NULL) == BEND_TABLE_OK;
}

/* As the firmware's build leaves slot A: a table, and no commit record in either slot. */
static bool find_flashed_table(struct store *store, struct slot *slot) {
    uint32_t area_bytes = 0u;
    const uint8_t *image = map(store, HAL_STORAGE_TABLE_A, &area_bytes);
    if (image == NULL || commit_offset(area_bytes) < BEND_TABLE_HEADER_BYTES) {
        return false;
    }
    slot->bytes = get_u32(image, BEND_TABLE_OFFSET_IMAGE_BYTES);
    return slot->bytes <= commit_offset(area_bytes) &&
           bend_table_open(&store->buffer.table, image, slot->bytes, NULL) == BEND_TABLE_OK;
}

/* Even a record whose table is damaged has had its sequence, and keeps what was never committed from being
 * used. */
static void find_table(struct store *store) {
    struct slot a, b;
    look_at_slot(store, HAL_STORAGE_TABLE_A, &a);
    look_at_slot(store, HAL_STORAGE_TABLE_B, &b);
    if (!a.committed && !b.committed) {
        a.sound = find_flashed_table(store, &a);
    }
    const bool takes_b = b.sound && (!a.sound || is_newer(b.sequence, a.sequence));
    store->table_found = a.sound || b.sound;
    store->table_slot = takes_b ? HAL_STORAGE_TABLE_B : HAL_STORAGE_TABLE_A;
    store->table_bytes = takes_b ? b.bytes : a.bytes;
    store->table_sequence = is_newer(b.sequence, a.sequence) ? b.sequence : a.sequence;
}

static bool is_usable(const struct hal_storage *storage) {
    return storage != NULL && storage->page_bytes >= STORE_COMMIT_BYTES && storage->page_bytes % WORD == 0u;
}

void store_init(struct store *store, const struct hal_storage *storage) {
    (void)memset(store, 0, sizeof *store);
    store->storage = is_usable(storage) ? storage : NULL;
    store->parameters_area = HAL_STORAGE_PARAMETERS_B; /* so that A is written first */
    find_parameters(store);
    find_table(store);
}

bool store_table(const struct store *store, const uint8_t **image, uint32_t *bytes) {
    uint32_t area_bytes = 0u;
    *image = store->table_found ? map(store, store->table_slot, &area_bytes) : NULL;
    *bytes = store->table_bytes;
    return *image != NULL;
}

enum parameters_image_status store_parameters(const struct store *store, const struct bend_table *table,
                                              struct parameters *parameters,
                                              struct parameters_image_report *report) {
    uint32_t area_bytes = 0u;
    const uint8_t *image = store->parameters_found ? map(store, store->parameters_area, &area_bytes) : NULL;
    if (image == NULL) {
        *report = (struct parameters_image_report){.unknown = 0u};
        parameters_default(parameters, table);
        return PARAMETERS_IMAGE_OK;
    }
    return parameters_read(parameters, table, image, area_bytes, report);
}

static bool is_blank(const struct store *store, enum hal_storage_area area) {
    uint32_t area_bytes = 0u;
    const uint8_t *image = map(store, area, &area_bytes);
    bool blank = true;
    for (uint32_t i = 0; image != NULL && i < PARAMETERS_IMAGE_HEADER_BYTES && i < area_bytes; i++) {
        blank = blank && image[i] == 0xffu;
    }
    return blank;
}

bool store_parameters_lost(const struct store *store) {
    return !store->parameters_found && !is_blank(store, HAL_STORAGE_PARAMETERS_A) &&
           !is_blank(store, HAL_STORAGE_PARAMETERS_B);
}

void store_set_running(struct store *store, const struct bend_table *running) {
    store->running = running;
}

/* --- beginnings and ends */

bool store_is_idle(const struct store *store) {
    return store->phase == STORE_IDLE;
}

static void enter(struct store *store, enum store_phase phase, enum transfer_state state) {
    store->phase = phase;
    store->waited = 0u;
    if (store->transfer.kind != TRANSFER_KIND_NONE && store->transfer.state != state) {
        store->transfer.state = state;
        store->transfer.report_due = true;
    }
}

static void end_save(struct store *store, bool well) {
    store->saves += well ? 1u : 0u;
    store->save_failed = !well;
}

static void fail(struct store *store, enum transfer_error error) {
    if (store->transfer.kind == TRANSFER_KIND_NONE) {
        end_save(store, false);
    }
    store->transfer.error = error;
    enter(store, STORE_IDLE, TRANSFER_FAILED);
}

static void start_collecting(struct store *store, const struct parameters *parameters) {
    store->saved = parameters;
    store->checked = 0u;
    store->records = 0u;
    store->crc = 0u;
    store->area = other_parameters(store->parameters_area);
    enter(store, STORE_COLLECT, TRANSFER_COMMITTING);
}

bool store_save(struct store *store, const struct parameters *parameters) {
    if (store->storage == NULL || store->phase != STORE_IDLE) {
        return false;
    }
    store->transfer = (struct store_transfer){.kind = TRANSFER_KIND_NONE};
    start_collecting(store, parameters);
    return true;
}

/* The slot that does not hold the table that runs. */
static uint32_t room_for(struct store *store, enum transfer_kind kind) {
    uint32_t area_bytes = 0u;
    if (kind == TRANSFER_KIND_PARAMETERS) {
        return PARAMETERS_IMAGE_BYTES;
    }
    store->area = store->table_found ? other_slot(store->table_slot) : HAL_STORAGE_TABLE_A;
    const bool usable =
        map(store, store->area, &area_bytes) != NULL && area_bytes % store->storage->page_bytes == 0u;
    return usable ? commit_offset(area_bytes) : 0u;
}

enum transfer_error store_begin(struct store *store, enum transfer_kind kind, uint32_t bytes, bool any_module,
                                float sensor_most_pa) {
    if (store->phase != STORE_IDLE) {
        return TRANSFER_ERROR_BUSY;
    }
    store->transfer = (struct store_transfer){.kind = kind, .bytes = bytes};
    if (store->storage == NULL) {
        fail(store, TRANSFER_ERROR_NO_STORAGE);
        return TRANSFER_ERROR_NO_STORAGE;
    }
    if (bytes == 0u || bytes > room_for(store, kind)) {
        fail(store, TRANSFER_ERROR_TOO_LONG);
        return TRANSFER_ERROR_TOO_LONG;
    }
    store->any_module = any_module;
    store->sensor_most_pa = sensor_most_pa;
    store->ended = false;
    store->silent = 0u;
    store->written = 0u;
    store->erased = 0u;
    store->commit_erased = false;
    store->reported = 0u;
    enter(store, STORE_RECEIVE, TRANSFER_RECEIVING);
    return TRANSFER_ERROR_NONE;
}

uint32_t store_room(const struct store *store) {
    if (store->phase != STORE_RECEIVE) {
        return 0u;
    }
    return (STORE_BUFFER_BYTES - (store->transfer.received - store->written)) / CHUNK_BYTES * CHUNK_BYTES;
}

/* The sender is told when enough has moved, and when all is there. */
static void note_progress(struct store *store) {
    struct store_transfer *transfer = &store->transfer;
    const uint32_t moved = transfer->received + store->written - store->reported;
    if (moved >= REPORT_BYTES || (moved > 0u && transfer->received == transfer->bytes)) {
        store->reported += moved;
        transfer->report_due = true;
    }
}

void store_data(struct store *store, uint8_t chunk, uint64_t data) {
    struct store_transfer *transfer = &store->transfer;
    if (store->phase != STORE_RECEIVE || transfer->received == transfer->bytes) {
        transfer->report_due = true;
        return;
    }
    const uint8_t expected = (uint8_t)(transfer->received / CHUNK_BYTES);
    if (chunk != expected || store_room(store) < CHUNK_BYTES) {
        transfer->report_due = transfer->report_due || (uint8_t)(chunk - expected) < 128u;
        return;
    }
    store->silent = 0u;
    for (uint32_t i = 0; i < CHUNK_BYTES && transfer->received < transfer->bytes; i++) {
        store->buffer.bytes[transfer->received % STORE_BUFFER_BYTES] = (uint8_t)(data >> (8u * i));
        transfer->received++;
    }
    note_progress(store);
}

void store_end(struct store *store, uint32_t crc) {
    if (store->phase != STORE_RECEIVE) {
        store->transfer.report_due = true;
        return;
    }
    if (store->transfer.received != store->transfer.bytes) {
        fail(store, TRANSFER_ERROR_INCOMPLETE);
        return;
    }
    store->sent_crc = crc;
    store->ended = true;
}

bool store_take_parameters(struct store *store, struct parameters *parameters) {
    const bool arrived = store->parameters_arrived;
    store->parameters_arrived = false;
    if (arrived) {
        *parameters = store->draft;
    }
    return arrived;
}

/* --- storage */

static void fail_storage(struct store *store) {
    store->errors++;
    if (store->phase != STORE_IDLE) {
        fail(store, TRANSFER_ERROR_STORAGE);
    }
}

/* For storage that is busy or does not want to start. */
static void wait(struct store *store) {
    store->waited++;
    if (store->waited > STORE_PATIENCE_STEPS) {
        store->waited = 0u;
        fail_storage(store);
    }
}

/* The operation that was started last has ended well. */
static bool is_ready(struct store *store) {
    if (!store->started) {
        return true;
    }
    const enum hal_storage_status status = store->storage->status(store->storage->context);
    if (status == HAL_STORAGE_BUSY) {
        wait(store);
        return false;
    }
    store->started = false;
    if (status != HAL_STORAGE_IDLE) {
        fail_storage(store);
    }
    return status == HAL_STORAGE_IDLE;
}

static bool note_start(struct store *store, bool started) {
    store->started = started;
    if (started) {
        store->waited = 0u;
    } else {
        wait(store);
    }
    return started;
}

static bool erase(struct store *store, uint32_t offset) {
    return note_start(store, store->storage->erase_page(store->storage->context, store->area, offset));
}

static bool program(struct store *store, uint32_t offset, const uint8_t word[WORD]) {
    return note_start(store, store->storage->program(store->storage->context, store->area, offset, word));
}

/* --- a table arrives */

/* The page with the commit record goes first, and is not erased again when the image reaches it. */
static bool has_erased_enough(struct store *store) {
    uint32_t area_bytes = 0u;
    (void)map(store, store->area, &area_bytes);
    const uint32_t last_page = area_bytes - store->storage->page_bytes;
    if (!store->commit_erased) {
        store->commit_erased = erase(store, last_page);
        return false;
    }
    if (store->written < store->erased || store->written >= last_page) {
        return true;
    }
    store->erased += erase(store, store->erased) ? store->storage->page_bytes : 0u;
    return false;
}

static void write_next_word(struct store *store) {
    const struct store_transfer *transfer = &store->transfer;
    const uint32_t waiting = transfer->received - store->written;
    uint8_t word[WORD];
    if (waiting < WORD && (transfer->received < transfer->bytes || waiting == 0u)) {
        return;
    }
    (void)memset(word, 0xff, sizeof word);
    (void)memcpy(word, store->buffer.bytes + store->written % STORE_BUFFER_BYTES,
                 waiting < WORD ? waiting : WORD);
    if (program(store, store->written, word)) {
        store->written += waiting < WORD ? waiting : WORD;
        note_progress(store); /* there is more room */
    }
}

static void start_checking(struct store *store) {
    store->checked = 0u;
    store->crc = 0u;
    store->inner_crc = 0u;
    enter(store, STORE_CHECK_BYTES, TRANSFER_CHECKING);
}

static void step_receive(struct store *store) {
    const bool is_table = store->transfer.kind == TRANSFER_KIND_TABLE;
    store->silent++;
    if (store->silent > STORE_PATIENCE_STEPS && !store->ended) {
        fail(store, TRANSFER_ERROR_TIMEOUT);
        return;
    }
    if (store->ended && (!is_table || store->written == store->transfer.bytes)) {
        start_checking(store);
        return;
    }
    if (is_table && has_erased_enough(store)) {
        write_next_word(store);
    }
}

/* --- an image is checked */

static const uint8_t *arrived_image(const struct store *store) {
    uint32_t area_bytes = 0u;
    return store->transfer.kind == TRANSFER_KIND_TABLE ? map(store, store->area, &area_bytes)
                                                       : store->buffer.bytes;
}

/* The transfer's CRC covers every byte, the image's own what comes after `from`. */
static void step_check_bytes(struct store *store) {
    const struct store_transfer *transfer = &store->transfer;
    const bool is_table = transfer->kind == TRANSFER_KIND_TABLE;
    const uint32_t from = is_table ? TABLE_CRC_FROM : RECORDS_CRC_FROM;
    const uint8_t *image = arrived_image(store);
    const uint32_t at = store->checked, left = transfer->bytes - at;
    const uint32_t count =
        at < from ? (left < from ? left : from) : (left < SLICE_BYTES ? left : SLICE_BYTES);
    store->crc = crc32_update(store->crc, image + at, count);
    store->inner_crc = at < from ? 0u : crc32_update(store->inner_crc, image + at, count);
    store->checked += count;
    if (store->checked < transfer->bytes) {
        return;
    }
    store->checked = 0u;
    if (store->crc != store->sent_crc) {
        fail(store, TRANSFER_ERROR_DIFFERS);
    } else {
        enter(store, is_table ? STORE_CHECK_NUMBERS : STORE_TAKE_RECORDS, TRANSFER_CHECKING);
    }
}

/* Binds it, and judges it by the module that it is of and by the limits that would follow from it. */
static enum transfer_error judge_table(struct store *store) {
    struct bend_table *table = &store->buffer.table;
    const uint8_t *image = arrived_image(store);
    const char *module = store->running != NULL && !store->any_module ? store->running->module.name : NULL;
    const enum bend_table_status status = bend_table_bind(table, image, store->transfer.bytes, module);
    if (status == BEND_TABLE_WRONG_MODULE) {
        return TRANSFER_ERROR_OTHER_MODULE;
    }
    if (status != BEND_TABLE_OK || store->inner_crc != table->image_crc) {
        return TRANSFER_ERROR_BAD_TABLE;
    }
    parameters_default(&store->draft, table);
    const bool agree = parameters_agree(&store->draft, table) &&
                       store->draft.controller.limits.hard_pressure_pa < store->sensor_most_pa;
    return agree ? TRANSFER_ERROR_NONE : TRANSFER_ERROR_LIMITS;
}

static void step_check_numbers(struct store *store) {
    const uint32_t at = store->checked, bytes = store->transfer.bytes;
    if (at == 0u) {
        const enum transfer_error error = judge_table(store);
        store->checked = BEND_TABLE_HEADER_BYTES;
        if (error != TRANSFER_ERROR_NONE) {
            fail(store, error);
        }
        return;
    }
    const uint32_t to = bytes - at < SLICE_BYTES ? bytes : at + SLICE_BYTES;
    store->checked = to;
    if (!bend_table_is_finite(&store->buffer.table, at, to)) {
        fail(store, TRANSFER_ERROR_BAD_TABLE);
    } else if (to == bytes) {
        store->checked = 0u;
        enter(store, STORE_COMMIT, TRANSFER_COMMITTING);
    }
}

/* --- a table becomes the valid one */

static void make_commit(const struct store *store, uint8_t record[STORE_COMMIT_BYTES]) {
    put_u32(record, 0u, COMMIT_MAGIC);
    put_u32(record, 4u, store->table_sequence + 1u);
    put_u32(record, 8u, store->transfer.bytes);
    put_u32(record, 12u, store->sent_crc);
    const uint32_t crc = crc32_update(0u, record, 16u);
    put_u32(record, 16u, crc);
    put_u32(record, 20u, ~crc);
}

static void step_commit(struct store *store) {
    uint8_t record[STORE_COMMIT_BYTES];
    uint32_t area_bytes = 0u;
    const uint8_t *slot = map(store, store->area, &area_bytes);
    const uint32_t at = commit_offset(area_bytes);
    make_commit(store, record);
    if (store->checked < STORE_COMMIT_BYTES) {
        store->checked += program(store, at + store->checked, record + store->checked) ? WORD : 0u;
        return;
    }
    if (memcmp(slot + at, record, STORE_COMMIT_BYTES) != 0) {
        fail_storage(store);
        return;
    }
    store->table_sequence++;
    enter(store, STORE_IDLE, TRANSFER_DONE);
}

/* --- parameters arrive */

static void step_take_records(struct store *store) {
    const uint8_t *image = store->buffer.bytes;
    const uint32_t bytes = store->transfer.bytes;
    if (store->checked == 0u) {
        const bool sound = parameters_image_bytes(image, bytes) == bytes &&
                           parameters_image_check(image, bytes, store->inner_crc) == PARAMETERS_IMAGE_OK;
        if (!sound) {
            fail(store, TRANSFER_ERROR_BAD_PARAMETERS);
            return;
        }
        parameters_default(&store->draft, store->running);
        store->report = (struct parameters_image_report){.unknown = 0u};
        store->checked = PARAMETERS_IMAGE_HEADER_BYTES;
        return;
    }
    if (store->checked < bytes) {
        parameters_take(&store->draft, image + store->checked, &store->report);
        store->checked += PARAMETERS_RECORD_BYTES;
        return;
    }
    parameters_settle(&store->draft, store->running, &store->report);
    if (store->report.unknown + store->report.refused > 0u) {
        fail(store, TRANSFER_ERROR_REFUSED_PARAMETERS);
    } else {
        start_collecting(store, &store->draft);
    }
}

/* --- parameters are saved */

static void step_collect(struct store *store) {
    uint8_t *image = store->buffer.bytes;
    uint8_t *record = image + PARAMETERS_IMAGE_HEADER_BYTES + store->records * PARAMETERS_RECORD_BYTES;
    if (store->checked < (uint32_t)PARAMETER_COUNT) {
        if (parameters_record(store->saved, store->running, (enum parameter_index)store->checked, record)) {
            store->crc = crc32_update(store->crc, record, PARAMETERS_RECORD_BYTES);
            store->records++;
        }
        store->checked++;
        return;
    }
    parameters_seal(image, store->records, store->parameters_sequence + 1u, store->crc);
    store->image_bytes = PARAMETERS_IMAGE_HEADER_BYTES + store->records * PARAMETERS_RECORD_BYTES;
    store->erased = 0u;
    store->written = 0u;
    enter(store, STORE_ERASE, TRANSFER_COMMITTING);
}

static void step_erase(struct store *store) {
    if (store->erased < store->image_bytes) {
        store->erased += erase(store, store->erased) ? store->storage->page_bytes : 0u;
    } else {
        enter(store, STORE_WRITE, TRANSFER_COMMITTING);
    }
}

/* The records, then the header's two words: the second, with sequence and CRC, makes the image valid. */
static void step_write(struct store *store) {
    const uint32_t records = store->image_bytes - PARAMETERS_IMAGE_HEADER_BYTES;
    if (store->written == store->image_bytes) {
        store->checked = 0u;
        enter(store, STORE_VERIFY, TRANSFER_COMMITTING);
        return;
    }
    const bool is_record = store->written < records;
    const uint32_t offset =
        is_record ? store->written + PARAMETERS_IMAGE_HEADER_BYTES : store->written - records;
    store->written += program(store, offset, store->buffer.bytes + offset) ? WORD : 0u;
}

static void step_verify(struct store *store) {
    uint32_t area_bytes = 0u;
    const uint8_t *written = map(store, store->area, &area_bytes);
    const uint32_t at = store->checked, left = store->image_bytes - at;
    const uint32_t count = left < SLICE_BYTES ? left : SLICE_BYTES;
    if (memcmp(written + at, store->buffer.bytes + at, count) != 0) {
        fail_storage(store);
        return;
    }
    store->checked += count;
    if (store->checked < store->image_bytes) {
        return;
    }
    store->parameters_sequence++;
    store->parameters_area = store->area;
    store->parameters_found = true;
    store->parameters_arrived = store->transfer.kind == TRANSFER_KIND_PARAMETERS;
    end_save(store, true);
    enter(store, STORE_IDLE, TRANSFER_DONE);
}

void store_step(struct store *store) {
    if (store->phase == STORE_IDLE && !store->started) {
        return;
    }
    if (!is_ready(store)) {
        return;
    }
    switch (store->phase) {
    case STORE_RECEIVE:
        step_receive(store);
        break;
    case STORE_CHECK_BYTES:
        step_check_bytes(store);
        break;
    case STORE_CHECK_NUMBERS:
        step_check_numbers(store);
        break;
    case STORE_COMMIT:
        step_commit(store);
        break;
    case STORE_TAKE_RECORDS:
        step_take_records(store);
        break;
    case STORE_COLLECT:
        step_collect(store);
        break;
    case STORE_ERASE:
        step_erase(store);
        break;
    case STORE_WRITE:
        step_write(store);
        break;
    case STORE_VERIFY:
        step_verify(store);
        break;
    case STORE_IDLE:
    default:
        break;
    }
}

/* --- words */

const char *transfer_state_text(enum transfer_state state) {
#define TRANSFER_STATE_TEXT(NAME, text) text,
    static const char *const texts[TRANSFER_STATE_COUNT] = {TRANSFER_STATES(TRANSFER_STATE_TEXT)};
#undef TRANSFER_STATE_TEXT
    return (uint32_t)state < (uint32_t)TRANSFER_STATE_COUNT ? texts[state] : "unknown";
}

const char *transfer_error_text(enum transfer_error error) {
#define TRANSFER_ERROR_TEXT(NAME, text) text,
    static const char *const texts[TRANSFER_ERROR_COUNT] = {TRANSFER_ERRORS(TRANSFER_ERROR_TEXT)};
#undef TRANSFER_ERROR_TEXT
    return (uint32_t)error < (uint32_t)TRANSFER_ERROR_COUNT ? texts[error] : "unknown";
}
