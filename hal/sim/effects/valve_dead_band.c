/* Short pulses do not get a valve open: below a least duty nothing flows. A sticking or spring-laden valve
 * also takes a part of every longer pulse (Taghizadeh, Ghaffari and Najafi 2009 model such a valve under
 * PWM). */
#include <math.h>

#include "sim/effect.h"

enum { LEAST_DUTY, LOSS };

#define CORNER 0.01 /* width over which a valve comes to life: no two pulses are alike */

/* 0 to 1 over the corner round `least`; a band narrower than that has a narrower corner. */
static double share_that_opens(double duty, double least) {
    const double half = fmin(0.5 * CORNER, least);
    if (duty >= least + half) {
        return 1.0;
    }
    const double at = fmax((duty - least + half) / (2.0 * half), 0.0);
    return at * at * (3.0 - 2.0 * at);
}

static void command(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    const double lost = parameter[LOSS] * parameter[LEAST_DUTY];
    for (size_t c = 0; c < 3; c++) {
        const double rest = fmax((signals->duty[c] - lost) / (1.0 - lost), 0.0);
        signals->duty[c] = rest * share_that_opens(signals->duty[c], parameter[LEAST_DUTY]);
    }
}

static const struct effect_kind valve_dead_band = {
    .name = "valve_dead_band",
    .what = "duties below a least one do nothing; of larger ones a part may be lost as well",
    .signature = "no pressure where a little was expected, at small duties only (with a loss: too little "
                 "everywhere, less so at large duties); without small duties in the recording it cannot be "
                 "seen",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_EVERY_CHAMBER,
    .by_threshold = true,
    .parameter_count = 2,
    .parameter =
        {[LEAST_DUTY] = {"least_duty", "1", 0.0, 0.5, 0.25, 0.0}, [LOSS] = {"loss", "1", 0.0, 1.0, 0.0, NAN}},
    .command = command};

EFFECT_REGISTER(valve_dead_band);
