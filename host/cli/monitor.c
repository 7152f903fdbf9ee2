/* tribend monitor: a controller in a full-screen terminal of 80 x 24 or more. Commands nothing, but for v,
 * which vents. */
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "cli/commands.h"
#include "cli/report_json.h"

#define DEGREES (180.0 / M_PI)
#define DRAW_US 100000
#define WORDS_BYTES 1024
#define WORDS_SHOWN 66
#define BAR 36
#define BAR_PA 12000.0 /* what a full bar stands for, unless a chamber is higher */
#define RED "\033[1;31m"
#define YELLOW "\033[33m"
#define GREEN "\033[32m"
#define DIM "\033[2m"
#define PLAIN "\033[0m"
#define LINE_END "\033[K\n"

struct arguments {
    struct bus_options bus;
    bool json;
};

struct monitor {
    struct bus *bus;
    const struct arguments *arguments;
    struct link_report report;
    uint64_t reports;
    uint64_t reports_before;
    int64_t drawn_us;
    double rate_hz;
    double full_pa;
};

static const struct argp_option options[] = {
    {"json", 'j', NULL, 0, "for programs: one JSON object a line, ten a second, in place of the screen", 0},
    {0}};

static error_t parse(int key, char *argument, struct argp_state *state) {
    struct arguments *arguments = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &arguments->bus;
        return 0;
    case 'j':
        arguments->json = true;
        return 0;
    case ARGP_KEY_ARG:
        argp_error(state, "monitor takes no argument, '%s' is too much", argument);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{&bus_options_parser, 0, NULL, 1}, {0}};
static const struct argp parser = {
    options,
    parse,
    "",
    "Watch a controller: pressures, bend, faults, warnings, the gap monitor, rates and what was "
    "lost. It commands nothing; q or Ctrl-C leaves, v vents. A board that goes away is waited "
    "for.\v"
    "Example: tribend monitor --bus can0",
    children,
    NULL,
    NULL};

/* --- the screen */

static void draw_bar(double pressure_pa, double target_pa, double full_pa) {
    const int filled =
        isfinite(pressure_pa) ? (int)lround(BAR * fmin(fmax(pressure_pa / full_pa, 0.0), 1.0)) : 0;
    const int aim = isfinite(target_pa) ? (int)lround(BAR * fmin(fmax(target_pa / full_pa, 0.0), 1.0)) : -1;
    putchar('[');
    for (int i = 0; i <= BAR; i++) {
        putchar(i == aim ? '|' : i < filled ? '#' : ' ');
    }
    putchar(']');
}

static void draw_pressures(const struct monitor *monitor) {
    const struct link_report *report = &monitor->report;
    printf(DIM "chamber   kPa   target  duty   0%*s%.0f kPa" PLAIN LINE_END, BAR - 5, "",
           1e-3 * monitor->full_pa);
    for (int c = 0; c < 3; c++) {
        const double pressure_pa = (double)report->status.pressure_estimate_pa[c];
        const double target_pa = (double)report->status.pressure_target_pa[c];
        printf("   %d   %7.3f %7.3f  %4.0f%%  ", c + 1, 1e-3 * pressure_pa, 1e-3 * target_pa,
               100.0 * (double)report->duty[c]);
        draw_bar(pressure_pa, target_pa, monitor->full_pa);
        fputs(LINE_END, stdout);
    }
    printf("supply %7.2f kPa" LINE_END LINE_END, 1e-3 * (double)report->supply_pa);
}

static void draw_words(const char *title, const char *colour, const char *words) {
    const bool none = strcmp(words, "none") == 0;
    printf("%-10s%s%.*s%s" PLAIN LINE_END, title, none ? "" : colour, WORDS_SHOWN, words,
           strlen(words) > WORDS_SHOWN ? "..." : "");
}

static void draw_head(const struct monitor *monitor) {
    const enum supervisor_state state = monitor->report.status.state;
    const char *colour = state == SUPERVISOR_FAULT ? RED : state == SUPERVISOR_ACTIVE ? GREEN : "";
    const int64_t silence_us = monitor->bus->can != NULL ? can_link_silence_us(monitor->bus->can) : 0;
    printf("tribend   bus %.30s", monitor->arguments->bus.bus);
    if (monitor->bus->can != NULL) {
        printf(", node %u", monitor->bus->can->node);
    }
    printf(", module %.28s" LINE_END, monitor->bus->module_name);
    if (silence_us > CAN_LINK_SILENT_US) {
        printf("state     " RED "silent for %.1f s; what follows is old" PLAIN LINE_END LINE_END,
               1e-6 * (double)silence_us);
    } else {
        printf("state     %s%-9s" PLAIN " %10.3f s  %6.1f reports/s" LINE_END LINE_END, colour,
               supervisor_state_name(state), 1e-6 * (double)monitor->report.time_us, monitor->rate_hz);
    }
}

static void draw_body(const struct monitor *monitor) {
    const struct controller_status *status = &monitor->report.status;
    const struct gap_monitor_report *gap = &status->gap;
    char words[WORDS_BYTES];
    printf("bend      %7.2f deg toward %7.1f deg   %s" LINE_END, DEGREES * (double)status->bend_rad,
           DEGREES * (double)status->direction_rad, status->bend_is_measured ? "measured" : "predicted");
    printf("tip       %7.2f %7.2f %7.2f mm" LINE_END, 1e3 * (double)monitor->report.tip_position_m[0],
           1e3 * (double)monitor->report.tip_position_m[1], 1e3 * (double)monitor->report.tip_position_m[2]);
    printf("gap       bend %.2f of %.2f deg, position %.2f of %.2f mm: %s%s" PLAIN LINE_END LINE_END,
           DEGREES * (double)gap->bend_gap_rad, DEGREES * (double)gap->bend_threshold_rad,
           1e3 * (double)gap->position_gap_m, 1e3 * (double)gap->position_threshold_m,
           gap->stage == GAP_MONITOR_NONE ? "" : YELLOW,
           gap->stage == GAP_MONITOR_NONE ? "none" : gap_monitor_stage_text(gap->stage));
    cli_describe_faults(status->faults, words, sizeof words);
    draw_words("faults", RED, words);
    cli_describe_warnings(status, words, sizeof words);
    draw_words("warnings", YELLOW, words);
}

static void draw_counters(const struct monitor *monitor) {
    struct can_link_counters counters;
    if (monitor->bus->can == NULL) {
        return;
    }
    can_link_count(monitor->bus->can, &counters);
    printf(LINE_END "frames    %" PRIu64 " received, %" PRIu64 " sent, %" PRIu64 " foreign, %" PRIu64
                    " undecodable" LINE_END,
           counters.received, counters.sent, counters.foreign, counters.undecodable);
    printf("lost      %" PRIu64 " reports on the way, %" PRIu64 " in the kernel, %" PRIu64 " here, %" PRIu64
           " not sent" LINE_END,
           counters.missing, counters.overflowed, counters.dropped, counters.unsent);
    printf("bus       %" PRIu64 " error frames, %" PRIu64 " bus-off; board silent %" PRIu64
           "x, restarted %" PRIu64 "x, reopened %" PRIu64 "x" LINE_END,
           counters.error_frames, counters.bus_off, counters.silences, counters.restarts,
           counters.reconnects);
}

static void draw(struct monitor *monitor) {
    const int64_t time_us = program_now_us();
    if (monitor->arguments->json) {
        json_t *object = report_json(monitor->bus, &monitor->report);
        (void)json_dumpf(object, stdout, JSON_COMPACT | JSON_REAL_PRECISION(9));
        json_decref(object);
        putchar('\n');
        (void)fflush(stdout);
        monitor->drawn_us = time_us;
        return;
    }
    const double elapsed_s = 1e-6 * (double)(time_us - monitor->drawn_us);
    const double rate_hz = (double)(monitor->reports - monitor->reports_before) / elapsed_s;
    monitor->rate_hz += 0.2 * (rate_hz - monitor->rate_hz);
    monitor->reports_before = monitor->reports;
    monitor->drawn_us = time_us;
    for (int c = 0; c < 3; c++) {
        monitor->full_pa = fmax(monitor->full_pa, (double)monitor->report.status.pressure_estimate_pa[c]);
    }
    fputs("\033[H", stdout);
    draw_head(monitor);
    draw_pressures(monitor);
    draw_body(monitor);
    draw_counters(monitor);
    fputs(LINE_END DIM "q leaves, v vents" PLAIN "\033[J", stdout);
    (void)fflush(stdout);
}

/* --- the terminal */

static bool enter_screen(struct termios *before) {
    struct termios raw;
    if (tcgetattr(STDIN_FILENO, before) != 0) {
        return false;
    }
    raw = *before;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    raw.c_cc[VMIN] = 0;
    raw.c_cc[VTIME] = 0;
    return tcsetattr(STDIN_FILENO, TCSANOW, &raw) == 0;
}

/* False: it is time to leave. */
static bool take_key(struct monitor *monitor) {
    const struct controller_command vent = {.kind = COMMAND_VENT};
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    char key = 0;
    if (poll(&input, 1, 0) <= 0 || read(STDIN_FILENO, &key, 1) != 1) {
        return true;
    }
    if (key == 'v') {
        (void)monitor->bus->link.send(monitor->bus->link.context, &vent);
    }
    return key != 'q';
}

/* One report, in its own time; a simulation is slowed down to it. */
static void take_report(struct monitor *monitor, int64_t start_us) {
    struct bus *bus = monitor->bus;
    bus_drill(bus, &monitor->arguments->bus);
    if (bus->can != NULL) {
        monitor->reports +=
            can_link_receive(bus->can, DRAW_US, &monitor->report) == CAN_LINK_REPORT ? 1u : 0u;
        return;
    }
    (void)bus->link.receive(bus->link.context, &monitor->report);
    monitor->reports++;
    const int64_t ahead_us = monitor->report.time_us - (program_now_us() - start_us);
    if (ahead_us > 0) {
        const struct timespec pause = {.tv_nsec = ahead_us % 1000000 * 1000};
        (void)nanosleep(&pause, NULL);
    }
}

static int watch(struct monitor *monitor, bool keys) {
    const double duration_s = monitor->arguments->bus.duration_s;
    const int64_t start_us = program_now_us();
    const int64_t end_us = duration_s > 0.0 ? start_us + (int64_t)(1e6 * duration_s) : INT64_MAX;
    monitor->drawn_us = start_us;
    while (program_interrupted == 0 && program_now_us() < end_us && (!keys || take_key(monitor))) {
        take_report(monitor, start_us);
        if (program_now_us() >= monitor->drawn_us + DRAW_US) {
            draw(monitor);
        }
    }
    return EXIT_OK;
}

static int show(struct bus *bus, void *input) {
    struct monitor *monitor = input;
    struct termios before;
    monitor->bus = bus;
    program_catch_interrupt();
    if (monitor->arguments->json) {
        return watch(monitor, false);
    }
    if (isatty(STDOUT_FILENO) == 0 || !enter_screen(&before)) {
        return program_fail(EXIT_USAGE, "the monitor wants a terminal; --json is for programs");
    }
    fputs("\033[?1049h\033[?25l\033[2J", stdout);
    const int code = watch(monitor, true);
    fputs("\033[?25h\033[?1049l", stdout);
    (void)fflush(stdout);
    (void)tcsetattr(STDIN_FILENO, TCSANOW, &before);
    return code;
}

int cli_monitor(int argc, char **argv) {
    struct arguments arguments = {.json = false};
    struct monitor monitor = {.arguments = &arguments, .full_pa = BAR_PA};
    bus_options_init(&arguments.bus);
    arguments.bus.duration_s = 0.0; /* until q or Ctrl-C */
    argp_err_exit_status = EXIT_USAGE;
    if (argp_parse(&parser, argc, argv, 0, NULL, &arguments) != 0) {
        return EXIT_USAGE;
    }
    return bus_run(&arguments.bus, show, &monitor);
}
