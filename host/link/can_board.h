/* What a host asks of a board beside motion: parameters, images, a new start; each request with its answer.
 *
 * Numbers in, numbers out; no file and no word of the terminal. Requests are said again where no answer
 * comes. Not here: the link itself (can_link.h), files (host/cli). */
#ifndef TRIBEND_CAN_BOARD_H
#define TRIBEND_CAN_BOARD_H

#include "comms/node.h"
#include "link/can_link.h"

enum can_board_result {
    CAN_BOARD_OK = 0,
    CAN_BOARD_SILENT,  /* no answer came */
    CAN_BOARD_REFUSED, /* `status` or `error` of the answer says why */
    CAN_BOARD_STOPPED  /* the caller wanted to */
};

/* `value`: an integer, or the bits of a float. */
enum can_board_result can_board_get(struct can_link *link, enum parameter_index parameter, uint32_t *value);
/* `value` becomes what the board then has. */
enum can_board_result can_board_set(struct can_link *link, enum parameter_index parameter, uint32_t *value,
                                    enum parameter_status *status);
enum can_board_result can_board_act(struct can_link *link, enum node_action action,
                                    enum parameter_status *status);

/* How a transfer went, and how far it came. */
struct can_board_transfer {
    enum transfer_error error;
    enum transfer_state state;
    uint32_t sent; /* bytes, of those that the board has taken */
    uint64_t frames;
    uint64_t again; /* bytes that the board asked for again */
};
/* Send an image. `progress` is called now and then, and returns false to stop; the board then keeps what it
 * has. */
enum can_board_result can_board_send(struct can_link *link, enum transfer_kind kind, const uint8_t *image,
                                     uint32_t bytes, bool any_module,
                                     bool (*progress)(void *context, uint32_t sent, uint32_t bytes),
                                     void *context, struct can_board_transfer *transfer);
/* Start the board anew; only while vented. True: it came back and said who it is. */
bool can_board_reset(struct can_link *link, struct can_link_identity *identity);

#endif
