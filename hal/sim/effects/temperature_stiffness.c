/* The rubber's stiffness changes with temperature: by so much a kelvin where the temperature is known, else
 * at a rate, from nothing at the start. Stiffness scales the pressures of every shape alike. */
#include <math.h>

#include "sim/effect.h"

enum { PER_KELVIN, DRIFT };
enum { STARTED, START_S };

#define REFERENCE_K 293.15
#define LEAST_STIFFNESS 0.05 /* of the nominal one, however far it drifts */

static void stiffen(double *state, const double *parameter, struct effect_signals *signals) {
    if (state[STARTED] == 0.0) {
        state[STARTED] = 1.0;
        state[START_S] = signals->time_s;
    }
    const double relative = isnan(signals->temperature_k)
                                ? parameter[DRIFT] * (signals->time_s - state[START_S])
                                : parameter[PER_KELVIN] * (signals->temperature_k - REFERENCE_K);
    for (size_t c = 0; c < 3; c++) {
        signals->load_pa[c] /= fmax(1.0 + relative, LEAST_STIFFNESS);
    }
}

static const struct effect_kind temperature_stiffness = {
    .name = "temperature_stiffness",
    .what = "the module's stiffness changes with its temperature, or where that is not known, in time",
    .signature = "bend is too small or too large as by a wrong stiffness, by an amount that follows the "
                 "temperature or drifts over the recording; the same pressure bends differently early and "
                 "late. In a short recording it is an error of stiffness",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_GLOBAL,
    .remembers = true,
    .parameter_count = 2,
    .parameter = {[PER_KELVIN] = {"per_kelvin", "1/K", -0.03, 0.03, 0.004, 0.0},
                  [DRIFT] = {"drift", "1/s", -0.01, 0.01, 5e-4, 0.0}},
    .doubt = {[DRIFT] = 0.25}, /* what nobody measures seldom warms up in a straight line */
    .load = stiffen};

EFFECT_REGISTER(temperature_stiffness);
