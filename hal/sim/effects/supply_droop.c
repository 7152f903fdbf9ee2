/* The supply gives way when air is drawn: its pressure falls in proportion to the flow and comes back with
 * one time constant (a regulator's droop, and the reservoir behind it). A valve open between 40 kPa and a
 * vented chamber draws 2.7e-5 kg/s. */
#include <math.h>

#include "sim/effect.h"

enum { DROP_PER_FLOW, RECOVERY_TIME };
enum { DROP_PA };

/* Exact for a flow that holds over the step. A supply does not suck. */
static void step(double *state, const double *parameter, struct effect_signals *signals) {
    const double kept = exp(-signals->step_s / parameter[RECOVERY_TIME]);
    state[DROP_PA] =
        kept * state[DROP_PA] + (1.0 - kept) * parameter[DROP_PER_FLOW] * signals->supply_flow_kgps;
    signals->influence->supply_pa = fmax(signals->influence->supply_pa - state[DROP_PA], 0.0);
}

static const struct effect_kind supply_droop = {
    .name = "supply_droop",
    .what = "the supply's pressure falls with the air that is drawn and recovers with one time constant",
    .signature = "every chamber fills slower and lower while much air is drawn, by any of them; venting is "
                 "right. A supply that is too low throughout is no droop. Where the supply is logged it "
                 "shows there",
    .stage = EFFECT_STAGE_SUPPLY,
    .scope = EFFECT_GLOBAL,
    .parameter_count = 2,
    .parameter = {[DROP_PER_FLOW] = {"drop_per_flow", "Pa s/kg", 0.0, 1.5e9, 1.5e8, 0.0},
                  [RECOVERY_TIME] = {"recovery_time", "s", 0.05, 3.0, 0.5, NAN}},
    .gas = step};

EFFECT_REGISTER(supply_droop);
