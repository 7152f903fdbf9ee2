/* The controller: one pure step from sensor readings, command and time to valve duties.
 *
 * Owns no clock, no I/O, no heap. The same inputs from the same state give the same bits on every build.
 * Units: Pa gauge, rad, us, m. float[3] is indexed by chamber. */
#ifndef TRIBEND_CONTROLLER_H
#define TRIBEND_CONTROLLER_H

#include "control/bend_inverse.h"
#include "control/bend_table.h"
#include "control/calibration.h"
#include "control/pressure_loop.h"
#include "control/tip_loop.h"
#include "hal.h"
#include "safety/board_watch.h"
#include "safety/flow_watch.h"
#include "safety/gap_monitor.h"
#include "safety/limits.h"
#include "safety/sensor_watch.h"
#include "safety/supervisor.h"
#include "safety/tip_watch.h"

#define CONTROLLER_STEP_US 1000

enum controller_command_kind {
    COMMAND_NONE = 0, /* nothing new this step */
    COMMAND_VENT,
    COMMAND_HOLD,
    COMMAND_PRESSURE,
    COMMAND_BEND,
    COMMAND_CLEAR /* leave FAULT for SAFE, if its cause is gone */
};

/* A command counts as alive for controller_parameters.command_timeout_us; senders repeat it. */
struct controller_command {
    enum controller_command_kind kind;
    float pressure_pa[3];     /* COMMAND_PRESSURE */
    float bend_rad;           /* COMMAND_BEND, >= 0 */
    float direction_rad;      /* COMMAND_BEND: where the tip moves, from +x counter-clockwise */
    float co_contraction_pa;  /* COMMAND_BEND: least pressure of every chamber */
    bool said_again;          /* COMMAND_PRESSURE, COMMAND_BEND: known to be a repetition; never starts a motion */
};

struct controller_parameters {
    int64_t tip_period_us;       /* expected; a sample overdue by tip_overdue_us opens the tip loop */
    int64_t tip_overdue_us;
    int64_t command_timeout_us;
    float idle_pressure_pa; /* bend commands leave a chamber alone that wants less than this over the co-contraction: it
                               bends by under 0.15 degrees, but a pulse of the valve into so stiff a chamber is felt */
    struct pressure_loop_parameters pressure_loop;
    struct tip_loop_parameters tip_loop;
    struct limits_parameters limits;
    struct sensor_watch_parameters sensor_watch;
    struct flow_watch_parameters flow_watch;
    struct board_watch_parameters board_watch;
    struct tip_watch_parameters tip_watch;
    struct gap_monitor_parameters gap_monitor;
    struct controller_calibration calibration; /* of this module and board; the identity by default */
};

struct controller_input {
    int64_t time_us;
    float pressure_pa[3];
    bool pressure_ok[3];
    float supply_pa;
    bool supply_ok;
    bool tip_new;
    int64_t tip_measured_us;
    float tip_position_m[3];
    float tip_quaternion[4]; /* w, x, y, z */
    uint16_t tip_quality;
    uint16_t tip_status;
    struct hal_health health;
    bool outputs_refused; /* the outputs of the step before could not be set */
    bool bus_off;         /* of the bus that commands come over */
    bool error_passive;
    bool parameters_corrupt; /* the stored ones failed their check */
    struct controller_command command;
};

struct controller_output {
    float duty[3];
    bool valves_enabled;
    bool supply_enabled;
};

struct controller_tip {
    int64_t came_us;
    int64_t measured_us;
    float position_m[3];
    float quaternion[4];
    uint16_t status;
};

/* What status messages, logs and displays show. */
struct controller_status {
    enum supervisor_state state;
    uint32_t faults;   /* latched, bit = enum supervisor_fault */
    uint32_t warnings; /* present, bit = enum supervisor_warning */
    float pressure_target_pa[3];
    float pressure_estimate_pa[3];
    float bend_rad;        /* measured where the tip is good, else predicted from pressures */
    float direction_rad;
    bool bend_is_measured;
    struct bend_inverse_result inverse; /* the last that was finished; targets follow one on its way, too */
    uint32_t tip_samples;
    uint32_t tip_rejected;
    uint32_t tip_overtaken; /* waited for their turn until a newer one came */
    uint32_t tip_lost_count;
    uint32_t commands_refused;
    uint32_t calibration_limited; /* numbers of the calibration that were out of bounds */
    struct gap_monitor_report gap;
};

struct controller {
    const struct bend_table *table; /* NULL: pressure commands only */
    struct controller_parameters parameters;
    struct controller_status status;
    /* state, see controller.c */
    struct supervisor supervisor;
    struct limits limits;
    struct limits_image parameters_image; /* round through `parameters`, */
    struct limits_image loops_image;      /* and through `loop_parameters` */
    uint32_t parameters_crc;
    uint32_t loops_crc;
    struct sensor_watch sensor_watch[3];
    struct flow_watch flow_watch[3];
    struct board_watch board_watch;
    struct tip_watch tip_watch;
    struct pressure_loop pressure_loop[3];
    struct pressure_loop_parameters loop_parameters[3]; /* each chamber's, calibrated */
    struct calibration_frames frames;                   /* of the tip sensor */
    float predicted_rad[2];         /* bend vector, while the tip sensor is lost */
    float crept_rad[CALIBRATION_CREEP_TERMS][2];
    struct tip_loop tip_loop;
    struct gap_monitor gap_monitor;
    struct gap_monitor_pose pose; /* the last good tip sample, for the gap monitor */
    struct controller_tip tip;    /* a sample, waiting or taken last */
    struct controller_command active;
    int64_t command_us;
    int64_t tip_us; /* when the last good sample came */
    struct bend_inverse inversion;
    struct pressure_loop_clock clock;
    int64_t period_start_us; /* of the valves */
    int32_t steps_left;      /* of that period, after this one */
    float capacity_m3[3];
    uint32_t capacity_next;  /* the chamber whose turn it is */
    uint32_t capacity_taken; /* step of the last */
    uint32_t step;
    uint32_t tip_taken;  /* step of the last tip sample, */
    uint32_t tip_since;  /* and since when one waits */
    bool tip_lost;
    bool targets_stale;  /* a new command or tip sample since the targets were taken up */
    bool inverting;      /* the inversion is under way */
    bool creeps;
    bool tip_waits;      /* these four: for their turn, see controller.c */
    bool pose_waits;
    bool creep_due;
    bool prediction_due;
};

/* The nominal board and plant of the design page; limits from the table's module where there is one. */
void controller_default_parameters(struct controller_parameters *parameters, const struct bend_table *table);
/* `table` (may be NULL) and `parameters` are kept: the table by pointer, the parameters by value. */
void controller_init(struct controller *controller, const struct bend_table *table,
                     const struct controller_parameters *parameters);
/* Other parameters from now on; only while vented, but for those of parameters.def that say otherwise. */
void controller_set_parameters(struct controller *controller, const struct controller_parameters *parameters);
/* After `parameters` or `loop_parameters` were changed on purpose while running: what stands there now is what the running
 * check compares with. */
void controller_seal_parameters(struct controller *controller);
/* One control step; called every CONTROLLER_STEP_US. Always fills `output`. */
void controller_step(struct controller *controller, const struct controller_input *input,
                     struct controller_output *output);

#endif
