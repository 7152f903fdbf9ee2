/* The codec: messages between structs and the bytes of CAN frames, driven by messages.def.
 *
 * A struct message_NAME each, in the units of the table. Packing saturates what does not fit and counts it;
 * unpacking counts what lies outside the table's ranges. Not here: what a message does (node.h), how it is
 * sent (hal.h). */
#ifndef TRIBEND_CODEC_H
#define TRIBEND_CODEC_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

#define MESSAGE_PROTOCOL 1u /* of messages.def: one more when a message changes its meaning; goes to 15 */
#define MESSAGE_NODE_BITS 4u
#define MESSAGE_NODE_ALL 0u /* commands to every board */
#define MESSAGE_NODE_MOST 15u
#define MESSAGE_NUMBER_MOST 127u
#define MESSAGE_CLEAR_KEY 0xC1EAu
#define MESSAGE_RESET_KEY 0x5E7Au
#define MESSAGE_CHUNK_BYTES 7u
#define MESSAGE_WORDS (HAL_CAN_DATA_BYTES / 4u)

enum message_id {
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment) MESSAGE_##NAME,
#include "comms/messages.def"
    MESSAGE_COUNT
};

enum message_direction { MESSAGE_TO_BOARD = 0, MESSAGE_TO_HOST };

#define MESSAGE_TYPE_BIT bool
#define MESSAGE_TYPE_U8 uint8_t
#define MESSAGE_TYPE_U16 uint16_t
#define MESSAGE_TYPE_U32 uint32_t
#define MESSAGE_TYPE_U64 uint64_t
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment) struct message_##name {
#define REAL(message, field, start, bits, sign, scale, offset, least, most, lack, unit, comment) float field;
#define WHOLE(message, field, start, bits, type, unit, values, comment) MESSAGE_TYPE_##type field;
#define END_MESSAGE                                                                                          \
    }                                                                                                        \
    ;
#include "comms/messages.def"

union message {
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment)                          \
    struct message_##name name;
#include "comms/messages.def"
};

/* What telemetry and commands need to know of a message. */
struct message_row {
    enum message_direction direction;
    uint16_t period_ms; /* 0: none */
    uint16_t phase_ms;
    uint16_t first_field; /* of all fields */
    uint16_t fields;
    uint8_t number;
    uint8_t bytes; /* of its data */
};

enum message_field_kind { MESSAGE_FIELD_REAL = 0, MESSAGE_FIELD_WHOLE };

struct message_field {
    uint16_t start; /* bits */
    uint8_t bits;
    enum message_field_kind kind;
    bool is_signed;
    bool may_lack;
    uint8_t at;    /* of its member in the struct, bytes */
    uint8_t width; /* of its member, bytes */
    int32_t least; /* raw, of REAL, */
    int32_t most;
    float under; /* and by one beyond them */
    float over;
    float scale;
    float offset;
};

/* What a message did not hold as it was given. */
struct message_trouble {
    uint32_t out_of_range; /* numbers that were saturated, or lie outside the table's range */
    uint32_t lacking;      /* fields without a value */
};

/* A message on its way into a frame. */
struct message_packing {
    uint32_t fields; /* that are packed */
    uint32_t words[MESSAGE_WORDS];
};

const struct message_row *message_row(enum message_id id);
const struct message_field *message_field(uint32_t index);
/* The message with this number; false: there is none. */
bool message_find(uint32_t number, enum message_id *id);
/* 11-bit identifier. */
uint32_t message_identifier(enum message_id id, uint32_t node);
/* `message` points to the struct of `id`; `data` has room for its bytes, which are all written. Adds to
 * `trouble`. */
void message_pack(enum message_id id, const void *message, uint8_t *data, struct message_trouble *trouble);
/* The reverse, from the message's bytes; REAL fields that lack a value become NaN, those out of range are
 * given as they are. Adds to `trouble`. */
void message_unpack(enum message_id id, const uint8_t *data, void *message, struct message_trouble *trouble);
/* A long one in parts: `most` fields at a time, until it returns true. */
void message_pack_begin(enum message_id id, struct message_packing *packing);
bool message_pack_some(enum message_id id, const void *message, uint32_t most, struct message_packing *packing,
                       struct message_trouble *trouble);
void message_pack_end(enum message_id id, const struct message_packing *packing, uint32_t node,
                      struct hal_can_frame *frame);
/* A whole frame to `node`. FD where the message is longer than 8 bytes. */
void message_frame(enum message_id id, uint32_t node, const void *message, struct hal_can_frame *frame,
                   struct message_trouble *trouble);

#endif
