/* Long or narrow tubes between valves and module. Form 0: flow elements in series are one of less conductance under the same
 * law (ISO 6358-3:2014), so the valve's conductance is scaled; over 1, the tubes are wider than those it was measured with.
 * Form 1: a narrow tube is laminar (Hagen and Poiseuille), so its drop goes with the flow while the valve's goes with the
 * square: it holds back a fill from the supply more than a gentle vent. Both let pass the same share at REFERENCE_PA. */
#include <math.h>

#include "sim/effect.h"

enum { CONDUCTANCE_SCALE };
enum { ORIFICE, LAMINAR };

#define REFERENCE_PA 10000.0 /* pressure difference at which the scale holds */
#define LEAST_PA 1.0

/* Of the valve's flow alone, at this difference: x^2 + resistance x = difference, x the flow over the valve's law. */
static double laminar_share(double scale, double difference_pa) {
    const double resistance = sqrt(REFERENCE_PA) * (1.0 - scale * scale) / scale;
    const double difference = fmax(difference_pa, LEAST_PA);
    const double flow = 0.5 * (sqrt(fmax(resistance * resistance + 4.0 * difference, 0.0)) - resistance);
    return flow / sqrt(difference);
}

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    struct chamber_influence *influence = signals->influence;
    for (size_t c = 0; c < 3; c++) {
        double fill = parameter[CONDUCTANCE_SCALE], vent = fill;
        if (signals->form == LAMINAR) {
            fill = laminar_share(parameter[CONDUCTANCE_SCALE], influence->supply_pa - signals->pressure_pa[c]);
            vent = laminar_share(parameter[CONDUCTANCE_SCALE], signals->pressure_pa[c]);
        }
        influence->vent_scale_change[c] += influence->conductance_scale[c] * (vent - fill);
        influence->conductance_scale[c] *= fill;
    }
}

static const struct effect_kind line_resistance = {
    .name = "line_resistance",
    .what = "the tubes let through less air than they should",
    .signature = "chambers fill and vent slower and end where they should; on a single chamber its first form is the same as "
                 "valve_sluggish. Unlike line_volume it slows large and small chamber volumes alike",
    .stage = EFFECT_STAGE_VALVE,
    .scope = EFFECT_EVERY_CHAMBER,
    .forms = 2,
    .form_what = {"the same share of every flow", "laminar: large flows are held back more than small ones"},
    .parameter_count = 1,
    .parameter = {[CONDUCTANCE_SCALE] = {"conductance_scale", "1", 0.1, 1.2, 0.6, 1.0}},
    .gas = step};

EFFECT_REGISTER(line_resistance);
