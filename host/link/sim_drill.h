/* Drills: a fault that is put into the simulation at a given time, so that people see what the controller makes of it. */
#ifndef TRIBEND_SIM_DRILL_H
#define TRIBEND_SIM_DRILL_H

#include "link/sim_link.h"

enum sim_drill_kind {
    SIM_DRILL_NONE = 0,
    SIM_DRILL_OVERPRESSURE,    /* chamber 1 reads over the hard limit */
    SIM_DRILL_SENSOR_RANGE,    /* chamber 1's channel cannot be read */
    SIM_DRILL_TIP_LOST,        /* no more tip samples */
    SIM_DRILL_COMMAND_TIMEOUT, /* the host falls silent: sim_drill_silences_host() */
    SIM_DRILL_TABLE_CORRUPT    /* one bit of the table's image flips */
};

struct sim_drill {
    enum sim_drill_kind kind;
    int64_t at_us;
};

/* "KIND@TIME", such as overpressure@2s. False: `error` lists what is known. */
bool sim_drill_parse(const char *text, struct sim_drill *drill, char *error, size_t error_bytes);
/* Put the fault in, once its time has come. `image` is the table's, writable. */
void sim_drill_apply(const struct sim_drill *drill, struct sim_link *link, uint8_t *image, size_t image_bytes);
bool sim_drill_silences_host(const struct sim_drill *drill, int64_t time_us);

#endif
