/* The module's own weight bends it: the rubber along the arc, without its chambers, and the distal cap. */
#include <math.h>

#include "sim/effect.h"

enum { ANGLE, AZIMUTH, WEIGHT_SCALE };

/* Of cured Ecoflex and Dragon Skin, by their data sheets; weight_scale makes up for others. */
#define DENSITY_KGPM3 1070.0
#define GRAVITY_MPS2 9.80665

static void bend(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    const struct bend_table_module *module = &signals->table->module;
    const double pull_npm3 = parameter[WEIGHT_SCALE] * DENSITY_KGPM3 * GRAVITY_MPS2;
    const double rest_pa[3] = {0.0, 0.0, 0.0}, cap_m = (double)module->cap_distal_m;
    const double face_m2 = M_PI / 4.0 * (double)module->outer_diameter_m * (double)module->outer_diameter_m;
    struct table_point rest;
    double rubber_m2 = face_m2;
    table_point_at(&rest, signals->table, rest_pa);
    for (size_t c = 0; c < 3; c++) {
        rubber_m2 -=
            table_point_value(&rest, (enum bend_table_channel)((size_t)BEND_TABLE_VOLUME_1 + c), NULL);
    }
    const double straight_m = body_distal_straight_m(module, signals->shape);
    struct body_weight weight = {.spread_n = pull_npm3 * rubber_m2 * (double)module->chamber_length_m,
                                 .end_n = pull_npm3 * face_m2 * cap_m,
                                 .end_beyond_m = straight_m + 0.5 * cap_m};
    body_down(parameter[ANGLE], parameter[AZIMUTH], weight.down);
    body_bend_under(signals->table, signals->stiffness_scale, &weight, signals->shape);
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
                  [WEIGHT_SCALE] = {"weight_scale", "1", 0.0, 3.0, 1.0, 0.0}},
    .shape = bend};

EFFECT_REGISTER(gravity);
