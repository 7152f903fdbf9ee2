/* A random mission in closed loop: the host's controller against the simulated plant, and the frames that an emulated
 * core gets to do the same. Commands: bends all over the reachable set, jumps between its ends, its edge and beyond,
 * streams at every step, co-contraction, pressures, hold, vent; now and then the tip sensor falls silent, a reading
 * leaves its range and is cleared again, nonsense is sent. */
#ifndef TRIBEND_MISSION_H
#define TRIBEND_MISSION_H

#include "frame_app.h"
#include "sim/sim_hal.h"

struct mission {
    const struct bend_table *table;
    struct frame_app board;
    struct frame frame;
    struct sim sim;
    struct hal plant;
    struct random_stream random;
    struct frame_command command; /* repeated */
    int64_t next_us;              /* when it changes */
    bool streams;                 /* a new bend at every step */
    uint32_t step;
};

/* `image` (of `bytes`) must outlive the mission. False: refused; frame.status says why. */
bool mission_open(struct mission *mission, const void *image, size_t bytes, enum frame_variant variant, uint64_t seed);
/* Fills frame.input for the next step; the caller may hand it to another core before mission_step(). */
void mission_read(struct mission *mission);
/* The host's controller takes the step, then the plant. frame.output is the controller's answer. */
void mission_step(struct mission *mission);
/* A random request to invert on its own, as mission commands are. */
void mission_inversion(struct mission *mission, struct frame_inversion *inversion);

#endif
