/* A mass at the centre of the tip face: a sensor, its cable, a tool. */
#include <math.h>

#include "sim/effect.h"

enum { MASS, ANGLE, AZIMUTH };

#define GRAVITY_MPS2 9.80665

static void weigh(const double *parameter, const struct effect_signals *signals, struct body_weight *weight) {
    const struct bend_table_module *module = &signals->table->module;
    *weight = (struct body_weight){
        .end_n = parameter[MASS] * GRAVITY_MPS2,
        .end_beyond_m = body_distal_straight_m(module, signals->shape) + (double)module->cap_distal_m};
    body_down(parameter[ANGLE], parameter[AZIMUTH], weight->down);
}

static void bend(double *state, const double *parameter, struct effect_signals *signals) {
    struct body_weight weight;
    (void)state;
    weigh(parameter, signals, &weight);
    body_bend_under(signals->table, signals->stiffness_scale, &weight, signals->shape);
}

static void sag(double *state, const double *parameter, struct effect_signals *signals) {
    struct body_weight weight;
    (void)state;
    weigh(parameter, signals, &weight);
    body_sag_further(signals->table, signals->stiffness_scale, &weight, signals->shape, signals->pose);
}

static const struct effect_kind tip_payload = {
    .name = "tip_payload",
    .what = "a mass at the tip face bends the module",
    .signature = "hanging: bend is too small, the more so the larger it is, at any rate and in every "
                 "direction; level: a bend towards down at rest. Much like gravity, and hanging like an "
                 "error of stiffness",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 3,
    .parameter = {[MASS] = {"mass", "kg", 0.0, 0.1, 0.01, 0.0},
                  [ANGLE] = {"angle", "rad", 0.0, M_PI, 0.0, NAN},
                  [AZIMUTH] = {"azimuth", "rad", -M_PI, M_PI, 0.0, NAN}},
    .doubt = {[MASS] = 0.05}, /* where it hangs at the tip */
    .shape = bend,
    .pose = sag};

EFFECT_REGISTER(tip_payload);
