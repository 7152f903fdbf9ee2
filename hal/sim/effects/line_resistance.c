/* Long or narrow tubes between valves and module. Form 0: flow elements in series are one of less conductance under the same
 * law (ISO 6358-3:2014), so the valve's conductance is scaled; over 1, the tubes are wider than those it was measured with.
 * Form 1: a narrow tube is laminar (Hagen and Poiseuille), so its drop goes with the flow while the valve's goes with the
 * square: it holds back a fill from the supply more than a gentle vent. Both let pass about the same share at REFERENCE_PA. */
#include <math.h>

#include "sim/effect.h"

enum { CONDUCTANCE_SCALE };
enum { ORIFICE, LAMINAR };

#define REFERENCE_PA 10000.0 /* pressure difference at which the scale holds */
#define LEAST_PA 1.0
#define AMBIENT_PA 101325.0
#define CRITICAL_RATIO 0.3 /* of the nominal valve */
#define NEWTON_STEPS 3     /* from where air that is not compressed would stand: 1e-4 of a flow */

/* Flow of the valve over its choked one at one pascal (ISO 6358-1:2013); absolute pressures. */
static double valve_flow(double up_pa, double down_pa) {
    const double ratio = down_pa / up_pa, above = (ratio - CRITICAL_RATIO) / (1.0 - CRITICAL_RATIO);
    return above > 0.0 ? up_pa * sqrt(fmax(1.0 - above * above, 0.0)) : up_pa;
}

/* Of the valve's flow alone: what is left with the line behind it (filling) or before it (venting). The line's drop goes
 * with its mass flow; the pressure between them is where both pass the same. */
static double laminar_share(double scale, double up_pa, double down_pa, bool filling) {
    const double difference_pa = fmax(up_pa - down_pa, LEAST_PA);
    /* for small differences the valve's is x = root of its own; x^2 + resistance x = difference */
    const double resistance = sqrt(REFERENCE_PA) * (1.0 - scale * scale) / scale;
    const double root = 0.5 * (sqrt(fmax(resistance * resistance + 4.0 * difference_pa, 0.0)) - resistance);
    const double mean_pa = AMBIENT_PA + 0.5 * REFERENCE_PA;
    const double line = sqrt(2.0 * mean_pa / (1.0 - CRITICAL_RATIO)) / resistance;
    if (resistance <= 0.0 || up_pa - down_pa < LEAST_PA) {
        return root / sqrt(difference_pa);
    }
    double between_pa = filling ? down_pa + resistance * root : down_pa + root * root;
    for (int i = 0; i < NEWTON_STEPS; i++) {
        const double nudge_pa = 1e-4 * difference_pa;
        double apart[2];
        between_pa = fmin(fmax(between_pa, down_pa + 2.0 * nudge_pa), up_pa - 2.0 * nudge_pa);
        for (int k = 0; k < 2; k++) {
            const double at_pa = between_pa + k * nudge_pa;
            apart[k] = filling ? valve_flow(up_pa, at_pa) - line * (at_pa - down_pa)
                               : line * (up_pa - at_pa) - valve_flow(at_pa, down_pa);
        }
        between_pa -= apart[0] * nudge_pa / (apart[1] - apart[0]);
    }
    between_pa = fmin(fmax(between_pa, down_pa), up_pa);
    return line * (filling ? between_pa - down_pa : up_pa - between_pa) / valve_flow(up_pa, down_pa);
}

static void step(double *state, const double *parameter, struct effect_signals *signals) {
    (void)state;
    struct chamber_influence *influence = signals->influence;
    for (size_t c = 0; c < 3; c++) {
        double fill = parameter[CONDUCTANCE_SCALE], vent = fill;
        if (signals->form == LAMINAR) {
            const double chamber_pa = AMBIENT_PA + signals->pressure_pa[c];
            fill = laminar_share(parameter[CONDUCTANCE_SCALE], AMBIENT_PA + influence->supply_pa, chamber_pa, true);
            vent = laminar_share(parameter[CONDUCTANCE_SCALE], chamber_pa, AMBIENT_PA, false);
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
    .doubt = {[CONDUCTANCE_SCALE] = 0.1}, /* between laminar and turbulent, before the valve or behind it */
    .gas = step};

EFFECT_REGISTER(line_resistance);
