#include "link/can_link.h"

#include <errno.h>
#include <linux/can/error.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#include "comms/node.h"
#include "program/program.h"

#define TICK_US 5000
#define HEARTBEAT_US 50000
#define SENT_LEAST 3u /* of each command: a frame may be lost */
#define START_US                                                                                             \
    700000 /* for so long a command that did not start its motion is said again: the board may still         \
              take our sequence for a stale one of the host before us */
#define START_OVER_TIMEOUT_US 200000
#define REPEAT_US 20000
#define IDENTIFY_US 300000
#define PAUSE_LEAST_US 50000
#define PAUSE_MOST_US 2000000
#define FRAMES_A_TURN 512
#define NAME_PIECES 5u
#define NAME_PIECE_BYTES 7u
#define ALL_PIECES ((1u << NAME_PIECES) - 1u)
#define IDENTITY_HEAD (1u << NAME_PIECES)
#define IDENTITY_HASH (2u << NAME_PIECES)
#define ALL_OF_IDENTITY (ALL_PIECES | IDENTITY_HEAD | IDENTITY_HASH)
#define PROTOCOL_MASK 15u

/* --- frames out; the lock is held */

static bool lose_bus(struct can_link *link) {
    (void)snprintf(link->error, sizeof link->error, "%s", strerror(errno));
    transport_close(&link->transport);
    link->connected = false;
    link->pause_us = PAUSE_LEAST_US;
    link->reopen_us = program_now_us() + link->pause_us;
    return false;
}

static bool send_frame(struct can_link *link, const struct hal_can_frame *frame) {
    enum transport_result result = TRANSPORT_NOTHING;
    if (link->connected) {
        result = link->transport.send(&link->transport, frame);
    }
    if (result == TRANSPORT_DONE) {
        link->counters.sent++;
        return true;
    }
    link->counters.unsent++;
    return result == TRANSPORT_GONE ? lose_bus(link) : false;
}

/* All commands but TRANSFER_DATA begin with sequence and protocol. */
static bool send_message(struct can_link *link, enum message_id id, const union message *message) {
    struct message_trouble trouble = {0};
    struct hal_can_frame frame;
    message_frame(id, link->node, message, &frame, &trouble);
    link->counters.saturated += trouble.out_of_range;
    if (id != MESSAGE_TRANSFER_DATA) {
        frame.data[0] = command_sequence_next(&link->sequence);
        frame.data[1] = (uint8_t)((frame.data[1] & ~PROTOCOL_MASK) | MESSAGE_PROTOCOL);
    }
    return send_frame(link, &frame);
}

static bool send_command(struct can_link *link) {
    const struct controller_command *command = &link->command;
    union message message = {0};
    switch (command->kind) {
    case COMMAND_VENT:
        return send_message(link, MESSAGE_VENT, &message);
    case COMMAND_HOLD:
        return send_message(link, MESSAGE_HOLD, &message);
    case COMMAND_PRESSURE:
        message.pressure_command.pressure_1 = command->pressure_pa[0];
        message.pressure_command.pressure_2 = command->pressure_pa[1];
        message.pressure_command.pressure_3 = command->pressure_pa[2];
        return send_message(link, MESSAGE_PRESSURE_COMMAND, &message);
    case COMMAND_BEND:
        message.bend_command.bend = command->bend_rad;
        message.bend_command.direction = (float)remainder((double)command->direction_rad, 2.0 * M_PI);
        message.bend_command.co_contraction = command->co_contraction_pa;
        return send_message(link, MESSAGE_BEND_COMMAND, &message);
    case COMMAND_CLEAR:
        message.clear.key = MESSAGE_CLEAR_KEY;
        message.clear.faults = link->assembly.report.status.faults;
        return send_message(link, MESSAGE_CLEAR, &message);
    case COMMAND_NONE:
    default:
        return true;
    }
}

static bool is_kept_alive(const struct controller_command *command) {
    return command->kind == COMMAND_HOLD || command->kind == COMMAND_PRESSURE ||
           command->kind == COMMAND_BEND;
}

/* A motion never starts out of a command that is older than START_US. */
static bool is_said_again(const struct can_link *link, int64_t time_us) {
    const enum supervisor_state state = link->assembly.report.status.state;
    const bool runs = state == SUPERVISOR_ACTIVE || state == SUPERVISOR_HOLD;
    const enum controller_command_kind kind = link->command.kind;
    if (kind == COMMAND_HOLD && state == SUPERVISOR_ACTIVE && !link->silent) {
        return true; /* another host's command came between; a hold starts nothing */
    }
    if (kind == COMMAND_NONE || kind == COMMAND_CLEAR || time_us >= link->commanded_us + link->start_us) {
        return false;
    }
    return link->times_sent < SENT_LEAST || (kind != COMMAND_VENT && !runs);
}

static void keep_alive(struct can_link *link, int64_t time_us) {
    const union message nothing = {0};
    if (is_said_again(link, time_us) && time_us >= link->repeat_us) {
        link->repeat_us = time_us + REPEAT_US;
        link->heartbeat_us = time_us + link->heartbeat_period_us;
        link->times_sent += send_command(link) ? 1u : 0u;
    }
    if (is_kept_alive(&link->command) && time_us >= link->heartbeat_us) {
        link->heartbeat_us = time_us + link->heartbeat_period_us;
        (void)send_message(link, MESSAGE_HOST_HEARTBEAT, &nothing);
    }
}

/* Who is not known is asked; so is who fell silent, for a socket's board answers only to who spoke to it. */
static void ask(struct can_link *link, int64_t time_us) {
    const union message nothing = {0};
    if ((!link->identity.known || link->silent) && time_us >= link->identify_us) {
        link->identify_us = time_us + IDENTIFY_US;
        (void)send_message(link, MESSAGE_IDENTIFY, &nothing);
    }
}

/* --- frames in; the lock is held */

static void put_report(struct can_link *link) {
    if (link->report_count == CAN_LINK_REPORTS) { /* the oldest goes */
        link->first_report = (link->first_report + 1) % CAN_LINK_REPORTS;
        link->report_count--;
        link->counters.dropped++;
    }
    link->reports[(link->first_report + link->report_count++) % CAN_LINK_REPORTS] = link->assembly.report;
}

static void put_answer(struct can_link *link, enum message_id id, const union message *message) {
    if (link->answer_count == CAN_LINK_ANSWERS) {
        link->first_answer = (link->first_answer + 1) % CAN_LINK_ANSWERS;
        link->answer_count--;
        link->counters.answers_dropped++;
    }
    link->answers[(link->first_answer + link->answer_count++) % CAN_LINK_ANSWERS] =
        (struct can_link_answer){.id = id, .message = *message};
}

static void take_name(struct can_link *link, const struct message_identity_name *name) {
    for (uint32_t i = 0; i < NAME_PIECE_BYTES && name->piece < NAME_PIECES; i++) {
        link->identity.module[name->piece * NAME_PIECE_BYTES + i] = (char)(name->text >> (8u * i) & 0xffu);
        link->name_pieces |= 1u << name->piece;
    }
}

static void take_identity(struct can_link *link, enum message_id id, const union message *message) {
    struct can_link_identity *identity = &link->identity;
    if (id == MESSAGE_IDENTITY) {
        identity->protocol = message->identity.protocol;
        identity->parameters_version = message->identity.parameters_version;
        identity->parameters = message->identity.parameters;
        identity->firmware = message->identity.firmware;
        link->name_pieces |= IDENTITY_HEAD;
    } else if (id == MESSAGE_IDENTITY_TABLE) {
        identity->table_hash = message->identity_table.table_hash;
        link->name_pieces |= IDENTITY_HASH;
    } else {
        take_name(link, &message->identity_name);
    }
    identity->known = link->name_pieces == ALL_OF_IDENTITY;
    if (identity->known && link->transport.listen_to != NULL) {
        link->transport.listen_to(&link->transport,
                                  link->node); /* who else is there was of interest till now */
    }
}

/* What came back may be another firmware. */
static void forget_identity(struct can_link *link) {
    link->identity.known = false;
    link->name_pieces = 0;
    link->identify_us = 0;
}

/* The board may take our first command for an old one of the host before us. */
static void take_refusal(struct can_link *link, const struct message_refusals *refusal) {
    if (refusal->count > 0 && refusal->reason == NODE_REFUSED_STALE && link->commanded_us > 0 &&
        command_sequence_refused(&link->sequence, refusal->step, (uint16_t)link->assembly.step, program_now_us())) {
        link->repeat_us = 0;
    }
}

static void take_message(struct can_link *link, enum message_id id, const union message *message) {
    const uint64_t restarts = link->assembly.restarts;
    link->counters.decoded++;
    link->latest[id] = *message;
    link->count[id]++;
    link->heard_us = program_now_us();
    if (link->silent) {
        link->silent = false;
        forget_identity(link);
    }
    if (can_assembly_take(&link->assembly, id, message)) {
        put_report(link);
    }
    if (link->assembly.restarts != restarts) {
        forget_identity(link);
    }
    link->counters.restarts = link->assembly.restarts;
    link->counters.missing = link->assembly.missing;
    if (id == MESSAGE_IDENTITY || id == MESSAGE_IDENTITY_TABLE || id == MESSAGE_IDENTITY_NAME) {
        take_identity(link, id, message);
    } else if (id == MESSAGE_PARAMETER_VALUE || id == MESSAGE_TRANSFER_STATE || id == MESSAGE_REFUSALS) {
        put_answer(link, id, message);
    }
    if (id == MESSAGE_REFUSALS) {
        take_refusal(link, &message->refusals);
    }
}

/* Another host's command to our board: from now on it is the stale one. VENT is taken whatever its sequence is. */
static void take_other_host(struct can_link *link, enum message_id id, const struct hal_can_frame *frame) {
    const union message nothing = {0};
    link->counters.other_hosts++;
    if (id == MESSAGE_VENT || message_row(id)->number >= message_row(MESSAGE_STATUS)->number ||
        frame->length != message_row(id)->bytes) {
        return;
    }
    command_sequence_pass(&link->sequence, frame->data[0], is_kept_alive(&link->command), program_now_us());
    while (link->sequence.leaps > 0) {
        (void)send_message(link, MESSAGE_HOST_HEARTBEAT, &nothing);
    }
}

static void take_frame(struct can_link *link, const struct hal_can_frame *frame) {
    const uint32_t node = frame->id & MESSAGE_NODE_MOST;
    struct message_trouble trouble = {0};
    union message message = {0};
    enum message_id id;
    link->counters.received++;
    if (frame->extended || !message_find(frame->id >> MESSAGE_NODE_BITS, &id)) {
        link->counters.foreign++;
        return;
    }
    const struct message_row *row = message_row(id);
    link->nodes_heard |= row->direction == MESSAGE_TO_HOST ? 1u << node : 0u;
    if (node != link->node) {
        link->counters.foreign++;
    } else if (row->direction == MESSAGE_TO_BOARD) {
        take_other_host(link, id, frame);
    } else if (frame->length != row->bytes) {
        link->counters.undecodable++;
    } else {
        message_unpack(id, frame->data, &message, &trouble);
        link->counters.undecodable += trouble.out_of_range > 0 ? 1u : 0u;
        if (trouble.out_of_range == 0) {
            take_message(link, id, &message);
        }
    }
}

static void take_error(struct can_link *link, uint32_t error_class) {
    link->counters.error_frames++;
    link->counters.bus_off += (error_class & CAN_ERR_BUSOFF) != 0 ? 1u : 0u;
}

/* True: there are more. */
static bool read_frames(struct can_link *link) {
    struct transport_frame frame;
    enum transport_result result = TRANSPORT_DONE;
    for (int i = 0; i < FRAMES_A_TURN && result == TRANSPORT_DONE; i++) {
        result = link->transport.receive(&link->transport, &frame);
        if (result == TRANSPORT_DONE && frame.is_error) {
            take_error(link, frame.error_class);
        } else if (result == TRANSPORT_DONE) {
            take_frame(link, &frame.frame);
        }
    }
    link->counters.overflowed = link->transport.overflowed;
    link->counters.malformed = link->transport.malformed;
    return result == TRANSPORT_GONE ? lose_bus(link) : result == TRANSPORT_DONE;
}

/* --- the thread */

/* What the transport counted goes on through its next life. */
static void reopen(struct can_link *link, int64_t time_us) {
    const uint64_t overflowed = link->counters.overflowed, malformed = link->counters.malformed;
    if (time_us < link->reopen_us) {
        return;
    }
    if (!transport_open(&link->transport, link->bus, link->error, sizeof link->error)) {
        link->pause_us = link->pause_us * 2 < PAUSE_MOST_US ? link->pause_us * 2 : PAUSE_MOST_US;
        link->reopen_us = time_us + link->pause_us;
        return;
    }
    link->transport.overflowed = overflowed;
    link->transport.malformed = malformed;
    link->connected = true;
    link->counters.reconnects++;
    forget_identity(link);
}

static void notice_silence(struct can_link *link, int64_t time_us) {
    if (!link->silent && link->heard_us > 0 && time_us - link->heard_us > CAN_LINK_SILENT_US) {
        link->silent = true;
        link->counters.silences++;
        link->identify_us = time_us;
    }
}

/* True: frames are waiting already. */
static bool turn(struct can_link *link) {
    const int64_t time_us = program_now_us();
    bool more = false;
    if (!link->connected) {
        reopen(link, time_us);
    }
    if (link->connected) {
        more = read_frames(link);
    }
    notice_silence(link, time_us);
    if (link->connected) {
        keep_alive(link, time_us);
    }
    if (link->connected) {
        ask(link, time_us);
    }
    (void)pthread_cond_broadcast(&link->changed);
    return more;
}

static void *run(void *context) {
    struct can_link *link = context;
    uint64_t count = 0;
    sigset_t all;
    (void)sigfillset(&all); /* Ctrl-C is the caller's */
    (void)pthread_sigmask(SIG_BLOCK, &all, NULL);
    for (;;) {
        (void)pthread_mutex_lock(&link->lock);
        const bool stop = link->stop;
        const bool more = !stop && turn(link);
        struct pollfd wait[3] = {{.fd = link->timer, .events = POLLIN},
                                 {.fd = link->wake, .events = POLLIN},
                                 {.fd = link->connected ? link->transport.descriptor : -1, .events = POLLIN}};
        (void)pthread_mutex_unlock(&link->lock);
        if (stop) {
            return NULL;
        }
        (void)poll(wait, 3, more ? 0 : -1);
        for (int i = 0; i < 2; i++) { /* both are only there to wake */
            if ((wait[i].revents & POLLIN) != 0 && read(wait[i].fd, &count, sizeof count) < 0 &&
                errno != EAGAIN) {
                return NULL;
            }
        }
    }
}

static void wake(struct can_link *link) {
    const uint64_t one = 1;
    (void)!write(link->wake, &one, sizeof one); /* full: it is awake */
}

/* --- opening */

static bool start_thread(struct can_link *link, char *error, size_t error_bytes) {
    const struct itimerspec tick = {.it_interval = {.tv_nsec = TICK_US * 1000L},
                                    .it_value = {.tv_nsec = TICK_US * 1000L}};
    pthread_condattr_t attributes;
    (void)pthread_mutex_init(&link->lock, NULL);
    (void)pthread_condattr_init(&attributes);
    (void)pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    (void)pthread_cond_init(&link->changed, &attributes);
    link->wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    link->timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    link->running = link->wake >= 0 && link->timer >= 0 &&
                    timerfd_settime(link->timer, 0, &tick, NULL) == 0 &&
                    pthread_create(&link->thread, NULL, run, link) == 0;
    if (!link->running) {
        (void)snprintf(error, error_bytes, "bus %s: no thread for it: %s", link->bus, strerror(errno));
    }
    return link->running;
}

bool can_link_open(struct can_link *link, const char *bus, uint32_t node, char *error, size_t error_bytes) {
    memset(link, 0, sizeof *link);
    link->node = node;
    link->wake = link->timer = -1;
    link->heartbeat_period_us = HEARTBEAT_US;
    link->start_us = START_US;
    command_sequence_start(&link->sequence, (uint8_t)program_now_us());
    can_assembly_init(&link->assembly);
    if (snprintf(link->bus, sizeof link->bus, "%s", bus) >= (int)sizeof link->bus) {
        (void)snprintf(error, error_bytes, "bus %s: its name is too long", bus);
        return false;
    }
    if (!transport_open(&link->transport, bus, error, error_bytes)) {
        return false;
    }
    link->connected = true;
    if (!start_thread(link, error, error_bytes)) {
        can_link_close(link);
        return false;
    }
    return true;
}

void can_link_close(struct can_link *link) {
    if (link->running) {
        (void)pthread_mutex_lock(&link->lock);
        link->stop = true;
        (void)pthread_mutex_unlock(&link->lock);
        wake(link);
        (void)pthread_join(link->thread, NULL);
        link->running = false;
    }
    transport_close(&link->transport);
    (void)close(link->wake);
    (void)close(link->timer);
}

/* --- the caller's side */

static struct timespec deadline(int64_t timeout_us) {
    const int64_t due_us = program_now_us() + timeout_us;
    return (struct timespec){.tv_sec = due_us / 1000000, .tv_nsec = due_us % 1000000 * 1000};
}

/* With the lock held; false once the time is over. */
static bool wait_change(struct can_link *link, const struct timespec *due) {
    return pthread_cond_timedwait(&link->changed, &link->lock, due) != ETIMEDOUT;
}

bool can_link_identify(struct can_link *link, int64_t timeout_us, struct can_link_identity *identity) {
    const struct timespec due = deadline(timeout_us);
    (void)pthread_mutex_lock(&link->lock);
    while (!link->identity.known && wait_change(link, &due)) {
    }
    *identity = link->identity;
    (void)pthread_mutex_unlock(&link->lock);
    return identity->known;
}

enum can_link_wait can_link_receive(struct can_link *link, int64_t timeout_us, struct link_report *report) {
    const struct timespec due = deadline(timeout_us);
    (void)pthread_mutex_lock(&link->lock);
    while (link->report_count == 0 && wait_change(link, &due)) {
    }
    const bool found = link->report_count > 0;
    if (found) {
        *report = link->reports[link->first_report];
        link->first_report = (link->first_report + 1) % CAN_LINK_REPORTS;
        link->report_count--;
    }
    (void)pthread_mutex_unlock(&link->lock);
    return found ? CAN_LINK_REPORT : CAN_LINK_TIMEOUT;
}

static bool is_same(const struct controller_command *a, const struct controller_command *b) {
    for (uint32_t chamber = 0; chamber < 3u; chamber++) {
        if (a->pressure_pa[chamber] != b->pressure_pa[chamber]) {
            return false;
        }
    }
    return a->kind == b->kind && a->bend_rad == b->bend_rad && a->direction_rad == b->direction_rad &&
           a->co_contraction_pa == b->co_contraction_pa;
}

void can_link_command(struct can_link *link, const struct controller_command *command) {
    (void)pthread_mutex_lock(&link->lock);
    if (!is_same(command, &link->command) || !is_kept_alive(command)) {
        link->command = *command;
        link->commanded_us = program_now_us();
        link->repeat_us = link->commanded_us + REPEAT_US;
        link->heartbeat_us = link->commanded_us + link->heartbeat_period_us;
        link->times_sent = send_command(link) ? 1u : 0u;
    }
    (void)pthread_mutex_unlock(&link->lock);
}

bool can_link_post(struct can_link *link, enum message_id id, const union message *message) {
    (void)pthread_mutex_lock(&link->lock);
    const bool sent = send_message(link, id, message);
    (void)pthread_mutex_unlock(&link->lock);
    return sent;
}

bool can_link_answer(struct can_link *link, int64_t timeout_us, struct can_link_answer *answer) {
    const struct timespec due = deadline(timeout_us);
    (void)pthread_mutex_lock(&link->lock);
    while (link->answer_count == 0 && wait_change(link, &due)) {
    }
    const bool found = link->answer_count > 0;
    if (found) {
        *answer = link->answers[link->first_answer];
        link->first_answer = (link->first_answer + 1) % CAN_LINK_ANSWERS;
        link->answer_count--;
    }
    (void)pthread_mutex_unlock(&link->lock);
    return found;
}

void can_link_forget_answers(struct can_link *link) {
    (void)pthread_mutex_lock(&link->lock);
    link->answer_count = 0;
    (void)pthread_mutex_unlock(&link->lock);
}

uint64_t can_link_latest(struct can_link *link, enum message_id id, union message *message) {
    (void)pthread_mutex_lock(&link->lock);
    const uint64_t count = link->count[id];
    if (count > 0) {
        *message = link->latest[id];
    }
    (void)pthread_mutex_unlock(&link->lock);
    return count;
}

void can_link_count(struct can_link *link, struct can_link_counters *counters) {
    (void)pthread_mutex_lock(&link->lock);
    *counters = link->counters;
    (void)pthread_mutex_unlock(&link->lock);
}

int64_t can_link_silence_us(struct can_link *link) {
    (void)pthread_mutex_lock(&link->lock);
    const int64_t silence_us = link->heard_us == 0 ? -1 : program_now_us() - link->heard_us;
    (void)pthread_mutex_unlock(&link->lock);
    return silence_us;
}

void can_link_others(struct can_link *link, char *text, size_t bytes) {
    size_t used = 0;
    (void)pthread_mutex_lock(&link->lock);
    for (uint32_t node = 0; node <= MESSAGE_NODE_MOST && used < bytes; node++) {
        if (node != link->node && (link->nodes_heard & 1u << node) != 0) {
            used += (size_t)snprintf(text + used, bytes - used, "%s%u", used > 0 ? ", " : "", node);
        }
    }
    (void)pthread_mutex_unlock(&link->lock);
    if (used == 0) {
        (void)snprintf(text, bytes, "none");
    }
}

void can_link_adapt(struct can_link *link, int64_t command_timeout_us, uint32_t telemetry_slowdown) {
    (void)pthread_mutex_lock(&link->lock);
    link->heartbeat_period_us = command_timeout_us / 4 < HEARTBEAT_US ? command_timeout_us / 4 : HEARTBEAT_US;
    link->start_us = command_timeout_us + START_OVER_TIMEOUT_US;
    link->assembly.telemetry_slowdown = telemetry_slowdown;
    (void)pthread_mutex_unlock(&link->lock);
}

/* --- behind link.h */

static bool link_send(void *context, const struct controller_command *command) {
    can_link_command(context, command);
    return true;
}

static bool link_receive(void *context, struct link_report *report) {
    return can_link_receive(context, CAN_LINK_PATIENCE_US, report) == CAN_LINK_REPORT;
}

static void link_close(void *context) {
    can_link_close(context);
}

void can_link_bind(struct can_link *link, struct link *interface) {
    *interface =
        (struct link){.context = link, .send = link_send, .receive = link_receive, .close = link_close};
}
