/* An independent plant for the blind check of the diagnosis: gas, valves, body and sensors of the design page's nominal
 * numbers, written without the simulator that the diagnosis replays, with other integrators and other effects.
 *
 * Gas: chamber pressures are the state, classical Runge-Kutta in steps that end at every switching of a valve. Body: quasi
 * static, looked up when a tip sample is taken. Effects change what passes between the stages (blind_effect.h).
 * SI units, gauge pressures unless _abs; arrays of three are indexed by chamber. */
#ifndef TRIBEND_BLIND_PLANT_H
#define TRIBEND_BLIND_PLANT_H

#include "blind_field.h"

#define BLIND_PERIOD_US 10000 /* of the PWM */
#define BLIND_STEP_US 1000    /* of the controller and the sensors */
#define BLIND_EFFECTS_MAX 4
#define BLIND_OPENINGS 8
#define BLIND_TIP_QUEUE 32
#define BLIND_STATES 7

struct blind_effect;

/* What may differ from one module and rig to the next without anything being missing from the model. */
struct blind_nominal {
    double stiffness_scale;
    double supply_scale;
};

/* How a valve is driven over one PWM period. */
struct blind_pulse {
    double duty;
    int64_t delay_us; /* of the coil against the period's start */
    int64_t open_delay_us;
    int64_t close_delay_us;
};

/* The gas network between supply, chambers and ambient; effects change it every millisecond. */
struct blind_ports {
    double supply_pa;
    double regulator_pas_per_kg; /* 0: a stiff supply */
    double reservoir_m3;         /* behind the regulator */
    double flow_scale[3];
    double critical_ratio[3];
    double line_pas_per_kg[3];   /* laminar, in series with the valve */
    double line_volume_m3[3];
    double orifice_leak[3];      /* to ambient, kg/s for the root of a pascal */
    double laminar_leak[3];      /* to ambient, kg/s for a pascal */
    double bridge[3];            /* to the next chamber, kg/s for a pascal */
    double heat_transfer_wpk;    /* 0: isothermal */
};

struct blind_shape {
    double bend_rad[2];
    double stretch;
    double twist_rad;
    double active_share;    /* of the chamber that bends freely; 1: all of it */
    double weight_scale;    /* 0: no gravity on the module itself */
    double tip_mass_kg;
    double down[3];         /* unit vector of gravity in the base frame */
};

struct blind_pose {
    double position_m[3];
    double quaternion[4];
};

struct blind_tip_sample {
    int64_t measured_us; /* as the sensor claims */
    int64_t arrives_us;
    struct blind_pose pose; /* without noise */
    bool repeated;          /* the sensor gave the previous sample again */
};

/* Sums over a run, for parameters whose size only shows in what flowed. */
struct blind_measure {
    double line_kg;           /* through valve and line of the chambers an effect names */
    double line_nominal_kg;   /* the same pressures, nominal valve and line */
    double leak_kg;
    double leak_per_conductance; /* kg for a sonic conductance of 1 m3/(s Pa) */
};

struct blind_opening {
    int64_t from_us;
    int64_t to_us;
};

struct blind_plant {
    struct blind_field *field;
    struct blind_nominal nominal;
    struct blind_effect *effect[BLIND_EFFECTS_MAX]; /* owned by the caller */
    size_t effects;
    bool failed; /* out of memory */

    int64_t time_us;
    double duty[3]; /* written last; the next period takes it over */
    double state[BLIND_STATES]; /* three pressures, the supply's, three masses of gas */
    struct blind_ports ports;
    struct blind_opening opening[3][BLIND_OPENINGS];
    struct blind_measure measure;

    double reading_pa[3]; /* what noiseless sensors of unlimited range would read */
    double temperature_k; /* of the rubber; set by the caller */

    int64_t tip_period_us;
    int64_t tip_phase_us;
    int64_t tip_age_us;    /* of a sample when it arrives */
    int64_t tip_latency_us; /* by which it is older than it claims */
    int64_t tip_next;      /* number of the next sample */
    double load_pa[3];     /* the pressures that bend */
    struct blind_shape shape;
    struct blind_pose pose;
    double bend_most_rad;
    double load_most_pa;
    struct blind_tip_sample queue[BLIND_TIP_QUEUE];
    size_t queued;
};

/* Vented and straight at time 0. Pointers are kept. */
void blind_plant_init(struct blind_plant *plant, struct blind_field *field, const struct blind_nominal *nominal,
                      struct blind_effect *const *effect, size_t effects);
/* The tip's sampling, before the first step. */
void blind_plant_sample_tip(struct blind_plant *plant, int64_t period_us, int64_t phase_us);
/* One millisecond. A period that starts at its end takes over `duty`. */
void blind_plant_step(struct blind_plant *plant);
/* The next sample that has arrived; false: none. */
bool blind_plant_next_tip(struct blind_plant *plant, struct blind_tip_sample *sample);

/* --- parts --- */

/* Signed mass flow, ISO 6358-1:2013 with its laminar part reduced to the last 2 Pa, kg/s. */
double blind_flow_kgps(double conductance, double critical_ratio, double up_pa_abs, double down_pa_abs,
                       double up_temperature_k);
/* The gas over a stretch of time in which no valve switches. */
void blind_gas_advance(struct blind_plant *plant, const bool fills[3], double duration_s);
/* Where the tip is, for a shape; the module's stiffness against its weight goes with the nominal scale. */
void blind_body_pose(const struct bend_table_module *module, double rubber_area_m2, double stiffness_scale,
                     const struct blind_shape *shape, struct blind_pose *pose);
/* Hamilton product. */
void blind_quaternion_product(const double a[4], const double b[4], double product[4]);
void blind_quaternion_of_rotation(const double rotation_rad[3], double quaternion[4]);
void blind_rotate(const double quaternion[4], const double vector[3], double rotated[3]);

#endif
