#include "messages/message_decode.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "messages/message_text.h"
#include "messages/message_words.h"

enum message_decode_status message_decode(const struct hal_can_frame *frame,
                                          struct message_decoded *decoded) {
    memset(decoded, 0, sizeof *decoded);
    decoded->node = frame->id & MESSAGE_NODE_MOST;
    if (frame->extended || !message_find(frame->id >> MESSAGE_NODE_BITS, &decoded->id)) {
        return MESSAGE_OF_OTHERS;
    }
    /* a board obeys a VENT of any length */
    if (frame->length < message_row(decoded->id)->bytes && decoded->id != MESSAGE_VENT) {
        return MESSAGE_WRONG_LENGTH;
    }
    message_unpack(decoded->id, frame->data, &decoded->message, &decoded->trouble);
    return MESSAGE_DECODED;
}

static uint64_t whole_of(const struct message_field *field, const union message *message) {
    uint64_t value = 0u;
    memcpy(&value, (const uint8_t *)message + field->at, field->width);
    return value;
}

/* --- text */

struct text {
    char *at;
    size_t left;
};

static void say(struct text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(struct text *text, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const int written = vsnprintf(text->at, text->left, format, arguments);
    va_end(arguments);
    const size_t kept = written < 0 ? 0u : ((size_t)written < text->left ? (size_t)written : text->left - 1u);
    text->at += kept;
    text->left -= kept;
}

static void say_bits(struct text *text, enum message_values values, uint64_t bits) {
    const char *between = "";
    if (bits == 0u) {
        say(text, "none");
    }
    for (uint32_t bit = 0; bit < 64u; bit++) {
        const char *name = message_value_name(values, bit);
        if ((bits >> bit & 1u) == 0u) {
            continue;
        }
        if (name != NULL) {
            say(text, "%s%s", between, name);
        } else {
            say(text, "%sbit %u", between, bit);
        }
        between = "+";
    }
}

static void say_field(struct text *text, uint32_t index, const union message *message) {
    const struct message_field *field = message_field(index);
    const struct message_field_words *words = message_field_words(index);
    const char *unit = strcmp(words->unit, "1") == 0 ? "" : words->unit;
    const uint64_t whole = whole_of(field, message);
    const char *name = whole <= UINT32_MAX ? message_value_name(words->values, (uint32_t)whole) : NULL;
    char number[32];
    say(text, "%s ", words->name);
    if (field->kind == MESSAGE_FIELD_REAL) {
        const double value = message_field_number(index, message);
        (void)snprintf(number, sizeof number, "%.10g", value);
        say(text, "%s%s%s", isnan(value) ? "none" : number, *unit != '\0' && !isnan(value) ? " " : "",
            isnan(value) ? "" : unit);
    } else if (message_values_are_bits(words->values)) {
        say_bits(text, words->values, whole);
    } else if (name != NULL) {
        say(text, "%s", name);
    } else {
        say(text, "%llu%s%s", (unsigned long long)whole, *unit != '\0' ? " " : "", unit);
    }
}

void message_decoded_text(const struct message_decoded *decoded, char *out, size_t bytes) {
    const struct message_row *row = message_row(decoded->id);
    struct text text = {out, bytes};
    say(&text, "%s %s node %u:", message_words(decoded->id)->name,
        row->direction == MESSAGE_TO_HOST ? "from" : "to", decoded->node);
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        say(&text, "%s", f == row->first_field ? " " : ", ");
        say_field(&text, f, &decoded->message);
    }
    if (decoded->trouble.out_of_range > 0u) {
        say(&text, " (%u out of range)", decoded->trouble.out_of_range);
    }
}

/* --- JSON */

static json_t *bits_json(enum message_values values, uint64_t bits) {
    json_t *names = json_array();
    for (uint32_t bit = 0; bit < 64u && names != NULL; bit++) {
        const char *name = message_value_name(values, bit);
        if ((bits >> bit & 1u) != 0u) {
            (void)json_array_append_new(names, name != NULL ? json_string(name) : json_integer(bit));
        }
    }
    return names;
}

static json_t *field_json(uint32_t index, const union message *message) {
    const struct message_field *field = message_field(index);
    const enum message_values values = message_field_words(index)->values;
    const uint64_t whole = whole_of(field, message);
    const char *name = whole <= UINT32_MAX ? message_value_name(values, (uint32_t)whole) : NULL;
    if (field->kind == MESSAGE_FIELD_REAL) {
        const double value = message_field_number(index, message);
        return isnan(value) ? json_null() : json_real(value);
    }
    if (message_values_are_bits(values)) {
        return bits_json(values, whole);
    }
    if (name != NULL) {
        return json_string(name);
    }
    if (field->bits == 64u) { /* more than JSON's readers hold */
        char hash[24];
        (void)snprintf(hash, sizeof hash, "0x%016llx", (unsigned long long)whole);
        return json_string(hash);
    }
    return field->bits == 1u ? json_boolean(whole != 0u) : json_integer((json_int_t)whole);
}

json_t *message_decoded_json(const struct message_decoded *decoded) {
    const struct message_row *row = message_row(decoded->id);
    json_t *fields = json_object();
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields && fields != NULL; f++) {
        (void)json_object_set_new(fields, message_field_words(f)->name, field_json(f, &decoded->message));
    }
    return json_pack("{s:s, s:I, s:o}", "message", message_words(decoded->id)->name, "node",
                     (json_int_t)decoded->node, "fields", fields);
}
