/* Sending an image to a board, with its progress on the terminal and its failures in words. */
#ifndef TRIBEND_TRANSFER_H
#define TRIBEND_TRANSFER_H

#include "cli/commands.h"
#include "comms/store.h"

/* Returns an exit code, with the message printed. */
int transfer_image(struct bus *bus, const struct bus_options *options, enum transfer_kind kind,
                   const uint8_t *image, uint32_t bytes, bool any_module);
/* "it did not answer", or its own words. */
int transfer_no_board(const struct bus_options *options);

#endif
