#include "link/sim_drill.h"

#include <stdio.h>
#include <string.h>

#include "units/units.h"

#define OVERPRESSURE_PA 20000.0f

static const char *const names[] = {[SIM_DRILL_OVERPRESSURE] = "overpressure",
                                    [SIM_DRILL_SENSOR_RANGE] = "sensor-range",
                                    [SIM_DRILL_TIP_LOST] = "tip-lost",
                                    [SIM_DRILL_COMMAND_TIMEOUT] = "command-timeout",
                                    [SIM_DRILL_TABLE_CORRUPT] = "table-corrupt"};

bool sim_drill_parse(const char *text, struct sim_drill *drill, char *error, size_t error_bytes) {
    const size_t length = strcspn(text, "@");
    double time_s = 0.0;
    for (size_t k = SIM_DRILL_OVERPRESSURE; k < sizeof names / sizeof names[0]; k++) {
        if (strlen(names[k]) == length && strncmp(text, names[k], length) == 0) {
            if (text[length] != '@') {
                (void)snprintf(error, error_bytes, "'%s' says no time; write %s@2s", text, names[k]);
                return false;
            }
            if (!units_parse(UNITS_TIME, text + length + 1, &time_s, error, error_bytes)) {
                return false;
            }
            *drill = (struct sim_drill){.kind = (enum sim_drill_kind)k, .at_us = (int64_t)(1e6 * time_s)};
            return true;
        }
    }
    (void)snprintf(error, error_bytes,
                   "there is no drill '%.*s'; there are overpressure, sensor-range, tip-lost, command-timeout and "
                   "table-corrupt, each with a time: tip-lost@2s",
                   (int)length, text);
    return false;
}

void sim_drill_apply(const struct sim_drill *drill, struct sim_link *link, uint8_t *image, size_t image_bytes) {
    struct sim_faults *faults = &link->sim.faults;
    if (drill->kind == SIM_DRILL_NONE || link->sim.time_us < drill->at_us) {
        return;
    }
    switch (drill->kind) {
    case SIM_DRILL_OVERPRESSURE:
        faults->reading_replaced[0] = true;
        faults->reading_pa[0] = OVERPRESSURE_PA;
        break;
    case SIM_DRILL_SENSOR_RANGE:
        faults->channel_fails[0] = true;
        break;
    case SIM_DRILL_TIP_LOST:
        faults->tip_stops = true;
        break;
    case SIM_DRILL_TABLE_CORRUPT:
        if (link->sim.time_us < drill->at_us + CONTROLLER_STEP_US) {
            image[image_bytes - 1u] ^= 1u; /* a node's tag, which the plant does not use */
        }
        break;
    case SIM_DRILL_COMMAND_TIMEOUT:
    case SIM_DRILL_NONE:
    default:
        break;
    }
}

bool sim_drill_silences_host(const struct sim_drill *drill, int64_t time_us) {
    return drill->kind == SIM_DRILL_COMMAND_TIMEOUT && time_us >= drill->at_us;
}
