/* DBC as CAN tools read it: BO_ a message, SG_ a field, VAL_ named values, cycle times and frame kinds as
 * attributes. */
#include "messages/message_text.h"

#include <math.h>
#include <stdlib.h>

#include "messages/message_words.h"

#define WHOLE_MOST 1e7f /* below, whole numbers are shown as such */
#define FRAME_FD 14     /* index of StandardCAN_FD */

void message_print_real(float value, char text[32]) {
    if (value >= -WHOLE_MOST && value <= WHOLE_MOST && truncf(value) >= value && truncf(value) <= value) {
        (void)snprintf(text, 32, "%.0f", (double)value);
        return;
    }
    for (int digits = 1; digits <= 9; digits++) {
        (void)snprintf(text, 32, "%.*g", digits, (double)value);
        if (strtof(text, NULL) >= value && strtof(text, NULL) <= value) {
            return;
        }
    }
}

static const char head[] = "VERSION \"protocol %u\"\n"
                           "\n"
                           "NS_ :\n"
                           "    CM_\n"
                           "    BA_DEF_\n"
                           "    BA_\n"
                           "    VAL_\n"
                           "    BA_DEF_DEF_\n"
                           "\n"
                           "BS_:\n"
                           "\n"
                           "BU_: Host Board\n";

static unsigned long long most_of(unsigned bits) {
    return bits < 64 ? (1ull << bits) - 1u : 0xffffffffffffffffull;
}

static void write_range(FILE *file, const struct message_field *field) {
    char scale[32], offset[32], least[32], most[32];
    if (field->kind == MESSAGE_FIELD_WHOLE) {
        (void)fprintf(file, "(1,0) [0|%llu]", most_of(field->bits));
        return;
    }
    message_print_real(field->scale, scale);
    message_print_real(field->offset, offset);
    message_print_real((float)field->least * field->scale + field->offset, least);
    message_print_real((float)field->most * field->scale + field->offset, most);
    (void)fprintf(file, "(%s,%s) [%s|%s]", scale, offset, least, most);
}

static const char *unit_of(const struct message_field_words *words) {
    return words->unit[0] == '1' && words->unit[1] == '\0' ? "" : words->unit;
}

static void write_message(FILE *file, enum message_id id, unsigned node) {
    const struct message_row *row = message_row(id);
    const bool to_host = row->direction == MESSAGE_TO_HOST;
    (void)fprintf(file, "\nBO_ %u %s: %u %s\n", (unsigned)message_identifier(id, node),
                  message_words(id)->name, row->bytes, to_host ? "Board" : "Host");
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        const struct message_field *field = message_field(f);
        const struct message_field_words *words = message_field_words(f);
        (void)fprintf(file, " SG_ %s : %u|%u@1%c ", words->name, field->start, field->bits,
                      field->is_signed ? '-' : '+');
        write_range(file, field);
        (void)fprintf(file, " \"%s\" %s\n", unit_of(words), to_host ? "Host" : "Board");
    }
}

static void write_bits(FILE *file, enum message_values values) {
    for (uint32_t bit = 0; bit < message_values_count(values); bit++) {
        (void)fprintf(file, "%s%u %s", bit == 0 ? "; bits: " : ", ", bit, message_value_name(values, bit));
    }
}

static void write_comments(FILE *file, enum message_id id, unsigned node) {
    const struct message_row *row = message_row(id);
    const unsigned identifier = (unsigned)message_identifier(id, node);
    (void)fprintf(file, "CM_ BO_ %u \"%s\";\n", identifier, message_words(id)->comment);
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        const struct message_field *field = message_field(f);
        const struct message_field_words *words = message_field_words(f);
        const bool bits = message_values_are_bits(words->values);
        if (words->comment[0] == '\0' && !field->may_lack && !bits) {
            continue;
        }
        (void)fprintf(file, "CM_ SG_ %u %s \"%s", identifier, words->name, words->comment);
        if (field->may_lack) {
            (void)fprintf(file, "%sraw %lld: no value", words->comment[0] == '\0' ? "" : "; ",
                          field->is_signed ? -(1ll << (field->bits - 1)) : (long long)most_of(field->bits));
        }
        if (bits) {
            write_bits(file, words->values);
        }
        (void)fputs("\";\n", file);
    }
}

static void write_values(FILE *file, enum message_id id, unsigned node) {
    const struct message_row *row = message_row(id);
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        const struct message_field_words *words = message_field_words(f);
        if (message_values_count(words->values) == 0u || message_values_are_bits(words->values)) {
            continue;
        }
        (void)fprintf(file, "VAL_ %u %s", (unsigned)message_identifier(id, node), words->name);
        for (uint32_t value = 0; value < message_values_count(words->values); value++) {
            const char *name = message_value_name(words->values, value);
            if (name != NULL) {
                (void)fprintf(file, " %u \"%s\"", value, name);
            }
        }
        (void)fputs(" ;\n", file);
    }
}

static void write_attributes(FILE *file, unsigned node) {
    (void)fputs("\nBA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\n"
                "BA_DEF_ BO_ \"VFrameFormat\" ENUM "
                "\"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\",\"reserved\","
                "\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\","
                "\"reserved\","
                "\"reserved\",\"StandardCAN_FD\",\"ExtendedCAN_FD\";\n"
                "BA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n"
                "BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n",
                file);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const enum message_id id = (enum message_id)m;
        const unsigned identifier = (unsigned)message_identifier(id, node);
        if (message_row(id)->period_ms > 0u) {
            (void)fprintf(file, "BA_ \"GenMsgCycleTime\" BO_ %u %u;\n", identifier,
                          message_row(id)->period_ms);
        }
        if (message_row(id)->bytes > 8u) {
            (void)fprintf(file, "BA_ \"VFrameFormat\" BO_ %u %d;\n", identifier, FRAME_FD);
        }
    }
}

bool message_dbc_write(FILE *file, unsigned node) {
    (void)fprintf(file, head, MESSAGE_PROTOCOL);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        write_message(file, (enum message_id)m, node);
    }
    (void)fputc('\n', file);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        write_comments(file, (enum message_id)m, node);
    }
    write_attributes(file, node);
    (void)fputc('\n', file);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        write_values(file, (enum message_id)m, node);
    }
    return ferror(file) == 0;
}
