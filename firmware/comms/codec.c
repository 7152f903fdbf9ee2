#include "comms/codec.h"

#include <stddef.h>
#include <string.h>

#include "control/real_math.h"

#define CLASSIC_BYTES 8u
#define NO_MESSAGE 255u

/* --- the table */

#define SIGNED_S true
#define SIGNED_U false
#define LACK_LACKS true
#define LACK_NEVER false
#define STEPS(value, scale, offset) (((value) - (offset)) / (scale))
#define NEAREST(steps) ((int32_t)((steps) + ((steps) < 0.0f ? -0.5f : 0.5f)))
#define MEMBER_BYTES(name, field) ((uint8_t)sizeof(((struct message_##name *)NULL)->field))

#define REAL(message, field, start, bits, sign, scale, offset, least, most, lack, unit, comment)             \
    {start,                                                                                                  \
     bits,                                                                                                   \
     MESSAGE_FIELD_REAL,                                                                                     \
     SIGNED_##sign,                                                                                          \
     LACK_##lack,                                                                                            \
     (uint8_t)offsetof(struct message_##message, field),                                                     \
     MEMBER_BYTES(message, field),                                                                           \
     NEAREST(STEPS(least, scale, offset)),                                                                   \
     NEAREST(STEPS(most, scale, offset)),                                                                    \
     (float)NEAREST(STEPS(least, scale, offset)) - 1.0f,                                                     \
     (float)NEAREST(STEPS(most, scale, offset)) + 1.0f,                                                      \
     scale,                                                                                                  \
     offset},
#define WHOLE(message, field, start, bits, type, unit, values, comment)                                      \
    {start,                                                                                                  \
     bits,                                                                                                   \
     MESSAGE_FIELD_WHOLE,                                                                                    \
     false,                                                                                                  \
     false,                                                                                                  \
     (uint8_t)offsetof(struct message_##message, field),                                                     \
     MEMBER_BYTES(message, field),                                                                           \
     0,                                                                                                      \
     0,                                                                                                      \
     0.0f,                                                                                                   \
     0.0f,                                                                                                   \
     1.0f,                                                                                                   \
     0.0f},
static const struct message_field fields[] = {
#include "comms/messages.def"
};

/* Where the fields of each message start: the enum counts them. */
enum field_index {
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment)                          \
    FIRST_OF_##NAME, BEFORE_##NAME = FIRST_OF_##NAME - 1,
#define REAL(message, field, start, bits, sign, scale, offset, least, most, lack, unit, comment)             \
    FIELD_##message##_##field,
#define WHOLE(message, field, start, bits, type, unit, values, comment) FIELD_##message##_##field,
#include "comms/messages.def"
    FIELD_COUNT
};
_Static_assert(sizeof fields / sizeof fields[0] == (size_t)FIELD_COUNT, "one row a field");

/* A byte a field: the size is their number. */
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment) struct fields_of_##name {
#define REAL(message, field, start, bits, sign, scale, offset, least, most, lack, unit, comment) char field;
#define WHOLE(message, field, start, bits, type, unit, values, comment) char field;
#define END_MESSAGE                                                                                          \
    }                                                                                                        \
    ;
#include "comms/messages.def"

static const struct message_row rows[MESSAGE_COUNT] = {
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment)                          \
    {MESSAGE_##direction,                                                                                    \
     period_ms,                                                                                              \
     phase_ms,                                                                                               \
     FIRST_OF_##NAME,                                                                                        \
     (uint16_t)sizeof(struct fields_of_##name),                                                              \
     number,                                                                                                 \
     bytes},
#include "comms/messages.def"
};

static const uint8_t id_of_number[MESSAGE_NUMBER_MOST + 1u] = {
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment)                          \
    [number] = (uint8_t)MESSAGE_##NAME + 1u,
#include "comms/messages.def"
};

const struct message_row *message_row(enum message_id id) {
    return &rows[id];
}

const struct message_field *message_field(uint32_t index) {
    return &fields[index];
}

bool message_find(uint32_t number, enum message_id *id) {
    if (number > MESSAGE_NUMBER_MOST || id_of_number[number] == 0u) {
        return false;
    }
    *id = (enum message_id)(id_of_number[number] - 1u);
    return true;
}

uint32_t message_identifier(enum message_id id, uint32_t node) {
    return (uint32_t)rows[id].number << MESSAGE_NODE_BITS | node;
}

/* --- bits: in words of 32, which are the data as they are in memory (little-endian) */

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
               "words are data, and the low bytes of a member come first");

#define WORD_BITS 32u
#define WORD_BYTES 4u

static uint32_t low_bits(uint32_t bits) {
    return bits < WORD_BITS ? (1u << bits) - 1u : UINT32_MAX;
}

/* At most 32 bits, into words that are zero there. */
static void put_bits(uint32_t *words, uint32_t start, uint32_t bits, uint32_t raw) {
    uint32_t *word = &words[start / WORD_BITS];
    const uint32_t shift = start % WORD_BITS;
    word[0] |= raw << shift;
    if (shift + bits > WORD_BITS) {
        word[1] |= raw >> (WORD_BITS - shift); /* then shift is not 0 */
    }
}

static uint32_t get_bits(const uint32_t *words, uint32_t start, uint32_t bits) {
    const uint32_t *word = &words[start / WORD_BITS];
    const uint32_t shift = start % WORD_BITS;
    uint32_t raw = word[0] >> shift;
    if (shift + bits > WORD_BITS) {
        raw |= word[1] << (WORD_BITS - shift);
    }
    return raw & low_bits(bits);
}

/* --- fields */

static int32_t raw_that_lacks(const struct message_field *field) {
    return field->is_signed ? -(int32_t)(1u << (field->bits - 1u)) : (int32_t)((1u << field->bits) - 1u);
}

static int32_t quantise(const struct message_field *field, float value, struct message_trouble *trouble) {
    const float steps = (value - field->offset) / field->scale;
    const float nearest = steps + (steps < 0.0f ? -0.5f : 0.5f);
    if (nearest > field->under && nearest < field->over) {
        return (int32_t)nearest; /* which cuts towards zero: past an end by less than one is that end */
    }
    if (!real_is_finite(value) && !(value < 0.0f) && !(value > 0.0f)) { /* NaN */
        trouble->lacking++;
        trouble->out_of_range += field->may_lack ? 0u : 1u;
        return field->may_lack ? raw_that_lacks(field) : field->least;
    }
    trouble->out_of_range++;
    return steps < (float)field->least ? field->least : field->most;
}

static void pack_real(const struct message_field *field, const uint8_t *member, uint32_t *words,
                      struct message_trouble *trouble) {
    float value = 0.0f;
    (void)memcpy(&value, member, sizeof value);
    put_bits(words, field->start, field->bits,
             (uint32_t)quantise(field, value, trouble) & low_bits(field->bits));
}

/* Members of 1, 2 and 4 bytes: copies of a known size, which are loads. */
static uint32_t read_whole(const uint8_t *member, uint32_t width) {
    uint32_t value = member[0];
    uint16_t half = 0u;
    if (width == sizeof half) {
        (void)memcpy(&half, member, sizeof half);
        value = half;
    } else if (width == sizeof value) {
        (void)memcpy(&value, member, sizeof value);
    }
    return value;
}

static void write_whole(uint8_t *member, uint32_t width, uint32_t value) {
    const uint16_t half = (uint16_t)value;
    if (width == sizeof half) {
        (void)memcpy(member, &half, sizeof half);
    } else if (width == sizeof value) {
        (void)memcpy(member, &value, sizeof value);
    } else {
        member[0] = (uint8_t)value; /* a bool, too: its field has one bit */
    }
}

static void pack_whole(const struct message_field *field, const uint8_t *member, uint32_t *words,
                       struct message_trouble *trouble) {
    const uint32_t value = read_whole(member, field->width), most = low_bits(field->bits);
    trouble->out_of_range += value > most ? 1u : 0u;
    put_bits(words, field->start, field->bits, value > most ? most : value);
}

/* Members of 8 bytes, whose fields have over 32 bits. */
static void pack_wide(const struct message_field *field, const uint8_t *member, uint32_t *words,
                      struct message_trouble *trouble) {
    const uint32_t high_bits = field->bits - WORD_BITS, most = low_bits(high_bits);
    uint32_t low = read_whole(member, WORD_BYTES), high = read_whole(member + WORD_BYTES, WORD_BYTES);
    if (high > most) {
        trouble->out_of_range++;
        high = most;
        low = UINT32_MAX;
    }
    put_bits(words, field->start, WORD_BITS, low);
    put_bits(words, field->start + WORD_BITS, high_bits, high);
}

static void unpack_whole(const struct message_field *field, const uint32_t *words, uint8_t *member) {
    if (field->bits <= WORD_BITS) {
        write_whole(member, field->width, get_bits(words, field->start, field->bits));
    } else {
        write_whole(member, WORD_BYTES, get_bits(words, field->start, WORD_BITS));
        write_whole(member + WORD_BYTES, WORD_BYTES,
                    get_bits(words, field->start + WORD_BITS, field->bits - WORD_BITS));
    }
}

static void unpack_real(const struct message_field *field, uint32_t raw, uint8_t *member,
                        struct message_trouble *trouble) {
    const uint32_t sign = 1u << (field->bits - 1u);
    const int32_t steps = field->is_signed ? (int32_t)(raw ^ sign) - (int32_t)sign : (int32_t)raw;
    float value = (float)steps * field->scale + field->offset;
    if (field->may_lack && steps == raw_that_lacks(field)) {
        const uint32_t not_a_number = 0x7fc00000u;
        trouble->lacking++;
        (void)memcpy(&value, &not_a_number, sizeof value);
    } else if (steps < field->least || steps > field->most) {
        trouble->out_of_range++;
    }
    (void)memcpy(member, &value, sizeof value);
}

/* --- messages */

void message_pack_begin(enum message_id id, struct message_packing *packing) {
    packing->fields = 0u;
    packing->words[0] = 0u;
    packing->words[1] = 0u;
    if (rows[id].bytes > CLASSIC_BYTES) {
        (void)memset(packing->words, 0, sizeof packing->words);
    }
}

bool message_pack_some(enum message_id id, const void *message, uint32_t most, struct message_packing *packing,
                       struct message_trouble *trouble) {
    const uint32_t left = rows[id].fields - packing->fields, count = left < most ? left : most;
    const struct message_field *field = &fields[rows[id].first_field + packing->fields], *end = field + count;
    const uint8_t *members = message;
    for (; field < end; field++) {
        if (field->kind == MESSAGE_FIELD_REAL) {
            pack_real(field, members + field->at, packing->words, trouble);
        } else if (field->bits <= WORD_BITS) {
            pack_whole(field, members + field->at, packing->words, trouble);
        } else {
            pack_wide(field, members + field->at, packing->words, trouble);
        }
    }
    packing->fields += count;
    return count == left;
}

void message_pack_end(enum message_id id, const struct message_packing *packing, uint32_t node,
                      struct hal_can_frame *frame) {
    frame->id = message_identifier(id, node);
    frame->extended = false;
    frame->fd = rows[id].bytes > CLASSIC_BYTES;
    frame->length = rows[id].bytes;
    (void)memcpy(frame->data, packing->words, rows[id].bytes);
}

void message_pack(enum message_id id, const void *message, uint8_t *data, struct message_trouble *trouble) {
    struct message_packing packing;
    message_pack_begin(id, &packing);
    (void)message_pack_some(id, message, rows[id].fields, &packing, trouble);
    (void)memcpy(data, packing.words, rows[id].bytes);
}

void message_unpack(enum message_id id, const uint8_t *data, void *message, struct message_trouble *trouble) {
    const struct message_row *row = &rows[id];
    const struct message_field *field = &fields[row->first_field], *end = field + row->fields;
    uint8_t *members = message;
    uint32_t words[MESSAGE_WORDS];
    words[(row->bytes - 1u) / WORD_BYTES] = 0u; /* the last may not be full */
    (void)memcpy(words, data, row->bytes);
    for (; field < end; field++) {
        if (field->kind == MESSAGE_FIELD_REAL) {
            unpack_real(field, get_bits(words, field->start, field->bits), members + field->at, trouble);
        } else {
            unpack_whole(field, words, members + field->at);
        }
    }
}

void message_frame(enum message_id id, uint32_t node, const void *message, struct hal_can_frame *frame,
                   struct message_trouble *trouble) {
    struct message_packing packing;
    message_pack_begin(id, &packing);
    (void)message_pack_some(id, message, rows[id].fields, &packing, trouble);
    message_pack_end(id, &packing, node, frame);
}
