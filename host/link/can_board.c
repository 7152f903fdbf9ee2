#include "link/can_board.h"

#include <string.h>
#include <time.h>

#include "control/crc32.h"
#include "program/program.h"

#define ANSWER_US 150000
#define SAVE_US 5000000
#define TIMES 12
#define BUSY_US 20000
#define ALL_PARAMETERS 65535u
#define CHUNK_US 500 /* two frames in a control step: as many as the board takes */
#define LATE_US 2000
#define NUDGE_US 200000
#define TRANSFER_PATIENCE_US 5000000
#define RESET_US 3000000
#define RESET_SLICE_US 100000

static void pause_us(int64_t us) {
    const struct timespec pause = {.tv_sec = us / 1000000, .tv_nsec = us % 1000000 * 1000};
    (void)nanosleep(&pause, NULL);
}

/* --- parameters */

/* An answer that belongs to this request. */
static bool await(struct can_link *link, int64_t timeout_us, uint32_t parameter, uint32_t action,
                  struct message_parameter_value *value) {
    const int64_t due_us = program_now_us() + timeout_us;
    struct can_link_answer answer;
    for (int64_t left_us = timeout_us; left_us > 0; left_us = due_us - program_now_us()) {
        if (!can_link_answer(link, left_us, &answer)) {
            return false;
        }
        *value = answer.message.parameter_value;
        if (answer.id == MESSAGE_PARAMETER_VALUE && value->parameter == parameter &&
            value->action == action) {
            return true;
        }
    }
    return false;
}

static enum can_board_result request(struct can_link *link, enum message_id id, const union message *message,
                                     uint32_t parameter, uint32_t action, int64_t timeout_us,
                                     struct message_parameter_value *value) {
    can_link_forget_answers(link);
    for (int i = 0; i < TIMES; i++) {
        (void)can_link_post(link, id, message);
        if (!await(link, timeout_us, parameter, action, value)) {
            continue;
        }
        if (value->status != PARAMETER_BUSY) {
            return value->status == PARAMETER_OK ? CAN_BOARD_OK : CAN_BOARD_REFUSED;
        }
        pause_us(BUSY_US);
    }
    return CAN_BOARD_SILENT;
}

enum can_board_result can_board_get(struct can_link *link, enum parameter_index parameter, uint32_t *value) {
    const union message message = {.parameter_get = {.parameter = parameter_row(parameter)->id}};
    struct message_parameter_value answer;
    const enum can_board_result result =
        request(link, MESSAGE_PARAMETER_GET, &message, message.parameter_get.parameter, NODE_ACTION_NONE,
                ANSWER_US, &answer);
    *value = result == CAN_BOARD_SILENT ? 0u : answer.value;
    return result;
}

enum can_board_result can_board_set(struct can_link *link, enum parameter_index parameter, uint32_t *value,
                                    enum parameter_status *status) {
    const union message message = {
        .parameter_set = {.parameter = parameter_row(parameter)->id, .value = *value}};
    struct message_parameter_value answer = {.status = PARAMETER_BUSY, .value = *value};
    const enum can_board_result result =
        request(link, MESSAGE_PARAMETER_SET, &message, message.parameter_set.parameter, NODE_ACTION_NONE,
                ANSWER_US, &answer);
    *status = (enum parameter_status)answer.status;
    *value = answer.value;
    return result;
}

enum can_board_result can_board_act(struct can_link *link, enum node_action action,
                                    enum parameter_status *status) {
    const union message message = {.parameter_action = {.action = (uint8_t)action}};
    struct message_parameter_value answer = {.status = PARAMETER_BUSY};
    const enum can_board_result result =
        request(link, MESSAGE_PARAMETER_ACTION, &message, ALL_PARAMETERS, (uint32_t)action, SAVE_US, &answer);
    *status = (enum parameter_status)answer.status;
    return result;
}

/* --- transfers */

struct sending {
    struct can_link *link;
    const uint8_t *image;
    uint32_t bytes;
    uint32_t next;  /* offset of the next chunk to go */
    uint32_t limit; /* room ends here */
    struct message_transfer_state last;
    struct can_board_transfer *transfer;
    int64_t heard_us;
    int64_t due_us; /* when the next chunk may go */
};

/* The board's steps go on while we sleep too long: what was late is made up, within its queue. */
static void keep_pace(struct sending *sending) {
    const int64_t time_us = program_now_us();
    sending->due_us += CHUNK_US;
    if (sending->due_us < time_us - LATE_US) {
        sending->due_us = time_us - LATE_US;
    }
    if (sending->due_us > time_us) {
        pause_us(sending->due_us - time_us);
    }
}

static void send_chunk(struct sending *sending) {
    union message message = {.transfer_data = {.chunk = (uint8_t)(sending->next / MESSAGE_CHUNK_BYTES)}};
    for (uint32_t i = 0; i < MESSAGE_CHUNK_BYTES && sending->next + i < sending->bytes; i++) {
        message.transfer_data.data |= (uint64_t)sending->image[sending->next + i] << (8u * i);
    }
    if (can_link_post(sending->link, MESSAGE_TRANSFER_DATA, &message)) {
        sending->next += MESSAGE_CHUNK_BYTES;
        sending->transfer->frames++;
    }
    keep_pace(sending);
}

/* True: the state of a transfer came. */
static bool hear(struct sending *sending, int64_t timeout_us) {
    struct can_link_answer answer;
    if (!can_link_answer(sending->link, timeout_us, &answer) || answer.id != MESSAGE_TRANSFER_STATE) {
        return false;
    }
    sending->last = answer.message.transfer_state;
    sending->heard_us = program_now_us();
    sending->transfer->sent = sending->last.offset < sending->bytes ? sending->last.offset : sending->bytes;
    sending->transfer->error = (enum transfer_error)sending->last.error;
    sending->transfer->state = (enum transfer_state)sending->last.state;
    return true;
}

static bool has_failed(const struct sending *sending) {
    return sending->last.state == TRANSFER_FAILED || sending->last.error != TRANSFER_ERROR_NONE;
}

static enum can_board_result begin(struct sending *sending, enum transfer_kind kind, bool any_module) {
    const union message message = {
        .transfer_begin = {.kind = (uint8_t)kind, .any_module = any_module, .bytes = sending->bytes}};
    can_link_forget_answers(sending->link);
    for (int i = 0; i < TIMES; i++) {
        (void)can_link_post(sending->link, MESSAGE_TRANSFER_BEGIN, &message);
        const int64_t due_us = program_now_us() + NUDGE_US;
        for (int64_t left_us = NUDGE_US; left_us > 0; left_us = due_us - program_now_us()) {
            if (!hear(sending, left_us)) {
                continue;
            }
            if (sending->last.error != TRANSFER_ERROR_NONE && sending->last.error != TRANSFER_ERROR_BUSY) {
                return CAN_BOARD_REFUSED;
            }
            if (sending->last.state == TRANSFER_RECEIVING && sending->last.kind == (uint8_t)kind) {
                return CAN_BOARD_OK;
            }
        }
    }
    return sending->last.error != TRANSFER_ERROR_NONE ? CAN_BOARD_REFUSED : CAN_BOARD_SILENT;
}

/* The board says where it stands; what it misses goes again. */
static void follow(struct sending *sending) {
    const uint32_t offset = sending->last.offset;
    sending->limit = offset + sending->last.room;
    if (sending->next > sending->limit || sending->next < offset) {
        sending->next = offset;
    }
}

static void go_back(struct sending *sending) {
    if (sending->next > sending->last.offset) {
        sending->transfer->again += sending->next - sending->last.offset;
        sending->next = sending->last.offset;
    }
}

/* All of the data; the end is not said yet. */
static enum can_board_result stream(struct sending *sending, bool (*progress)(void *, uint32_t, uint32_t),
                                    void *context) {
    sending->heard_us = program_now_us();
    follow(sending);
    while (sending->last.offset < sending->bytes) {
        while (hear(sending, 0)) {
            follow(sending);
        }
        if (has_failed(sending)) {
            return CAN_BOARD_REFUSED;
        }
        if (!progress(context, sending->transfer->sent, sending->bytes)) {
            return CAN_BOARD_STOPPED;
        }
        if (sending->next < sending->bytes && sending->next + MESSAGE_CHUNK_BYTES <= sending->limit) {
            send_chunk(sending);
        } else if (hear(sending, NUDGE_US)) {
            follow(sending);
        } else if (program_now_us() - sending->heard_us > TRANSFER_PATIENCE_US) {
            return CAN_BOARD_SILENT;
        } else {
            go_back(sending);
        }
    }
    return CAN_BOARD_OK;
}

static enum can_board_result end(struct sending *sending) {
    const union message message = {.transfer_end = {.crc = crc32_update(0u, sending->image, sending->bytes)}};
    sending->heard_us = program_now_us();
    do {
        if (sending->last.state == TRANSFER_RECEIVING) {
            (void)can_link_post(sending->link, MESSAGE_TRANSFER_END, &message);
        }
        (void)hear(sending, NUDGE_US);
        if (sending->last.state == TRANSFER_DONE) {
            return CAN_BOARD_OK;
        }
        if (has_failed(sending)) {
            return CAN_BOARD_REFUSED;
        }
    } while (program_now_us() - sending->heard_us < TRANSFER_PATIENCE_US);
    return CAN_BOARD_SILENT;
}

enum can_board_result can_board_send(struct can_link *link, enum transfer_kind kind, const uint8_t *image,
                                     uint32_t bytes, bool any_module,
                                     bool (*progress)(void *context, uint32_t sent, uint32_t bytes),
                                     void *context, struct can_board_transfer *transfer) {
    struct sending sending = {.link = link, .image = image, .bytes = bytes, .transfer = transfer};
    memset(transfer, 0, sizeof *transfer);
    enum can_board_result result = begin(&sending, kind, any_module);
    result = result == CAN_BOARD_OK ? stream(&sending, progress, context) : result;
    return result == CAN_BOARD_OK ? end(&sending) : result;
}

/* --- a new start */

bool can_board_reset(struct can_link *link, struct can_link_identity *identity) {
    const union message message = {.reset = {.key = MESSAGE_RESET_KEY}};
    struct can_link_counters before, now;
    can_link_count(link, &before);
    const int64_t due_us = program_now_us() + RESET_US;
    do {
        (void)can_link_post(link, MESSAGE_RESET, &message);
        pause_us(RESET_SLICE_US);
        can_link_count(link, &now);
    } while (now.restarts == before.restarts && program_now_us() < due_us);
    return now.restarts != before.restarts && can_link_identify(link, RESET_US, identity);
}
