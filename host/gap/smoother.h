/* Kalman smoothing of a slowly wandering difference, seen through white noise (Rauch, Tung, Striebel 1965). */
#ifndef TRIBEND_GAP_SMOOTHER_H
#define TRIBEND_GAP_SMOOTHER_H

#include <stdbool.h>
#include <stddef.h>

struct smoother {
    bool absent;   /* the observations are but noise: the level is zero */
    double drift;  /* variance that the level gains a step; unit^2 */
    double swing;  /* variance that its slope gains a step: 0 for a level that only wanders; (unit / step)^2 */
    double spread; /* standard deviation of the smoothed level, typical; unit */
};

/* observed[i] with variance[i] (infinite: nothing was seen); `level` gets the smoothed level. False: out of memory. */
bool smoother_run(const struct smoother *smoother, const double *observed, const double *variance, size_t count,
                  double *level);
/* The drift (and, where `with_slope`, the swing) under which the observations are most likely, and the spread; none at all
 * where noise alone is likelier still (but never `with_slope`: there the level is what is sought). `rigid`: the level is a
 * constant, or absent, whatever was observed. */
bool smoother_fit(struct smoother *smoother, const double *observed, const double *variance, size_t count, bool rigid,
                  bool with_slope);

#endif
