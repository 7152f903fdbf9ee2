/* A hole in one chamber or its tube lets air out to ambient: ISO 6358 flow, as the plant's valves. */
#include "sim/effect.h"

enum { CONDUCTANCE };

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    for (size_t c = 0; c < 3; c++) {
        signals->influence->leak_conductance[c] += parameter[CONDUCTANCE];
    }
}

static const struct effect_kind chamber_leak = {
    .name = "chamber_leak",
    .what = "one chamber loses air to ambient",
    .signature = "one chamber's pressure is too low wherever it is held, the more the higher it is, and it "
                 "vents a little faster; the tip, simulated from measured pressures, is right",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_ONE_CHAMBER,
    .parameter_count = 1,
    .parameter = {[CONDUCTANCE] = {"conductance", "m3/(s Pa)", 0.0, 1e-10, 5e-12, 0.0}},
    .gas = step};

EFFECT_REGISTER(chamber_leak);
