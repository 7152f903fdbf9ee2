/* Fit of a material law to one or several tensile tests by least squares of the nominal stress. Units: Pa, stretch. */
#ifndef TRIBEND_MATERIAL_FIT_H
#define TRIBEND_MATERIAL_FIT_H

#include "material/tensile_test.h"

struct material_fit_options {
    enum material_law law;
    size_t terms;
    double strain_max; /* fit over strains [0, strain_max] */
    /* Bounds that keep the law stable at every stretch: c_i >= 0, and |a_i| >= 1 for
     * Ogden, whose energy is then polyconvex (Ball 1977). Without them a fit may turn just beyond its data. */
    bool stable;
};

struct material_fit {
    struct material material; /* name and source are the caller's to fill */
    size_t points;
    size_t parameters;
    double rms_pa;
    double rms_relative; /* each test over its own greatest stress */
    double most_pa;      /* greatest deviation, and where */
    double most_strain;
    /* Akaike's criterion, n ln(sum of relative squares / n) + 2 (parameters + 1): less is better; only differences
     * between laws on the same data mean anything (Burnham and Anderson 2002). */
    double aic;
};

/* Every test counts alike: its stresses are taken over its greatest one, its squares over its number of points. False:
 * `error` says why. */
bool material_fit(const struct tensile_test *tests, size_t test_count, const struct material_fit_options *options,
                  struct material_fit *fit, char *error, size_t error_bytes);

#endif
