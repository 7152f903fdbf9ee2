#include "log/can_layout.h"

struct message {
    uint32_t identifier;
    size_t bytes;
};

struct field {
    const char *column;
    double factor;
    enum can_message message;
    unsigned first_bit;
    unsigned bits;
    bool is_signed;
};

#define MESSAGE_ROW(name, identifier, bytes) {identifier, bytes},
static const struct message messages[] = {CAN_MESSAGES(MESSAGE_ROW)};
#define FIELD_ROW(message, column, first_bit, bits, is_signed, factor)                                       \
    {#column, factor, CAN_##message, first_bit, bits, is_signed},
static const struct field fields[] = {CAN_FIELDS(FIELD_ROW)};
#define FIELDS (sizeof fields / sizeof fields[0])

bool can_layout_find(uint32_t identifier, enum can_message *message, unsigned *node) {
    for (int m = 0; m < (int)CAN_MESSAGE_COUNT; m++) {
        if (identifier >> CAN_NODE_BITS == messages[m].identifier >> CAN_NODE_BITS) {
            *message = (enum can_message)m;
            *node = identifier & ((1u << CAN_NODE_BITS) - 1u);
            return true;
        }
    }
    return false;
}

size_t can_layout_bytes(enum can_message message) {
    return messages[message].bytes;
}

static double read_field(const struct field *field, const uint8_t *data) {
    uint64_t word = 0;
    bool last_bit = false;
    for (unsigned bit = 0; bit < field->bits; bit++) {
        const unsigned at = field->first_bit + bit;
        last_bit = (data[at / 8u] >> (at % 8u) & 1u) != 0u;
        word |= (uint64_t)last_bit << bit;
    }
    const bool negative = field->is_signed && last_bit;
    const double value = (double)word - (negative ? (double)(1ull << field->bits) : 0.0);
    return field->factor * value;
}

size_t can_layout_decode(enum can_message message, const uint8_t *data,
                         struct event_value values[CAN_FIELDS_MAX]) {
    size_t count = 0;
    for (size_t f = 0; f < FIELDS; f++) {
        if (fields[f].message == message) {
            values[count++] = (struct event_value){fields[f].column, read_field(&fields[f], data)};
        }
    }
    return count;
}
