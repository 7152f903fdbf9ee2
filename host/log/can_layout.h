/* Which columns of a run log the messages of a board carry. Their bits are firmware/comms/messages.def's. */
#ifndef TRIBEND_CAN_LAYOUT_H
#define TRIBEND_CAN_LAYOUT_H

#include "comms/codec.h"
#include "log/event_rows.h"

#define CAN_COLUMNS_MAX 24

/* The message and the node of an identifier; false: none that carries columns. */
bool can_layout_find(uint32_t identifier, enum message_id *id, unsigned *node);
/* Those that have a value; returns how many. `tip` false: without the tip sensor's. */
size_t can_layout_columns(enum message_id id, const union message *message, bool tip,
                          struct event_value values[CAN_COLUMNS_MAX]);

#endif
