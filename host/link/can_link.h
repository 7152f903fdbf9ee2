/* A board behind any transport: commands go out by messages.def, reports come in.
 *
 * One thread of its own reads, sends and keeps the heartbeat, so that nothing that the caller does can stop
 * it. A new command is sent three times, 20 ms apart, for a frame may be lost, and on until it moves, for
 * less than a second; from then on only heartbeats go out, which never start a motion. A transport that goes
 * away is opened again, each time after a longer pause; a board that comes back is asked again who it is.
 * Several boards share a bus by their node ids.
 *
 * All functions may be called from any one thread at a time. Not here: bits (codec.h), bytes on a wire
 * (transport.h). */
#ifndef TRIBEND_CAN_LINK_H
#define TRIBEND_CAN_LINK_H

#include <pthread.h>

#include "link/can_assembly.h"
#include "link/command_sequence.h"
#include "link/transport.h"

#define CAN_LINK_NODE_DEFAULT 1u
#define CAN_LINK_NAME_BYTES 36
#define CAN_LINK_REPORTS 1024 /* 5 s of them */
#define CAN_LINK_ANSWERS 64
#define CAN_LINK_BUS_BYTES 128
#define CAN_LINK_SILENT_US 500000 /* without a frame for so long the board is silent */
#define CAN_LINK_PATIENCE_US 2000000

/* Everything that came, went or was left; a row each, in the order in which they are shown. */
#define CAN_LINK_COUNTERS(X)                                                                                 \
    X(received, "frames that came")                                                                          \
    X(decoded, "messages of this board")                                                                     \
    X(foreign, "frames of other nodes and other protocols")                                                  \
    X(undecodable, "frames of this board with a wrong length, or with numbers out of range")                 \
    X(malformed, "what came and was no data frame")                                                          \
    X(overflowed, "frames that the kernel dropped before they were read")                                    \
    X(error_frames, "error frames of the CAN controller")                                                    \
    X(bus_off, "of them, times that this computer's controller left the bus")                                \
    X(sent, "frames sent")                                                                                   \
    X(unsent, "frames for which the transport had no room; commands are sent again")                         \
    X(missing, "reports lost between two that came")                                                         \
    X(dropped, "reports that the program did not take in time")                                              \
    X(answers_dropped, "answers that the program did not take in time")                                      \
    X(silences, "times that the board fell silent")                                                          \
    X(restarts, "times that the board started anew")                                                         \
    X(reconnects, "times that the bus had to be opened again")                                               \
    X(saturated, "numbers of commands that did not fit their message")                                       \
    X(other_hosts, "commands to this board that others sent")
struct can_link_counters {
#define CAN_LINK_COUNTER(name, text) uint64_t name;
    CAN_LINK_COUNTERS(CAN_LINK_COUNTER)
#undef CAN_LINK_COUNTER
};

/* Who the board is, as IDENTITY says. */
struct can_link_identity {
    bool known; /* all of it arrived */
    uint32_t protocol;
    uint32_t parameters_version;
    uint32_t parameters;
    uint32_t firmware;
    uint64_t table_hash; /* 0: no table */
    char module[CAN_LINK_NAME_BYTES];
};

struct can_link_answer {
    enum message_id id;
    union message message;
};

enum can_link_wait { CAN_LINK_REPORT = 0, CAN_LINK_TIMEOUT };

struct can_link {
    char bus[CAN_LINK_BUS_BYTES];
    uint32_t node;
    pthread_t thread;
    pthread_mutex_t lock; /* of all that follows, but for what is the thread's */
    pthread_cond_t changed;
    bool running;
    bool stop;
    bool connected;
    int64_t heard_us; /* monotonic, of the last message of the board; 0: never */
    bool silent;
    uint32_t nodes_heard; /* bit n: node n */
    struct can_link_counters counters;
    struct can_link_identity identity;
    uint32_t name_pieces;
    struct can_assembly assembly;
    struct link_report reports[CAN_LINK_REPORTS];
    size_t first_report, report_count;
    struct can_link_answer answers[CAN_LINK_ANSWERS];
    size_t first_answer, answer_count;
    union message latest[MESSAGE_COUNT];
    uint64_t count[MESSAGE_COUNT];
    struct controller_command command; /* kept alive while it moves or holds */
    uint32_t times_sent;               /* since it was given */
    int64_t commanded_us;
    int64_t start_us; /* for so long it may start a motion */
    int64_t repeat_us;
    int64_t heartbeat_us; /* when the next one is due */
    int64_t heartbeat_period_us;
    int64_t identify_us; /* when the board is asked next who it is */
    struct command_sequence sequence;
    /* the thread's */
    struct transport transport;
    int wake; /* eventfd */
    int timer;
    int64_t reopen_us;
    int64_t pause_us;
    char error[1024]; /* why the bus cannot be opened again */
};

/* Open the bus and start the thread. False: `error` says what is missing, and what helps. */
bool can_link_open(struct can_link *link, const char *bus, uint32_t node, char *error, size_t error_bytes);
/* Sends nothing: what moves is vented by its command timeout, unless it was vented before. */
void can_link_close(struct can_link *link);
/* The link of link.h. Its receive() gives up after CAN_LINK_PATIENCE_US without a report. */
void can_link_bind(struct can_link *link, struct link *interface);

/* True: all of IDENTITY came within `timeout_us`. */
bool can_link_identify(struct can_link *link, int64_t timeout_us, struct can_link_identity *identity);
/* The next report. */
enum can_link_wait can_link_receive(struct can_link *link, int64_t timeout_us, struct link_report *report);
/* A command; repeated and kept alive until another one. */
void can_link_command(struct can_link *link, const struct controller_command *command);
/* Any message to the board, once; sequence and protocol are filled in. False: no room, or the bus is gone. */
bool can_link_post(struct can_link *link, enum message_id id, const union message *message);
/* The next answer: PARAMETER_VALUE, TRANSFER_STATE or REFUSALS. False: none within `timeout_us`. */
bool can_link_answer(struct can_link *link, int64_t timeout_us, struct can_link_answer *answer);
void can_link_forget_answers(struct can_link *link);
/* The newest message of a kind, and how many came; 0: none, and `message` is left alone. */
uint64_t can_link_latest(struct can_link *link, enum message_id id, union message *message);
void can_link_count(struct can_link *link, struct can_link_counters *counters);
/* How long the board has been silent, us; negative: it never spoke. */
int64_t can_link_silence_us(struct can_link *link);
/* "2, 3": other nodes that were heard; "none". */
void can_link_others(struct can_link *link, char *text, size_t bytes);
/* Heartbeats so often, at most; telemetry so much slower. As the board's parameters have them. */
void can_link_adapt(struct can_link *link, int64_t command_timeout_us, uint32_t telemetry_slowdown);

#endif
