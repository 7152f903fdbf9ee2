/* tribend vent: vent all chambers. Sent before anything else is looked at: every version of a board obeys it.
 */
#include <stdio.h>
#include <string.h>

#include "cli/commands.h"
#include "cli/report_json.h"

#define VENT_WITHIN_US 10000000
#define VENTED_PA 500.0f

static const char usage[] = "Vent all chambers, whatever else goes on, and watch the pressures go.\v"
                            "Example: tribend vent --bus can0";

static bool is_vented(const struct link_report *report) {
    const float *pressure_pa = report->status.pressure_estimate_pa;
    return pressure_pa[0] < VENTED_PA && pressure_pa[1] < VENTED_PA && pressure_pa[2] < VENTED_PA &&
           report->status.state != SUPERVISOR_ACTIVE && report->status.state != SUPERVISOR_HOLD;
}

static int say_vented(struct bus *bus, const struct bus_options *options, const struct link_report *report,
                      double vented_s) {
    if (options->json) {
        json_t *object = report_json(bus, report);
        (void)json_object_set_new(object, "vented_s", json_real(vented_s));
        return report_json_print(object);
    }
    printf("vented    in %.2f s, state %s\n", vented_s, supervisor_state_name(report->status.state));
    return EXIT_OK;
}

static int vent(struct bus *bus, void *input) {
    const struct bus_options *options = input;
    const struct controller_command command = {.kind = COMMAND_VENT};
    struct link_report report;
    int64_t start_us = -1;
    (void)bus->link.send(bus->link.context, &command);
    do {
        if (!bus->link.receive(bus->link.context, &report)) {
            return bus_gone(bus, options);
        }
        start_us = start_us < 0 ? report.time_us : start_us;
        if (is_vented(&report)) {
            return say_vented(bus, options, &report, 1e-6 * (double)(report.time_us - start_us));
        }
    } while (report.time_us < start_us + VENT_WITHIN_US);
    return program_fail(
        EXIT_FAULT, "the chambers did not vent: %.0f, %.0f, %.0f Pa left: shut the supply off by hand",
        (double)report.pressure_pa[0], (double)report.pressure_pa[1], (double)report.pressure_pa[2]);
}

int cli_vent(int argc, char **argv) {
    struct bus_options options;
    bus_options_init(&options);
    options.vent_at_once = true;
    const int code = bus_parse_alone("vent", usage, argc, argv, &options);
    return code == EXIT_OK ? bus_run(&options, vent, &options) : code;
}
