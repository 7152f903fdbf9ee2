/* The tip loop: what the bend table misses, learnt from the tip sensor.
 *
 * Each tip sample is old when it arrives. It is compared with what the table says of the pressures at the time when it
 * was true; the low-passed difference is taken off the commanded bend before the inverse. Model error and slow pressure
 * error are cancelled alike, and a good model leaves the loop nothing to do, whatever its gain. Bend vectors are bend
 * (rad) times the unit vector of the direction in which the tip moves. */
#ifndef TRIBEND_TIP_LOOP_H
#define TRIBEND_TIP_LOOP_H

#include "control/bend_table.h"

#define TIP_LOOP_HISTORY 64u /* control steps */

struct tip_loop_parameters {
    float gain;                  /* share of a sample's difference that is taken over */
    float correction_limit_rad;
    int64_t age_limit_us;        /* an older sample is refused */
};

struct tip_loop {
    float correction_rad[2];     /* measured minus predicted bend vector */
    float known_rad[2];          /* what the table leaves out and the caller knows: part of what is predicted */
    float measured_rad[2];       /* of the last good sample */
    float gap_rad[2];            /* of the last sample that was compared: measured minus predicted */
    struct bend_table_stencil stencil; /* where the table was asked for it */
    bool compared;               /* the last good sample was compared */
    float history_pa[TIP_LOOP_HISTORY][3];
    uint32_t newest;
    uint32_t stored;
};

void tip_loop_default_parameters(struct tip_loop_parameters *parameters);
void tip_loop_init(struct tip_loop *loop);
/* Remember the pressure estimates of this control step. */
void tip_loop_store(struct tip_loop *loop, const float pressure_pa[3]);
/* Bend vector of a tip's orientation (w, x, y, z): false for what is no unit quaternion within 5 %. */
bool tip_loop_bend_of(const float quaternion[4], float bend_rad[2]);
/* Bend vector that the table gives, at a place that is already located, or at pressures. */
void tip_loop_predict_at(const struct bend_table *table, const struct bend_table_stencil *stencil, float bend_rad[2]);
void tip_loop_predict(const struct bend_table *table, const float pressure_pa[3], float bend_rad[2]);
/* A sample that was true `age_us` ago. False: refused. `table` NULL only records the measured bend. */
bool tip_loop_update(struct tip_loop *loop, const struct tip_loop_parameters *parameters,
                     const struct bend_table *table, const float quaternion[4], int64_t age_us, int64_t step_us);

#endif
