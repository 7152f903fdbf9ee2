/* A link to a controller: commands go out, reports come in. One transport a file; the caller does not know which. */
#ifndef TRIBEND_LINK_H
#define TRIBEND_LINK_H

#include "control/controller.h"

/* What one control step looked like. */
struct link_report {
    int64_t time_us;
    struct controller_status status;
    float duty[3];
    float pressure_pa[3]; /* single samples */
    float supply_pa;
    bool tip_new;
    int64_t tip_measured_us;
    float tip_position_m[3];
    float tip_quaternion[4];
    uint16_t tip_quality;
    uint16_t tip_status;
};

struct link {
    void *context;
    /* Hand over a command. False: it could not be sent. */
    bool (*send)(void *context, const struct controller_command *command);
    /* Wait for the next report. False: the link is gone. */
    bool (*receive)(void *context, struct link_report *report);
    void (*close)(void *context);
};

#endif
