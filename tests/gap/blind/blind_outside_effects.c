/* Effects outside the catalogue: whatever the diagnosis calls these, the right answer is that it knows none of them. */
#include <math.h>
#include <string.h>

#include "blind_effect.h"

#define DEGREE (M_PI / 180.0)
#define NO_SCENE (void)scene

static double gate_of(const struct blind_effect *effect, const struct blind_plant *plant) {
    return blind_effect_gate(effect, blind_time_s(plant));
}

/* --- gas_temperature: filling heats the gas, venting cools it; the wall takes its time --- */

static void gas_temperature_draw(struct blind_effect *effect, struct blind_random *random,
                                 const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_log_uniform(random, 0.01, 0.06);
}

static void gas_temperature_ports(struct blind_effect *effect, const struct blind_plant *plant,
                                  struct blind_ports *ports) {
    ports->heat_transfer_wpk = gate_of(effect, plant) > 0.0 ? effect->parameter[0] : 0.0;
}

/* --- pressed_valve: the spool is slower to open and to close, the higher the pressure that holds it --- */

static void pressed_valve_draw(struct blind_effect *effect, struct blind_random *random,
                               const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_uniform(random, 0.4e-3, 2.5e-3); /* s at 10 kPa */
    effect->form[0] = blind_uniform(random, -0.8, 0.2);         /* of the closing, over that of the opening */
}

static void pressed_valve_command(struct blind_effect *effect, const struct blind_plant *plant,
                                  struct blind_pulse pulse[3]) {
    for (size_t c = 0; c < 3; c++) {
        const double share = fmax(plant->state[c], 0.0) / 10000.0;
        const double late_us = 1e6 * effect->parameter[0] * pow(share, 1.5) * gate_of(effect, plant);
        pulse[c].open_delay_us += llround(late_us);
        pulse[c].close_delay_us = llround(fmax((double)pulse[c].close_delay_us + effect->form[0] * late_us, 0.0));
    }
}

/* --- stick_slip: the body hangs in its sheath until the strain is enough, then jumps most of the way --- */

static void stick_slip_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_uniform(random, 1.5, 6.0) * DEGREE;
    effect->form[0] = blind_uniform(random, 0.1, 0.5); /* of the strain that is left after a jump */
}

static void stick_slip_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                             struct blind_shape *shape) {
    double *held = &effect->memory[0], *limit = &effect->memory[2];
    const double strain[2] = {shape->bend_rad[0] - held[0], shape->bend_rad[1] - held[1]};
    (void)step_s;
    if (!(*limit > 0.0)) {
        *limit = effect->parameter[0];
    }
    if (hypot(strain[0], strain[1]) > *limit) {
        held[0] += (1.0 - effect->form[0]) * strain[0];
        held[1] += (1.0 - effect->form[0]) * strain[1];
        *limit = effect->parameter[0] * blind_uniform(&effect->random, 0.6, 1.4);
    }
    for (int k = 0; k < 2; k++) {
        shape->bend_rad[k] += gate_of(effect, plant) * (held[k] - shape->bend_rad[k]);
    }
}

/* --- ring_down: the body swings about its equilibrium --- */

#define SUBSTEPS 20

static void ring_down_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_uniform(random, 3.0, 4.0);  /* Hz */
    effect->parameter[1] = blind_uniform(random, 0.04, 0.2); /* damping ratio */
}

static void ring_down_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                            struct blind_shape *shape) {
    const double omega = 2.0 * M_PI * effect->parameter[0], step = step_s / SUBSTEPS;
    for (int k = 0; k < 2; k++) {
        double *at = &effect->memory[3 * k], *rate = &effect->memory[3 * k + 1], *before = &effect->memory[3 * k + 2];
        for (int i = 0; i < SUBSTEPS; i++) { /* symplectic Euler, the input straight between samples */
            const double input = *before + (shape->bend_rad[k] - *before) * (i + 0.5) / SUBSTEPS;
            *rate += step * (omega * omega * (input - *at) - 2.0 * effect->parameter[1] * omega * *rate);
            *at += step * *rate;
        }
        *before = shape->bend_rad[k];
        shape->bend_rad[k] += gate_of(effect, plant) * (*at - shape->bend_rad[k]);
    }
}

/* --- dashpot: the bend gives way to a fast pressure only slowly, the more so the smaller the strain --- */

static void dashpot_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_log_uniform(random, 0.08, 0.4);
    effect->form[0] = blind_uniform(random, 0.5, 1.0);
}

static void dashpot_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                          struct blind_shape *shape) {
    double *at = effect->memory;
    for (int i = 0; i < SUBSTEPS; i++) {
        const double strain[2] = {shape->bend_rad[0] - at[0], shape->bend_rad[1] - at[1]};
        const double ease = pow(hypot(strain[0], strain[1]) / (10.0 * DEGREE), effect->form[0]);
        const double share = fmin(step_s / SUBSTEPS / effect->parameter[0] * ease, 1.0);
        at[0] += share * strain[0];
        at[1] += share * strain[1];
    }
    for (int k = 0; k < 2; k++) {
        shape->bend_rad[k] += gate_of(effect, plant) * (at[k] - shape->bend_rad[k]);
    }
}

/* --- tip_wander: the tracker's reference walks at random --- */

static void tip_wander_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_log_uniform(random, 1e-4, 6e-4); /* m for the root of a second */
}

static void tip_wander_pose(struct blind_effect *effect, const struct blind_plant *plant, double step_s,
                            struct blind_pose *pose) {
    double turn[4];
    for (int d = 0; d < 6; d++) {
        const double size = effect->parameter[0] * (d < 3 ? 1.0 : 3.0); /* 3 rad for a metre */
        effect->memory[d] += size * sqrt(step_s) * blind_normal(&effect->random);
    }
    double rotation[3];
    for (int d = 0; d < 3; d++) {
        pose->position_m[d] += gate_of(effect, plant) * effect->memory[d];
        rotation[d] = gate_of(effect, plant) * effect->memory[3 + d];
    }
    blind_quaternion_of_rotation(rotation, turn);
    blind_quaternion_product(turn, pose->quaternion, pose->quaternion);
}

/* --- compressor: the supply falls while the compressor rests and is filled up again --- */

static void compressor_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_uniform(random, 0.05, 0.18);    /* of the supply, from crest to trough */
    effect->parameter[1] = blind_log_uniform(random, 2.0, 10.0); /* period, s */
    effect->form[0] = blind_uniform(random, 0.1, 0.4);           /* of the period in which it fills */
    effect->form[1] = blind_uniform(random, 0.0, 1.0);
}

static void compressor_ports(struct blind_effect *effect, const struct blind_plant *plant, struct blind_ports *ports) {
    const double phase = blind_time_s(plant) / effect->parameter[1] + effect->form[1], share = phase - floor(phase);
    const double rise = effect->form[0];
    const double level = share < rise ? share / rise : (1.0 - share) / (1.0 - rise);
    ports->supply_pa *= 1.0 + gate_of(effect, plant) * effect->parameter[0] * (level - 0.5);
}

/* --- valve_misses: now and then a coil is not energised at all --- */

static void valve_misses_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_log_uniform(random, 0.005, 0.06);
    effect->form[0] = blind_uniform(random, 1.0, 4.0); /* periods in a row */
}

static void valve_misses_command(struct blind_effect *effect, const struct blind_plant *plant,
                                 struct blind_pulse pulse[3]) {
    for (size_t c = 0; c < 3; c++) {
        const bool misses = effect->memory[c] > 0.5;
        const double enter = effect->parameter[0] / effect->form[0];
        effect->memory[c] = blind_chance(&effect->random, misses ? 1.0 - 1.0 / effect->form[0] : enter) ? 1.0 : 0.0;
        if (effect->memory[c] > 0.5 && gate_of(effect, plant) > 0.5) {
            pulse[c].duty = 0.0;
        }
    }
}

/* --- pressure_curve: the sensors' characteristic is bent, true at both ends of the working range --- */

static void pressure_curve_draw(struct blind_effect *effect, struct blind_random *random,
                                const struct blind_scene *scene) {
    effect->parameter[0] = blind_signed(random, 0.2, 0.45);
    effect->form[0] = scene->pressure_most_pa;
    effect->form[1] = blind_uniform(random, 0.7, 1.0); /* where it is true again, of the range */
}

static void pressure_curve_reading(struct blind_effect *effect, const struct blind_plant *plant, double reading_pa[3]) {
    for (size_t c = 0; c < 3; c++) {
        const double share = reading_pa[c] / (effect->form[0] * effect->form[1]);
        reading_pa[c] *= 1.0 + gate_of(effect, plant) * effect->parameter[0] * (share > 0.0 ? 1.0 - share : 0.0);
    }
}

/* --- twist: pressure winds the body about its own axis --- */

static void twist_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    effect->parameter[0] = blind_signed(random, 3.0, 20.0) * DEGREE;
    effect->form[0] = scene->pressure_most_pa;
}

static void twist_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s, struct blind_shape *shape) {
    double square = 0.0;
    (void)step_s;
    for (size_t c = 0; c < 3; c++) {
        const double share = plant->load_pa[c] / effect->form[0];
        square += share * share;
    }
    shape->twist_rad += gate_of(effect, plant) * effect->parameter[0] * square;
}

/* --- snap: one chamber's wall jumps outwards at a pressure and back at a lower one (a relay of Preisach's) --- */

static void snap_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    effect->parameter[0] = blind_uniform(random, 4.0, 15.0) * DEGREE;
    effect->form[0] = scene->pressure_most_pa * blind_uniform(random, 0.45, 0.75);
    effect->form[1] = effect->form[0] * blind_uniform(random, 0.3, 0.8);
}

static void snap_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s, struct blind_shape *shape) {
    const double toward = M_PI + 2.0 * M_PI / 3.0 * (double)(effect->chamber - 1);
    const double pressure_pa = plant->load_pa[effect->chamber - 1];
    const double wanted = pressure_pa > effect->form[0] ? 1.0 : (pressure_pa < effect->form[1] ? 0.0 : effect->memory[0]);
    effect->memory[0] = wanted;
    effect->memory[1] += fmin(step_s / 0.04, 1.0) * (wanted - effect->memory[1]);
    shape->bend_rad[0] += gate_of(effect, plant) * effect->memory[1] * effect->parameter[0] * cos(toward);
    shape->bend_rad[1] += gate_of(effect, plant) * effect->memory[1] * effect->parameter[0] * sin(toward);
}

/* --- wall_threshold: a chamber's wall sticks to the core up to a pressure and is free only well above it --- */

static void wall_threshold_draw(struct blind_effect *effect, struct blind_random *random,
                                const struct blind_scene *scene) {
    effect->parameter[0] = scene->pressure_most_pa * blind_uniform(random, 0.4, 0.7);
    effect->form[0] = effect->parameter[0] * blind_uniform(random, 0.1, 0.25);
}

static void wall_threshold_load(struct blind_effect *effect, const struct blind_plant *plant, double load_pa[3]) {
    for (size_t c = 0; c < 3; c++) {
        const double free = 1.0 / (1.0 + exp(-(load_pa[c] - effect->parameter[0]) / effect->form[0]));
        load_pa[c] *= 1.0 - 0.35 * (1.0 - free) * gate_of(effect, plant);
    }
}

/* --- curl: the plane of bending turns the further the body is bent --- */

static void curl_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    NO_SCENE;
    effect->parameter[0] = blind_signed(random, 5.0, 25.0) * DEGREE; /* at 90 degrees of bend */
}

static void curl_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s, struct blind_shape *shape) {
    const double x = shape->bend_rad[0], y = shape->bend_rad[1], share = hypot(x, y) / (90.0 * DEGREE);
    const double angle = gate_of(effect, plant) * effect->parameter[0] * share * share;
    (void)step_s;
    shape->bend_rad[0] = x * cos(angle) - y * sin(angle);
    shape->bend_rad[1] = x * sin(angle) + y * cos(angle);
}

static const struct blind_effect_kind kinds[] = {
    {.name = "gas_temperature", .stage = "valve", .parameter = {"heat_transfer"}, .neutral = {NAN},
     .draw = gas_temperature_draw, .ports = gas_temperature_ports},
    {.name = "pressed_valve", .stage = "valve", .parameter = {"delay"},
     .draw = pressed_valve_draw, .command = pressed_valve_command},
    {.name = "stick_slip", .stage = "body", .parameter = {"limit"},
     .draw = stick_slip_draw, .shape = stick_slip_shape},
    {.name = "ring_down", .stage = "body", .parameter = {"frequency", "damping"}, .neutral = {NAN, NAN},
     .draw = ring_down_draw, .shape = ring_down_shape},
    {.name = "dashpot", .stage = "body", .parameter = {"time_constant"},
     .draw = dashpot_draw, .shape = dashpot_shape},
    {.name = "tip_wander", .stage = "tip sensor", .parameter = {"walk"},
     .draw = tip_wander_draw, .pose = tip_wander_pose},
    {.name = "compressor", .stage = "supply", .parameter = {"swing", "period"}, .neutral = {0.0, NAN},
     .draw = compressor_draw, .ports = compressor_ports},
    {.name = "valve_misses", .stage = "valve", .parameter = {"fraction"},
     .draw = valve_misses_draw, .command = valve_misses_command},
    {.name = "pressure_curve", .stage = "pressure sensor", .parameter = {"bow"},
     .draw = pressure_curve_draw, .reading = pressure_curve_reading},
    {.name = "twist", .stage = "body", .parameter = {"angle"},
     .draw = twist_draw, .shape = twist_shape},
    {.name = "snap", .stage = "body", .reach = BLIND_ONE_CHAMBER, .parameter = {"jump"},
     .draw = snap_draw, .shape = snap_shape},
    {.name = "wall_threshold", .stage = "body", .parameter = {"pressure"}, .neutral = {NAN},
     .draw = wall_threshold_draw, .load = wall_threshold_load},
    {.name = "curl", .stage = "body", .parameter = {"angle"},
     .draw = curl_draw, .shape = curl_shape},
};

const struct blind_kinds blind_outside_kinds = {kinds, sizeof kinds / sizeof kinds[0]};
