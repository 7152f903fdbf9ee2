/* Rubber that has been stretched before is softer up to that stretch, and as it was beyond it (Mullins 1948).
 * As Ogden and Roxburgh (1999) have it, the softening depends on how far the present energy is below the
 * greatest past one; energies go with the square of the load, and each chamber's wall has its own past. */
#include <math.h>

#include "sim/effect.h"

/* Form 1: whatever its load, a wall is softer by a power 1 / `scale` of the greatest load that it has borne: damage that
 * stays (Chaboche 1988 has such a law for damage). */
enum { RELOADING, LASTING };
#define SOFTENING_MOST 0.8
#define GREATEST_SHARE 1.5 /* of the working pressure: beyond, no more damage */

enum { SOFTENING, SCALE };
enum { GREATEST };

static void soften(double *state, const double *parameter, struct effect_signals *signals) {
    const double scale_pa = parameter[SCALE] * (double)signals->table->module.working_pressure_pa;
    for (size_t c = 0; c < 3; c++) {
        double *greatest = &state[GREATEST + c], *load = &signals->load_pa[c];
        *greatest = fmax(*greatest, *load);
        if (*greatest > 0.0) {
            const double share = fmax(*load / *greatest, 0.0);
            const double working = fmin(*greatest / (scale_pa / parameter[SCALE]), GREATEST_SHARE);
            const double softer =
                signals->form == LASTING
                    ? parameter[SOFTENING] * pow(working, 1.0 / parameter[SCALE])
                    : parameter[SOFTENING] * (1.0 - exp(-*greatest / scale_pa)) * (1.0 - share * share);
            *load /= 1.0 - fmin(softer, SOFTENING_MOST);
        }
    }
}

static const struct effect_kind mullins = {
    .name = "mullins",
    .what = "after a first loading the module is softer, up to the greatest load it has seen",
    .signature = "the first loading to a new height is right; every later cycle below that height bends "
                 "too much, in loading and unloading alike and at any rate, most at middle loads. Cycles "
                 "of growing height tell it from hysteresis",
    .stage = EFFECT_STAGE_BODY,
    .scope = EFFECT_EVERY_CHAMBER,
    .forms = 2,
    .form_what = {"softer below the greatest past load only", "softer for good, by the greatest past load"},
    .remembers = true,
    .parameter_count = 2,
    .parameter = {[SOFTENING] = {"softening", "1", 0.0, 0.5, 0.15, 0.0},
                  [SCALE] = {"scale", "1", 0.05, 2.0, 0.5, NAN}},
    .doubt = {[SOFTENING] = 0.25, [SCALE] = 0.5}, /* laws agree on what was seen, not on where it ends */
    .load = soften};

EFFECT_REGISTER(mullins);
