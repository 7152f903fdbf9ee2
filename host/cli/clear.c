/* tribend clear: leave FAULT on purpose. Only what was seen here is cleared: a fault that comes meanwhile
 * stays. */
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"
#include "cli/report_json.h"
#include "comms/node.h"

#define WITHIN_US 2500000
#define AGAIN_US 700000 /* nearer to the last one, refused or not, the controller takes it for one of a stream */
#define WORDS_BYTES 512

static const char usage[] =
    "Leave FAULT, if the cause of each latched fault is gone. The module stays vented until the "
    "next command.\v"
    "Example: tribend clear --bus can0";

static void send_clear(struct bus *bus, uint32_t faults) {
    const struct controller_command command = {.kind = COMMAND_CLEAR};
    const union message message = {.clear = {.key = MESSAGE_CLEAR_KEY, .faults = faults}};
    if (bus->can != NULL) {
        (void)can_link_post(bus->can, MESSAGE_CLEAR, &message);
    } else {
        (void)bus->link.send(bus->link.context, &command);
    }
}

static int still_there(uint32_t faults) {
    char words[WORDS_BYTES];
    cli_describe_faults(faults, words, sizeof words);
    (void)program_fail(EXIT_REFUSED, "the controller stays in FAULT: %s", words);
    for (int f = 0; f < (int)FAULT_COUNT; f++) {
        if ((faults & (1u << (unsigned)f)) != 0u) {
            const struct supervisor_fault_row *row = supervisor_fault_describe((enum supervisor_fault)f);
            fprintf(stderr, "  %s\n    cleared when  %s\n    remedy        %s\n", row->name, row->clear,
                    row->remedy);
        }
    }
    return EXIT_REFUSED;
}

static int say_cleared(struct bus *bus, const struct bus_options *options, const struct link_report *report,
                       uint32_t faults) {
    char words[WORDS_BYTES];
    if (options->json) {
        json_t *object = report_json(bus, report);
        (void)json_object_set_new(object, "cleared", report_faults_json(faults));
        return report_json_print(object);
    }
    if (faults == 0u) {
        printf("nothing to clear: state %s\n", supervisor_state_name(report->status.state));
    } else {
        cli_describe_faults(faults, words, sizeof words);
        printf("cleared   %s; state SAFE, vented\n", words);
    }
    return EXIT_OK;
}

static int clear(struct bus *bus, void *input) {
    const struct bus_options *options = input;
    struct link_report report;
    if (!bus->link.receive(bus->link.context, &report)) {
        return bus_gone(bus, options);
    }
    const uint32_t faults = report.status.faults;
    const int64_t start_us = report.time_us;
    if (report.status.state != SUPERVISOR_FAULT) {
        return say_cleared(bus, options, &report, 0u);
    }
    for (int64_t again_us = start_us; report.time_us < start_us + WITHIN_US;) {
        if (report.time_us >= again_us) {
            again_us = report.time_us + AGAIN_US;
            send_clear(bus, faults);
        }
        if (!bus->link.receive(bus->link.context, &report)) {
            return bus_gone(bus, options);
        }
        if (report.status.state == SUPERVISOR_SAFE) {
            return say_cleared(bus, options, &report, faults);
        }
    }
    return still_there(report.status.faults);
}

int cli_clear(int argc, char **argv) {
    struct bus_options options;
    bus_options_init(&options);
    const int code = bus_parse_alone("clear", usage, argc, argv, &options);
    return code == EXIT_OK ? bus_run(&options, clear, &options) : code;
}
