/* What people call the messages, fields and values of firmware/comms/messages.def: for decoder, DBC and
 * message page. Beside the codec's own table, in the same order; the firmware carries none of these words. */
#ifndef TRIBEND_MESSAGE_WORDS_H
#define TRIBEND_MESSAGE_WORDS_H

#include "comms/codec.h"

enum message_values {
    MESSAGE_VALUES_NUMBER = 0, /* a plain number */
    MESSAGE_VALUES_STATE,
    MESSAGE_VALUES_FAULTS, /* a bit each, like the next one and BEND_FLAGS */
    MESSAGE_VALUES_WARNINGS,
    MESSAGE_VALUES_GAP_STAGE,
    MESSAGE_VALUES_REFUSAL,
    MESSAGE_VALUES_PARAMETER_STATUS,
    MESSAGE_VALUES_PARAMETER_ACTION,
    MESSAGE_VALUES_TRANSFER_KIND,
    MESSAGE_VALUES_TRANSFER_STATE,
    MESSAGE_VALUES_TRANSFER_ERROR,
    MESSAGE_VALUES_BEND_FLAGS,
    MESSAGE_VALUES_MESSAGE_NUMBER,
    MESSAGE_VALUES_COUNT
};

struct message_words {
    const char *name;
    const char *comment;
};

struct message_field_words {
    const char *name;
    const char *unit; /* "1": none */
    const char *comment;
    enum message_values values;
};

const struct message_words *message_words(enum message_id id);
/* `index` as for message_field(). */
const struct message_field_words *message_field_words(uint32_t index);
/* The value of field `index` of a message that was unpacked, as steps of the table's decimal scale; NaN: it
 * has none. */
double message_field_number(uint32_t index, const union message *message);
/* The shortest decimal number whose float this is: what a table shows, and no float is. */
double message_decimal(float value);
/* How many values have a name; 0 of plain numbers. */
uint32_t message_values_count(enum message_values values);
bool message_values_are_bits(enum message_values values);
/* A word for a value, or for the bit of that number; NULL: it has none. */
const char *message_value_name(enum message_values values, uint32_t value);
/* A sentence, or NULL. */
const char *message_value_text(enum message_values values, uint32_t value);

#endif
