#include "messages/message_words.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "comms/node.h"
#include "messages/message_text.h"
#include "safety/supervisor.h"

/* --- messages and fields */

static const struct message_words messages[MESSAGE_COUNT] = {
#define MESSAGE(NAME, name, number, direction, bytes, period_ms, phase_ms, comment) {#NAME, comment},
#include "comms/messages.def"
};

#define REAL(message, field, start, bits, sign, scale, offset, least, most, lack, unit, comment)             \
    {#field, unit, comment, MESSAGE_VALUES_NUMBER},
#define WHOLE(message, field, start, bits, type, unit, values, comment)                                      \
    {#field, unit, comment, MESSAGE_VALUES_##values},
static const struct message_field_words fields[] = {
#include "comms/messages.def"
};

const struct message_words *message_words(enum message_id id) {
    return &messages[id];
}

const struct message_field_words *message_field_words(uint32_t index) {
    return &fields[index];
}

double message_decimal(float value) {
    char text[32];
    message_print_real(value, text);
    return strtod(text, NULL);
}

double message_field_number(uint32_t index, const union message *message) {
    const struct message_field *field = message_field(index);
    const uint8_t *member = (const uint8_t *)message + field->at;
    if (field->kind == MESSAGE_FIELD_REAL) {
        float value = 0.0f;
        memcpy(&value, member, sizeof value);
        const double steps = round((double)((value - field->offset) / field->scale));
        return steps * message_decimal(field->scale) + message_decimal(field->offset);
    }
    uint64_t value = 0u;
    memcpy(&value, member, field->width);
    return (double)value;
}

/* --- values */

struct word {
    const char *name;
    const char *text;
};

#define WORD(NAME, text) {#NAME, text},
static const struct word refusals[] = {NODE_REFUSALS(WORD)};
static const struct word bend_flags[] = {NODE_BEND_FLAGS(WORD)};
static const struct word actions[] = {NODE_ACTIONS(WORD)};
static const struct word parameter_statuses[] = {PARAMETER_STATUSES(WORD)};
static const struct word transfer_states[] = {TRANSFER_STATES(WORD)};
static const struct word transfer_errors[] = {TRANSFER_ERRORS(WORD)};
static const struct word transfer_kinds[TRANSFER_KIND_COUNT] = {
    [TRANSFER_KIND_NONE] = {"NONE", "none"},
    [TRANSFER_KIND_TABLE] = {"TABLE", "a bend table (.tbt)"},
    [TRANSFER_KIND_PARAMETERS] = {"PARAMETERS", "a parameter image"}};
static const struct word gap_stages[GAP_MONITOR_STAGE_COUNT] = {
    [GAP_MONITOR_NONE] = {"NONE", NULL},
    [GAP_MONITOR_VALVE] = {"VALVE", NULL},
    [GAP_MONITOR_PRESSURE_SENSOR] = {"PRESSURE_SENSOR", NULL},
    [GAP_MONITOR_BODY] = {"BODY", NULL},
    [GAP_MONITOR_TIP_SENSOR] = {"TIP_SENSOR", NULL}};
static const struct word states[SUPERVISOR_STATE_COUNT] = {
    [SUPERVISOR_BOOT] = {"BOOT", "just started"},
    [SUPERVISOR_SELFTEST] = {"SELFTEST", "the supply comes on, no chamber may rise"},
    [SUPERVISOR_SAFE] = {"SAFE", "vented, waiting for a command"},
    [SUPERVISOR_ACTIVE] = {"ACTIVE", "following a pressure or bend command"},
    [SUPERVISOR_HOLD] = {"HOLD", "keeping the present pressures"},
    [SUPERVISOR_FAULT] = {"FAULT", "vented, latched until cleared on purpose"}};
static const struct word faults[FAULT_COUNT] = {
#define FAULT(NAME, title, sees, detector, limit, time, clear, remedy, why) [FAULT_##NAME] = {#NAME, title},
#include "safety/faults.def"
};
static const struct word warnings[WARNING_COUNT] = {
#define WARNING(NAME, title, sees, detector, limit, time, reaction, remedy, why)                             \
    [WARNING_##NAME] = {#NAME, title},
#include "safety/faults.def"
};

struct list {
    const struct word *words;
    uint32_t count;
    bool bits;
};

#define LIST(words, bits)                                                                                    \
    { words, (uint32_t)(sizeof(words) / sizeof((words)[0])), bits }
static const struct list lists[MESSAGE_VALUES_COUNT] = {
    [MESSAGE_VALUES_NUMBER] = {NULL, 0u, false},
    [MESSAGE_VALUES_STATE] = LIST(states, false),
    [MESSAGE_VALUES_FAULTS] = LIST(faults, true),
    [MESSAGE_VALUES_WARNINGS] = LIST(warnings, true),
    [MESSAGE_VALUES_GAP_STAGE] = LIST(gap_stages, false),
    [MESSAGE_VALUES_REFUSAL] = LIST(refusals, false),
    [MESSAGE_VALUES_PARAMETER_STATUS] = LIST(parameter_statuses, false),
    [MESSAGE_VALUES_PARAMETER_ACTION] = LIST(actions, false),
    [MESSAGE_VALUES_TRANSFER_KIND] = LIST(transfer_kinds, false),
    [MESSAGE_VALUES_TRANSFER_STATE] = LIST(transfer_states, false),
    [MESSAGE_VALUES_TRANSFER_ERROR] = LIST(transfer_errors, false),
    [MESSAGE_VALUES_BEND_FLAGS] = LIST(bend_flags, true),
    [MESSAGE_VALUES_MESSAGE_NUMBER] = {NULL, MESSAGE_NUMBER_MOST + 1u, false},
};

uint32_t message_values_count(enum message_values values) {
    return lists[values].count;
}

bool message_values_are_bits(enum message_values values) {
    return lists[values].bits;
}

static const struct word *word_of(enum message_values values, uint32_t value) {
    return lists[values].words != NULL && value < lists[values].count ? &lists[values].words[value] : NULL;
}

const char *message_value_name(enum message_values values, uint32_t value) {
    const struct word *word = word_of(values, value);
    enum message_id id;
    if (values == MESSAGE_VALUES_MESSAGE_NUMBER && message_find(value, &id)) {
        return messages[id].name;
    }
    return word != NULL ? word->name : NULL;
}

const char *message_value_text(enum message_values values, uint32_t value) {
    const struct word *word = word_of(values, value);
    if (values == MESSAGE_VALUES_GAP_STAGE && word != NULL) {
        return gap_monitor_stage_text((enum gap_monitor_stage)value);
    }
    return word != NULL ? word->text : NULL;
}
