/* The course of a command: wait until the controller is ready, send and repeat, vent, sum up. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"
#include "cli/report_json.h"
#include "cli/run_course.h"
#include "comms/node.h"
#include "log/run_log.h"
#include "report/run_summary.h"

#define DEGREES (180.0 / M_PI)
#define READY_WITHIN_US 2000000
#define STARTED_WITHIN_US 2000000
#define REFUSALS_TRIED 16
#define REFUSALS_US 50000
#define REPEAT_US 100000
#define CHANGE_US 10000 /* a command that changes is sent at most this often */
#define PROGRESS_US 500000
#define VENT_WITHIN_US 10000000
#define VENTED_PA 500.0f
#define WORDS_BYTES 512
#define NOTE_BYTES 512

struct run {
    const struct bus_options *options;
    struct bus *bus;
    struct run_log_writer *log; /* NULL: not recorded */
    struct controller_command command; /* sent last */
    int64_t sent_us;
    int64_t next_send_us;
    int64_t next_progress_us;
    struct run_summary summary;
    bool moved; /* since the start */
};

static bool supervisor_moves(enum supervisor_state state) {
    return state == SUPERVISOR_ACTIVE || state == SUPERVISOR_HOLD;
}

static bool is_same(const struct controller_command *a, const struct controller_command *b) {
    return a->kind == b->kind && a->pressure_pa[0] == b->pressure_pa[0] &&
           a->pressure_pa[1] == b->pressure_pa[1] && a->pressure_pa[2] == b->pressure_pa[2] &&
           a->bend_rad == b->bend_rad && a->direction_rad == b->direction_rad &&
           a->co_contraction_pa == b->co_contraction_pa;
}

static bool send(struct run *run, const struct controller_command *command, int64_t time_us) {
    const bool changed = !is_same(command, &run->command) && time_us >= run->sent_us + CHANGE_US;
    if ((time_us < run->next_send_us && !changed) || sim_drill_silences_host(&run->options->drill, time_us)) {
        return true;
    }
    run->sent_us = time_us;
    run->next_send_us = time_us + REPEAT_US;
    run->command = *command;
    return run->bus->link.send(run->bus->link.context, &run->command);
}

/* One report, logged; false: the link is gone. */
static bool receive(struct run *run, struct link_report *report) {
    struct bus *bus = run->bus;
    bus_drill(bus, run->options);
    if (!bus->link.receive(bus->link.context, report)) {
        return false;
    }
    if (run->log != NULL) {
        run_log_append(run->log, report, &run->command);
    }
    return true;
}

static void show_progress(struct run *run, const struct link_report *report) {
    const struct controller_status *status = &report->status;
    if (run->options->quiet || run->options->json || report->time_us < run->next_progress_us) {
        return;
    }
    run->next_progress_us = report->time_us + PROGRESS_US;
    printf("%6.1f s  %-8s bend %6.2f deg  toward %7.2f deg  pressures %6.2f %6.2f %6.2f kPa  targets %6.2f %6.2f %6.2f "
           "kPa%s\n",
           1e-6 * (double)report->time_us, supervisor_state_name(status->state), DEGREES * (double)status->bend_rad,
           DEGREES * (double)status->direction_rad, 1e-3 * (double)report->pressure_pa[0],
           1e-3 * (double)report->pressure_pa[1], 1e-3 * (double)report->pressure_pa[2],
           1e-3 * (double)status->pressure_target_pa[0], 1e-3 * (double)status->pressure_target_pa[1],
           1e-3 * (double)status->pressure_target_pa[2], status->bend_is_measured ? "" : "  (no tip: predicted)");
    (void)fflush(stdout);
}

/* Until SAFE; an exit code. */
static int wait_ready(struct run *run, struct link_report *report) {
    int64_t until_us = INT64_MAX;
    do {
        if (!receive(run, report)) {
            return bus_gone(run->bus, run->options);
        }
        until_us = until_us == INT64_MAX ? report->time_us + READY_WITHIN_US : until_us;
        if (report->status.state == SUPERVISOR_FAULT) {
            return EXIT_FAULT;
        }
        if (report->time_us > until_us && supervisor_moves(report->status.state)) {
            return program_fail(EXIT_REFUSED,
                                "the controller is in %s: another host commands it; stop that one, or say tribend vent",
                                supervisor_state_name(report->status.state));
        }
        if (report->time_us > until_us) {
            return program_fail(EXIT_FAULT, "the controller stayed in %s: do all chambers read under 2 kPa?",
                                supervisor_state_name(report->status.state));
        }
    } while (report->status.state != SUPERVISOR_SAFE);
    return EXIT_OK;
}

static int explain_refusal(struct run *run) {
    union message message = {.refusals = {.count = 0}};
    for (int i = 0; i < REFUSALS_TRIED && message.refusals.count == 0; i++) {
        struct can_link_answer answer;
        if (can_link_answer(run->bus->can, REFUSALS_US, &answer) && answer.id == MESSAGE_REFUSALS) {
            message = answer.message;
        }
    }
    return program_fail(EXIT_REFUSED, "the board did not start to move: %s",
                        message.refusals.count > 0 ? node_refusal_text((enum node_refusal)message.refusals.reason)
                                                   : "it did not say why");
}

/* Does it still do what it was told? An exit code, with the message printed but for EXIT_FAULT. */
static int judge(struct run *run, const struct link_report *report, int64_t start_us) {
    const bool moves = supervisor_moves(report->status.state);
    if (report->status.state == SUPERVISOR_FAULT) {
        return EXIT_FAULT;
    }
    if (run->moved && !moves && run->command.kind != COMMAND_VENT) {
        return program_fail(EXIT_REFUSED, "at %.2f s the board went to %s: another host vented it, or it started anew",
                            1e-6 * (double)report->time_us, supervisor_state_name(report->status.state));
    }
    run->moved = moves;
    if (run->bus->can != NULL && !moves && run->command.kind != COMMAND_VENT &&
        report->time_us > start_us + STARTED_WITHIN_US) {
        return explain_refusal(run);
    }
    return EXIT_OK;
}

static int follow(struct run *run, const struct run_course *course, struct link_report *report) {
    const int64_t start_us = report->time_us;
    const int64_t end_us = start_us + (int64_t)(1e6 * run->options->duration_s);
    struct controller_command command;
    course->command_at(course->context, 0.0, &command);
    run->command = command;
    run_summary_start(&run->summary, course->steady != NULL ? course->steady : &command, start_us, end_us);
    while (report->time_us < end_us && program_interrupted == 0) {
        course->command_at(course->context, 1e-6 * (double)(report->time_us - start_us), &command);
        if (!send(run, &command, report->time_us) || !receive(run, report)) {
            return bus_gone(run->bus, run->options);
        }
        run_summary_add(&run->summary, report);
        show_progress(run, report);
        const int code = judge(run, report, start_us);
        if (code != EXIT_OK) {
            return code;
        }
    }
    return program_interrupted == 0 ? EXIT_OK : EXIT_INTERRUPTED;
}

/* Vent, and watch the pressures go; true once they are gone. */
static bool vent(struct run *run, struct link_report *report) {
    const int64_t until_us = report->time_us + VENT_WITHIN_US;
    const float *pressure_pa = report->status.pressure_estimate_pa;
    const struct controller_command command = {.kind = COMMAND_VENT};
    bool vented = false;
    run->command = command;
    run->next_send_us = report->time_us;
    while (!vented && report->time_us < until_us) {
        if (!send(run, &command, report->time_us) || !receive(run, report)) {
            return false;
        }
        vented = pressure_pa[0] < VENTED_PA && pressure_pa[1] < VENTED_PA && pressure_pa[2] < VENTED_PA;
    }
    return vented;
}

/* Until Ctrl-C comes again, a fault, or the bus' end. */
static void hold(struct run *run, struct link_report *report) {
    const struct controller_command command = {.kind = COMMAND_HOLD};
    program_interrupted = 0;
    program_catch_interrupt();
    run->next_send_us = report->time_us;
    while (program_interrupted == 0 && report->status.state != SUPERVISOR_FAULT) {
        if (!send(run, &command, report->time_us) || !receive(run, report)) {
            return;
        }
        show_progress(run, report);
    }
}

static void print_followed(const struct run_summary *summary) {
    const struct controller_command *command = &summary->command;
    if (command->kind == COMMAND_BEND && summary->samples > 0) {
        const double n = (double)summary->samples;
        const double bend = DEGREES * summary->bend_sum_rad / n, turn = DEGREES * summary->direction_sum_rad / n;
        printf("bend      %.2f deg, error %+.2f deg (rms %.2f deg)\n", bend, bend - DEGREES * (double)command->bend_rad,
               DEGREES * sqrt(summary->bend_square_rad2 / n));
        if (command->bend_rad > 0.0f) {
            printf("direction %.2f deg, error %+.2f deg (rms %.2f deg)\n",
                   DEGREES * (double)command->direction_rad + turn, turn,
                   DEGREES * sqrt(summary->direction_square_rad2 / n));
        }
    }
    if (summary->pressure_samples > 0) {
        const double n = (double)summary->pressure_samples;
        printf("pressures");
        for (size_t c = 0; c < 3; c++) {
            printf("%s %.3f kPa (rms error %.0f Pa)", c > 0 ? "," : "", 1e-3 * summary->pressure_sum_pa[c] / n,
                   sqrt(summary->pressure_square_pa2[c] / n));
        }
        printf("\n");
    }
    const double settling_s = run_summary_settling_s(summary);
    const char *band = command->kind == COMMAND_BEND ? "1 deg" : "0.2 kPa";
    if (settling_s >= 0.0) {
        printf("settled   within %s after %.2f s\n", band, settling_s);
    } else {
        printf("settled   not within %s\n", band);
    }
}

static void print_health(const struct link_report *last) {
    char words[WORDS_BYTES];
    cli_describe_warnings(&last->status, words, sizeof words);
    printf("warnings  %s\n", words);
    printf("tip       %u samples, %u rejected, lost %u times; commands refused: %u\n", last->status.tip_samples,
           last->status.tip_rejected, last->status.tip_lost_count, last->status.commands_refused);
}

static int explain_fault(const struct link_report *report) {
    char words[WORDS_BYTES];
    cli_describe_faults(report->status.faults, words, sizeof words);
    (void)program_fail(EXIT_FAULT, "the controller vented and is in FAULT since %.3f s: %s",
                       1e-6 * (double)report->time_us, words);
    for (int f = 0; f < (int)FAULT_COUNT; f++) {
        if ((report->status.faults & (1u << (unsigned)f)) != 0u) {
            const struct supervisor_fault_row *row = supervisor_fault_describe((enum supervisor_fault)f);
            fprintf(stderr, "  %s\n    seen by   %s\n    reaction  %s\n    remedy    %s\n", row->name, row->detector,
                    row->reaction, row->clear);
        }
    }
    return EXIT_FAULT;
}

/* In words; an exit code. */
static int sum_up(const struct run *run, const struct run_course *course, const struct link_report *last, int code) {
    if (code == EXIT_FAULT) {
        return explain_fault(last);
    }
    if (!run->options->json && (code == EXIT_OK || code == EXIT_INTERRUPTED)) {
        if (course->steady != NULL) {
            print_followed(&run->summary);
        }
        print_health(last);
    }
    return code;
}

static int print_json(struct run *run, const struct run_course *course, struct run_outcome *outcome, int code) {
    outcome->summary = &run->summary;
    outcome->plan = course->plan;
    outcome->record = run->options->record;
    outcome->interrupted = code == EXIT_INTERRUPTED;
    return report_json_print(run_outcome_json(run->bus, outcome)) == EXIT_OK ? code : EXIT_OUTPUT;
}

static int run_on_bus(struct run *run, const struct run_course *course) {
    const struct controller_command vent_command = {.kind = COMMAND_VENT};
    struct link_report report;
    memset(&report, 0, sizeof report);
    int code = wait_ready(run, &report);
    if (code == EXIT_REFUSED) {
        return code; /* what moves there is another host's */
    }
    if (code == EXIT_OK) {
        code = follow(run, course, &report);
    }
    if (code == EXIT_BUS) {
        (void)run->bus->link.send(run->bus->link.context, &vent_command);
        return code;
    }
    if (code == EXIT_INTERRUPTED) {
        fprintf(run->options->json ? stderr : stdout, "interrupted at %.2f s: %s\n", 1e-6 * (double)report.time_us,
                run->options->hold_on_interrupt ? "holding, Ctrl-C again vents" : "venting");
        (void)fflush(stdout);
    }
    if (code == EXIT_INTERRUPTED && run->options->hold_on_interrupt) {
        hold(run, &report);
    }
    struct link_report last = report;
    const int64_t vent_us = report.time_us;
    const bool vented = vent(run, &report);
    const double vented_s = 1e-6 * (double)(report.time_us - vent_us);
    code = sum_up(run, course, &last, code);
    if (run->options->json) {
        struct run_outcome outcome = {.last = &last,
                                      .followed_s = 1e-6 * (double)(vent_us - run->summary.start_us),
                                      .vented_s = vented ? vented_s : -1.0};
        code = print_json(run, course, &outcome, code);
    } else if (vented) {
        printf("vented    in %.2f s\n", vented_s);
    }
    if (!vented) {
        (void)program_fail(EXIT_FAULT, "the chambers did not vent: %.0f, %.0f, %.0f Pa left",
                           (double)report.pressure_pa[0], (double)report.pressure_pa[1],
                           (double)report.pressure_pa[2]);
        code = EXIT_FAULT;
    }
    return code;
}

int run_course(const struct bus_options *options, const struct run_course *course) {
    static struct bus bus;
    struct run_log_writer log;
    char error[PROGRAM_ERROR_BYTES], note[NOTE_BYTES];
    int code = bus_open(&bus, options);
    if (code != EXIT_OK) {
        return code;
    }
    (void)snprintf(note, sizeof note, "%sbus %s, seed %" PRIu64, course->note, options->bus, options->seed);
    const struct run_log_metadata metadata = {
        .module = bus.module_name, .table_hash = bus.table_hash, .rate_hz = bus.rate_hz, .note = note};
    if (options->record != NULL && !run_log_create(&log, options->record, &metadata, error, sizeof error)) {
        bus_close(&bus);
        return program_fail(EXIT_OUTPUT, "%s", error);
    }
    if (!options->json) {
        printf("module    %s, table %s\n", bus.module_name, bus.table_path);
    }
    program_catch_interrupt();
    struct run run = {.options = options, .bus = &bus, .log = options->record != NULL ? &log : NULL};
    code = run_on_bus(&run, course);
    if (options->record != NULL && !run_log_finish(&log, error, sizeof error)) {
        code = program_fail(EXIT_OUTPUT, "%s", error);
    } else if (options->record != NULL && !options->json) {
        printf("wrote     %s\n", options->record);
    }
    bus_close(&bus);
    return code;
}

static void same_at_all_times(const void *context, double since_s, struct controller_command *command) {
    (void)since_s;
    *command = *(const struct controller_command *)context;
}

int run_command(const struct bus_options *options, const struct controller_command *command) {
    const struct run_course course = {
        .context = command, .command_at = same_at_all_times, .steady = command, .note = ""};
    return run_course(options, &course);
}
