#include "frame_app.h"

#include <stddef.h>

static int64_t time_us(void *context) {
    return ((const struct frame_app *)context)->frame->input.time_us;
}

static bool read_pressures(void *context, struct hal_pressures *pressures) {
    const struct frame_input *input = &((const struct frame_app *)context)->frame->input;
    for (uint32_t c = 0; c < 3u; c++) {
        pressures->chamber_pa[c] = input->chamber_pa[c];
        pressures->chamber_ok[c] = input->chamber_ok[c] != 0u;
    }
    pressures->supply_pa = input->supply_pa;
    pressures->supply_ok = input->supply_ok != 0u;
    return input->pressures_read != 0u;
}

static bool read_tip(void *context, struct hal_tip_sample *sample) {
    struct frame_app *board = context;
    if (board->tip_next >= board->frame->input.tip_count) {
        return false;
    }
    const struct frame_tip *tip = &board->frame->input.tip[board->tip_next++];
    sample->measured_us = tip->measured_us;
    for (uint32_t i = 0; i < 3u; i++) {
        sample->position_m[i] = tip->position_m[i];
    }
    for (uint32_t i = 0; i < 4u; i++) {
        sample->quaternion[i] = tip->quaternion[i];
    }
    sample->quality = (uint16_t)tip->quality;
    sample->status = (uint16_t)tip->status;
    return true;
}

static bool write_outputs(void *context, const struct hal_outputs *outputs) {
    struct frame_output *output = &((const struct frame_app *)context)->frame->output;
    for (uint32_t c = 0; c < 3u; c++) {
        output->duty[c] = outputs->duty[c];
    }
    output->valves_enabled = outputs->valves_enabled ? 1u : 0u;
    output->supply_enabled = outputs->supply_enabled ? 1u : 0u;
    return true;
}

/* Every number in use, valves as late as they may be; mission.c has the plant that is like that. */
static void calibrate(struct controller_calibration *calibration) {
    for (uint32_t c = 0; c < 3u; c++) {
        calibration->reading_gain[c] = 1.03f;
        calibration->reading_offset_pa[c] = 120.0f;
        calibration->reading_lag_s[c] = 0.01f;
        calibration->valve_late_us[c] = 60000;
        calibration->least_duty[c] = 0.12f;
        calibration->lost_duty[c] = 0.05f;
        calibration->fill_scale[c] = 0.9f;
        calibration->vent_scale[c] = 0.9f;
        calibration->leak_scale[c] = 0.01f;
        calibration->extra_volume_m3[c] = 1e-6f;
        calibration->tip_arm_m[c] = 0.001f;
        calibration->tip_mount_rad[c] = 0.01f;
        calibration->tip_offset_m[c] = 0.0005f;
        calibration->tip_frame_rad[c] = 0.01f;
    }
    calibration->tip_late_us = 3000;
    for (uint32_t k = 0; k < CALIBRATION_CREEP_TERMS; k++) {
        calibration->creep_share[k] = 0.02f;
        calibration->creep_time_s[k] = 0.3f * (float)(k + 1u);
    }
}

bool frame_app_open(struct frame_app *board, struct frame *frame, const void *image) {
    struct controller_parameters parameters;
    board->frame = frame;
    board->hal = (struct hal){.context = board,
                              .time_us = time_us,
                              .read_pressures = read_pressures,
                              .read_tip = read_tip,
                              .write_outputs = write_outputs};
    frame->status = (uint32_t)bend_table_open(&board->table, image, frame->table_bytes, NULL);
    if (frame->status != (uint32_t)BEND_TABLE_OK) {
        return false;
    }
    controller_default_parameters(&parameters, &board->table);
    if (frame->variant == (uint32_t)FRAME_CALIBRATED) {
        calibrate(&parameters.calibration);
    }
    app_init(&board->app, &board->hal, &board->table, &parameters);
    return true;
}

static void give_command(struct frame_app *board) {
    const struct frame_command *given = &board->frame->input.command;
    if (given->kind == (uint32_t)COMMAND_NONE) {
        return;
    }
    const struct controller_command command = {
        .kind = (enum controller_command_kind)given->kind,
        .pressure_pa = {given->pressure_pa[0], given->pressure_pa[1], given->pressure_pa[2]},
        .bend_rad = given->bend_rad,
        .direction_rad = given->direction_rad,
        .co_contraction_pa = given->co_contraction_pa};
    app_command(&board->app, &command);
}

static void show_status(const struct controller_status *status, struct frame_output *output) {
    output->state = (uint32_t)status->state;
    output->faults = status->faults;
    output->warnings = status->warnings;
    for (uint32_t c = 0; c < 3u; c++) {
        output->target_pa[c] = status->pressure_target_pa[c];
        output->estimate_pa[c] = status->pressure_estimate_pa[c];
    }
    output->bend_rad = status->bend_rad;
    output->direction_rad = status->direction_rad;
    output->inverse_residual_rad = status->inverse.residual_rad;
    output->inverse_flags = status->inverse.flags;
}

void frame_app_step(struct frame_app *board) {
    board->tip_next = 0u;
    give_command(board);
    (void)app_step(&board->app); /* a latched fault shows in the output */
    show_status(&board->app.controller.status, &board->frame->output);
}

void frame_app_begin(struct frame_app *board) {
    struct frame_inversion *inversion = &board->frame->inversion;
    bend_inverse_begin(&board->inverse, &board->table, inversion->bend_rad, inversion->co_contraction_pa);
    frame_app_invert(board);
}

void frame_app_invert(struct frame_app *board) {
    struct frame_inversion *inversion = &board->frame->inversion;
    inversion->done = bend_inverse_step(&board->inverse) ? 1u : 0u;
    inversion->previews = bend_inverse_preview(&board->inverse, inversion->preview_pa) ? 1u : 0u;
    if (inversion->done != 0u) {
        struct bend_inverse_result result;
        bend_inverse_finish(&board->inverse, &result);
        for (uint32_t c = 0; c < 3u; c++) {
            inversion->pressure_pa[c] = result.pressure_pa[c];
        }
        inversion->reached_rad = result.bend_rad;
        inversion->residual_rad = result.residual_rad;
        inversion->flags = result.flags;
    }
}
