#include "log/can_layout.h"

#include <math.h>
#include <string.h>

#include "messages/message_words.h"

struct column {
    enum message_id id;
    const char *field;
    const char *column;
};

#define TIP_PREFIX "tip_"

/* message, field, column */
static const struct column columns[] = {
    {MESSAGE_PRESSURES, "pressure_1", "p1_pa"},
    {MESSAGE_PRESSURES, "pressure_2", "p2_pa"},
    {MESSAGE_PRESSURES, "pressure_3", "p3_pa"},
    {MESSAGE_TARGETS, "target_1", "p1_cmd_pa"},
    {MESSAGE_TARGETS, "target_2", "p2_cmd_pa"},
    {MESSAGE_TARGETS, "target_3", "p3_cmd_pa"},
    {MESSAGE_DUTIES, "duty_1", "valve1"},
    {MESSAGE_DUTIES, "duty_2", "valve2"},
    {MESSAGE_DUTIES, "duty_3", "valve3"},
    {MESSAGE_DUTIES, "supply", "supply_pa"},
    {MESSAGE_STATUS, "state", "state"},
    {MESSAGE_TIP_POSITION, "x", "tip_x_m"},
    {MESSAGE_TIP_POSITION, "y", "tip_y_m"},
    {MESSAGE_TIP_POSITION, "z", "tip_z_m"},
    {MESSAGE_TIP_ORIENTATION, "w", "tip_qw"},
    {MESSAGE_TIP_ORIENTATION, "x", "tip_qx"},
    {MESSAGE_TIP_ORIENTATION, "y", "tip_qy"},
    {MESSAGE_TIP_ORIENTATION, "z", "tip_qz"},
    {MESSAGE_TELEMETRY, "pressure_1", "p1_pa"},
    {MESSAGE_TELEMETRY, "pressure_2", "p2_pa"},
    {MESSAGE_TELEMETRY, "pressure_3", "p3_pa"},
    {MESSAGE_TELEMETRY, "supply", "supply_pa"},
    {MESSAGE_TELEMETRY, "target_1", "p1_cmd_pa"},
    {MESSAGE_TELEMETRY, "target_2", "p2_cmd_pa"},
    {MESSAGE_TELEMETRY, "target_3", "p3_cmd_pa"},
    {MESSAGE_TELEMETRY, "duty_1", "valve1"},
    {MESSAGE_TELEMETRY, "duty_2", "valve2"},
    {MESSAGE_TELEMETRY, "duty_3", "valve3"},
    {MESSAGE_TELEMETRY, "state", "state"},
    {MESSAGE_TELEMETRY, "tip_x", "tip_x_m"},
    {MESSAGE_TELEMETRY, "tip_y", "tip_y_m"},
    {MESSAGE_TELEMETRY, "tip_z", "tip_z_m"},
    {MESSAGE_TELEMETRY, "tip_qw", "tip_qw"},
    {MESSAGE_TELEMETRY, "tip_qx", "tip_qx"},
    {MESSAGE_TELEMETRY, "tip_qy", "tip_qy"},
    {MESSAGE_TELEMETRY, "tip_qz", "tip_qz"},
    {MESSAGE_TELEMETRY, "tip_status", "tip_status"},
};
#define COLUMNS (sizeof columns / sizeof columns[0])

static const char *column_of(enum message_id id, const char *field) {
    for (size_t c = 0; c < COLUMNS; c++) {
        if (columns[c].id == id && strcmp(columns[c].field, field) == 0) {
            return columns[c].column;
        }
    }
    return NULL;
}

static bool carries_columns(enum message_id id) {
    for (size_t c = 0; c < COLUMNS; c++) {
        if (columns[c].id == id) {
            return true;
        }
    }
    return false;
}

bool can_layout_find(uint32_t identifier, enum message_id *id, unsigned *node) {
    *node = identifier & MESSAGE_NODE_MOST;
    return message_find(identifier >> MESSAGE_NODE_BITS, id) && carries_columns(*id);
}

size_t can_layout_columns(enum message_id id, const union message *message, bool tip,
                          struct event_value values[CAN_COLUMNS_MAX]) {
    const struct message_row *row = message_row(id);
    size_t count = 0;
    for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
        const char *column = column_of(id, message_field_words(f)->name);
        const double value = message_field_number(f, message);
        const bool left_out =
            column == NULL || isnan(value) || (!tip && strncmp(column, TIP_PREFIX, strlen(TIP_PREFIX)) == 0);
        if (!left_out && count < CAN_COLUMNS_MAX) {
            values[count++] = (struct event_value){column, value};
        }
    }
    return count;
}
