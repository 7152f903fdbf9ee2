#include "control/tip_loop.h"

#include <string.h>

#include "control/real_math.h"

#define NORM_TOLERANCE 0.05f

void tip_loop_default_parameters(struct tip_loop_parameters *parameters) {
    *parameters =
        (struct tip_loop_parameters){.gain = 0.2f, .correction_limit_rad = 0.7f, .age_limit_us = 60000};
}

void tip_loop_init(struct tip_loop *loop) {
    (void)memset(loop, 0, sizeof *loop);
}

void tip_loop_store(struct tip_loop *loop, const float pressure_pa[3]) {
    loop->newest = (loop->newest + 1u) % TIP_LOOP_HISTORY;
    loop->stored = loop->stored < TIP_LOOP_HISTORY ? loop->stored + 1u : TIP_LOOP_HISTORY;
    for (uint32_t c = 0; c < 3u; c++) {
        loop->history_pa[loop->newest][c] = pressure_pa[c];
    }
}

bool tip_loop_bend_of(const float quaternion[4], float bend_rad[2]) {
    const float w = quaternion[0], x = quaternion[1], y = quaternion[2], z = quaternion[3];
    const float norm = w * w + x * x + y * y + z * z;
    if (!(real_abs(norm - 1.0f) < 2.0f * NORM_TOLERANCE)) {
        return false;
    }
    /* the tip's axis is the quaternion's turn of the z axis */
    const float axis_x = 2.0f * (x * z + w * y) / norm, axis_y = 2.0f * (y * z - w * x) / norm;
    const float axis_z = (w * w - x * x - y * y + z * z) / norm;
    const float across = real_hypot(axis_x, axis_y);
    const float bend = real_atan2(across, axis_z);
    const float scale = across > 1e-6f ? bend / across : 1.0f;
    bend_rad[0] = scale * axis_x;
    bend_rad[1] = scale * axis_y;
    return true;
}

void tip_loop_predict_at(const struct bend_table *table, const struct bend_table_stencil *stencil,
                         float bend_rad[2]) {
    bend_rad[0] = table->module.active_length_m * bend_table_value(table, stencil, BEND_TABLE_CURVATURE_X);
    bend_rad[1] = table->module.active_length_m * bend_table_value(table, stencil, BEND_TABLE_CURVATURE_Y);
}

void tip_loop_predict(const struct bend_table *table, const float pressure_pa[3], float bend_rad[2]) {
    struct bend_table_stencil stencil;
    bend_table_locate(table, pressure_pa, &stencil);
    tip_loop_predict_at(table, &stencil, bend_rad);
}

/* The estimates `age_us` ago, between the two steps next to it. */
static bool recall(const struct tip_loop *loop, int32_t age_us, int32_t step_us, float pressure_pa[3]) {
    const int32_t whole = age_us / step_us;
    if (whole < 0 || whole + 1 >= (int32_t)loop->stored) {
        return false;
    }
    const float share = (float)(age_us - whole * step_us) / (float)step_us;
    const uint32_t later = (loop->newest + TIP_LOOP_HISTORY - (uint32_t)whole) % TIP_LOOP_HISTORY;
    const uint32_t earlier = (later + TIP_LOOP_HISTORY - 1u) % TIP_LOOP_HISTORY;
    for (uint32_t c = 0; c < 3u; c++) {
        pressure_pa[c] =
            loop->history_pa[later][c] + share * (loop->history_pa[earlier][c] - loop->history_pa[later][c]);
    }
    return true;
}

static void limit(float vector[2], float most) {
    const float size = real_hypot(vector[0], vector[1]);
    if (size > most) {
        vector[0] *= most / size;
        vector[1] *= most / size;
    }
}

bool tip_loop_update(struct tip_loop *loop, const struct tip_loop_parameters *parameters,
                     const struct bend_table *table, const float quaternion[4], int64_t age_us,
                     int64_t step_us) {
    float measured[2], predicted[2], pressure_pa[3];
    if (age_us < 0 || age_us > parameters->age_limit_us || !tip_loop_bend_of(quaternion, measured)) {
        return false;
    }
    loop->measured_rad[0] = measured[0];
    loop->measured_rad[1] = measured[1];
    loop->compared = table != NULL && recall(loop, (int32_t)age_us, (int32_t)step_us, pressure_pa);
    if (!loop->compared) {
        return true; /* a good sample, from before the history began */
    }
    bend_table_locate(table, pressure_pa, &loop->stencil);
    tip_loop_predict_at(table, &loop->stencil, predicted);
    for (uint32_t i = 0; i < 2u; i++) {
        loop->gap_rad[i] = measured[i] - predicted[i] - loop->known_rad[i];
        loop->correction_rad[i] += parameters->gain * (loop->gap_rad[i] - loop->correction_rad[i]);
    }
    limit(loop->correction_rad, parameters->correction_limit_rad);
    return true;
}
