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

/* --- bits */

/* Into `data` that is zero there. */
static void put_bits(uint8_t *data, uint32_t start, uint32_t bits, uint64_t raw) {
    uint32_t at = start / 8u, shift = start % 8u, done = 8u - shift;
    data[at] = (uint8_t)(data[at] | (uint8_t)(raw << shift));
    for (; done < bits; done += 8u) {
        at++;
        data[at] = (uint8_t)(data[at] | (uint8_t)(raw >> done));
    }
}

static uint64_t get_bits(const uint8_t *data, uint32_t start, uint32_t bits) {
    uint32_t at = start / 8u, shift = start % 8u, done = 8u - shift;
    uint64_t raw = (uint64_t)data[at] >> shift;
    for (; done < bits; done += 8u) {
        at++;
        raw |= (uint64_t)data[at] << done;
    }
    return bits < 64u ? raw & (((uint64_t)1u << bits) - 1u) : raw;
}

/* --- fields */

static int32_t raw_that_lacks(const struct message_field *field) {
    return field->is_signed ? -(int32_t)(1u << (field->bits - 1u)) : (int32_t)((1u << field->bits) - 1u);
}

static int32_t quantise(const struct message_field *field, float value, struct message_trouble *trouble) {
    const float steps = (value - field->offset) / field->scale;
    const float nearest = steps + (steps < 0.0f ? -0.5f : 0.5f);
    if (nearest > (float)field->least - 1.0f && nearest < (float)field->most + 1.0f) {
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

static uint64_t read_whole(const struct message_field *field, const uint8_t *member,
                           struct message_trouble *trouble) {
    uint64_t value = 0u; /* little-endian: the low bytes come first */
    (void)memcpy(&value, member, field->width);
    if (field->bits < 64u && value >> field->bits != 0u) {
        trouble->out_of_range++;
        value = ((uint64_t)1u << field->bits) - 1u;
    }
    return value;
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

void message_pack(enum message_id id, const void *message, uint8_t *data, struct message_trouble *trouble) {
    const struct message_row *row = &rows[id];
    const uint8_t *members = message;
    (void)memset(data, 0, row->bytes);
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        const struct message_field *field = &fields[f];
        uint64_t raw = 0u;
        if (field->kind == MESSAGE_FIELD_REAL) {
            float value = 0.0f;
            (void)memcpy(&value, members + field->at, sizeof value);
            raw = (uint32_t)quantise(field, value, trouble) & ((1u << field->bits) - 1u);
        } else {
            raw = read_whole(field, members + field->at, trouble);
        }
        put_bits(data, field->start, field->bits, raw);
    }
}

void message_unpack(enum message_id id, const uint8_t *data, void *message, struct message_trouble *trouble) {
    const struct message_row *row = &rows[id];
    uint8_t *members = message;
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        const struct message_field *field = &fields[f];
        const uint64_t raw = get_bits(data, field->start, field->bits);
        if (field->kind == MESSAGE_FIELD_REAL) {
            unpack_real(field, (uint32_t)raw, members + field->at, trouble);
        } else {
            (void)memcpy(members + field->at, &raw, field->width);
        }
    }
}

void message_frame(enum message_id id, uint32_t node, const void *message, struct hal_can_frame *frame,
                   struct message_trouble *trouble) {
    frame->id = message_identifier(id, node);
    frame->extended = false;
    frame->fd = rows[id].bytes > CLASSIC_BYTES;
    frame->length = rows[id].bytes;
    message_pack(id, message, frame->data, trouble);
}
