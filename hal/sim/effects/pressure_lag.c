/* A pressure sensor, its port or its filter answers late: first order. */
#include <math.h>

#include "sim/effect.h"

enum { TIME_CONSTANT };
enum { STARTED, SHOWN, BEFORE = SHOWN + 3 };

/* Exact for a pressure that is straight over the step, as a gas's nearly is; linear in a short time constant.
 */
static void read(double *state, const double *parameter, struct effect_signals *signals) {
    const double lag_steps = parameter[TIME_CONSTANT] / signals->step_s;
    const double kept = lag_steps > 0.0 ? exp(-1.0 / lag_steps) : 0.0;
    for (size_t c = 0; c < 3; c++) {
        double *shown = &state[SHOWN + c], *before = &state[BEFORE + c], now = signals->reading_pa[c];
        if (state[STARTED] == 0.0) {
            *shown = *before = now;
        }
        const double of_now = 1.0 - lag_steps * (1.0 - kept);
        *shown = kept * *shown + of_now * now + (1.0 - kept - of_now) * *before;
        *before = now;
        signals->reading_pa[c] = *shown;
    }
    state[STARTED] = 1.0;
}

static const struct effect_kind pressure_lag = {
    .name = "pressure_lag",
    .what = "a pressure sensor follows with one time constant",
    .signature = "readings are too low while pressure rises and too high while it falls, in proportion to "
                 "the rate, and the ripple of the PWM is smoothed; the tip, simulated from the duties, is "
                 "right. Unlike line_volume it leaves the module alone",
    .stage = EFFECT_STAGE_PRESSURE_SENSOR,
    .scope = EFFECT_EVERY_CHAMBER,
    .delays = true,
    .parameter_count = 1,
    .parameter = {[TIME_CONSTANT] = {"time_constant", "s", 0.0, 0.3, 0.03, 0.0}},
    .reading = read};

EFFECT_REGISTER(pressure_lag);
