/* The module's own weight bends it: the rubber along the arc, without its chambers, and the distal cap. */
#include <math.h>

#include "sim/effect.h"

enum { ANGLE, AZIMUTH, WEIGHT_SCALE };

/* Of cured Ecoflex and Dragon Skin, by their data sheets; weight_scale makes up for others, and for what body.h estimates of the
 * stiffness. */
#define DENSITY_KGPM3 1070.0
#define GRAVITY_MPS2 9.80665

static void weigh(const double *parameter, const struct effect_signals *signals, struct body_weight *weight) {
    const struct bend_table_module *module = &signals->table->module;
    const double pull_npm3 = parameter[WEIGHT_SCALE] * DENSITY_KGPM3 * GRAVITY_MPS2;
    const double rest_pa[3] = {0.0, 0.0, 0.0}, cap_m = (double)module->cap_distal_m;
    const double face_m2 = M_PI / 4.0 * (double)module->outer_diameter_m * (double)module->outer_diameter_m;
    struct table_point rest;
    double chamber_m2[3], gradient[3][3];
    table_point_at(&rest, signals->table, rest_pa);
    table_point_values(&rest, BEND_TABLE_VOLUME_1, chamber_m2, gradient);
    const double rubber_m2 = face_m2 - chamber_m2[0] - chamber_m2[1] - chamber_m2[2];
    *weight = (struct body_weight){.spread_n = pull_npm3 * rubber_m2 * (double)module->chamber_length_m,
                                   .end_n = pull_npm3 * face_m2 * cap_m,
                                   .end_beyond_m = body_distal_straight_m(module, signals->shape) + 0.5 * cap_m};
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

static const struct effect_kind gravity = {
    .name = "gravity",
    .what = "the module's own weight bends it",
    .signature = "bend towards one side at rest (none if it hangs or stands), and in other poses by the "
                 "lever of the weight: hanging it bends less, standing more. Pressures, rates and history "
                 "do not matter. Much like tip_payload",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 3,
    .parameter = {[ANGLE] = {"angle", "rad", 0.0, M_PI, M_PI / 2.0, NAN},
                  [AZIMUTH] = {"azimuth", "rad", -M_PI, M_PI, 0.0, NAN},
                  [WEIGHT_SCALE] = {"weight_scale", "1", 0.0, 6.0, 1.0, 0.0}},
    .doubt = {[WEIGHT_SCALE] = 0.1}, /* how the weight is spread, and how the module yields to it off its arc */
    .shape = bend,
    .pose = sag};

EFFECT_REGISTER(gravity);
