/* Effects on the tip sensor. */
#include <math.h>

#include "blind_effect.h"

static double gate_of(const struct blind_effect *effect, const struct blind_plant *plant) {
    return blind_effect_gate(effect, blind_time_s(plant));
}

/* --- tip_offset: the transmitter stands elsewhere --- */

static void tip_offset_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    blind_direction(random, blind_log_uniform(random, 2e-4, 5e-3), effect->parameter);
}

static void tip_offset_pose(struct blind_effect *effect, const struct blind_plant *plant, double step_s,
                            struct blind_pose *pose) {
    (void)step_s;
    for (int d = 0; d < 3; d++) {
        pose->position_m[d] += gate_of(effect, plant) * effect->parameter[d];
    }
}

/* --- tip_misalignment: the transmitter is turned (variant 0), or the sensor is turned in the tip (variant 1) --- */

static void tip_misalignment_draw(struct blind_effect *effect, struct blind_random *random,
                                  const struct blind_scene *scene) {
    (void)scene;
    blind_direction(random, blind_log_uniform(random, 0.01, 0.17), effect->parameter);
    effect->variant = (int)blind_below(random, 2);
}

static void tip_misalignment_pose(struct blind_effect *effect, const struct blind_plant *plant, double step_s,
                                  struct blind_pose *pose) {
    double rotation[3], turn[4];
    (void)step_s;
    for (int d = 0; d < 3; d++) {
        rotation[d] = gate_of(effect, plant) * effect->parameter[d];
    }
    blind_quaternion_of_rotation(rotation, turn);
    if (effect->variant == 0) {
        blind_quaternion_product(turn, pose->quaternion, pose->quaternion);
        blind_rotate(turn, pose->position_m, rotation);
        for (int d = 0; d < 3; d++) {
            pose->position_m[d] = rotation[d];
        }
    } else {
        blind_quaternion_product(pose->quaternion, turn, pose->quaternion);
    }
}

/* --- tip_lever_arm: the sensor sits beside the middle of the tip face --- */

static void tip_lever_arm_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    blind_direction(random, blind_log_uniform(random, 5e-4, 15e-3), effect->parameter);
}

static void tip_lever_arm_pose(struct blind_effect *effect, const struct blind_plant *plant, double step_s,
                               struct blind_pose *pose) {
    double arm[3];
    (void)step_s;
    blind_rotate(pose->quaternion, effect->parameter, arm);
    for (int d = 0; d < 3; d++) {
        pose->position_m[d] += gate_of(effect, plant) * arm[d];
    }
}

/* --- tip_distortion: a piece of metal beside the workspace, or a field that bends smoothly through it --- */

#define WORKSPACE_M 0.05

static void tip_distortion_draw(struct blind_effect *effect, struct blind_random *random,
                                const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 5e-4, 5e-3);
    effect->variant = (int)blind_below(random, 2);
    blind_direction(random, 1.0, effect->form);
    effect->form[3] = blind_uniform(random, 0.0, 2.0 * M_PI);
}

/* Bias in units of its greatest: a dipole's field about a place 90 mm aside, falling with the cube of the distance. */
static void dipole(const struct blind_effect *effect, const double at[3], double bias[3]) {
    const double away = 0.09, place[3] = {away * cos(effect->form[3]), away * sin(effect->form[3]), 0.045};
    double arm[3], square = 0.0, along = 0.0;
    for (int d = 0; d < 3; d++) {
        arm[d] = at[d] - place[d];
        square += arm[d] * arm[d];
        along += arm[d] * effect->form[d];
    }
    const double size = pow(0.05 * 0.05 / square, 1.5);
    for (int d = 0; d < 3; d++) {
        bias[d] = 0.5 * size * (3.0 * along * arm[d] / square - effect->form[d]);
    }
}

static void quadratic(const struct blind_effect *effect, const double at[3], double bias[3]) {
    const double x = at[0] / WORKSPACE_M, y = at[1] / WORKSPACE_M, z = (at[2] - 0.065) / WORKSPACE_M;
    const double along = x * cos(effect->form[3]) + y * sin(effect->form[3]);
    for (int d = 0; d < 3; d++) {
        bias[d] = effect->form[d] * (along * along + 0.5 * z * z + 0.3 * along * z);
    }
}

static void tip_distortion_pose(struct blind_effect *effect, const struct blind_plant *plant, double step_s,
                                struct blind_pose *pose) {
    double bias[3] = {0.0, 0.0, 0.0}, rotation[3], turn[4];
    (void)step_s;
    (effect->variant == 0 ? dipole : quadratic)(effect, pose->position_m, bias);
    for (int d = 0; d < 3; d++) {
        const double moved = gate_of(effect, plant) * effect->parameter[0] * bias[d];
        rotation[d] = 4.0 * gate_of(effect, plant) * effect->parameter[0] * bias[(d + 1) % 3]; /* 4 rad for a metre */
        pose->position_m[d] += moved;
    }
    blind_quaternion_of_rotation(rotation, turn);
    blind_quaternion_product(turn, pose->quaternion, pose->quaternion);
}

/* --- tip_latency --- */

static void tip_latency_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 0.005, 0.1);
}

static int64_t tip_latency_us(const struct blind_effect *effect) {
    return llround(1e6 * effect->parameter[0]);
}

/* --- tip_freeze: runs of repeated samples; the parameter is their share --- */

static void tip_freeze_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_uniform(random, 0.05, 0.5);
    effect->form[0] = blind_log_uniform(random, 1.5, 12.0); /* mean length of a run */
}

static bool tip_freeze_repeats(struct blind_effect *effect, const struct blind_plant *plant) {
    const double leave = 1.0 / effect->form[0], share = effect->parameter[0];
    const double enter = leave * share / (1.0 - share);
    const bool frozen = effect->memory[0] > 0.5;
    effect->memory[0] = blind_chance(&effect->random, frozen ? 1.0 - leave : fmin(enter, 1.0)) ? 1.0 : 0.0;
    return effect->memory[0] > 0.5 && gate_of(effect, plant) > 0.5;
}

static const struct blind_effect_kind kinds[] = {
    {.name = "tip_offset",
     .stage = "tip sensor",
     .parameter = {"x", "y", "z"},
     .draw = tip_offset_draw,
     .pose = tip_offset_pose},
    {.name = "tip_misalignment",
     .stage = "tip sensor",
     .parameter = {"x", "y", "z"},
     .draw = tip_misalignment_draw,
     .pose = tip_misalignment_pose},
    {.name = "tip_lever_arm",
     .stage = "tip sensor",
     .parameter = {"x", "y", "z"},
     .draw = tip_lever_arm_draw,
     .pose = tip_lever_arm_pose},
    {.name = "tip_distortion",
     .stage = "tip sensor",
     .parameter = {"amplitude"},
     .draw = tip_distortion_draw,
     .pose = tip_distortion_pose},
    {.name = "tip_latency",
     .stage = "tip sensor",
     .parameter = {"delay"},
     .draw = tip_latency_draw,
     .latency_us = tip_latency_us},
    {.name = "tip_freeze",
     .stage = "tip sensor",
     .parameter = {"fraction"},
     .draw = tip_freeze_draw,
     .repeats = tip_freeze_repeats},
};

const struct blind_kinds blind_tip_kinds = {kinds, sizeof kinds / sizeof kinds[0]};
