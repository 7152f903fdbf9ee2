/* What the sensors make of the truth: noise, steps, limits, delay. */
#ifndef TRIBEND_SIM_SENSORS_H
#define TRIBEND_SIM_SENSORS_H

#include "hal.h"
#include "sim/body.h"
#include "sim/random.h"

struct sensor_parameters {
    double pressure_noise_pa;   /* rms of a sample */
    double pressure_range_pa;   /* readings are clipped to 0 .. range */
    double pressure_step_pa;    /* of the converter; 0: none */
    int64_t tip_period_us;
    int64_t tip_delay_us;       /* a pose is this old when it arrives */
    double tip_position_noise_m;
    double tip_angle_noise_rad;
    double tip_position_step_m; /* of the 14-bit words; 0: none */
    double tip_angle_step_rad;
};

double sensor_pressure(const struct sensor_parameters *parameters, double pressure_pa, struct random_stream *random);
/* The sample that a true pose gives; orientation noise and steps act on its rotation vector. */
void sensor_tip(const struct sensor_parameters *parameters, const struct tip_pose *pose, int64_t time_us,
                struct random_stream *random, struct hal_tip_sample *sample);

#endif
