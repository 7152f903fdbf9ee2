/* A board's telemetry, message by message, into the reports of link.h.
 *
 * Pure: messages in, reports out. A report is complete with each PRESSURES (classic) or TELEMETRY (FD): the
 * newest of everything else, on the board's clock, which TIME ties to control steps. A board that starts anew
 * begins again at 0: its reports go on where the last one stood. Numbers that the board could not measure are
 * NaN. */
#ifndef TRIBEND_CAN_ASSEMBLY_H
#define TRIBEND_CAN_ASSEMBLY_H

#include "comms/codec.h"
#include "link/link.h"

struct can_assembly {
    struct link_report report;
    uint32_t telemetry_slowdown; /* periods are so many times the table's */
    uint64_t restarts;           /* of the board */
    uint64_t missing;            /* reports that were lost on the way, by the gaps between steps */
    bool status_known; /* no report before: its state would be made up */
    bool time_known;
    uint64_t time_us; /* of `step` */
    uint16_t step;
    int64_t offset_us; /* of reports over the board's clock */
    bool reported;
    uint64_t reported_us; /* board time of the last report */
    bool position_waits;
    bool tip_waits;
    uint16_t tip_measured;
};

void can_assembly_init(struct can_assembly *assembly);
/* True: `assembly->report` is a new report. */
bool can_assembly_take(struct can_assembly *assembly, enum message_id id, const union message *message);

#endif
