/* Thresholds, with the default parameters and the reference module:
 *
 *   pressure   noise of a reading + flow_accuracy |change gathered| + flow_error pressure_time / capacity
 *              150 Pa + a tenth of the change + 50 Pa at 8 kPa (480 Pa at 2.7 kPa: a chamber then takes little air)
 *   vented     noise of a reading, 150 Pa: noise clipped at zero reads 0.4 of it on average
 *   bend       table (0.15 deg, and 0.55 deg of direction times the bend) + sigmas x filtered noise. Of white noise a
 *              low-pass leaves sqrt(period / (2 time)): 3.4 Pa times the slope (at most 26 deg/kPa), and the tip's
 *              0.0136 deg / 14: 0.16 deg straight, 1.1 deg at 60 deg
 *   position   kinematics (0.3 mm) + half a step of each axis (0.1 mm) + sigmas x filtered noise (0.02 mm)
 *              + uneven_share x bend gap x length */
#include "safety/gap_monitor.h"

#include "control/real_math.h"

#define FED_US 100000 /* a valve that filled within this time is at work */
#define RECENT_STEPS 100u /* a pose of so many control steps ago is the present one */
#define SOONER 4.0f /* a second low-pass of a vented reading, so many times as fast, shows whether it still falls */
#define CLIPPED_SIGMAS 3.0f
#define SMALL_RAD 1e-4f
#define INTERVAL_MOST_S 0.1f /* a longer silence of the tip sensor counts for no more */
#define SQRT_3 1.7320508f

void gap_monitor_default_parameters(struct gap_monitor_parameters *parameters) {
    *parameters = (struct gap_monitor_parameters){
        .pressure_time_s = 2.0f,
        .rest_time_s = 1.0f,
        .pose_time_s = 1.0f,
        .persist_s = 2.0f,
        .vented_after_us = 5000000, /* twice as long as the fullest chamber takes */
        .rest_after_us = 10000000,  /* creep of silicone, 1 to 1.4 s in measurements, has gone */
        .sigmas = 5.0f,
        .pressure_noise_pa = 150.0f,
        .pressure_period_s = 1e-3f,
        .flow_error = 0.014f,    /* 50 us of a valve's 10 ms period at 2.8 Pa m3/s, its full flow from 40 kPa */
        .flow_accuracy = 0.1f,   /* the other chambers' pull on the volume, which the observer leaves out */
        .moved_pa = 1000.0f,
        .tip_angle_noise_rad = 2.37e-4f, /* 0.012 deg and the steps of 0.022 deg */
        .tip_position_noise_m = 4e-5f,   /* 0.02 mm and the steps of 0.11 mm */
        .tip_position_step_m = 1.1e-4f,
        .table_bend_rad = 2.6e-3f,      /* 0.15 deg: the table against 500 solutions */
        .table_direction_rad = 9.6e-3f, /* 0.55 deg */
        .kinematics_m = 3e-4f, /* a cap's face turns by up to 0.01 rad under pressure; over half the module's length */
        .uneven_share = 0.25f, /* a beam under its own weight (1/8 - 1/12 of q L^4/EI against 1/6 of q L^3/EI) */
        .bent_rad = 0.175f,
    };
}

void gap_monitor_init(struct gap_monitor *monitor) {
    *monitor = (struct gap_monitor){.at_rest = false};
}

static void judge(struct gap_monitor_latch *latch, float gap, float threshold, float persist_s, float step_s) {
    const bool crossed = latch->raised ? gap < 0.5f * threshold : gap > threshold;
    latch->held_s = crossed ? latch->held_s + step_s : 0.0f;
    if (latch->held_s >= persist_s) {
        latch->raised = !latch->raised;
        latch->held_s = 0.0f;
    }
}

/* --- verdict --- */

/* A wrong pressure reading bends the prediction, a wrong tip sensor the measurement, and a softer body takes more air:
 * the first of this order that is raised accounts for those after it. */
static void name_stage(struct gap_monitor *monitor) {
    enum gap_monitor_stage stage = GAP_MONITOR_NONE;
    uint32_t chamber = 0u;
    for (uint32_t c = 0; c < 3u; c++) {
        if (monitor->valve[c].raised && stage == GAP_MONITOR_NONE) {
            stage = GAP_MONITOR_VALVE;
            chamber = c + 1u;
        }
    }
    if (monitor->tip_sensor.raised || monitor->body.raised) {
        stage = monitor->tip_sensor.raised ? GAP_MONITOR_TIP_SENSOR : GAP_MONITOR_BODY;
        chamber = 0u;
    }
    for (uint32_t c = 0; c < 3u; c++) {
        if (monitor->vented[c].raised && stage != GAP_MONITOR_PRESSURE_SENSOR) {
            stage = monitor->vented_is_real[c] ? GAP_MONITOR_VALVE : GAP_MONITOR_PRESSURE_SENSOR;
            chamber = c + 1u;
        }
    }
    monitor->report.stage = stage;
    monitor->report.chamber = chamber;
}

/* --- pressures --- */

static bool is_read(const struct gap_monitor_pressure *pressure) {
    return pressure->reading_ok && real_is_finite(pressure->reading_pa);
}

/* Or so near to it that readings are clipped and their mean is wrong. */
static bool reads_zero(const struct gap_monitor_parameters *parameters, const struct gap_monitor_pressure *pressure) {
    return pressure->estimate_pa < CLIPPED_SIGMAS * parameters->pressure_noise_pa;
}

static void follow_valve(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters, uint32_t c,
                         const struct gap_monitor_pressure *pressure, float step_s) {
    const float kept = 1.0f - step_s / parameters->pressure_time_s;
    float *gap_pa = &monitor->report.pressure_gap_pa[c], *moved_pa = &monitor->moved_pa[c];
    *gap_pa = kept * *gap_pa + pressure->unmodelled_pa;
    *moved_pa = kept * *moved_pa + pressure->estimate_pa - monitor->estimate_pa[c];
    monitor->estimate_pa[c] = pressure->estimate_pa;
    if (!(pressure->capacity_m3 > 0.0f)) {
        return;
    }
    const float threshold_pa = parameters->pressure_noise_pa + parameters->flow_accuracy * real_abs(*moved_pa) +
                               parameters->flow_error * parameters->pressure_time_s / pressure->capacity_m3;
    monitor->report.pressure_threshold_pa[c] = threshold_pa;
    /* a chamber neither fed nor emptying has a pressure only in its sensor's eyes: judged once vented for long */
    const bool works = pressure->vented_us < FED_US || *moved_pa < -parameters->moved_pa;
    const bool shows = !monitor->valve[c].raised || real_abs(*moved_pa) > parameters->moved_pa;
    if (works && shows) {
        judge(&monitor->valve[c], real_abs(*gap_pa), threshold_pa, parameters->persist_s, step_s);
    }
}

/* An observer whose valve model is wrong runs behind; the pose must not pay for it. */
static void follow_lag(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters, uint32_t c,
                       const struct gap_monitor_pressure *pressure) {
    const bool tells = is_read(pressure) && !reads_zero(parameters, pressure);
    monitor->lag_pa[c] += tells ? pressure->reading_pa - pressure->estimate_pa : 0.0f;
}

/* A pressure that the tip would show, and it does: air comes in where none should. A sensor's fault alone would be a
 * gap of the bend. */
static bool bend_confirms(const struct gap_monitor *monitor, uint32_t c) {
    const struct gap_monitor_report *report = &monitor->report;
    const float shown_rad = monitor->slope_radppa[c] * real_abs(report->vented_pa[c]);
    return monitor->steps < RECENT_STEPS && shown_rad > report->bend_threshold_rad &&
           report->bend_gap_rad < 0.5f * shown_rad;
}

static void follow_vented(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters, uint32_t c,
                          const struct gap_monitor_pressure *pressure, float step_s) {
    float *vented_pa = &monitor->report.vented_pa[c], *sooner_pa = &monitor->sooner_pa[c];
    if (pressure->vented_us < parameters->vented_after_us || !is_read(pressure)) {
        monitor->vented[c].held_s = 0.0f;
        return;
    }
    *vented_pa += step_s / parameters->rest_time_s * (pressure->reading_pa - *vented_pa);
    *sooner_pa += SOONER * step_s / parameters->rest_time_s * (pressure->reading_pa - *sooner_pa);
    if (*vented_pa - *sooner_pa > 0.5f * parameters->pressure_noise_pa) {
        monitor->vented[c].held_s = 0.0f;
        return; /* still on its way down */
    }
    const bool was_raised = monitor->vented[c].raised;
    judge(&monitor->vented[c], real_abs(*vented_pa), monitor->report.vented_threshold_pa, parameters->persist_s,
          step_s);
    if (monitor->vented[c].raised && !was_raised) {
        monitor->vented_is_real[c] = bend_confirms(monitor, c);
    }
}

void gap_monitor_follow_pressures(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                                  const struct gap_monitor_pressure pressure[3], float step_s) {
    monitor->report.vented_threshold_pa = parameters->pressure_noise_pa;
    monitor->at_rest = true;
    monitor->in_doubt = false;
    for (uint32_t c = 0; c < 3u; c++) {
        follow_valve(monitor, parameters, c, &pressure[c], step_s);
        follow_lag(monitor, parameters, c, &pressure[c]);
        follow_vented(monitor, parameters, c, &pressure[c], step_s);
        monitor->at_rest = monitor->at_rest && pressure[c].vented_us >= parameters->rest_after_us;
        monitor->in_doubt = monitor->in_doubt || (pressure[c].vented_us >= FED_US && !monitor->vented[c].raised &&
                                                  !reads_zero(parameters, &pressure[c]));
    }
    monitor->steps++;
    name_stage(monitor);
}

/* --- pose --- */

static void follow_bend(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                        const struct bend_table *table, const struct bend_table_stencil *stencil,
                        const struct gap_monitor_pose *pose, const float lag_pa[3], float interval_s) {
    const float length_m = table->module.active_length_m;
    float x[3], y[3], slope_squared = 0.0f, lag_rad[2] = {0.0f, 0.0f};
    (void)bend_table_gradient(table, stencil, BEND_TABLE_CURVATURE_X, x);
    (void)bend_table_gradient(table, stencil, BEND_TABLE_CURVATURE_Y, y);
    for (uint32_t c = 0; c < 3u; c++) {
        monitor->slope_radppa[c] = length_m * real_hypot(x[c], y[c]);
        monitor->push_radppa[c][0] = length_m * x[c];
        monitor->push_radppa[c][1] = length_m * y[c];
        slope_squared += monitor->slope_radppa[c] * monitor->slope_radppa[c];
        lag_rad[0] += length_m * x[c] * lag_pa[c];
        lag_rad[1] += length_m * y[c] * lag_pa[c];
    }
    const float share = interval_s / (parameters->pose_time_s + interval_s);
    for (uint32_t i = 0; i < 2u; i++) {
        monitor->bend_gap_rad[i] += share * (pose->gap_rad[i] - lag_rad[i] - monitor->bend_gap_rad[i]);
    }
    const float predicted_rad =
        real_hypot(pose->bend_rad[0] - pose->gap_rad[0], pose->bend_rad[1] - pose->gap_rad[1]);
    const float pressure_squared = parameters->pressure_noise_pa * parameters->pressure_noise_pa;
    const float angle_squared = parameters->tip_angle_noise_rad * parameters->tip_angle_noise_rad;
    const float noise_squared = (slope_squared * pressure_squared * parameters->pressure_period_s +
                                 2.0f * angle_squared * interval_s) / (2.0f * parameters->pose_time_s);
    struct gap_monitor_report *report = &monitor->report;
    report->bend_gap_rad = real_hypot(monitor->bend_gap_rad[0], monitor->bend_gap_rad[1]);
    report->bend_threshold_rad =
        real_hypot(parameters->table_bend_rad, parameters->table_direction_rad * predicted_rad) +
        parameters->sigmas * real_sqrt(noise_squared);
    if (!monitor->in_doubt && (!monitor->body.raised || predicted_rad > parameters->bent_rad)) {
        judge(&monitor->body, report->bend_gap_rad, report->bend_threshold_rad, parameters->persist_s, interval_s);
    }
}

/* The arc's chord: position less both caps, the distal one along the measured axis (Webster and Jones 2010). */
static void follow_position(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                            const struct bend_table_module *module, const struct gap_monitor_pose *pose,
                            float interval_s) {
    const float bend_rad = real_hypot(pose->bend_rad[0], pose->bend_rad[1]);
    const float s = real_sin(0.5f * bend_rad), c = real_cos(0.5f * bend_rad);
    const bool straight = bend_rad < SMALL_RAD;
    const float x = straight ? 1.0f : pose->bend_rad[0] / bend_rad, y = straight ? 0.0f : pose->bend_rad[1] / bend_rad;
    const float along[3] = {s * x, s * y, c};
    const float cap_across_m = module->cap_distal_m * 2.0f * s * c;
    const float chord_m[3] = {pose->position_m[0] - cap_across_m * x, pose->position_m[1] - cap_across_m * y,
                              pose->position_m[2] - module->cap_proximal_m -
                                  module->cap_distal_m * (1.0f - 2.0f * s * s)};
    const float length_m = chord_m[0] * along[0] + chord_m[1] * along[1] + chord_m[2] * along[2];
    const float share = interval_s / (parameters->pose_time_s + interval_s);
    float squared = 0.0f;
    for (uint32_t i = 0; i < 3u; i++) {
        monitor->across_m[i] += share * (chord_m[i] - length_m * along[i] - monitor->across_m[i]);
        squared += monitor->across_m[i] * monitor->across_m[i];
    }
    if (monitor->at_rest) {
        const float chord_at_rest_m = module->chamber_length_m * (straight ? 1.0f : 2.0f * s / bend_rad);
        monitor->length_m += share * (length_m - chord_at_rest_m - monitor->length_m);
    }
    struct gap_monitor_report *report = &monitor->report;
    report->position_gap_m = real_sqrt(squared + monitor->length_m * monitor->length_m);
    const float averaged = real_sqrt(interval_s / (2.0f * parameters->pose_time_s));
    const float noise_m = SQRT_3 * parameters->tip_position_noise_m * averaged;
    report->position_threshold_m = parameters->kinematics_m + 0.5f * SQRT_3 * parameters->tip_position_step_m +
                                   parameters->sigmas * noise_m +
                                   parameters->uneven_share * report->bend_gap_rad * module->chamber_length_m;
    judge(&monitor->tip_sensor, report->position_gap_m, report->position_threshold_m, parameters->persist_s,
          interval_s);
}

void gap_monitor_follow_pose(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                             const struct bend_table *table, const struct bend_table_stencil *stencil,
                             const struct gap_monitor_pose *pose) {
    const float interval_s = real_clamp(1e-6f * (float)(pose->measured_us - monitor->pose_us), 0.0f, INTERVAL_MOST_S);
    float lag_pa[3];
    for (uint32_t c = 0; c < 3u; c++) {
        lag_pa[c] = monitor->steps > 0u ? monitor->lag_pa[c] / (float)monitor->steps : 0.0f;
        monitor->lag_pa[c] = 0.0f;
    }
    monitor->steps = 0u;
    monitor->pose_us = pose->measured_us;
    if (!bend_table_is_valid(table, stencil) || !real_is_finite(pose->position_m[0]) ||
        !real_is_finite(pose->position_m[1]) || !real_is_finite(pose->position_m[2])) {
        return;
    }
    follow_bend(monitor, parameters, table, stencil, pose, lag_pa, interval_s);
    follow_position(monitor, parameters, &table->module, pose, interval_s);
}

const char *gap_monitor_stage_text(enum gap_monitor_stage stage) {
    static const char *const texts[GAP_MONITOR_STAGE_COUNT] = {
        [GAP_MONITOR_NONE] = "none: the module does what its model says",
        [GAP_MONITOR_VALVE] = "valve: a chamber does not fill or empty as its valve, supply and tubing should make it",
        [GAP_MONITOR_PRESSURE_SENSOR] = "pressure sensor: a chamber that has vented still reads a pressure",
        [GAP_MONITOR_BODY] = "body: the bend is not what the table gives for the measured pressures",
        [GAP_MONITOR_TIP_SENSOR] = "tip sensor: position and orientation do not belong to one pose of the module"};
    return (uint32_t)stage < (uint32_t)GAP_MONITOR_STAGE_COUNT ? texts[stage] : "unknown";
}
