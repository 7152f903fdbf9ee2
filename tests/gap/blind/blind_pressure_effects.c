/* Effects on the pressure sensors. */
#include <math.h>

#include "blind_effect.h"

#define STEP_S (1e-6 * BLIND_STEP_US)

static double gate_of(const struct blind_effect *effect, const struct blind_plant *plant) {
    return blind_effect_gate(effect, blind_time_s(plant));
}

/* --- pressure_offset: mostly there from the start, the rest comes as the sensor warms up --- */

static void pressure_offset_draw(struct blind_effect *effect, struct blind_random *random,
                                 const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_signed(random, 300.0, 3000.0);
    effect->form[0] = blind_uniform(random, 0.0, 0.06);
    effect->form[1] = blind_uniform(random, 1.0, 5.0);
}

static void pressure_offset_reading(struct blind_effect *effect, const struct blind_plant *plant, double reading_pa[3]) {
    const double warm = 1.0 - effect->form[0] * exp(-blind_time_s(plant) / effect->form[1]);
    for (size_t c = 0; c < 3; c++) {
        reading_pa[c] += blind_effect_on(effect, c) ? effect->parameter[0] * warm * gate_of(effect, plant) : 0.0;
    }
}

/* --- pressure_gain --- */

static void pressure_gain_draw(struct blind_effect *effect, struct blind_random *random,
                               const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = 1.0 + blind_signed(random, 0.02, 0.1);
}

static void pressure_gain_reading(struct blind_effect *effect, const struct blind_plant *plant, double reading_pa[3]) {
    for (size_t c = 0; c < 3; c++) {
        reading_pa[c] *= blind_effect_on(effect, c) ? 1.0 + (effect->parameter[0] - 1.0) * gate_of(effect, plant) : 1.0;
    }
}

/* --- pressure_lag: one or two stages of a filter; the parameter is their whole delay --- */

static void pressure_lag_draw(struct blind_effect *effect, struct blind_random *random, const struct blind_scene *scene) {
    (void)scene;
    effect->parameter[0] = blind_log_uniform(random, 0.005, 0.1);
    effect->variant = 1 + (int)blind_below(random, 2);
}

static void pressure_lag_reading(struct blind_effect *effect, const struct blind_plant *plant, double reading_pa[3]) {
    const double stage_s = fmax(effect->parameter[0] / (double)effect->variant, 1e-4);
    for (size_t c = 0; c < 3; c++) {
        double passed = reading_pa[c];
        for (int stage = 0; stage < effect->variant; stage++) {
            double *held = &effect->memory[6 * stage + 2 * (int)c];
            /* exact for an input that runs straight between the steps */
            const double before = held[1], slope = (passed - before) / STEP_S;
            const double lagging = held[0] - (before - slope * stage_s);
            held[1] = passed;
            held[0] = passed - slope * stage_s + lagging * exp(-STEP_S / stage_s);
            passed = held[0];
        }
        if (blind_effect_on(effect, c)) {
            reading_pa[c] += gate_of(effect, plant) * (passed - reading_pa[c]);
        }
    }
}

static const struct blind_effect_kind kinds[] = {
    {.name = "pressure_offset",
     .stage = "pressure sensor",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"offset"},
     .draw = pressure_offset_draw,
     .reading = pressure_offset_reading},
    {.name = "pressure_gain",
     .stage = "pressure sensor",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"gain"},
     .neutral = {1.0},
     .draw = pressure_gain_draw,
     .reading = pressure_gain_reading},
    {.name = "pressure_lag",
     .stage = "pressure sensor",
     .reach = BLIND_ANY_CHAMBER,
     .parameter = {"time_constant"},
     .draw = pressure_lag_draw,
     .reading = pressure_lag_reading},
};

const struct blind_kinds blind_pressure_kinds = {kinds, sizeof kinds / sizeof kinds[0]};
