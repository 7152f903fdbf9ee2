/* Effects on the body. */
#include <math.h>

#include "blind_effect.h"

#define DEGREE (M_PI / 180.0)

static double gate_of(const struct blind_effect *effect, const struct blind_plant *plant) {
    return blind_effect_gate(effect, blind_time_s(plant));
}

/* --- creep: stretched exponential (Kohlrausch 1854) or a power-law tail, by convolution with the whole past.
 * Either has done 1 - 1/e of its amplitude after the time constant. --- */

static void creep_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 0.03, 0.15);
    effect->parameter[1] = blind_log_uniform(random, 0.3, 8.0);
    effect->variant = (int)blind_below(random, 2);
    effect->form[0] = effect->variant == 0 ? blind_uniform(random, 0.55, 0.9) : blind_uniform(random, 1.2, 2.5);
}

static double crept(const struct blind_effect *effect, double since_s) {
    const double share = since_s / effect->parameter[1], power = effect->form[0];
    if (effect->variant == 0) {
        return 1.0 - exp(-pow(share, power));
    }
    return 1.0 - pow(1.0 + share * (exp(1.0 / power) - 1.0), -power);
}

/* History: kernel and the three elastic parts of each sample, in fours. */
static void creep_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s, struct blind_shape *shape) {
    const size_t samples = effect->history_count / 4;
    const double gate = gate_of(effect, plant);
    const double now[3] = {shape->bend_rad[0], shape->bend_rad[1], shape->stretch - 1.0};
    double sum[3] = {0.0, 0.0, 0.0};
    bool kept = blind_effect_remember(effect, crept(effect, ((double)samples + 0.5) * step_s));
    for (int k = 0; k < 3; k++) {
        kept = kept && blind_effect_remember(effect, now[k]);
    }
    plant->failed = plant->failed || !kept;
    for (size_t i = 0; i < samples && kept; i++) { /* increments between samples act from half-way on */
        const double weight = effect->history[4 * (samples - 1 - i)];
        const double *from = &effect->history[4 * i + 1], *to = &effect->history[4 * (i + 1) + 1];
        for (int k = 0; k < 3; k++) {
            sum[k] += weight * (to[k] - from[k]);
        }
    }
    shape->bend_rad[0] += gate * effect->parameter[0] * sum[0];
    shape->bend_rad[1] += gate * effect->parameter[0] * sum[1];
    shape->stretch += gate * effect->parameter[0] * sum[2];
}

/* --- mullins: each chamber's wall softens with a power of the greatest pressure that it has borne --- */

static void mullins_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    effect->parameter[0] = blind_log_uniform(random, 0.05, 0.3);
    effect->form[0] = blind_uniform(random, 0.8, 2.5);
    effect->form[1] = scene->pressure_most_pa;
}

static void mullins_load(struct blind_effect *effect, const struct blind_plant *plant, double load_pa[3]) {
    for (size_t c = 0; c < 3; c++) {
        effect->memory[c] = fmax(effect->memory[c], load_pa[c]);
        const double share = fmin(effect->memory[c] / effect->form[1], 1.2);
        const double softer = effect->parameter[0] * pow(fmax(share, 0.0), effect->form[0]) * gate_of(effect, plant);
        load_pa[c] /= blind_effect_on(effect, c) ? 1.0 - fmin(softer, 0.5) : 1.0;
    }
}

/* --- hysteresis: a restoring part of the Bouc-Wen kind on the bend vector (Park, Wen and Ang 1986). The parameter is the
 * opening of a full loop over the bend of one chamber at its greatest pressure. --- */

#define FULL_BEND (90.0 * DEGREE)
#define SUBSTEP_RAD (0.2 * DEGREE)

static void hysteresis_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 0.01, 0.15);
    effect->form[0] = FULL_BEND * blind_uniform(random, 0.06, 0.25); /* bend over which it builds up */
    effect->form[1] = blind_uniform(random, 0.5, 0.85);              /* beta; gamma is the rest to one */
}

static void hysteresis_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                             struct blind_shape *shape) {
    double *z = &effect->memory[0], *last = &effect->memory[2];
    const double move[2] = {shape->bend_rad[0] - last[0], shape->bend_rad[1] - last[1]};
    const int steps = 1 + (int)(hypot(move[0], move[1]) / SUBSTEP_RAD);
    (void)step_s;
    for (int i = 0; i < steps; i++) {
        const double by[2] = {move[0] / steps / effect->form[0], move[1] / steps / effect->form[0]};
        const double power = by[0] * z[0] + by[1] * z[1];
        const double back = effect->form[1] * fabs(power) + (1.0 - effect->form[1]) * power;
        z[0] += by[0] - z[0] * back;
        z[1] += by[1] - z[1] * back;
    }
    for (int k = 0; k < 2; k++) {
        last[k] += move[k];
        shape->bend_rad[k] -= 0.5 * effect->parameter[0] * FULL_BEND * z[k] * gate_of(effect, plant);
    }
}

/* --- temperature_stiffness: with the temperature that is logged, or a warming-up over the run that nothing logs --- */

#define RUN_S 30.0

static void temperature_stiffness_draw(struct blind_effect *effect, struct blind_random *random,
                                       const struct blind_scene *scene) {
    effect->variant = scene->temperature_logged ? 0 : 1;
    effect->parameter[0] =
        effect->variant == 0 ? blind_signed(random, 0.003, 0.02) : blind_signed(random, 0.01, 0.1) / RUN_S;
    effect->form[0] = blind_uniform(random, 0.7, 1.4); /* power of time */
}

static void temperature_stiffness_load(struct blind_effect *effect, const struct blind_plant *plant, double load_pa[3]) {
    const double warmer_k = plant->temperature_k - 293.15;
    const double late = RUN_S * pow(blind_time_s(plant) / RUN_S, effect->form[0]);
    const double change = effect->parameter[0] * (effect->variant == 0 ? warmer_k : late) * gate_of(effect, plant);
    for (size_t c = 0; c < 3; c++) {
        load_pa[c] /= exp(change);
    }
}

/* --- chamber_asymmetry: one chamber acts as if under another pressure, and its share of the bend points elsewhere --- */

static void chamber_asymmetry_draw(struct blind_effect *effect, struct blind_random *random,
                                   const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = 1.0 + blind_signed(random, 0.03, 0.15);
    effect->parameter[1] = blind_signed(random, 1.0 * DEGREE, 10.0 * DEGREE);
}

static void chamber_asymmetry_load(struct blind_effect *effect, const struct blind_plant *plant, double load_pa[3]) {
    load_pa[effect->chamber - 1] *= 1.0 + (effect->parameter[0] - 1.0) * gate_of(effect, plant);
}

static void chamber_asymmetry_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                                    struct blind_shape *shape) {
    const double angle = effect->parameter[1] * gate_of(effect, plant);
    double others_pa[3] = {plant->load_pa[0], plant->load_pa[1], plant->load_pa[2]}, rest[2], all[2], stretch;
    (void)step_s;
    others_pa[effect->chamber - 1] = 0.0;
    if (!blind_field_bend(plant->field, others_pa, rest, &stretch) ||
        !blind_field_bend(plant->field, plant->load_pa, all, &stretch)) {
        plant->failed = true;
        return;
    }
    const double own[2] = {all[0] - rest[0], all[1] - rest[1]};
    shape->bend_rad[0] += own[0] * (cos(angle) - 1.0) - own[1] * sin(angle);
    shape->bend_rad[1] += own[0] * sin(angle) + own[1] * (cos(angle) - 1.0);
}

/* --- gravity and tip_payload: weights along the bent arc (blind_body.c). The angle is that between the module's axis at its
 * base and down: 0 hangs, a right angle is level. --- */

static void gravity_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_uniform(random, 0.0, M_PI);
    effect->parameter[1] = blind_uniform(random, 0.6, 1.4);
    effect->form[0] = blind_uniform(random, -M_PI, M_PI); /* towards which side down leans */
}

static void hang(struct blind_shape *shape, double mount_rad, double toward_rad) {
    shape->down[0] = sin(mount_rad) * cos(toward_rad);
    shape->down[1] = sin(mount_rad) * sin(toward_rad);
    shape->down[2] = cos(mount_rad);
}

static void gravity_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                          struct blind_shape *shape) {
    (void)step_s;
    hang(shape, effect->parameter[0], effect->form[0]);
    shape->weight_scale = effect->parameter[1] * gate_of(effect, plant);
}

static void tip_payload_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 1e-3, 30e-3);
    effect->variant = (int)blind_below(random, 2);
    effect->form[0] = effect->variant == 0 ? 0.0 : blind_uniform(random, 0.0, M_PI / 2.0);
    effect->form[1] = blind_uniform(random, -M_PI, M_PI);
}

/* Where gravity acts on the module as well, both share its down. */
static void tip_payload_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                              struct blind_shape *shape) {
    (void)step_s;
    if (!(shape->weight_scale > 0.0)) {
        hang(shape, effect->form[0], effect->form[1]);
    }
    shape->tip_mass_kg = effect->parameter[0] * gate_of(effect, plant);
}

/* --- end_restraint: curvature dies away towards the caps, or is greater there --- */

static void end_restraint_draw(struct blind_effect *effect, struct blind_random *random,
                               const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_chance(random, 0.7) ? blind_uniform(random, 0.85, 0.98) : blind_uniform(random, 1.01, 1.05);
}

static void end_restraint_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                                struct blind_shape *shape) {
    (void)step_s;
    shape->active_share += (effect->parameter[0] - 1.0) * gate_of(effect, plant);
}

/* --- contact: a wall square to a direction, reached at a bend, that yields like two rounded bodies (Hertz 1882). The
 * stiffness is the wall's over the body's at ten degrees of indentation. --- */

static void contact_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    const double chamber = (double)blind_below(random, 6);
    effect->parameter[0] = remainder(chamber * M_PI / 3.0 + blind_uniform(random, -0.4, 0.4), 2.0 * M_PI);
    effect->parameter[1] = blind_uniform(random, 15.0, 45.0) * DEGREE;
    effect->parameter[2] = blind_log_uniform(random, 0.5, 6.0);
}

/* Indentation d under a free excess: d + k d^1.5 / sqrt(10 degrees) = excess, by Newton. */
static double indentation(double excess_rad, double stiffness) {
    const double factor = stiffness / sqrt(10.0 * DEGREE);
    double d = excess_rad / (1.0 + stiffness);
    for (int i = 0; i < 20; i++) {
        d -= (d + factor * pow(d, 1.5) - excess_rad) / (1.0 + 1.5 * factor * sqrt(d));
        d = fmax(d, 0.0);
    }
    return d;
}

static void contact_shape(struct blind_effect *effect, struct blind_plant *plant, double step_s,
                          struct blind_shape *shape) {
    const double toward[2] = {cos(effect->parameter[0]), sin(effect->parameter[0])};
    const double excess_rad =
        shape->bend_rad[0] * toward[0] + shape->bend_rad[1] * toward[1] - effect->parameter[1];
    (void)step_s;
    if (excess_rad > 0.0) {
        const double back = gate_of(effect, plant) * (excess_rad - indentation(excess_rad, effect->parameter[2]));
        shape->bend_rad[0] -= back * toward[0];
        shape->bend_rad[1] -= back * toward[1];
    }
}

static const struct blind_effect_kind kinds[] = {
    {.name = "creep",
     .stage = "body",
     .parameter = {"amplitude", "time_constant"},
     .neutral = {0.0, NAN},
     .draw = creep_draw,
     .shape = creep_shape},
    {.name = "mullins",
     .stage = "body",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"softening"},
     .draw = mullins_draw,
     .load = mullins_load},
    {.name = "hysteresis",
     .stage = "body",
     .parameter = {"width"},
     .draw = hysteresis_draw,
     .shape = hysteresis_shape},
    {.name = "temperature_stiffness",
     .stage = "body",
     .parameter = {"drift"},
     .draw = temperature_stiffness_draw,
     .load = temperature_stiffness_load},
    {.name = "chamber_asymmetry",
     .stage = "body",
     .reach = BLIND_ONE_CHAMBER,
     .parameter = {"gain", "azimuth"},
     .neutral = {1.0, 0.0},
     .draw = chamber_asymmetry_draw,
     .load = chamber_asymmetry_load,
     .shape = chamber_asymmetry_shape},
    {.name = "gravity",
     .stage = "body",
     .parameter = {"angle", "weight_scale"},
     .neutral = {NAN, 0.0},
     .draw = gravity_draw,
     .shape = gravity_shape},
    {.name = "tip_payload",
     .stage = "body",
     .parameter = {"mass"},
     .draw = tip_payload_draw,
     .shape = tip_payload_shape},
    {.name = "end_restraint",
     .stage = "body",
     .parameter = {"fraction"},
     .neutral = {1.0},
     .draw = end_restraint_draw,
     .shape = end_restraint_shape},
    {.name = "contact",
     .stage = "body",
     .parameter = {"direction", "bend", "stiffness"},
     .neutral = {NAN, NAN, 0.0},
     .draw = contact_draw,
     .shape = contact_shape},
};

const struct blind_kinds blind_body_kinds = {kinds, sizeof kinds / sizeof kinds[0]};
