#include "control/calibration.h"

#include <stddef.h>

#include "control/real_math.h"

#define CLIPPED_SIGMAS 3.0f
#define VALVE_LATE_MOST_US 60000
#define TIP_LATE_MOST_US 45000 /* with 10 ms of the sensor's own, the tip loop still remembers the pressures */
#define SMALL_RAD 1e-6f

/* Bounds of the arrays: those of the catalogue of effects, where it has them. */
struct bounds {
    size_t offset;
    uint32_t count;
    float least;
    float most;
    float none;
};

#define OF(member) offsetof(struct controller_calibration, member)
static const struct bounds bounds[] = {
    {OF(reading_gain), 3u, 0.7f, 1.3f, 1.0f},
    {OF(reading_offset_pa), 3u, -8000.0f, 8000.0f, 0.0f},
    {OF(reading_lag_s), 3u, 0.0f, 0.3f, 0.0f},
    {OF(least_duty), 3u, 0.0f, 0.5f, 0.0f},
    {OF(lost_duty), 3u, 0.0f, 0.5f, 0.0f},
    {OF(fill_scale), 3u, 0.02f, 1.5f, 1.0f},
    {OF(vent_scale), 3u, 0.02f, 1.5f, 1.0f},
    {OF(leak_scale), 3u, 0.0f, 0.5f, 0.0f},
    {OF(extra_volume_m3), 3u, 0.0f, 1.6e-5f, 0.0f},
    {OF(tip_arm_m), 3u, -0.04f, 0.04f, 0.0f},
    {OF(tip_mount_rad), 3u, -0.5f, 0.5f, 0.0f},
    {OF(tip_offset_m), 3u, -0.02f, 0.02f, 0.0f},
    {OF(tip_frame_rad), 3u, -0.5f, 0.5f, 0.0f},
    {OF(creep_share), CALIBRATION_CREEP_TERMS, 0.0f, 0.5f, 0.0f},
    {OF(creep_time_s), CALIBRATION_CREEP_TERMS, 0.005f, 3600.0f, 1.0f},
};
#define BOUNDS (sizeof bounds / sizeof bounds[0])

static float *first_of(struct controller_calibration *calibration, const struct bounds *bound) {
    return (float *)(void *)((unsigned char *)calibration + bound->offset);
}

void calibration_none(struct controller_calibration *calibration) {
    *calibration = (struct controller_calibration){.tip_late_us = 0};
    for (size_t b = 0; b < BOUNDS; b++) {
        float *value = first_of(calibration, &bounds[b]);
        for (uint32_t i = 0; i < bounds[b].count; i++) {
            value[i] = bounds[b].none;
        }
    }
}

static uint32_t limit_time(int64_t *time_us, int64_t most_us) {
    const int64_t given_us = *time_us;
    *time_us = given_us < 0 ? 0 : (given_us > most_us ? most_us : given_us);
    return *time_us != given_us ? 1u : 0u;
}

uint32_t calibration_limit(struct controller_calibration *calibration) {
    uint32_t changed = limit_time(&calibration->tip_late_us, TIP_LATE_MOST_US);
    for (uint32_t c = 0; c < 3u; c++) {
        changed += limit_time(&calibration->valve_late_us[c], VALVE_LATE_MOST_US);
    }
    for (size_t b = 0; b < BOUNDS; b++) {
        float *value = first_of(calibration, &bounds[b]);
        for (uint32_t i = 0; i < bounds[b].count; i++) {
            const bool within = value[i] >= bounds[b].least && value[i] <= bounds[b].most;
            const float kept = real_clamp(value[i], bounds[b].least, bounds[b].most);
            changed += within ? 0u : 1u;
            value[i] = real_is_finite(value[i]) ? kept : bounds[b].none;
        }
    }
    return changed;
}

/* --- pressures --- */

void calibration_apply(const struct controller_calibration *calibration, uint32_t chamber,
                       const struct pressure_loop_parameters *nominal, struct pressure_loop_parameters *loop) {
    *loop = *nominal;
    loop->flow_factor = nominal->flow_factor * calibration->fill_scale[chamber];
    loop->vent_factor = nominal->vent_factor * calibration->vent_scale[chamber];
    loop->leak_factor = nominal->flow_factor * calibration->leak_scale[chamber];
    loop->tube_volume_m3 = nominal->tube_volume_m3 + calibration->extra_volume_m3[chamber];
    loop->nominal_capacity_m3 = nominal->nominal_capacity_m3 + calibration->extra_volume_m3[chamber];
    loop->late_us = (int32_t)calibration->valve_late_us[chamber]; /* at most VALVE_LATE_MOST_US */
    loop->reading_lag_s = calibration->reading_lag_s[chamber];
    loop->least_duty = calibration->least_duty[chamber];
    loop->lost_duty = real_min(calibration->lost_duty[chamber], calibration->least_duty[chamber]);
}

float calibration_pressure(const struct controller_calibration *calibration, uint32_t chamber, float reading_pa,
                           float noise_pa, float estimate_pa) {
    const float offset_pa = calibration->reading_offset_pa[chamber];
    const float pressure_pa = (reading_pa - offset_pa) / calibration->reading_gain[chamber];
    const bool blind = offset_pa < 0.0f && reading_pa < CLIPPED_SIGMAS * noise_pa;
    return blind ? real_min(pressure_pa, estimate_pa) : pressure_pa;
}

/* --- tip --- */

/* The quaternion that turns back what the rotation vector turns. */
static void turn_back(const float rotation_rad[3], float back[4]) {
    const float across = real_hypot(rotation_rad[0], rotation_rad[1]);
    const float angle_rad = real_hypot(across, rotation_rad[2]);
    const float along = angle_rad < SMALL_RAD ? 0.5f : real_sin(0.5f * angle_rad) / angle_rad;
    back[0] = real_cos(0.5f * angle_rad);
    for (uint32_t i = 0; i < 3u; i++) {
        back[1u + i] = -along * rotation_rad[i];
    }
}

void calibration_frames_of(const struct controller_calibration *calibration, struct calibration_frames *frames) {
    frames->none = true;
    turn_back(calibration->tip_mount_rad, frames->mount_back);
    turn_back(calibration->tip_frame_rad, frames->frame_back);
    for (uint32_t i = 0; i < 3u; i++) {
        frames->arm_m[i] = calibration->tip_arm_m[i];
        frames->offset_m[i] = calibration->tip_offset_m[i];
        frames->none = frames->none && real_abs(calibration->tip_arm_m[i]) + real_abs(calibration->tip_offset_m[i]) +
                                               real_abs(calibration->tip_mount_rad[i]) +
                                               real_abs(calibration->tip_frame_rad[i]) <= 0.0f;
    }
}

static void multiply(const float a[4], const float b[4], float product[4]) {
    product[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    product[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    product[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
    product[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

/* v + 2 q x (q x v + w v), q the vector part. */
static void rotate(const float q[4], const float v[3], float rotated[3]) {
    const float t[3] = {q[2] * v[2] - q[3] * v[1] + q[0] * v[0], q[3] * v[0] - q[1] * v[2] + q[0] * v[1],
                        q[1] * v[1] - q[2] * v[0] + q[0] * v[2]};
    rotated[0] = v[0] + 2.0f * (q[2] * t[2] - q[3] * t[1]);
    rotated[1] = v[1] + 2.0f * (q[3] * t[0] - q[1] * t[2]);
    rotated[2] = v[2] + 2.0f * (q[1] * t[1] - q[2] * t[0]);
}

void calibration_pose(const struct calibration_frames *frames, float position_m[3], float quaternion[4]) {
    float turned[4], straight_m[3], arm_m[3];
    if (frames->none) {
        return;
    }
    multiply(frames->frame_back, quaternion, turned);
    multiply(turned, frames->mount_back, quaternion);
    rotate(frames->frame_back, position_m, straight_m);
    rotate(quaternion, frames->arm_m, arm_m);
    for (uint32_t i = 0; i < 3u; i++) {
        position_m[i] = straight_m[i] - frames->offset_m[i] - arm_m[i];
    }
}

bool calibration_creeps(const struct controller_calibration *calibration) {
    bool creeps = false;
    for (uint32_t k = 0; k < CALIBRATION_CREEP_TERMS; k++) {
        creeps = creeps || calibration->creep_share[k] > 0.0f;
    }
    return creeps;
}
