/* A frame in words: which message it is, from or to which board, and what its fields say. */
#ifndef TRIBEND_MESSAGE_DECODE_H
#define TRIBEND_MESSAGE_DECODE_H

#include <jansson.h>

#include "comms/codec.h"

enum message_decode_status {
    MESSAGE_DECODED = 0,
    MESSAGE_OF_OTHERS,   /* no identifier of ours */
    MESSAGE_WRONG_LENGTH /* ours, with another number of bytes: another version of the protocol? */
};

struct message_decoded {
    enum message_id id;
    unsigned node;
    union message message;
    struct message_trouble trouble;
};

enum message_decode_status message_decode(const struct hal_can_frame *frame, struct message_decoded *decoded);
/* "BEND from node 1: bend 0.6 rad, direction 0.5 rad, flags MEASURED, step 12"; cut where `bytes` end. */
void message_decoded_text(const struct message_decoded *decoded, char *text, size_t bytes);
/* {"message": "BEND", "node": 1, "fields": {"bend": 0.6, ..., "flags": ["MEASURED"], "step": 12}}: a number
 * without a value is null, a named value its name, one of 64 bits a string such as "0x0123456789abcdef". NULL: no memory. */
json_t *message_decoded_json(const struct message_decoded *decoded);

#endif
