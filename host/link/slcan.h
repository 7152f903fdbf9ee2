/* The ASCII protocol of Lawicel's CAN232 (SLCAN), as slcand and most USB adapters have it:
 *
 *     tIIIL<data>CR  TIIIIIIIIL<data>CR    a frame, 11 or 29 bits; r and R: remote
 *     dIIIL<data>CR  bIIIL<data>CR         an FD frame, without and with the faster data phase (newer
 * adapters) SnCR OCR CCR                         bit rate, open, close; answers: CR, z, Z, or BEL for no
 *
 * L is the length code; a time of four digits may stand behind the data. Not here: the terminal (slcan.c). */
#ifndef TRIBEND_SLCAN_H
#define TRIBEND_SLCAN_H

#include <stddef.h>

#include "hal.h"

#define SLCAN_LINE_BYTES 160 /* more than an FD frame's line */

struct slcan_reader {
    char line[SLCAN_LINE_BYTES];
    size_t bytes;
};

enum slcan_result { SLCAN_MORE = 0, SLCAN_FRAME, SLCAN_MALFORMED };

enum slcan_result slcan_take(struct slcan_reader *reader, char byte, struct hal_can_frame *frame);
/* Returns the bytes of the line, CR included. An FD frame's length must be one that FD has. */
size_t slcan_format(const struct hal_can_frame *frame, char line[SLCAN_LINE_BYTES]);

#endif
