/* One chamber is not the others' copy: its wall is thinner or thicker, so that it acts like another pressure,
 * and it sits, and bends the module, at another azimuth. */
#include <math.h>

#include "sim/effect.h"

enum { GAIN, AZIMUTH };

static void load(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->load_pa[c] *= parameter[GAIN];
    }
}

/* What the chamber adds to the bend with the others as they are, turned. */
static void turn(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    if (signals->chamber == 0 || parameter[AZIMUTH] == 0.0) {
        return;
    }
    double without_pa[3] = {signals->load_pa[0], signals->load_pa[1], signals->load_pa[2]};
    struct body_shape all, without;
    without_pa[signals->chamber - 1] = 0.0;
    effect_shape_at(signals, signals->load_pa, &all);
    effect_shape_at(signals, without_pa, &without);
    const double x = all.bend_x_rad - without.bend_x_rad, y = all.bend_y_rad - without.bend_y_rad;
    const double c = cos(parameter[AZIMUTH]), s = sin(parameter[AZIMUTH]);
    signals->shape->bend_x_rad += (c - 1.0) * x - s * y;
    signals->shape->bend_y_rad += s * x + (c - 1.0) * y;
}

static const struct effect_kind chamber_asymmetry = {
    .name = "chamber_asymmetry",
    .what = "one chamber bends the module more or less than the others, or in a direction that is off",
    .signature = "too much or too little bend, or one that is off sideways, whenever that chamber is under "
                 "pressure, at any rate; pressures are right. A gain is also what a wrong pressure_gain of "
                 "that chamber looks like without the duties",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_ONE_CHAMBER,
    .parameter_count = 2,
    .parameter =
        {[GAIN] = {"gain", "1", 0.7, 1.3, 1.07, 1.0}, [AZIMUTH] = {"azimuth", "rad", -0.3, 0.3, 0.05, 0.0}},
    .load = load,
    .shape = turn};

EFFECT_REGISTER(chamber_asymmetry);
