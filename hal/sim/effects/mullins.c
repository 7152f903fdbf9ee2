/* Rubber that has been stretched before is softer up to that stretch, and as it was beyond it (Mullins 1948).
 * As Ogden and Roxburgh (1999) have it, the softening depends on how far the present energy is below the
 * greatest past one; energies go with the square of the load, and each chamber's wall has its own past. */
#include <math.h>

#include "sim/effect.h"

enum { SOFTENING, SCALE };
enum { GREATEST };

static void soften(double *state, const double *parameter, struct effect_signals *signals) {
    const double scale_pa = parameter[SCALE] * (double)signals->table->module.working_pressure_pa;
    for (size_t c = 0; c < 3; c++) {
        double *greatest = &state[GREATEST + c], *load = &signals->load_pa[c];
        *greatest = fmax(*greatest, *load);
        if (*greatest > 0.0) {
            const double share = fmax(*load / *greatest, 0.0);
            const double softer =
                parameter[SOFTENING] * (1.0 - exp(-*greatest / scale_pa)) * (1.0 - share * share);
            *load /= 1.0 - softer;
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
    .scope = EFFECT_GLOBAL,
    .parameter_count = 2,
    .parameter = {[SOFTENING] = {"softening", "1", 0.0, 0.5, 0.15, 0.0},
                  [SCALE] = {"scale", "1", 0.05, 2.0, 0.5, NAN}},
    .load = soften};

EFFECT_REGISTER(mullins);
