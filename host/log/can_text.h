/* CAN frames as text, as can-utils write and take them:
 *
 *     (1700000000.123456) can0 051#0102030405060708    candump -L
 *     (000.123456)  can0  051   [8]  01 02 03 04       candump, with or without a time
 *     051#0102030405060708                             cansend
 *
 * CAN FD with `##` and a digit of flags, or with its length in two digits. */
#ifndef TRIBEND_CAN_TEXT_H
#define TRIBEND_CAN_TEXT_H

#include "hal.h"

#define CAN_TEXT_INTERFACE_BYTES 16

struct can_text {
    bool has_time;
    int64_t time_us;
    char interface[CAN_TEXT_INTERFACE_BYTES]; /* "": none */
    bool remote;
    struct hal_can_frame frame;
};

/* A line of candump -L, without its end. What is wrong with it, or NULL. */
const char *can_text_parse_log(const char *line, struct can_text *text);
/* A line of any of these. */
const char *can_text_parse(const char *line, struct can_text *text);

#endif
