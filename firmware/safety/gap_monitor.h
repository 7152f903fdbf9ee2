/* The gap monitor: says when the module no longer does what its model says, and which stage of the chain it lies in.
 *
 * Pressures: what the observer had to add to valve and gas (pressure_loop.h), gathered over some time, is the valve's;
 * what a chamber reads that has long vented is its sensor's, unless the bend shows that the pressure is real. Pose:
 * constant curvature puts the arc's chord at half the bend, however long the arc, so a position off that chord is the
 * tip sensor's, and so is a wrong length at rest; a bend off the table's with a position that fits it is the body's.
 * Each gap is low-passed and must stay over its threshold to be raised, and under half of it to be withdrawn. A stage
 * that cannot be seen at the moment keeps its verdict. Nothing here acts on control. Not here: which effect inside a
 * stage it is. Units: Pa gauge, m, rad, s, us; float[3] is indexed by chamber. */
#ifndef TRIBEND_GAP_MONITOR_H
#define TRIBEND_GAP_MONITOR_H

#include <stdbool.h>
#include <stdint.h>

#include "control/bend_table.h"

enum gap_monitor_stage {
    GAP_MONITOR_NONE = 0,
    GAP_MONITOR_VALVE,           /* valve, supply, tubing or a leak */
    GAP_MONITOR_PRESSURE_SENSOR,
    GAP_MONITOR_BODY,
    GAP_MONITOR_TIP_SENSOR,
    GAP_MONITOR_STAGE_COUNT
};

struct gap_monitor_parameters {
    float pressure_time_s;        /* over which pressure that valve and gas do not explain is gathered */
    float rest_time_s;            /* low-pass of the readings of a vented chamber */
    float pose_time_s;            /* low-pass of the gaps of bend and position */
    float persist_s;              /* over the threshold to be raised, under half of it to be withdrawn */
    int64_t vented_after_us;      /* a settled chamber whose valve has not filled for so long must read zero */
    int64_t rest_after_us;        /* with all three vented for so long, the module must have its length */
    float sigmas;                 /* of filtered noise within a threshold */
    float pressure_noise_pa;      /* rms of a reading */
    float pressure_period_s;      /* between readings */
    float flow_error;             /* steady error of the valves' mean flow that is no gap, Pa m3/s */
    float flow_accuracy;          /* share of a change of pressure that the observer's model may miss */
    float moved_pa;               /* only a change of pressure over this can clear a valve */
    float tip_angle_noise_rad;    /* rms of a sample */
    float tip_position_noise_m;   /* rms of a sample and axis */
    float tip_position_step_m;    /* of the sensor's words: half of it does not average out */
    float table_bend_rad;         /* the table's accuracy */
    float table_direction_rad;
    float kinematics_m;           /* what constant curvature between rigid caps leaves out */
    float uneven_share;           /* an uneven bend puts the tip off by up to this share of bend gap times length */
    float bent_rad;               /* only a bend over this can clear the body */
};

/* The filtered gaps, their thresholds, and the verdict. */
struct gap_monitor_report {
    enum gap_monitor_stage stage;
    uint32_t chamber;              /* 1 to 3 where the stage has one, else 0 */
    float pressure_gap_pa[3];      /* change that valve and gas do not explain: measured minus modelled */
    float pressure_threshold_pa[3];
    float vented_pa[3];            /* read when last vented for long */
    float vented_threshold_pa;
    float bend_gap_rad;            /* measured against the table's for the measured pressures */
    float bend_threshold_rad;
    float position_gap_m;          /* measured against the measured orientation's */
    float position_threshold_m;
};

/* Raised after `persist_s` beyond its threshold, withdrawn after as much below half of it. */
struct gap_monitor_latch {
    float held_s;
    bool raised;
};

struct gap_monitor {
    struct gap_monitor_report report;
    struct gap_monitor_latch valve[3];
    struct gap_monitor_latch vented[3];
    float sooner_pa[3];         /* like the report's vented_pa, with a shorter time constant */
    bool vented_is_real[3];     /* the bend showed that the pressure of a vented chamber is real */
    struct gap_monitor_latch body;
    struct gap_monitor_latch tip_sensor;
    float estimate_pa[3];       /* of the step before */
    float moved_pa[3];          /* change of the estimate, gathered like the gap */
    float lag_pa[3];            /* readings minus estimates, summed since the last pose */
    uint32_t steps;             /* since the last pose */
    float slope_radppa[3];      /* size of the bend vector's slope by each pressure, */
    float push_radppa[3][2];    /* and that slope itself */
    float bend_gap_rad[2];
    float across_m[3];          /* position off the chord, base frame */
    float length_m;             /* measured minus undeformed, when last at rest */
    bool at_rest;
    bool in_doubt;              /* a chamber that is not fed reads a pressure, and it is open why */
    int64_t pose_us;            /* time of the last pose */
};

/* One chamber in one control step. */
struct gap_monitor_pressure {
    float reading_pa;
    bool reading_ok;
    float estimate_pa;
    float unmodelled_pa; /* of pressure_loop.h */
    float capacity_m3;   /* 0: not known, the valve is not judged */
    int64_t vented_us;   /* since its valve last filled */
};

/* A good tip sample. */
struct gap_monitor_pose {
    int64_t measured_us;
    float bend_rad[2];       /* measured bend vector (tip_loop.h) */
    float gap_rad[2];        /* measured minus predicted from the pressures when it was true */
    float position_m[3];
};

/* Design page's sensors, README's table; the derivation of each is in gap_monitor.c. */
void gap_monitor_default_parameters(struct gap_monitor_parameters *parameters);
void gap_monitor_init(struct gap_monitor *monitor);
/* Each control step, `step_s` after the last. */
void gap_monitor_follow_pressures(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                                  const struct gap_monitor_pressure pressure[3], float step_s);
/* Each good tip sample, with the place in the table that its prediction came from; one that is not finite, or where the
 * table does not hold, changes nothing. */
void gap_monitor_follow_pose(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                             const struct bend_table *table, const struct bend_table_stencil *stencil,
                             const struct gap_monitor_pose *pose);
/* A sentence for people that starts with the stage's name, never NULL. */
const char *gap_monitor_stage_text(enum gap_monitor_stage stage);

#endif
