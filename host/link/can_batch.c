#include "link/can_batch.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

#include "link/transport.h"

static void read_control(struct msghdr *message, struct can_batch_frame *frame) {
    for (struct cmsghdr *control = CMSG_FIRSTHDR(message); control != NULL;
         control = CMSG_NXTHDR(message, control)) {
        if (control->cmsg_level != SOL_SOCKET) {
            continue;
        }
        if (control->cmsg_type == SCM_TIMESTAMPNS) {
            struct timespec time;
            memcpy(&time, CMSG_DATA(control), sizeof time);
            frame->time_us = (int64_t)time.tv_sec * 1000000 + time.tv_nsec / 1000;
        } else if (control->cmsg_type == SO_RXQ_OVFL) {
            memcpy(&frame->dropped, CMSG_DATA(control), sizeof frame->dropped);
            frame->has_dropped = true;
        }
    }
}

static int read_messages(int descriptor, struct mmsghdr *messages) {
    int count;
    do {
        count = recvmmsg(descriptor, messages, CAN_BATCH_FRAMES, MSG_DONTWAIT, NULL);
    } while (count < 0 && errno == EINTR);
    return count;
}

static bool fill(struct can_batch *batch, int descriptor) {
    struct mmsghdr messages[CAN_BATCH_FRAMES];
    struct iovec parts[CAN_BATCH_FRAMES];
    memset(messages, 0, sizeof messages);
    for (size_t i = 0; i < CAN_BATCH_FRAMES; i++) {
        parts[i] = (struct iovec){.iov_base = &batch->frame[i].can, .iov_len = sizeof batch->frame[i].can};
        messages[i].msg_hdr = (struct msghdr){.msg_iov = &parts[i],
                                              .msg_iovlen = 1,
                                              .msg_control = batch->control[i].bytes,
                                              .msg_controllen = sizeof batch->control[i].bytes};
    }
    const int count = read_messages(descriptor, messages);
    batch->next = 0;
    batch->count = count > 0 ? (size_t)count : 0;
    batch->drained = batch->count < CAN_BATCH_FRAMES;
    for (size_t i = 0; i < batch->count; i++) {
        struct can_batch_frame *frame = &batch->frame[i];
        frame->bytes = messages[i].msg_len;
        frame->time_us = 0;
        frame->has_dropped = false;
        read_control(&messages[i].msg_hdr, frame);
        if (frame->time_us == 0) {
            frame->time_us = i > 0 ? batch->frame[0].time_us : transport_now_us();
        }
    }
    return count > 0;
}

const struct can_batch_frame *can_batch_next(struct can_batch *batch, int descriptor) {
    if (batch->next == batch->count && batch->drained) {
        batch->drained = false;
        errno = EAGAIN;
        return NULL;
    }
    if (batch->next == batch->count && !fill(batch, descriptor)) {
        batch->drained = false;
        return NULL;
    }
    return &batch->frame[batch->next++];
}
