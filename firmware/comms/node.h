/* The node: a controller on a CAN bus, with its parameters and tables in flash. What a board's main loop
 * needs:
 *
 *     node_init(&node, &setup);            // takes milliseconds: reads and checks what is stored
 *     // bring up the bus with node.parameters.node: node_id, bit_rate, can_fd ...
 *     every CONTROLLER_STEP_US:
 *         node_step(&node);                // frames in, commands and requests; a step of the storage
 *         app_step(&node.app);             // read, control, write the valves
 *         node_report(&node);              // telemetry and answers out
 *         if (node.reset_wanted) ...       // vent, then reset: a host asked for it while vented
 *
 * Nothing of it blocks, and each step's work is bounded: node_step() and node_report() together take some
 * 1,500 instructions of a Cortex-M4F at most while a host commands and hears, 2,400 with two commands in
 * every step, about 100 more for each foreign frame that the bus hands over, and up to 9,000 for one step of
 * a table's check, while vented. Commands come in the messages of messages.def; one that is malformed, out of
 * range, of another version, stale or out of place is refused, counted by its reason and reported. VENT is
 * obeyed whatever it holds, and wins over whatever came in the same step. Not here: the bits of messages
 * (codec.h), whether a state takes a command (supervisor.h), flash (store.h). */
#ifndef TRIBEND_NODE_H
#define TRIBEND_NODE_H

#include "app.h"
#include "comms/codec.h"
#include "comms/parameters.h"
#include "comms/store.h"
#include "comms/tip_stream.h"

#define NODE_FRAMES_A_STEP 24u  /* more than a 1 Mbit/s bus carries in a step */
#define NODE_COMMANDS_A_STEP 2u /* of them, those that are for this node; what is left waits */
#define NODE_REPORTS_A_STEP 2u  /* frames sent; one in a step that took commands or a tip sample, and a part of one of 64 bytes */

/* Why a command was refused. */
#define NODE_REFUSALS(X)                                                                                     \
    X(LENGTH, "wrong number of bytes for this message")                                                      \
    X(RANGE, "a number is outside the message's range")                                                      \
    X(VERSION, "the sender speaks another version of the protocol: update host or board")                    \
    X(STALE, "the sequence stood still or went back: a frozen sender, an old frame, or two hosts at once")   \
    X(KEY, "the key is wrong")                                                                               \
    X(STATE, "the state does not allow it: see STATUS")                                                      \
    X(UNSEEN_FAULT, "the latched faults are not those of the CLEAR: look at STATUS again")                   \
    X(NO_TABLE, "no valid bend table: pressure commands only")                                               \
    X(BUSY, "a save, a transfer or another request is under way: try again")                                 \
    X(BROADCAST, "only VENT and IDENTIFY go to every board")                                                 \
    X(DUPLICATE_NODE, "another board on the bus has this node's id")                                         \
    X(CONTROLLER,                                                                                            \
      "a cause of the fault is still there, or commands must first pause for 0.5 s, as after a restart")
enum node_refusal {
#define NODE_REFUSAL_ENUM(NAME, text) NODE_REFUSED_##NAME,
    NODE_REFUSALS(NODE_REFUSAL_ENUM) NODE_REFUSAL_COUNT
#undef NODE_REFUSAL_ENUM
};

/* Bits of BEND.flags. */
#define NODE_BEND_FLAGS(X)                                                                                   \
    X(MEASURED, "by the tip sensor; else predicted from the pressures")                                      \
    X(TIP_LOST, "no good tip sample in time")                                                                \
    X(LIMITED, "the command was out of reach: the nearest is followed")
enum node_bend_flag {
#define NODE_BEND_FLAG_ENUM(NAME, text) NODE_BEND_##NAME,
    NODE_BEND_FLAGS(NODE_BEND_FLAG_ENUM) NODE_BEND_FLAG_COUNT
#undef NODE_BEND_FLAG_ENUM
};

#define NODE_ACTIONS(X)                                                                                      \
    X(NONE, "get or set")                                                                                    \
    X(SAVE, "keep the parameters over a reset")                                                              \
    X(DEFAULTS, "back to the firmware's and the table's own")
enum node_action {
#define NODE_ACTION_ENUM(NAME, text) NODE_ACTION_##NAME,
    NODE_ACTIONS(NODE_ACTION_ENUM) NODE_ACTION_COUNT
#undef NODE_ACTION_ENUM
};

/* What a board brings. All pointers are kept. */
struct node_setup {
    const struct hal *hal;
    const struct hal_bus *bus;         /* NULL: none */
    const struct hal_storage *storage; /* NULL: none, and nothing is kept */
    const void *table_image;           /* came with the firmware, used where none is stored; NULL: none */
    uint32_t table_bytes;
    uint32_t firmware;                            /* hash of its version */
    const struct tip_stream_counters *tip_stream; /* NULL: the tip sensor has no serial line */
};

struct node_refused {
    uint32_t count;
    uint32_t step;   /* of the last one */
    uint8_t message; /* its number */
};

struct node_counters {
    uint32_t accepted;
    uint32_t foreign; /* frames for others */
    uint32_t refused; /* for any reason */
    uint32_t reports_dropped;
    uint32_t sequence_lost;
    struct message_trouble reported; /* numbers that did not fit their field */
};

#define NODE_REPORT_COUNT 25u
#define NODE_TURNS 5u /* steps; every period of messages.def is a multiple of it */

/* One of 64 bytes, which is built in some steps. */
struct node_long_report {
    bool begun;
    union message message;
    struct message_packing packing;
};

struct node {
    struct app app;
    struct parameters parameters; /* as set; what the controller runs on */
    struct store store;
    struct bend_table table;
    bool has_table;
    bool reset_wanted;
    struct node_counters counters;
    struct node_refused refused[NODE_REFUSAL_COUNT];
    struct parameters_image_report parameters_report; /* of the start */
    /* the rest is node.c's */
    const struct node_setup *setup;
    uint32_t node_id;               /* of the start: another one holds from the next on */
    struct controller_command last; /* that a heartbeat keeps alive */
    bool sequence_known;
    uint8_t sequence;
    uint32_t sequence_age;   /* steps since a command came, taken or not */
    enum message_id given;   /* what was handed to the controller in this step; MESSAGE_COUNT: nothing */
    uint32_t refused_before; /* by the controller */
    uint32_t timeout_steps;
    struct hal_can_state bus_state;
    uint32_t pending; /* reports to send, a bit each, */
    uint32_t due;     /* and those of them whose period has passed */
    uint32_t next_report;
    struct node_long_report long_report;
    bool took_commands; /* in this step */
    uint32_t turn;                          /* of this step, */
    uint32_t in_turn[NODE_TURNS];           /* the reports that can fall due in each, a bit each, */
    uint32_t turns_left[NODE_REPORT_COUNT]; /* and when they do */
    uint32_t refusal_next; /* reason of the next REFUSALS */
    uint32_t name_piece;
    enum transfer_error begin_error;
    bool saving; /* an answer is owed once the save ends */
    struct message_parameter_value answer;
    enum supervisor_state state_reported;
    uint32_t faults_reported;
    struct message_tip_position tip_position;
    struct message_tip_orientation tip_orientation;
    uint16_t tip_quality;
    uint16_t tip_status;
};

void node_init(struct node *node, const struct node_setup *setup);
void node_step(struct node *node);
void node_report(struct node *node);
/* One frame, as node_step() takes it from the bus. False: it was for others. */
bool node_take(struct node *node, const struct hal_can_frame *frame);
/* Sentences for people, never NULL. */
const char *node_refusal_text(enum node_refusal refusal);
const char *node_bend_flag_text(enum node_bend_flag flag);
const char *node_action_text(enum node_action action);

#endif
