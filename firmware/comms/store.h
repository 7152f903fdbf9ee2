/* The store: parameters and bend tables in flash, whole whatever moment the power fails.
 *
 * Parameters: an image of parameters.h at the start of either of two areas. A save writes the area that does
 * not hold the newest image: records first, the header's sequence and CRC last. A table: its image at the
 * start of either of two slots, and at the slot's end a record that commits it, which is erased first and
 * written last, after the image was checked from its transfer's CRC to its last number. Until that last word
 * is in, the old one is found; from then on the new one.
 *
 *     commit record    magic, sequence | image bytes, CRC-32 of the image | CRC-32 of these 16 bytes, its
 * complement
 *
 * One store_step() a control step: it starts at most one erasure or write of a word, or looks at a slice of
 * some hundred bytes. The caller begins a save or a transfer only while vented, and lets nothing move until
 * store_is_idle(). A new table is used from the next start on. */
#ifndef TRIBEND_STORE_H
#define TRIBEND_STORE_H

#include "comms/parameters.h"
#include "hal.h"

#define STORE_BUFFER_BYTES 1536u
#define STORE_COMMIT_BYTES 24u
#define STORE_PATIENCE_STEPS 2000u /* without data, or with storage that does not answer */

enum transfer_kind {
    TRANSFER_KIND_NONE = 0,
    TRANSFER_KIND_TABLE,
    TRANSFER_KIND_PARAMETERS,
    TRANSFER_KIND_COUNT
};

#define TRANSFER_STATES(X)                                                                                   \
    X(IDLE, "nothing was sent yet")                                                                          \
    X(RECEIVING, "waits for data")                                                                           \
    X(CHECKING, "checks the image")                                                                          \
    X(COMMITTING, "makes the image the valid one")                                                           \
    X(DONE, "a table is used from the next reset on, parameters are used")                                   \
    X(FAILED, "what was there before is still valid")
enum transfer_state {
#define TRANSFER_STATE_ENUM(NAME, text) TRANSFER_##NAME,
    TRANSFER_STATES(TRANSFER_STATE_ENUM) TRANSFER_STATE_COUNT
#undef TRANSFER_STATE_ENUM
};

#define TRANSFER_ERRORS(X)                                                                                   \
    X(NONE, "none")                                                                                          \
    X(NOT_NOW, "only while vented: send VENT first")                                                         \
    X(BUSY, "a save or another transfer is under way")                                                       \
    X(NO_STORAGE, "this board has no storage")                                                               \
    X(TOO_LONG, "the image is empty or longer than its place")                                               \
    X(NOT_BEGUN, "data or an end came without a begin")                                                      \
    X(INCOMPLETE, "the end came before all the data")                                                        \
    X(TIMEOUT, "no data came for two seconds")                                                               \
    X(DIFFERS, "what arrived is not what was sent: the CRC differs")                                         \
    X(BAD_TABLE, "this is no sound bend table of this version")                                              \
    X(OTHER_MODULE, "the table is of another module than the one that runs")                                 \
    X(LIMITS, "the table's pressures are beyond what this board's sensors read")                             \
    X(BAD_PARAMETERS, "this is no sound parameter image of this version")                                    \
    X(REFUSED_PARAMETERS, "a parameter is unknown here, out of its bounds or in conflict with another")      \
    X(STORAGE, "the storage failed to erase or write")
enum transfer_error {
#define TRANSFER_ERROR_ENUM(NAME, text) TRANSFER_ERROR_##NAME,
    TRANSFER_ERRORS(TRANSFER_ERROR_ENUM) TRANSFER_ERROR_COUNT
#undef TRANSFER_ERROR_ENUM
};

enum store_phase {
    STORE_IDLE = 0,
    STORE_RECEIVE,
    STORE_CHECK_BYTES,
    STORE_CHECK_NUMBERS,
    STORE_COMMIT,
    STORE_TAKE_RECORDS,
    STORE_COLLECT,
    STORE_ERASE,
    STORE_WRITE,
    STORE_VERIFY
};

struct store_transfer {
    enum transfer_state state;
    enum transfer_kind kind;
    enum transfer_error error;
    uint32_t bytes;    /* of the image */
    uint32_t received; /* bytes, in order */
    bool report_due;   /* something changed that the sender wants to know */
};

struct store {
    const struct hal_storage *storage; /* NULL: none */
    const struct bend_table *running;  /* NULL: none */
    struct store_transfer transfer;
    uint32_t errors; /* erasures and writes that failed */
    uint32_t saves;  /* of parameters, that came to their end */
    bool save_failed;
    bool parameters_arrived; /* a transfer left a whole set in `draft`; taken by store_take_parameters() */
    /* what was found at the start */
    bool parameters_found;
    bool table_found;
    enum hal_storage_area parameters_area; /* of the newest image */
    enum hal_storage_area table_slot;      /* of the table that runs */
    uint32_t parameters_sequence;
    uint32_t table_bytes;
    uint32_t table_sequence; /* the highest that was committed */
    /* the work under way, see store.c */
    enum store_phase phase;
    bool started;
    uint32_t waited; /* steps, for the storage */
    uint32_t silent; /* steps, of the sender */
    bool ended;
    bool any_module;
    float sensor_most_pa;
    uint32_t sent_crc;
    enum hal_storage_area area;
    uint32_t written;
    uint32_t erased;
    bool commit_erased;
    uint32_t reported; /* of bytes received and written */
    uint32_t checked;
    uint32_t crc;
    uint32_t inner_crc;
    uint32_t records;
    uint32_t image_bytes;
    const struct parameters *saved;
    struct parameters draft;
    struct parameters_image_report report;
    union {
        uint8_t bytes[STORE_BUFFER_BYTES];
        struct bend_table table;
    } buffer;
};

/* Looks for the newest whole parameters and table; takes some 10 instructions a byte of both, so before the
 * control steps begin. `storage` NULL: finds nothing and keeps nothing. */
void store_init(struct store *store, const struct hal_storage *storage);
/* The table that was found: false: none. */
bool store_table(const struct store *store, const uint8_t **image, uint32_t *bytes);
/* The parameters that were found, or the defaults. */
enum parameters_image_status store_parameters(const struct store *store, const struct bend_table *table,
                                              struct parameters *parameters,
                                              struct parameters_image_report *report);
/* Both places hold something, and neither is whole: parameters were there and are lost. No power failure
 * makes that. */
bool store_parameters_lost(const struct store *store);
/* The table that the controller runs (NULL: none), for what depends on it. */
void store_set_running(struct store *store, const struct bend_table *running);

bool store_is_idle(const struct store *store);
/* Start to save `parameters`, which stay as they are until store_is_idle(). False: busy, or no storage. */
bool store_save(struct store *store, const struct parameters *parameters);
/* Start to receive an image. `sensor_most_pa` is what the board's sensors read at most. Anything but
 * TRANSFER_ERROR_NONE: it did not start (a transfer under way goes on). */
enum transfer_error store_begin(struct store *store, enum transfer_kind kind, uint32_t bytes, bool any_module,
                                float sensor_most_pa);
/* Seven bytes, the lowest of `data` first; `chunk` is the low byte of their offset over 7. One that came
 * before is left alone, one that comes too early or finds no room is asked for again. */
void store_data(struct store *store, uint8_t chunk, uint64_t data);
/* All was sent; `crc` is the image's. */
void store_end(struct store *store, uint32_t crc);
/* Bytes after `received` that may be sent on. */
uint32_t store_room(const struct store *store);
/* Parameters that arrived whole and are saved: true once. */
bool store_take_parameters(struct store *store, struct parameters *parameters);
/* Once a control step. */
void store_step(struct store *store);
/* Sentences for people, never NULL. */
const char *transfer_state_text(enum transfer_state state);
const char *transfer_error_text(enum transfer_error error);

#endif
