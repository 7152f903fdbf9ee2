/* The messages that a controller puts on the CAN bus, and which columns of a run log they carry. One table;
 * little-endian bits, 11-bit identifiers with the node in the lowest four. */
#ifndef TRIBEND_CAN_LAYOUT_H
#define TRIBEND_CAN_LAYOUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "log/event_rows.h"

#define CAN_NODE_BITS 4
#define CAN_FIELDS_MAX 8

/* message, identifier of node 0, bytes */
#define CAN_MESSAGES(X)                                                                                      \
    X(PRESSURES, 0x100, 8)                                                                                   \
    X(TARGETS, 0x110, 6)                                                                                     \
    X(VALVES, 0x120, 7)                                                                                      \
    X(TIP_POSITION, 0x130, 8)                                                                                \
    X(TIP_ORIENTATION, 0x140, 8)

/* message, column, first bit, bits, signed, SI a bit */
#define CAN_FIELDS(X)                                                                                        \
    X(PRESSURES, p1_pa, 0, 16, true, 4.0)                                                                    \
    X(PRESSURES, p2_pa, 16, 16, true, 4.0)                                                                   \
    X(PRESSURES, p3_pa, 32, 16, true, 4.0)                                                                   \
    X(PRESSURES, supply_pa, 48, 16, true, 4.0)                                                               \
    X(TARGETS, p1_cmd_pa, 0, 16, true, 4.0)                                                                  \
    X(TARGETS, p2_cmd_pa, 16, 16, true, 4.0)                                                                 \
    X(TARGETS, p3_cmd_pa, 32, 16, true, 4.0)                                                                 \
    X(VALVES, valve1, 0, 16, false, 1e-4)                                                                    \
    X(VALVES, valve2, 16, 16, false, 1e-4)                                                                   \
    X(VALVES, valve3, 32, 16, false, 1e-4)                                                                   \
    X(VALVES, state, 48, 8, false, 1.0)                                                                      \
    X(TIP_POSITION, tip_x_m, 0, 16, true, 1e-5)                                                              \
    X(TIP_POSITION, tip_y_m, 16, 16, true, 1e-5)                                                             \
    X(TIP_POSITION, tip_z_m, 32, 16, true, 1e-5)                                                             \
    X(TIP_POSITION, tip_quality, 48, 16, false, 1.0)                                                         \
    X(TIP_ORIENTATION, tip_qw, 0, 16, true, 1.0 / 32767.0)                                                   \
    X(TIP_ORIENTATION, tip_qx, 16, 16, true, 1.0 / 32767.0)                                                  \
    X(TIP_ORIENTATION, tip_qy, 32, 16, true, 1.0 / 32767.0)                                                  \
    X(TIP_ORIENTATION, tip_qz, 48, 16, true, 1.0 / 32767.0)

#define CAN_MESSAGE_ENUM(message, identifier, bytes) CAN_##message,
enum can_message { CAN_MESSAGES(CAN_MESSAGE_ENUM) CAN_MESSAGE_COUNT };
#undef CAN_MESSAGE_ENUM

/* The message and the node of an identifier; false: none of ours. */
bool can_layout_find(uint32_t identifier, enum can_message *message, unsigned *node);
size_t can_layout_bytes(enum can_message message);
/* Columns out of at least can_layout_bytes() of data; returns how many. */
size_t can_layout_decode(enum can_message message, const uint8_t *data,
                         struct event_value values[CAN_FIELDS_MAX]);

#endif
