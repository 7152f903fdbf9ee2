/* A table sent over CAN to the board of a test, in virtual time; as `tribend update` does, and no more frames than the board
 * has room for. Header only. */
#ifndef TRIBEND_UPDATE_H
#define TRIBEND_UPDATE_H

#include "comms/store.h"
#include "control/bend_table_format.h"
#include "control/crc32.h"
#include "hil/hil.h"

#define UPDATE_CHUNK 7u
#define UPDATE_CHUNKS_A_MS 2 /* the node takes two commands a step */
#define UPDATE_PATIENCE_MS 30
#define UPDATE_MOST_MS 90000

struct update {
    uint8_t *image;
    uint32_t bytes, sent;
    uint32_t reports; /* of the board */
    int silent_ms;    /* since the last one */
    bool ended;
};

static struct update update;

/* The reference table again, as if from other inputs. */
static inline void update_make(uint64_t hash) {
    const uint32_t covered = BEND_TABLE_OFFSET_CRC + 4u;
    update = (struct update){.image = malloc(hil_file.size), .bytes = (uint32_t)hil_file.size};
    assert_non_null(update.image);
    memcpy(update.image, hil_file.bytes, update.bytes);
    memcpy(update.image + BEND_TABLE_OFFSET_HASH, &hash, sizeof hash);
    const uint32_t crc = crc32_update(0u, update.image + covered, update.bytes - covered);
    memcpy(update.image + BEND_TABLE_OFFSET_CRC, &crc, sizeof crc);
}

static inline void update_send_chunk(void) {
    struct message_transfer_data data = {.chunk = (uint8_t)(update.sent / UPDATE_CHUNK)};
    const uint32_t left = update.bytes - update.sent;
    memcpy(&data.data, update.image + update.sent, left < UPDATE_CHUNK ? left : UPDATE_CHUNK);
    hil_send_as_is(MESSAGE_TRANSFER_DATA, &data);
    update.sent += UPDATE_CHUNK;
}

/* What the board has room for, a few frames at a time. */
static inline void update_send_more(void) {
    const struct message_transfer_state *at = &hil.last[MESSAGE_TRANSFER_STATE].transfer_state;
    if (at->state != TRANSFER_RECEIVING || update.ended) {
        return;
    }
    if (hil.heard[MESSAGE_TRANSFER_STATE] != update.reports) {
        update.reports = hil.heard[MESSAGE_TRANSFER_STATE];
        update.sent =
            hil.board.host.waiting_count == 0 || update.sent < at->offset ? at->offset : update.sent;
        update.silent_ms = 0;
    } else if (++update.silent_ms > UPDATE_PATIENCE_MS && update.sent < update.bytes) {
        update.silent_ms = 0; /* one more, wanted or not, makes the board say where it is */
        update_send_chunk();
    }
    for (int i = 0;
         i < UPDATE_CHUNKS_A_MS && update.sent < update.bytes && update.sent + UPDATE_CHUNK <= at->offset + at->room; i++) {
        update_send_chunk();
    }
    if (at->offset >= update.bytes) {
        struct message_transfer_end end = {.protocol = MESSAGE_PROTOCOL,
                                           .crc = crc32_update(0u, update.image, update.bytes)};
        hil_send(MESSAGE_TRANSFER_END, &end, sizeof end);
        update.ended = true;
    }
}

static inline void update_begin(void) {
    const struct message_transfer_begin begin = {
        .protocol = MESSAGE_PROTOCOL, .kind = TRANSFER_KIND_TABLE, .bytes = update.bytes};
    update.sent = 0u;
    update.ended = false;
    memset(&hil.last[MESSAGE_TRANSFER_STATE], 0, sizeof hil.last[0]);
    hil_send(MESSAGE_TRANSFER_BEGIN, &begin, sizeof begin);
}

static inline uint64_t update_running_table(void) {
    const struct message_identify identify = {.protocol = MESSAGE_PROTOCOL};
    const uint32_t heard = hil.heard[MESSAGE_IDENTITY_TABLE];
    hil_send(MESSAGE_IDENTIFY, &identify, sizeof identify);
    hil_run(20);
    assert_true(hil.heard[MESSAGE_IDENTITY_TABLE] > heard);
    return hil.last[MESSAGE_IDENTITY_TABLE].identity_table.table_hash;
}

#endif
