/* The bridge between a board on CAN and LCM: telemetry becomes messages of the types in host/lcm, commands
 * become frames.
 *
 * Pure: frames, messages and the time come in, frames and messages go out through two functions; no socket,
 * no clock of its own, bounded memory. Of several commands that came together only the freshest goes on,
 * once: nothing keeps alive a motion whose sender fell silent. Everything that is not passed on has a
 * counter. Not here: sockets and options (cli/bridge.c), which commands may pass (command_gate.h), clocks
 * (clock_map.h). */
#ifndef TRIBEND_BRIDGE_H
#define TRIBEND_BRIDGE_H

#include "comms/codec.h"
#include "lcm/clock_map.h"
#include "lcm/command_gate.h"
#include "lcm/latency.h"
#include "link/can_assembly.h"
#include "link/transport.h"

#define BRIDGE_REQUESTS_MOST 32u
#define BRIDGE_SILENT_US 2000000 /* more than a busy host holds it up */
#define BRIDGE_ANSWER_US 500000
#define BRIDGE_STATUS_US 1000000
#define BRIDGE_CALL_US 500000  /* a silent board is asked who it is so often */
#define BRIDGE_LACKS INT32_MIN /* of a number that the board does not have */

/* Channels, after the prefix. */
#define BRIDGE_CHANNELS(X)                                                                                   \
    X(COMMAND, "COMMAND")                                                                                    \
    X(STATUS, "STATUS")                                                                                      \
    X(TIP, "TIP")                                                                                            \
    X(GAP, "GAP")                                                                                            \
    X(PARAMETER_REQUEST, "PARAMETER_REQUEST")                                                                \
    X(PARAMETER, "PARAMETER")                                                                                \
    X(BRIDGE, "BRIDGE")
enum bridge_channel {
#define BRIDGE_CHANNEL_ENUM(NAME, text) BRIDGE_CHANNEL_##NAME,
    BRIDGE_CHANNELS(BRIDGE_CHANNEL_ENUM) BRIDGE_CHANNEL_COUNT
#undef BRIDGE_CHANNEL_ENUM
};

/* Everything that came, went or was left, as in bridge_t. */
#define BRIDGE_COUNTERS(X)                                                                                   \
    X(frames_received, "CAN frames that came")                                                               \
    X(frames_foreign, "of them, of other nodes and other protocols")                                         \
    X(frames_undecodable, "of them, with a wrong length or numbers out of range")                            \
    X(frames_malformed, "what came and was no data frame")                                                   \
    X(frames_overflowed, "frames that the kernel dropped before they were read")                             \
    X(error_frames, "error frames of the CAN controller")                                                    \
    X(frames_sent, "CAN frames sent")                                                                        \
    X(frames_unsent, "CAN frames for which there was no room, or no bus")                                    \
    X(bus_reopened, "times that the bus had to be opened again")                                             \
    X(board_silences, "times that the board fell silent")                                                    \
    X(board_restarts, "times that the board started anew")                                                   \
    X(reports_missing, "reports lost between two that came")                                                 \
    X(refused_by_board, "commands that the board refused")                                                   \
    X(clock_resets, "times that the clock mapping began anew")                                               \
    X(published, "LCM messages published")                                                                   \
    X(unpublished, "LCM messages that could not be")                                                         \
    X(commands_received, "commands that came over LCM")                                                      \
    X(commands_forwarded, "of them, sent on to the board")                                                   \
    X(commands_flying, "of them, refused: already under way when the bridge started or the board came back") \
    X(commands_superseded, "of them, left for a fresher one that came with them")                            \
    X(commands_late, "of them, not fresher than one before")                                                 \
    X(commands_unsent, "of them, for which the bus had no room")                                             \
    X(commands_malformed, "of them, of another type, unknown or out of range")                               \
    X(requests_received, "requests for parameters that came over LCM")                                       \
    X(requests_dropped, "of them, unknown, or more than wait at once")                                       \
    X(requests_unanswered, "of them, that the board did not answer")                                         \
    X(log_errors, "writes to logs that failed")
struct bridge_counters {
#define BRIDGE_COUNTER(name, text) uint64_t name;
    BRIDGE_COUNTERS(BRIDGE_COUNTER)
#undef BRIDGE_COUNTER
};

enum bridge_parameter_request {
    BRIDGE_PARAMETER_GET = 0,
    BRIDGE_PARAMETER_SET,
    BRIDGE_PARAMETER_SAVE,
    BRIDGE_PARAMETER_DEFAULTS,
    BRIDGE_PARAMETER_REQUESTS
};

/* Where things go; both return false where they could not. */
struct bridge_out {
    void *context;
    bool (*publish)(void *context, enum bridge_channel channel, const void *data, uint32_t bytes);
    bool (*send)(void *context, const struct hal_can_frame *frame);
};

/* The two clocks: since 1970, and one that nobody sets. */
struct bridge_now {
    int64_t host_us;
    int64_t monotonic_us;
};

struct bridge_request {
    enum bridge_parameter_request kind;
    uint32_t parameter, value;
};

struct bridge {
    struct bridge_out out;
    struct bridge_counters counters;
    struct can_assembly assembly;
    struct clock_map clock;
    struct command_gate gate;
    struct latency latency;
    int64_t heard_us;    /* monotonic, like all but utime_us */
    int64_t call_us;     /* when a silent board is called next */
    int64_t status_us;   /* when TRIBEND_BRIDGE is due */
    int64_t followed_us; /* when the last command was sent */
    int64_t asked_us;
    int64_t utime_us; /* of the last status published */
    uint64_t refusals_seen;
    size_t first_request, requests;
    struct bridge_request request[BRIDGE_REQUESTS_MOST]; /* a ring; the first is under way while `asked` */
    struct controller_command waiting;                   /* COMMAND_NONE: none */
    struct controller_command followed;                  /* that was last sent */
    uint32_t node;
    uint32_t protocol; /* that the board speaks; 0: not heard */
    uint8_t sequence;
    bool board_is_heard;
    bool asked;
    bool report_is_new; /* for logs; cleared by whoever took it */
};

void bridge_init(struct bridge *bridge, uint32_t node, const struct bridge_out *out,
                 const struct bridge_now *now);
void bridge_take_frame(struct bridge *bridge, const struct transport_frame *frame,
                       const struct bridge_now *now);
/* A message of TRIBEND_COMMAND or TRIBEND_PARAMETER_REQUEST. */
void bridge_take_message(struct bridge *bridge, enum bridge_channel channel, const void *data, uint32_t bytes,
                         const struct bridge_now *now);
/* After all that had come was taken, and at least every 50 ms: sends what waits, notices silence, publishes
 * its status. */
void bridge_step(struct bridge *bridge, const struct bridge_now *now);
/* The bus went away: the gate shuts. */
void bridge_lose_bus(struct bridge *bridge, const struct bridge_now *now);
/* Vent what was set in motion through this bridge; for its end. */
void bridge_vent(struct bridge *bridge, const struct bridge_now *now);
/* Since 1970, of a report's time; the present where the clocks are not mapped yet. */
int64_t bridge_host_time(const struct bridge *bridge, int64_t board_us, const struct bridge_now *now);
const char *bridge_channel_name(enum bridge_channel channel);

#endif
