/* `tribend board`: the flashed ELF on the emulated board, with the plant on its pins and CAN to the world. A
 * program of its own (tribend-board), for libunicorn is under the GPL. */
#include <argp.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "board/board_record.h"
#include "board/board_changes.h"
#include "board/can_socket.h"
#include "cli/commands.h"
#include "comms/tip_stream.h"
#include "units/units.h"

#define FIRMWARE "firmware/tribend.elf"
#define SLICE_US 1000
#define BEHIND_NS 200000000 /* so far behind the clock it starts anew */
#define STEP_FUNCTION "node_step"
#define DURATION_MOST_S 86400.0
#define NS_A_SECOND 1000000000

struct settings {
    const char *elf, *bus, *table, *record;
    enum { PACE_BY_BUS, PACE_REAL_TIME, PACE_NONE } pace; /* by the bus: real time where there is one */
    bool quiet;
    uint64_t seed;
    double duration_s; /* 0: until Ctrl-C */
    struct effect effect[PLANT_EFFECTS_MAX];
    size_t effects;
};

static const struct argp_option options[] = {
    {"elf", 'E', "FILE", 0, "what is flashed (default: " FIRMWARE " beside this program)", 1},
    {"bus", 'b', "BUS", 0, "CAN of the board: an interface such as can0, unix:PATH, or none (default)", 1},
    {"speed", 'v', "1|max", 0,
     "1: in real time (default with a bus); max: as fast as it goes (default without)", 1},
    {"for", 'f', "TIME", 0, "how long (default: until Ctrl-C with a bus, 5s without)", 1},
    {"duration", 0, NULL, OPTION_ALIAS, NULL, 1},
    {"record", 'r', "FILE", 0, "write a run log (CSV) of sensors, outputs and true pressures", 1},
    {"table", 't', "FILE", 0,
     "bend table of the module on the board (default $TRIBEND_TABLE, else the reference table)", 2},
    {"seed", 's', "N", 0, "of the sensors' noise (default 1)", 2},
    {"effect", 'e', "NAME[:P=V,..]", 0, "add a real-world effect to the plant; may be repeated", 2},
    {"quiet", 'q', NULL, 0, "only the summary", 2},
    {0}};

static void parse_speed(struct argp_state *state, const char *text, struct settings *settings) {
    settings->pace = strcmp(text, "1") == 0 ? PACE_REAL_TIME : PACE_NONE;
    if (settings->pace == PACE_NONE && strcmp(text, "max") != 0) {
        argp_error(state, "--speed: '%s' is neither 1 nor max", text);
    }
}

static void parse_seed(struct argp_state *state, const char *text, struct settings *settings) {
    char *end = NULL;
    errno = 0;
    settings->seed = strtoull(text, &end, 10);
    if (errno != 0 || end == text || *end != '\0' || *text == '-') {
        argp_error(state, "--seed: '%s' is not a whole number from 0 on", text);
    }
}

static void parse_duration(struct argp_state *state, const char *text, struct settings *settings) {
    char error[PROGRAM_ERROR_BYTES];
    if (!units_parse(UNITS_TIME, text, &settings->duration_s, error, sizeof error)) {
        argp_error(state, "--for: %s", error);
    } else if (!(settings->duration_s > 0.0) || settings->duration_s > DURATION_MOST_S) {
        argp_error(state, "--for: %s is not between 0 and a day", text);
    }
}

static void parse_effect(struct argp_state *state, const char *text, struct settings *settings) {
    char error[PROGRAM_ERROR_BYTES];
    if (settings->effects == PLANT_EFFECTS_MAX) {
        argp_error(state, "--effect: at most %d effects", PLANT_EFFECTS_MAX);
    } else if (!effect_parse(text, &settings->effect[settings->effects++], error, sizeof error)) {
        argp_error(state, "--effect: %s", error);
    }
}

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct settings *settings = state->input;
    switch (key) {
    case 'E':
        settings->elf = argument;
        return 0;
    case 'b':
        settings->bus = strcmp(argument, "none") == 0 ? NULL : argument;
        return 0;
    case 'r':
        settings->record = argument;
        return 0;
    case 't':
        settings->table = argument;
        return 0;
    case 'q':
        settings->quiet = true;
        return 0;
    case 'v':
        parse_speed(state, argument, settings);
        return 0;
    case 's':
        parse_seed(state, argument, settings);
        return 0;
    case 'f':
        parse_duration(state, argument, settings);
        return 0;
    case 'e':
        parse_effect(state, argument, settings);
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "board takes no argument, '%s' is too much", argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    options,
    parse,
    "",
    "Run the flashed ELF on an emulated NUCLEO-G474RE with the simulated module on its pins.\v"
    "Examples:\n"
    "  tribend board --for 2s\n"
    "  tribend board --bus vcan0\n"
    "Instructions are counted, not cycles.",
    NULL,
    NULL,
    NULL};

/* --- pace --- */

struct pace {
    struct timespec start;
    int64_t start_us;
    uint32_t slipped; /* times that the emulation fell far behind */
};

static int64_t ns_between(const struct timespec *from, const struct timespec *to) {
    return (int64_t)(to->tv_sec - from->tv_sec) * NS_A_SECOND + (to->tv_nsec - from->tv_nsec);
}

static void pace_start(struct pace *pace, int64_t time_us) {
    (void)clock_gettime(CLOCK_MONOTONIC, &pace->start);
    pace->start_us = time_us;
}

/* Sleep until the wall clock has caught up with the board's. */
static void pace_wait(struct pace *pace, int64_t time_us) {
    const int64_t due_ns = (time_us - pace->start_us) * 1000;
    struct timespec now, until = pace->start;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    if (ns_between(&pace->start, &now) > due_ns + BEHIND_NS) {
        pace->slipped++;
        pace_start(pace, time_us);
        return;
    }
    until.tv_sec += (time_t)((until.tv_nsec + due_ns) / NS_A_SECOND);
    until.tv_nsec = (long)((until.tv_nsec + due_ns) % NS_A_SECOND);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR &&
           program_interrupted == 0) {
    }
}

/* --- running --- */

struct session {
    const struct settings *settings;
    struct board board;
    struct can_socket can;
    struct board_changes changes;
    struct board_record record;
    struct pace pace;
};

static int run(struct session *session) {
    const struct settings *settings = session->settings;
    const int64_t end_us = settings->duration_s > 0.0 ? (int64_t)(1e6 * settings->duration_s) : INT64_MAX;
    program_catch_interrupt();
    board_changes_listen(&session->changes, &session->board);
    pace_start(&session->pace, 0);
    while (board_time_us(&session->board) < end_us && program_interrupted == 0) {
        board_run(&session->board, SLICE_US);
        board_changes_look(&session->changes, &session->board);
        if (settings->bus != NULL && !can_socket_exchange(&session->can, &session->board)) {
            return program_fail(EXIT_OUTPUT, "bus %s: gone: %s", settings->bus, strerror(errno));
        }
        if (settings->record != NULL) {
            board_record_row(&session->record, &session->board);
        }
        if (settings->pace == PACE_REAL_TIME) {
            pace_wait(&session->pace, board_time_us(&session->board));
        }
    }
    return settings->duration_s > 0.0 && program_interrupted != 0 ? EXIT_INTERRUPTED : EXIT_OK;
}

static void summarise(const struct session *session, const struct timespec *from) {
    const struct board *board = &session->board;
    const struct core_count *step = &board->core.step;
    struct timespec now;
    char text[1024];
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    const double wall_s = 1e-9 * (double)ns_between(from, &now),
                 emulated_s = 1e-6 * (double)board_time_us(board);
    printf("emulated  %.3f s in %.3f s, %.2f x real time; %u resets\n", emulated_s, wall_s,
           emulated_s / wall_s, board->resets);
    if (step->entries > 0) {
        printf("step      %" PRIu64 " of them, mean %.0f instructions, worst %" PRIu64 "\n", step->entries,
               (double)step->instructions / (double)step->entries, step->most);
    }
    printf("CAN       %" PRIu64 " frames sent, %" PRIu64 " received, %" PRIu64 " error frames\n",
           board->fdcan.node.sent_frames, board->fdcan.node.received_frames, board->fdcan.node.error_frames);
    if (session->settings->bus != NULL) {
        printf("bus %-5s %" PRIu64 " frames taken, %" PRIu64 " given, %" PRIu64 " not sent, %" PRIu64
               " ignored\n",
               session->settings->bus, session->can.taken, session->can.given, session->can.not_sent,
               session->can.ignored);
    }
    if (session->pace.slipped > 0) {
        printf("pace      fell behind real time %u times\n", session->pace.slipped);
    }
    if (board_describe_oddities(board, text, sizeof text)) {
        printf("odd       %s\n", text);
    }
}

static int use(struct session *session, const struct bend_table *table) {
    const struct settings *settings = session->settings;
    char error[PROGRAM_ERROR_BYTES], note[64];
    struct timespec from;
    uint32_t address;
    if (settings->bus != NULL && !can_socket_open(&session->can, settings->bus, error, sizeof error)) {
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    if (board_symbol(&session->board, STEP_FUNCTION, &address)) {
        (void)core_mark_step(&session->board.core, address);
    }
    (void)clock_gettime(CLOCK_MONOTONIC, &from);
    int code = run(session);
    if (settings->bus != NULL) {
        can_socket_close(&session->can);
    }
    (void)snprintf(note, sizeof note, "emulated board, seed %" PRIu64, settings->seed);
    if (settings->record != NULL &&
        !board_record_finish(&session->record, settings->record, table, note, error, sizeof error)) {
        code = program_fail(EXIT_OUTPUT, "%s", error);
    }
    summarise(session, &from);
    return code;
}

static size_t encode_tip(const struct hal_tip_sample *sample, uint8_t bytes[WIRING_RECORD_BYTES]) {
    tip_stream_encode(sample, bytes);
    return TIP_STREAM_RECORD_BYTES;
}
_Static_assert(TIP_STREAM_RECORD_BYTES <= WIRING_RECORD_BYTES, "a record fits the line's");

static int open_and_use(struct session *session, const struct bend_table *table) {
    const struct settings *settings = session->settings;
    struct board_setup setup;
    char error[PROGRAM_ERROR_BYTES];
    board_default_setup(&setup, settings->elf, table);
    setup.seed = settings->seed;
    setup.encode = encode_tip;
    if (access(settings->elf, F_OK) != 0) {
        return program_fail(EXIT_BAD_INPUT,
                            "%s: %s: make firmware builds what is flashed, --elf says where it is",
                            settings->elf, strerror(errno));
    }
    if (!board_open(&session->board, &setup, error, sizeof error)) {
        return program_fail(EXIT_BAD_INPUT, "%s", error);
    }
    int code = EXIT_OK;
    for (size_t i = 0; i < settings->effects && code == EXIT_OK; i++) {
        if (!board_add_effect(&session->board, &settings->effect[i])) {
            code = program_fail(EXIT_USAGE, "the plant has no room for effect '%s'",
                                settings->effect[i].kind->name);
        }
    }
    code = code == EXIT_OK ? use(session, table) : code;
    board_close(&session->board);
    return code;
}

int main(int argc, char **argv) {
    static struct session session;
    static char elf[PROGRAM_PATH_BYTES], found[PROGRAM_PATH_BYTES];
    static struct settings settings = {.seed = 1};
    struct table_file file;
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &settings) != 0) {
        return EXIT_USAGE;
    }
    if (settings.elf == NULL) {
        program_find(FIRMWARE, elf);
        settings.elf = elf;
    }
    if (settings.pace == PACE_BY_BUS) {
        settings.pace = settings.bus != NULL ? PACE_REAL_TIME : PACE_NONE;
    }
    settings.duration_s = settings.duration_s <= 0.0 && settings.bus == NULL ? 5.0 : settings.duration_s;
    const int code = table_file_open(&file, bus_table_path(settings.table, found), NULL);
    if (code != EXIT_OK) {
        return code;
    }
    session.settings = &settings;
    session.changes.out = settings.quiet ? NULL : stdout;
    const int result = open_and_use(&session, &file.table);
    table_file_close(&file);
    return result;
}
