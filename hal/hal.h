/* The seam between the controller and the world: what a board (or a simulated one) gives the firmware.
 *
 * A struct hal is a small table of functions and the context they get. All calls return at once; none blocks. The
 * firmware calls them only from app_step(), once a control step. Units: Pa gauge, us, m, unit quaternion (w, x, y, z),
 * duty 0..1. */
#ifndef TRIBEND_HAL_H
#define TRIBEND_HAL_H

#include <stdbool.h>
#include <stdint.h>

struct hal_pressures {
    float chamber_pa[3];
    float supply_pa;      /* meaningful only with supply_ok */
    bool chamber_ok[3];   /* false: the converter could not read this channel */
    bool supply_ok;
};

/* trakSTAR-style pose of the tip face's centre in the base frame. */
struct hal_tip_sample {
    int64_t measured_us; /* when the pose was true, on the clock of time_us */
    float position_m[3];
    float quaternion[4];
    uint16_t quality;
    uint16_t status; /* the sensor's bits; 0 = good */
};

struct hal_outputs {
    float duty[3];       /* 0 = vent, 1 = fill; taken over at the start of the next PWM period */
    bool valves_enabled; /* false: all coils off at once, inside the running period too */
    bool supply_enabled; /* false: the normally closed shut-off valve drops at once */
};

struct hal {
    void *context;
    /* Monotonic, from 0 at start. PWM periods start at its multiples of the PWM period. */
    int64_t (*time_us)(void *context);
    /* Latest reading of each sensor; false: no reading at all this step. */
    bool (*read_pressures)(void *context, struct hal_pressures *pressures);
    /* The next tip sample that arrived since the last call; false: none. Bounded by the caller to a few a step. */
    bool (*read_tip)(void *context, struct hal_tip_sample *sample);
    /* False: an output could not be set. */
    bool (*write_outputs)(void *context, const struct hal_outputs *outputs);
};

#endif
