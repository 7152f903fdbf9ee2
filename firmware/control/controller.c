/* The order of a step: correct what the sensors say, estimate pressures, look for gaps to the model, learn from the tip,
 * look for faults, take the command, let the supervisor decide, compute the targets, write duties. State that lives here:
 * the command being followed and when it came, when the last tip sample came, each chamber's capacity from the table, and
 * how far a body that is known to creep has crept.
 *
 * A step has a bound (tests/bench), so what can wait is spread over steps. Of what looks into the table at length, a step
 * does one: take a tip sample, judge its pose, follow the creep, predict the bend where no sensor tells it, work on the
 * targets, or else renew the chambers' capacities. Valves take a new duty every 10 ms, so a millisecond or two is no loss.
 *   tip         a step after it came, since to read it is work, too; at most every TIP_STEPS, so that the others get their
 *               turn; tip sensors give up to 255 samples a second
 *   inversion   one look at the table a step; what Newton makes of the first is within 0.1 degree of the answer already
 *   capacity    two chambers a step, and one at the latest after CAPACITY_STEPS: in 3 ms of full flow it changes by some 2 %
 *   duty        once a period, in the last step before it: only the duty at the period's start counts; a late valve's, whose
 *               forecast through the pulses on their way is long, in one of the last three, a chamber each
 *   table       a part of its CRC-32: none in a step that takes a tip sample, nor in one that works out duties and has more
 *               to do; a large one in a step that has only capacities to renew: no tip sample to read, no duty */
#include "control/controller.h"

#include <stddef.h>

#include "control/crc32.h"
#include "control/real_math.h"

#define SUPPLY_LEAST_PA 1000.0f
#define SELFTEST_PRESSURE_PA 2000.0f
#define FLOW_JUDGED_FROM 50u /* control steps */
#define PREDICTION_STEPS 10u /* control steps between looks at the creep, which takes a hundred times as long, and at the
                                bend where no sensor tells it */
#define TIP_STEPS 3u      /* control steps from one tip sample to the next, at least */
#define CAPACITY_STEPS 3u /* without a capacity renewed, at most */

enum look { LOOK_ELSEWHERE = 0, LOOK_AT_TIP, LOOK_FOR_TARGETS, LOOK_IDLE };

void controller_default_parameters(struct controller_parameters *parameters, const struct bend_table *table) {
    *parameters = (struct controller_parameters){
        .tip_period_us = 10000, .tip_overdue_us = 5000, .command_timeout_us = 500000, .idle_pressure_pa = 800.0f};
    pressure_loop_default_parameters(&parameters->pressure_loop);
    tip_loop_default_parameters(&parameters->tip_loop);
    limits_default_parameters(&parameters->limits, table);
    sensor_watch_default_parameters(&parameters->sensor_watch, parameters->pressure_loop.sensor_noise_pa);
    flow_watch_default_parameters(&parameters->flow_watch);
    board_watch_default_parameters(&parameters->board_watch, parameters->pressure_loop.nominal_supply_pa,
                                   parameters->limits.working_pressure_pa);
    tip_watch_default_parameters(&parameters->tip_watch);
    gap_monitor_default_parameters(&parameters->gap_monitor);
    calibration_none(&parameters->calibration);
}

void controller_seal_parameters(struct controller *controller) {
    controller->parameters_image = (struct limits_image){.corrupt = false};
    controller->loops_image = (struct limits_image){.corrupt = false};
    controller->parameters_crc = crc32_update(0u, &controller->parameters, sizeof controller->parameters);
    controller->loops_crc = crc32_update(0u, controller->loop_parameters, sizeof controller->loop_parameters);
}

void controller_set_parameters(struct controller *controller, const struct controller_parameters *parameters) {
    controller->parameters = *parameters;
    controller->period_start_us = 0; /* periods start at multiples of what they now are */
    struct controller_calibration *calibration = &controller->parameters.calibration;
    controller->status.calibration_limited = calibration_limit(calibration);
    calibration_frames_of(calibration, &controller->frames);
    controller->creeps = calibration_creeps(calibration);
    for (uint32_t c = 0; c < 3u; c++) {
        calibration_apply(calibration, c, &parameters->pressure_loop, &controller->loop_parameters[c]);
    }
    controller_seal_parameters(controller);
}

/* V + p_abs dV/dp of chamber `c` with its tube; the pull of the other chambers on V is left to the observer. */
static float capacity_of(const struct controller *controller, const struct bend_table_stencil *stencil, uint32_t c) {
    const struct pressure_loop_parameters *parameters = &controller->loop_parameters[c];
    const float length_m = controller->table->module.chamber_length_m;
    float gradient[3];
    const float volume_m2 = bend_table_gradient(
        controller->table, stencil, (enum bend_table_channel)((uint32_t)BEND_TABLE_VOLUME_1 + c), gradient);
    const float pressure_pa_abs = parameters->ambient_pa_abs + controller->pressure_loop[c].estimate_pa;
    return parameters->tube_volume_m3 + length_m * (volume_m2 + pressure_pa_abs * real_max(gradient[c], 0.0f));
}

/* The next `count` chambers', at the estimated pressures. Beyond the table's end a chamber grows at least as fast as at it:
 * taken for rigid there, it would be held above that end unseen. */
static void update_capacities(struct controller *controller, uint32_t count) {
    const struct bend_table *table = controller->table;
    struct bend_table_stencil stencil;
    float pressure_pa[3];
    if (table == NULL) {
        return;
    }
    for (uint32_t c = 0; c < 3u; c++) {
        pressure_pa[c] = real_min(controller->pressure_loop[c].estimate_pa, table->axis_pa[c][table->nodes[c] - 1u]);
    }
    bend_table_locate(table, pressure_pa, &stencil);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t c = controller->capacity_next;
        controller->capacity_m3[c] = capacity_of(controller, &stencil, c);
        controller->capacity_next = c < 2u ? c + 1u : 0u;
    }
    controller->capacity_taken = controller->step;
}

void controller_init(struct controller *controller, const struct bend_table *table,
                     const struct controller_parameters *parameters) {
    *controller = (struct controller){.table = table};
    supervisor_init(&controller->supervisor);
    limits_init(&controller->limits);
    board_watch_init(&controller->board_watch);
    tip_watch_init(&controller->tip_watch);
    tip_loop_init(&controller->tip_loop);
    gap_monitor_init(&controller->gap_monitor);
    controller_set_parameters(controller, parameters);
    for (uint32_t c = 0; c < 3u; c++) {
        pressure_loop_init(&controller->pressure_loop[c]);
        controller->capacity_m3[c] = controller->loop_parameters[c].nominal_capacity_m3;
        sensor_watch_init(&controller->sensor_watch[c]);
        flow_watch_init(&controller->flow_watch[c]);
    }
    update_capacities(controller, 3u);
    controller->tip_lost = true;
    controller->status.state = SUPERVISOR_BOOT;
}

/* --- calibration --- */

/* The pressures and the pose behind what the sensors say. */
static void correct(const struct controller *controller, struct controller_input *input) {
    const struct controller_calibration *calibration = &controller->parameters.calibration;
    const float noise_pa = controller->parameters.pressure_loop.sensor_noise_pa;
    for (uint32_t c = 0; c < 3u; c++) {
        input->pressure_pa[c] = calibration_pressure(calibration, c, input->pressure_pa[c], noise_pa,
                                                     controller->pressure_loop[c].estimate_pa);
    }
}

/* By implicit Euler steps, so that no time constant is too short for them. */
static void follow_creep(struct controller *controller) {
    const struct controller_calibration *calibration = &controller->parameters.calibration;
    float elastic_rad[2], *known_rad = controller->tip_loop.known_rad;
    tip_loop_predict(controller->table, controller->status.pressure_estimate_pa, elastic_rad);
    const float step_s = 1e-6f * (float)(PREDICTION_STEPS * (uint32_t)CONTROLLER_STEP_US);
    for (uint32_t i = 0; i < 2u; i++) {
        known_rad[i] = 0.0f;
        for (uint32_t k = 0; k < CALIBRATION_CREEP_TERMS; k++) {
            const float share = step_s / (calibration->creep_time_s[k] + step_s);
            const float end_rad = calibration->creep_share[k] * elastic_rad[i];
            controller->crept_rad[k][i] += share * (end_rad - controller->crept_rad[k][i]);
            known_rad[i] += controller->crept_rad[k][i];
        }
    }
    controller->creep_due = false;
    controller->targets_stale = true;
}

/* --- time --- */

/* From the last period on: a remainder of 64 bits takes long. */
static void set_clock(struct controller *controller, int64_t time_us) {
    const int64_t period_us = controller->parameters.pressure_loop.pwm_period_us;
    int64_t *start_us = &controller->period_start_us;
    *start_us += time_us - *start_us >= period_us ? period_us : 0;
    if (time_us < *start_us || time_us - *start_us >= period_us) {
        *start_us = time_us - time_us % period_us;
    }
    controller->clock = pressure_loop_clock_at(time_us, *start_us, CONTROLLER_STEP_US);
    controller->steps_left = ((int32_t)period_us - controller->clock.phase_us - 1) / CONTROLLER_STEP_US;
}

/* --- pressures --- */

static float supply_of(const struct controller *controller, const struct controller_input *input) {
    const bool known = input->supply_ok && real_is_finite(input->supply_pa) && input->supply_pa > SUPPLY_LEAST_PA;
    return known ? input->supply_pa : controller->parameters.pressure_loop.nominal_supply_pa;
}

static void estimate(struct controller *controller, const struct controller_input *input) {
    float pressure_pa[3];
    for (uint32_t c = 0; c < 3u; c++) {
        const struct pressure_loop_parameters *parameters = &controller->loop_parameters[c];
        struct pressure_loop *loop = &controller->pressure_loop[c];
        if (controller->step > 0u) {
            pressure_loop_predict(loop, parameters, supply_of(controller, input), controller->capacity_m3[c],
                                  &controller->clock);
        }
        if (input->pressure_ok[c] && real_is_finite(input->pressure_pa[c])) {
            pressure_loop_correct(loop, parameters, input->pressure_pa[c], controller->capacity_m3[c],
                                  CONTROLLER_STEP_US);
        }
        pressure_pa[c] = loop->estimate_pa;
        controller->status.pressure_estimate_pa[c] = loop->estimate_pa;
    }
    tip_loop_store(&controller->tip_loop, pressure_pa);
}

/* --- gap --- */

static void watch_pressures(struct controller *controller, const struct controller_input *input) {
    struct gap_monitor_pressure pressure[3];
    for (uint32_t c = 0; c < 3u; c++) {
        const struct pressure_loop *loop = &controller->pressure_loop[c];
        pressure[c] = (struct gap_monitor_pressure){
            .reading_pa = input->pressure_pa[c],
            .reading_ok = input->pressure_ok[c],
            .estimate_pa = loop->estimate_pa,
            .unmodelled_pa = loop->unmodelled_pa,
            .capacity_m3 = controller->table != NULL ? controller->capacity_m3[c] : 0.0f,
            .vented_us = pressure_loop_vented_us(loop, &controller->clock)};
    }
    gap_monitor_follow_pressures(&controller->gap_monitor, &controller->parameters.gap_monitor, pressure,
                                 (float)CONTROLLER_STEP_US * 1e-6f);
}

static void keep_pose(struct controller *controller) {
    const struct tip_loop *loop = &controller->tip_loop;
    struct gap_monitor_pose *pose = &controller->pose;
    pose->measured_us = controller->tip.measured_us;
    for (uint32_t i = 0; i < 2u; i++) {
        pose->bend_rad[i] = loop->measured_rad[i];
        pose->gap_rad[i] = loop->gap_rad[i];
    }
    for (uint32_t i = 0; i < 3u; i++) {
        pose->position_m[i] = controller->tip.position_m[i];
    }
    controller->pose_waits = true;
}

static void judge_pose(struct controller *controller) {
    gap_monitor_follow_pose(&controller->gap_monitor, &controller->parameters.gap_monitor, controller->table,
                            &controller->tip_loop.stencil, &controller->pose);
    controller->pose_waits = false;
}

/* --- tip --- */

static float highest_pressure(const struct controller *controller) {
    const struct pressure_loop *loop = controller->pressure_loop;
    return real_max(real_max(loop[0].estimate_pa, loop[1].estimate_pa), loop[2].estimate_pa);
}

static void watch_bend(struct controller *controller, int64_t time_us) {
    const struct pressure_loop *loop = controller->pressure_loop;
    const struct tip_watch_view view = {.time_us = time_us,
                                        .measured_rad = controller->tip_loop.measured_rad,
                                        .gap_rad = controller->tip_loop.gap_rad,
                                        .push_radppa = (const float(*)[2])controller->gap_monitor.push_radppa,
                                        .slope_radppa = controller->gap_monitor.slope_radppa,
                                        .pressure_pa = {loop[0].estimate_pa, loop[1].estimate_pa, loop[2].estimate_pa},
                                        .working_pa = controller->parameters.limits.working_pressure_pa};
    tip_watch_follow(&controller->tip_watch, &controller->parameters.tip_watch, &view, controller->tip_loop.correction_rad);
}

/* Keeps a new sample until its turn. */
static void receive_tip(struct controller *controller, const struct controller_input *input) {
    struct controller_tip *tip = &controller->tip;
    if (!input->tip_new) {
        return;
    }
    controller->status.tip_overtaken += controller->tip_waits ? 1u : 0u;
    controller->tip_since = controller->tip_waits ? controller->tip_since : controller->step;
    controller->tip_waits = true;
    tip->came_us = input->time_us;
    tip->measured_us = input->tip_measured_us - controller->parameters.calibration.tip_late_us;
    tip->status = input->tip_status;
    for (uint32_t i = 0; i < 3u; i++) {
        tip->position_m[i] = input->tip_position_m[i];
    }
    for (uint32_t i = 0; i < 4u; i++) {
        tip->quaternion[i] = input->tip_quaternion[i];
    }
}

static void follow_tip(struct controller *controller, int64_t time_us) {
    struct controller_tip *tip = &controller->tip;
    calibration_pose(&controller->frames, tip->position_m, tip->quaternion);
    const struct tip_watch_sample sample = {time_us, tip->position_m, tip->quaternion, tip->status};
    const bool good = tip_watch_take(&controller->tip_watch, &controller->parameters.tip_watch,
                                     controller->table != NULL ? &controller->table->module : NULL, &sample) &&
                      tip_loop_update(&controller->tip_loop, &controller->parameters.tip_loop, controller->table,
                                      tip->quaternion, time_us - tip->measured_us, CONTROLLER_STEP_US);
    controller->tip_waits = false;
    controller->tip_taken = controller->step;
    controller->status.tip_samples += good ? 1u : 0u;
    controller->status.tip_rejected += good ? 0u : 1u;
    if (good) {
        controller->tip_us = tip->came_us;
        controller->tip_lost = false;
        controller->targets_stale = true;
    }
    if (good && controller->tip_loop.compared) {
        watch_bend(controller, time_us);
        keep_pose(controller);
    }
}

static void watch_tip(struct controller *controller, int64_t time_us) {
    const struct controller_parameters *parameters = &controller->parameters;
    const bool overdue = time_us - controller->tip_us >= parameters->tip_period_us + parameters->tip_overdue_us;
    if (overdue && !controller->tip_lost) {
        controller->tip_lost = true; /* the last correction is kept: it is the best that is known of the model's error */
        controller->status.tip_lost_count++;
    }
}

/* Without a tip sensor, what the table makes of the pressures, as often as samples would come. */
static void predict_bend(struct controller *controller) {
    const struct tip_loop *loop = &controller->tip_loop;
    float bend[2];
    tip_loop_predict(controller->table, controller->status.pressure_estimate_pa, bend);
    for (uint32_t i = 0; i < 2u; i++) {
        controller->predicted_rad[i] = bend[i] + loop->correction_rad[i] + (controller->creeps ? loop->known_rad[i] : 0.0f);
    }
    controller->prediction_due = false;
}

static void report_bend(struct controller *controller) {
    const float *bend = controller->tip_lost && controller->table != NULL ? controller->predicted_rad
                                                                          : controller->tip_loop.measured_rad;
    controller->status.bend_rad = real_hypot(bend[0], bend[1]);
    controller->status.direction_rad = real_atan2(bend[1], bend[0]);
    controller->status.bend_is_measured = !controller->tip_lost;
}

/* A valve's duty has its turn in the last step of a period, a late one's in one of the last. */
static bool has_turn(const struct controller *controller, uint32_t c) {
    const struct pressure_loop_parameters *parameters = &controller->loop_parameters[c];
    const int32_t last = (int32_t)parameters->pwm_period_us / CONTROLLER_STEP_US - 1;
    const int32_t turn = parameters->late_us > 0 ? (int32_t)c : 0;
    return controller->steps_left == (turn < last ? turn : last);
}

/* Of a late valve's duty, through the pulses that are on their way. */
static bool forecasts_long(const struct controller *controller) {
    bool is_long = false;
    for (uint32_t c = 0; c < 3u; c++) {
        is_long = is_long || (controller->loop_parameters[c].late_us > 0 && has_turn(controller, c));
    }
    return is_long;
}

/* What this step checks of the table. */
static uint32_t table_bytes_for(const struct controller *controller, const struct controller_input *input,
                                enum look looks) {
    const struct limits_parameters *parameters = &controller->parameters.limits;
    const bool drives = controller->steps_left == 0, idle = looks == LOOK_IDLE;
    if (looks == LOOK_AT_TIP || (drives && !idle)) {
        return 0u;
    }
    const bool busy = drives || !idle || input->tip_new || forecasts_long(controller);
    return busy ? parameters->table_bytes_busy : parameters->table_bytes_per_step;
}

static bool is_tip_due(const struct controller *controller) {
    return controller->tip_waits && controller->tip_since != controller->step &&
           controller->step - controller->tip_taken >= TIP_STEPS;
}

/* This step's one look into the table at length. `aims`: the targets want it. */
static enum look look(struct controller *controller, int64_t time_us, bool aims) {
    const bool overdue = controller->step - controller->capacity_taken > CAPACITY_STEPS;
    if (controller->table != NULL && controller->step % PREDICTION_STEPS == 0u) {
        controller->creep_due = controller->creeps;
        controller->prediction_due = controller->tip_lost;
    }
    if (overdue) {
        update_capacities(controller, 1u);
    } else if (is_tip_due(controller)) {
        follow_tip(controller, time_us);
        return LOOK_AT_TIP;
    } else if (controller->pose_waits) {
        judge_pose(controller);
    } else if (controller->creep_due) {
        follow_creep(controller);
    } else if (controller->prediction_due) {
        predict_bend(controller);
    } else if (aims) {
        return LOOK_FOR_TARGETS;
    } else {
        update_capacities(controller, 2u);
        return LOOK_IDLE;
    }
    return LOOK_ELSEWHERE;
}

/* --- commands --- */

static bool command_is_sound(const struct controller *controller, const struct controller_command *command) {
    if (command->kind == COMMAND_PRESSURE) {
        return real_is_finite(command->pressure_pa[0]) && real_is_finite(command->pressure_pa[1]) &&
               real_is_finite(command->pressure_pa[2]);
    }
    if (command->kind == COMMAND_BEND) {
        return controller->table != NULL && real_is_finite(command->bend_rad) && command->bend_rad >= 0.0f &&
               real_is_finite(command->direction_rad) && real_is_finite(command->co_contraction_pa);
    }
    return true;
}

static enum supervisor_request request_of(const struct controller_command *command) {
    switch (command->kind) {
    case COMMAND_VENT:
        return SUPERVISOR_REQUEST_VENT;
    case COMMAND_HOLD:
        return SUPERVISOR_REQUEST_HOLD;
    case COMMAND_PRESSURE:
    case COMMAND_BEND:
        return command->said_again ? SUPERVISOR_REQUEST_MOVE_ON : SUPERVISOR_REQUEST_MOVE;
    case COMMAND_CLEAR:
        return SUPERVISOR_REQUEST_CLEAR;
    case COMMAND_NONE:
    default:
        return SUPERVISOR_REQUEST_NONE;
    }
}

static uint32_t find_corruption(struct controller *controller, const struct controller_input *input,
                                uint32_t table_bytes) {
    const uint32_t count = controller->parameters.limits.parameter_bytes_per_step;
    uint32_t faults = 0u;
    if (controller->table != NULL &&
        limits_check_table(&controller->limits, controller->table, table_bytes)) {
        faults |= 1u << FAULT_TABLE_CORRUPT;
    }
    const bool odd = controller->step % 2u != 0u;
    const bool corrupt =
        odd ? limits_check_image(&controller->loops_image, (const uint8_t *)controller->loop_parameters,
                                 (uint32_t)sizeof controller->loop_parameters, controller->loops_crc, count)
            : limits_check_image(&controller->parameters_image, (const uint8_t *)&controller->parameters,
                                 (uint32_t)sizeof controller->parameters, controller->parameters_crc, count);
    if (corrupt || controller->loops_image.corrupt || controller->parameters_image.corrupt || input->parameters_corrupt) {
        faults |= 1u << FAULT_PARAMETERS_CORRUPT;
    }
    return faults;
}

/* One chamber's sensor, in what it `shows` itself, and its valve. An observer that starts has the pressure to find first. */
static uint32_t find_chamber_faults(struct controller *controller, const struct controller_input *shows, uint32_t c) {
    const struct pressure_loop *loop = &controller->pressure_loop[c];
    const bool usable = shows->pressure_ok[c] && real_is_finite(shows->pressure_pa[c]);
    const struct flow_watch_view view = {loop->estimate_pa, loop->unmodelled_pa, loop->filled_share, loop->fill_pa,
                                         loop->vent_pa};
    uint32_t faults = sensor_watch_step(&controller->sensor_watch[c], &controller->parameters.sensor_watch,
                                        shows->pressure_pa[c], usable, real_max(loop->fill_pa, loop->vent_pa),
                                        controller->step);
    if (controller->step >= FLOW_JUDGED_FROM) {
        faults |= flow_watch_step(&controller->flow_watch[c], &controller->parameters.flow_watch, &view);
    }
    return faults;
}

static uint32_t find_board_faults(struct controller *controller, const struct controller_input *input,
                                  float highest_pa) {
    const struct board_watch_view view = {.time_us = input->time_us,
                                          .supply_pa = input->supply_pa,
                                          .supply_ok = input->supply_ok,
                                          .supply_enabled = supervisor_supply_enabled(&controller->supervisor),
                                          .moving = supervisor_valves_enabled(&controller->supervisor),
                                          .highest_pa = highest_pa,
                                          .health = &input->health,
                                          .outputs_refused = input->outputs_refused,
                                          .bus_off = input->bus_off};
    uint32_t faults = board_watch_step(&controller->board_watch, &controller->parameters.board_watch, &view);
    if (view.moving && input->command.kind == COMMAND_NONE &&
        input->time_us - controller->command_us >= controller->parameters.command_timeout_us) {
        faults |= 1u << FAULT_COMMAND_TIMEOUT;
    }
    return faults;
}

/* A chamber takes more air than its reading explains, and there is no tip sensor that vouches for the reading. */
static bool is_doubted(const struct controller *controller) {
    bool doubted = false;
    for (uint32_t c = 0; c < 3u; c++) {
        doubted = doubted || flow_watch_doubts(&controller->flow_watch[c], &controller->parameters.flow_watch);
    }
    return doubted && controller->tip_lost && controller->table != NULL;
}

/* `shows`: what the sensors say before it is corrected. */
static uint32_t find_faults(struct controller *controller, const struct controller_input *input,
                            const struct controller_input *shows, uint32_t table_bytes) {
    const struct limits_parameters *limits = &controller->parameters.limits;
    uint32_t faults = limits_check_pressures(limits, shows->pressure_pa, input->pressure_pa, input->pressure_ok);
    const float highest_pa = highest_pressure(controller);
    for (uint32_t c = 0; c < 3u; c++) {
        faults |= find_chamber_faults(controller, shows, c);
    }
    if (limits_check_working(&controller->limits, limits, highest_pa)) {
        faults |= 1u << FAULT_OVERPRESSURE;
    }
    if (is_doubted(controller)) {
        faults |= 1u << FAULT_SENSORS_DISAGREE;
    }
    if (tip_watch_disagrees(&controller->tip_watch, &controller->parameters.tip_watch, input->time_us)) {
        faults |= 1u << FAULT_SENSORS_DISAGREE;
    }
    return faults | find_corruption(controller, input, table_bytes) | find_board_faults(controller, input, highest_pa);
}

static void supervise(struct controller *controller, const struct controller_input *input,
                      const struct controller_input *shows, uint32_t table_bytes) {
    const struct controller_command *command = &input->command;
    const uint32_t present = find_faults(controller, input, shows, table_bytes);
    bool healthy = true; /* the self-test waits until every chamber has vented, should it run into a restart */
    for (uint32_t c = 0; c < 3u; c++) {
        healthy = healthy && input->pressure_pa[c] < SELFTEST_PRESSURE_PA;
    }
    const bool sound = command_is_sound(controller, command);
    const enum supervisor_request request = sound ? request_of(command) : SUPERVISOR_REQUEST_NONE;
    const bool accepted =
        supervisor_step(&controller->supervisor, input->time_us, present, healthy, request) && sound;
    controller->status.commands_refused += accepted ? 0u : 1u;
    if (command->kind != COMMAND_NONE && accepted) {
        controller->command_us = input->time_us;
        if (command->kind == COMMAND_HOLD && controller->active.kind != COMMAND_HOLD) {
            for (uint32_t c = 0; c < 3u; c++) {
                controller->active.pressure_pa[c] = controller->status.pressure_estimate_pa[c];
            }
            controller->active.kind = COMMAND_HOLD;
        } else if (command->kind != COMMAND_HOLD) {
            controller->active = *command;
        }
        controller->targets_stale = true;
    }
}

/* --- targets and duties --- */

static void take_up_bend(struct controller *controller) {
    const struct controller_command *command = &controller->active;
    const float *correction = controller->tip_loop.correction_rad, *known = controller->tip_loop.known_rad;
    const float x = command->bend_rad * real_cos(command->direction_rad) - correction[0] - known[0];
    const float y = command->bend_rad * real_sin(command->direction_rad) - correction[1] - known[1];
    /* no bend wanted means no pressure, whatever the sensor's noise says */
    const bool none = !(command->bend_rad > 0.0f);
    const float bend_rad[2] = {none ? 0.0f : x, none ? 0.0f : y};
    bend_inverse_begin(&controller->inversion, controller->table, bend_rad, command->co_contraction_pa);
    controller->inverting = true;
    controller->targets_stale = false;
}

/* A request that comes during an inversion waits for its end, some steps, so that a stream of them starves none. */
static void aim_at_bend(struct controller *controller) {
    struct bend_inverse *inversion = &controller->inversion;
    float wanted_pa[3];
    if (!controller->inverting) {
        take_up_bend(controller);
    }
    const float floor_pa = inversion->plane.floor_pa;
    if (bend_inverse_step(inversion)) {
        controller->inverting = false;
        bend_inverse_finish(inversion, &controller->status.inverse);
    }
    if (!bend_inverse_preview(inversion, wanted_pa)) {
        return; /* the targets stay until there are better ones */
    }
    for (uint32_t c = 0; c < 3u; c++) {
        const bool idle = wanted_pa[c] < controller->parameters.idle_pressure_pa && wanted_pa[c] > floor_pa;
        controller->status.pressure_target_pa[c] = idle ? floor_pa : wanted_pa[c];
    }
}

/* Within the limits, and within the domain over which the table holds: beyond a fold the module would snap. */
static void aim_at_pressures(struct controller *controller) {
    struct controller_status *status = &controller->status;
    status->inverse.flags = 0u;
    for (uint32_t c = 0; c < 3u; c++) {
        const float wanted_pa = controller->active.pressure_pa[c];
        status->pressure_target_pa[c] = real_clamp(wanted_pa, 0.0f, controller->parameters.limits.working_pressure_pa);
        if (wanted_pa < 0.0f || wanted_pa > controller->parameters.limits.working_pressure_pa) {
            status->inverse.flags |= (uint32_t)BEND_INVERSE_LIMITED_PRESSURE;
        }
    }
    if (controller->table != NULL && !bend_table_keep_valid(controller->table, status->pressure_target_pa)) {
        status->inverse.flags |= (uint32_t)BEND_INVERSE_LIMITED_PRESSURE;
    }
}

static void aim(struct controller *controller, bool may_look) {
    struct controller_status *status = &controller->status;
    if (!supervisor_valves_enabled(&controller->supervisor)) {
        for (uint32_t c = 0; c < 3u; c++) {
            status->pressure_target_pa[c] = 0.0f;
        }
        status->inverse.flags = 0u;
        controller->inverting = false;
        controller->targets_stale = false;
    } else if (controller->active.kind == COMMAND_BEND) {
        if (may_look && (controller->targets_stale || controller->inverting)) {
            aim_at_bend(controller);
        }
    } else if (may_look && controller->targets_stale) {
        aim_at_pressures(controller);
        controller->inverting = false;
        controller->targets_stale = false;
    }
}

static void drive(struct controller *controller, const struct controller_input *input,
                  struct controller_output *output) {
    output->valves_enabled = supervisor_valves_enabled(&controller->supervisor);
    output->supply_enabled = supervisor_supply_enabled(&controller->supervisor);
    for (uint32_t c = 0; c < 3u; c++) {
        const struct pressure_loop_parameters *parameters = &controller->loop_parameters[c];
        struct pressure_loop *loop = &controller->pressure_loop[c];
        output->duty[c] = 0.0f;
        if (!output->valves_enabled) {
            pressure_loop_vent(loop, parameters, &controller->clock);
        } else if (has_turn(controller, c) || !(controller->status.pressure_target_pa[c] > 0.0f)) {
            output->duty[c] = pressure_loop_duty(loop, parameters, controller->status.pressure_target_pa[c],
                                                 supply_of(controller, input), controller->capacity_m3[c],
                                                 &controller->clock);
        } else {
            output->duty[c] = pressure_loop_same_duty(loop, parameters);
        }
    }
}

static uint32_t bit_if(bool present, enum supervisor_warning warning) {
    return present ? 1u << (uint32_t)warning : 0u;
}

static uint32_t find_warnings(const struct controller *controller, const struct controller_input *input) {
    const struct controller_status *status = &controller->status;
    bool leaks = false, keeps = false;
    for (uint32_t c = 0; c < 3u; c++) {
        const bool raised = controller->gap_monitor.valve[c].raised;
        const struct flow_watch_parameters *flow = &controller->parameters.flow_watch;
        leaks = leaks || flow_watch_loses(&controller->flow_watch[c], flow) ||
                (raised && status->gap.pressure_gap_pa[c] < 0.0f);
        keeps = keeps || flow_watch_keeps(&controller->flow_watch[c], flow) ||
                (raised && status->gap.pressure_gap_pa[c] > 0.0f);
    }
    return tip_watch_warnings(&controller->tip_watch, &controller->parameters.tip_watch, input->time_us) |
           bit_if(controller->tip_lost, WARNING_TIP_LOST) | bit_if(controller->table == NULL, WARNING_NO_TABLE) |
           bit_if(status->inverse.flags != 0u, WARNING_COMMAND_LIMITED) |
           bit_if(status->gap.stage != GAP_MONITOR_NONE, WARNING_MODEL_GAP) | bit_if(leaks, WARNING_LEAK) |
           bit_if(keeps, WARNING_VENT_WEAK) | bit_if(input->error_passive || input->bus_off, WARNING_CAN_ERROR_PASSIVE) |
           bit_if(input->health.clock_failed, WARNING_CLOCK_INTERNAL) |
           bit_if(board_watch_was_late(&controller->board_watch, input->time_us), WARNING_STEP_LATE) |
           bit_if(!input->supply_ok, WARNING_SUPPLY_UNKNOWN);
}

void controller_step(struct controller *controller, const struct controller_input *input,
                     struct controller_output *output) {
    struct controller_input corrected = *input;
    set_clock(controller, input->time_us);
    correct(controller, &corrected);
    estimate(controller, &corrected);
    watch_pressures(controller, &corrected);
    receive_tip(controller, input);
    const bool aims = controller->inverting || controller->targets_stale || input->command.kind != COMMAND_NONE;
    const enum look looks = look(controller, input->time_us, aims);
    watch_tip(controller, input->time_us);
    supervise(controller, &corrected, input, table_bytes_for(controller, input, looks));
    aim(controller, looks == LOOK_FOR_TARGETS);
    drive(controller, &corrected, output);
    report_bend(controller);
    controller->step++;
    controller->status.gap = controller->gap_monitor.report;
    struct controller_status *status = &controller->status;
    status->state = controller->supervisor.state;
    status->faults = controller->supervisor.faults;
    status->warnings = find_warnings(controller, input);
}
