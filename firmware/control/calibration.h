/* What was measured of this very module and board, where it differs from the nominal ones.
 *
 * The identity (none) leaves every bit of the controller's answers as it is. What changes the bend at given pressures
 * (stiffness, the gain of a chamber, the length that bends) is not here: it is in the bend table. Not here either: what
 * a controller cannot know beforehand, such as the past loads of the rubber. float[3] is indexed by chamber, or x, y, z.
 * Units: Pa gauge, m, m3, rad, s, us. */
#ifndef TRIBEND_CONTROL_CALIBRATION_H
#define TRIBEND_CONTROL_CALIBRATION_H

#include <stdbool.h>
#include <stdint.h>

#include "control/pressure_loop.h"

#define CALIBRATION_CREEP_TERMS 3u

struct controller_calibration {
    /* a pressure sensor shows gain * pressure + offset, following with a time constant */
    float reading_gain[3];
    float reading_offset_pa[3];
    float reading_lag_s[3];
    /* a valve sees its pulses late; duties under `least` do nothing, larger ones act like (duty - lost) / (1 - lost) */
    int64_t valve_late_us[3];
    float least_duty[3];
    float lost_duty[3];
    /* conductances over that of the nominal valve: of valve and tube while filling and venting, of a leak to ambient */
    float fill_scale[3];
    float vent_scale[3];
    float leak_scale[3];
    float extra_volume_m3[3];
    /* the tip sensor, in the order in which the errors add up: a lever arm (m, tip's frame), a mounting angle (rotation
     * vector, tip's frame), a displaced zero (m, base frame), a turned transmitter (rotation vector, base frame); poses
     * are so much older than their times say */
    float tip_arm_m[3];
    float tip_mount_rad[3];
    float tip_offset_m[3];
    float tip_frame_rad[3];
    int64_t tip_late_us;
    /* under a held pressure the bend grows by these shares of itself, each with its time constant */
    float creep_share[CALIBRATION_CREEP_TERMS];
    float creep_time_s[CALIBRATION_CREEP_TERMS];
};

/* The tip sensor's part, made ready to be used. */
struct calibration_frames {
    bool none;
    float arm_m[3];
    float mount_back[4]; /* quaternions (w, x, y, z) that turn back */
    float offset_m[3];
    float frame_back[4];
};

void calibration_none(struct controller_calibration *calibration);
/* Keeps every number within its bounds (calibration.c); one that is not finite becomes the identity's. Returns how many
 * had to be changed. */
uint32_t calibration_limit(struct controller_calibration *calibration);
/* `chamber`'s pressure loop, from the nominal one's parameters. */
void calibration_apply(const struct controller_calibration *calibration, uint32_t chamber,
                       const struct pressure_loop_parameters *nominal, struct pressure_loop_parameters *loop);
/* The pressure behind a reading. Sensors clip at zero, so a sensor whose zero lies lower is blind to small pressures:
 * such a reading only says that the pressure is not higher, and `estimate_pa` stands where it agrees. */
float calibration_pressure(const struct controller_calibration *calibration, uint32_t chamber, float reading_pa,
                           float noise_pa, float estimate_pa);
void calibration_frames_of(const struct controller_calibration *calibration, struct calibration_frames *frames);
/* The true pose behind a measured one, in place: position of the tip face's centre, quaternion (w, x, y, z). */
void calibration_pose(const struct calibration_frames *frames, float position_m[3], float quaternion[4]);
bool calibration_creeps(const struct controller_calibration *calibration);

#endif
