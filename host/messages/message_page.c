/* docs/messages.md: a section a message, a row a field, and the lists of what values mean. */
#include "messages/message_text.h"

#include <ctype.h>
#include <string.h>

#include "comms/parameters.h"
#include "messages/message_words.h"

static const char head[] =
    "# Messages\n"
    "\n"
    "This page is made from `firmware/comms/messages.def` (`make docs-messages`), which codec, node, "
    "`docs/tribend.dbc` and\n"
    "`tribend decode` are made from too. Protocol version %u.\n"
    "\n"
    "- Classic CAN: 11-bit identifiers, message number x 16 + node. Node 1 to 15 is a board; a command to "
    "node 0 goes to every\n"
    "  board, and only VENT and IDENTIFY may. `TELEMETRY` alone needs CAN FD, and is sent only with the "
    "parameter `can_fd`.\n"
    "- Bits count from the lowest of byte 0 (little-endian). A value is raw x scale, in the unit shown.\n"
    "- Every command starts with a sequence, one more with each command of a host: one that stands still or "
    "goes back is refused\n"
    "  until nothing came for the command timeout. Then the protocol's version: another one is refused.\n"
    "- A motion or hold command lives for the command timeout (0.5 s by default); `HOST_HEARTBEAT` says it "
    "again.\n"
    "- `step` is the low bits of the number of the control step (1 ms) that the numbers are of; `TIME` says "
    "when it was.\n"
    "- Periods are multiplied by the parameter `telemetry_slowdown`. At most two frames are sent in a "
    "control step.\n"
    "\n"
    "To bend board 1 by 60 degrees towards 30 degrees with can-utils alone (0x28e8 = 10472 x 0.1 mrad, "
    "0x1474 = 5236), and then\n"
    "to vent:\n"
    "\n"
    "    for s in $(seq 0 250); do cansend can0 051#$(printf %%02x $s)01E82874140000; sleep 0.1; done\n"
    "    cansend can0 011#\n";

static void write_values_cell(FILE *file, const struct message_field_words *words) {
    static const char *const anchors[MESSAGE_VALUES_COUNT] = {
        [MESSAGE_VALUES_STATE] = "state",
        [MESSAGE_VALUES_FAULTS] = "faults",
        [MESSAGE_VALUES_WARNINGS] = "warnings",
        [MESSAGE_VALUES_GAP_STAGE] = "gap-stage",
        [MESSAGE_VALUES_REFUSAL] = "refusal",
        [MESSAGE_VALUES_PARAMETER_STATUS] = "parameter-status",
        [MESSAGE_VALUES_PARAMETER_ACTION] = "parameter-action",
        [MESSAGE_VALUES_TRANSFER_KIND] = "transfer-kind",
        [MESSAGE_VALUES_TRANSFER_STATE] = "transfer-state",
        [MESSAGE_VALUES_TRANSFER_ERROR] = "transfer-error",
        [MESSAGE_VALUES_BEND_FLAGS] = "bend-flags"};
    const char *comma = words->comment[0] == '\0' ? "" : "; ";
    (void)fputs(words->comment, file);
    if (words->values == MESSAGE_VALUES_MESSAGE_NUMBER) {
        (void)fprintf(file, "%sa message's number", comma);
    } else if (anchors[words->values] != NULL) {
        (void)fprintf(file, "%s[%s](#%s)", comma, anchors[words->values], anchors[words->values]);
    }
}

static void write_field(FILE *file, uint32_t index) {
    const struct message_field *field = message_field(index);
    const struct message_field_words *words = message_field_words(index);
    const char *unit = strcmp(words->unit, "1") == 0 ? "" : words->unit;
    (void)fprintf(file, "| %s | %u | %s%u | ", words->name, field->start, field->is_signed ? "-" : "",
                  field->bits);
    if (field->kind == MESSAGE_FIELD_REAL) {
        char scale[32], least[32], most[32];
        message_print_real(field->scale, scale);
        message_print_real((float)field->least * field->scale + field->offset, least);
        message_print_real((float)field->most * field->scale + field->offset, most);
        (void)fprintf(file, "%s %s | %s to %s%s | ", scale, unit, least, most,
                      field->may_lack ? ", or none" : "");
    } else {
        (void)fprintf(file, "%s | | ", unit);
    }
    write_values_cell(file, words);
    (void)fputs(" |\n", file);
}

static void write_message(FILE *file, enum message_id id) {
    const struct message_row *row = message_row(id);
    const char *comment = message_words(id)->comment;
    (void)fprintf(file, "\n### %s\n\n%c%s. Number %u, identifier 0x%03x + node, %u bytes",
                  message_words(id)->name, toupper((unsigned char)comment[0]), comment + 1, row->number,
                  (unsigned)message_identifier(id, 0u), row->bytes);
    if (row->period_ms > 0u) {
        (void)fprintf(file, ", every %u ms", row->period_ms);
    }
    (void)fputs(".\n\n| field | bit | bits | scale and unit | range | what |\n| --- | --: | --: | --- | --- "
                "| --- |\n",
                file);
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        write_field(file, f);
    }
}

static void write_messages(FILE *file, const char *title, enum message_direction direction, uint32_t from,
                           uint32_t to) {
    (void)fprintf(file, "\n## %s\n", title);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        if (row->direction == direction && row->number >= from && row->number < to) {
            write_message(file, (enum message_id)m);
        }
    }
}

static void write_list(FILE *file, const char *title, enum message_values values) {
    const bool bits = message_values_are_bits(values);
    (void)fprintf(file, "\n### %s\n\n| %s | name | what |\n| --: | --- | --- |\n", title,
                  bits ? "bit" : "value");
    for (uint32_t value = 0; value < message_values_count(values); value++) {
        const char *text = message_value_text(values, value);
        (void)fprintf(file, "| %u | %s | %s |\n", value, message_value_name(values, value),
                      text != NULL ? text : "");
    }
}

/* --- parameters */

static void write_whole_bounds(FILE *file, const struct parameter_row *row) {
    (void)fprintf(file, "%u to %u", row->least_whole, row->most_whole);
}

static void write_real(FILE *file, uint32_t bits) {
    char text[32];
    float value = 0.0f;
    memcpy(&value, &bits, sizeof value);
    message_print_real(value, text);
    (void)fputs(text, file);
}

static void write_parameter(FILE *file, enum parameter_index index, const char *name, const char *unit,
                            const char *when, const char *comment, const struct parameters *defaults) {
    const struct parameter_row *row = parameter_row(index);
    char least[32], most[32];
    uint32_t value = 0u;
    (void)parameter_get(defaults, row->id, &value);
    (void)fprintf(file, "| %u | %s | ", row->id, name);
    if (row->type == PARAMETER_TYPE_REAL) {
        write_real(file, value);
        message_print_real(row->least, least);
        message_print_real(row->most, most);
        (void)fprintf(file, " | %s to %s", least, most);
    } else {
        (void)fprintf(file, "%u | ", value);
        write_whole_bounds(file, row);
    }
    (void)fprintf(file, " | %s | %s | %s |\n", strcmp(unit, "1") == 0 ? "" : unit,
                  strcmp(when, "START") == 0 ? "vented; holds from the next start on"
                  : row->vented              ? "vented"
                                             : "any time",
                  comment);
}

static void write_parameters(FILE *file) {
    struct parameters defaults;
    parameters_default(&defaults, NULL);
    (void)fprintf(
        file,
        "\n## Parameters\n\nWhat `PARAMETER_GET` and `PARAMETER_SET` reach (`firmware/comms/parameters.def`, "
        "version %u). "
        "Values are integers or the bits of a\nfloat. Limits default to the module's of the table that runs; "
        "below "
        "are those of the founding paper's.\n\n| number | name | default | bounds | unit | changed | what |\n"
        "| --: | --- | --- | --- | --- | --- | --- |\n",
        PARAMETERS_VERSION);
#define PARAMETER(id, name, type, member, unit, least, most, when, comment)                                  \
    write_parameter(file, PARAMETER_##name, #name, unit, #when, comment, &defaults);
#include "comms/parameters.def"
}

bool message_page_write(FILE *file) {
    (void)fprintf(file, head, MESSAGE_PROTOCOL);
    write_messages(file, "Commands", MESSAGE_TO_BOARD, 0u, 16u);
    write_messages(file, "Telemetry", MESSAGE_TO_HOST, 16u, 64u);
    write_messages(file, "Requests", MESSAGE_TO_BOARD, 64u, 128u);
    write_messages(file, "Answers", MESSAGE_TO_HOST, 64u, 128u);
    (void)fputs("\n## Values\n", file);
    write_list(file, "state", MESSAGE_VALUES_STATE);
    write_list(file, "faults", MESSAGE_VALUES_FAULTS);
    write_list(file, "warnings", MESSAGE_VALUES_WARNINGS);
    write_list(file, "gap-stage", MESSAGE_VALUES_GAP_STAGE);
    write_list(file, "bend-flags", MESSAGE_VALUES_BEND_FLAGS);
    write_list(file, "refusal", MESSAGE_VALUES_REFUSAL);
    write_list(file, "parameter-status", MESSAGE_VALUES_PARAMETER_STATUS);
    write_list(file, "parameter-action", MESSAGE_VALUES_PARAMETER_ACTION);
    write_list(file, "transfer-kind", MESSAGE_VALUES_TRANSFER_KIND);
    write_list(file, "transfer-state", MESSAGE_VALUES_TRANSFER_STATE);
    write_list(file, "transfer-error", MESSAGE_VALUES_TRANSFER_ERROR);
    write_parameters(file);
    return ferror(file) == 0;
}
