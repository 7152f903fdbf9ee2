/* tribend hold: take over a motion that another host began, and keep its pressures until Ctrl-C; then vent.
 */
#include <stdio.h>

#include "cli/commands.h"
#include "cli/report_json.h"

#define WITHIN_US 1000000
#define WORDS_BYTES 512

static const char usage[] =
    "Keep the pressures that the module has now, which another host commanded, until --for is "
    "over or Ctrl-C; then vent. The other host's commands are refused from then on.\v"
    "Example: tribend hold --bus can0 --for 60s";

static bool moves(enum supervisor_state state) {
    return state == SUPERVISOR_ACTIVE || state == SUPERVISOR_HOLD;
}

/* With --json on the side, for the object comes at the end. */
static void say_held(const struct bus_options *options, const struct link_report *report) {
    fprintf(options->json ? stderr : stdout, "holding   %.3f %.3f %.3f kPa; Ctrl-C vents\n",
            1e-3 * (double)report->pressure_pa[0], 1e-3 * (double)report->pressure_pa[1],
            1e-3 * (double)report->pressure_pa[2]);
    (void)fflush(stdout);
}

/* From the first report that it is held, for as long as asked, or until it cannot be; an exit code. */
static int hold(struct bus *bus, const struct bus_options *options, struct link_report *report) {
    const struct controller_command command = {.kind = COMMAND_HOLD};
    const int64_t start_us = report->time_us, asked_us = program_now_us();
    int64_t end_us = INT64_MAX;
    while (report->time_us < end_us && program_interrupted == 0) {
        if (!bus->link.send(bus->link.context, &command) || !bus->link.receive(bus->link.context, report)) {
            return bus_gone(bus, options);
        }
        if (report->status.state == SUPERVISOR_FAULT) {
            char words[WORDS_BYTES];
            cli_describe_faults(report->status.faults, words, sizeof words);
            return program_fail(EXIT_FAULT, "the controller went to FAULT and vented: %s", words);
        }
        if (end_us == INT64_MAX && report->status.state == SUPERVISOR_HOLD) {
            end_us = report->time_us + (int64_t)(1e6 * options->duration_s);
            say_held(options, report);
        }
        /* a report may have waited here while this host did something else: both clocks must say that it is late */
        const bool late = report->time_us - start_us > WITHIN_US && program_now_us() - asked_us > WITHIN_US;
        if (!moves(report->status.state) || (end_us == INT64_MAX && late)) {
            return program_fail(EXIT_REFUSED, "the controller is in %s and does not hold",
                                supervisor_state_name(report->status.state));
        }
    }
    return program_interrupted == 0 ? EXIT_OK : EXIT_INTERRUPTED;
}

static int run(struct bus *bus, void *input) {
    const struct bus_options *options = input;
    const struct controller_command vent = {.kind = COMMAND_VENT};
    struct link_report report;
    if (!bus->link.receive(bus->link.context, &report)) {
        return bus_gone(bus, options);
    }
    if (!moves(report.status.state)) {
        return program_fail(EXIT_REFUSED, "there is nothing to hold: the controller is in %s",
                            supervisor_state_name(report.status.state));
    }
    program_catch_interrupt();
    const int code = hold(bus, options, &report);
    const struct link_report held = report;
    (void)bus->link.send(bus->link.context, &vent);
    while (code != EXIT_BUS && moves(report.status.state) && bus->link.receive(bus->link.context, &report)) {
    }
    if (code != EXIT_OK && code != EXIT_INTERRUPTED) {
        return code;
    }
    if (options->json) {
        return report_json_print(report_json(bus, &held)) == EXIT_OK ? code : EXIT_OUTPUT;
    }
    printf("venting   state %s\n", supervisor_state_name(report.status.state));
    return code;
}

int cli_hold(int argc, char **argv) {
    struct bus_options options;
    bus_options_init(&options);
    options.duration_s = 86400.0;
    const int code = bus_parse_alone("hold", usage, argc, argv, &options);
    return code == EXIT_OK ? bus_run(&options, run, &options) : code;
}
