#include "sim/sensors.h"

#include <math.h>

#define GOOD_QUALITY 100

static double in_steps(double value, double step) {
    return step > 0.0 ? step * round(value / step) : value;
}

double sensor_pressure(const struct sensor_parameters *parameters, double pressure_pa, struct random_stream *random) {
    const double noisy_pa = pressure_pa + parameters->pressure_noise_pa * random_normal(random);
    return fmin(fmax(in_steps(noisy_pa, parameters->pressure_step_pa), 0.0), parameters->pressure_range_pa);
}

void sensor_tip(const struct sensor_parameters *parameters, const struct tip_pose *pose, int64_t time_us,
                struct random_stream *random, struct hal_tip_sample *sample) {
    const double sine = sqrt(pose->quaternion[1] * pose->quaternion[1] + pose->quaternion[2] * pose->quaternion[2] +
                             pose->quaternion[3] * pose->quaternion[3]);
    const double angle = 2.0 * atan2(sine, pose->quaternion[0]);
    double rotation[3], size = 0.0;
    for (int i = 0; i < 3; i++) {
        const double along = sine > 0.0 ? pose->quaternion[1 + i] / sine : 0.0;
        rotation[i] = in_steps(along * angle + parameters->tip_angle_noise_rad * random_normal(random),
                               parameters->tip_angle_step_rad);
        size += rotation[i] * rotation[i];
        sample->position_m[i] =
            (float)in_steps(pose->position_m[i] + parameters->tip_position_noise_m * random_normal(random),
                            parameters->tip_position_step_m);
    }
    size = sqrt(size);
    sample->quaternion[0] = (float)cos(0.5 * size);
    for (int i = 0; i < 3; i++) {
        sample->quaternion[1 + i] = (float)(size > 0.0 ? rotation[i] / size * sin(0.5 * size) : 0.0);
    }
    sample->measured_us = time_us;
    sample->quality = GOOD_QUALITY;
    sample->status = 0;
}
