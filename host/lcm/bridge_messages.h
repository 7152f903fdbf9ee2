/* Between the board's reports and commands and the bytes of LCM messages; generated code packs them. Numbers
 * saturate at their type's range; what the board does not have is BRIDGE_LACKS. Not here: when they go
 * (bridge.h). */
#ifndef TRIBEND_BRIDGE_MESSAGES_H
#define TRIBEND_BRIDGE_MESSAGES_H

#include "lcm/bridge.h"

#define BRIDGE_MESSAGE_BYTES 512 /* of the longest */

/* Each returns how many bytes of `data` it filled, negative where they do not fit. */
int bridge_encode_status(const struct link_report *report, int64_t utime_us,
                         uint8_t data[BRIDGE_MESSAGE_BYTES]);
int bridge_encode_tip(const struct link_report *report, int64_t utime_us, int64_t measured_us,
                      uint8_t data[BRIDGE_MESSAGE_BYTES]);
int bridge_encode_gap(const struct gap_monitor_report *gap, int64_t utime_us,
                      uint8_t data[BRIDGE_MESSAGE_BYTES]);
int bridge_encode_parameter(int request, const struct message_parameter_value *value, int status,
                            int64_t utime_us, uint8_t data[BRIDGE_MESSAGE_BYTES]);
int bridge_encode_bridge(const struct bridge *bridge, int64_t utime_us, uint8_t data[BRIDGE_MESSAGE_BYTES]);

/* False: another type, an unknown kind, or a number that its CAN message cannot carry. */
bool bridge_decode_command(const void *data, uint32_t bytes, struct controller_command *command,
                           int64_t *sent_us);
bool bridge_decode_parameter(const void *data, uint32_t bytes, int *request, uint32_t *parameter,
                             uint32_t *value);

/* The CAN message of a command; `faults` are those that its sender saw. */
enum message_id bridge_command_message(const struct controller_command *command, uint32_t faults,
                                       uint8_t sequence, union message *message);
enum message_id bridge_request_message(int request, uint32_t parameter, uint32_t value,
                                       union message *message);

#endif
