/* What flies a trial: the simulated board (bench.h) or the emulated one (emulated.h), one control step at a time. */
#ifndef TRIBEND_VEHICLE_H
#define TRIBEND_VEHICLE_H

#include "campaign/injection.h"

struct vehicle {
    void *context;
    /* Switched on, and through its self-test; returns the time, us. */
    int64_t (*start)(void *context, const struct plant_parameters *plant, uint64_t seed);
    void (*inject)(void *context, const struct injection *injection, size_t chamber, struct random_stream *random);
    /* `command` NULL: none came. */
    void (*step)(void *context, const struct controller_command *command);
    void (*sample)(void *context, struct oracle_sample *sample);
    void (*finish)(void *context);
};

#endif
