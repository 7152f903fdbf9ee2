#include "gap/smoother.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PRIOR_VARIANCE 1e8 /* of a level before anything was seen: (10 kPa)^2 */
#define CHOICES 11
#define CHOICE_FIRST 1e-4
#define CHOICE_FACTOR 5.0

/* Mean (level, slope) and covariance. */
struct belief {
    double level, slope;
    double ll, ls, ss;
};

static void predict(const struct smoother *smoother, struct belief *belief) {
    const bool sloped = smoother->swing > 0.0;
    if (sloped) {
        belief->level += belief->slope;
        belief->ll += 2.0 * belief->ls + belief->ss;
        belief->ls += belief->ss;
        belief->ss += smoother->swing;
    }
    belief->ll += smoother->drift;
}

/* Returns the log-likelihood of the observation. */
static double correct(struct belief *belief, double observed, double variance) {
    if (!isfinite(variance)) {
        return 0.0;
    }
    const double total = belief->ll + variance, innovation = observed - belief->level;
    const double gain_level = belief->ll / total, gain_slope = belief->ls / total;
    belief->level += gain_level * innovation;
    belief->slope += gain_slope * innovation;
    belief->ss -= gain_slope * belief->ls;
    belief->ls -= gain_level * belief->ls;
    belief->ll -= gain_level * belief->ll;
    return -0.5 * (log(total) + innovation * innovation / total);
}

static struct belief prior(const struct smoother *smoother) {
    return (struct belief){.ll = PRIOR_VARIANCE, .ss = smoother->swing > 0.0 ? PRIOR_VARIANCE : 0.0};
}

/* Of a level that is zero throughout. */
static double likelihood_of_noise(const double *observed, const double *variance, size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum -= isfinite(variance[i]) ? 0.5 * (log(variance[i]) + observed[i] * observed[i] / variance[i]) : 0.0;
    }
    return sum;
}

static double likelihood(const struct smoother *smoother, const double *observed, const double *variance, size_t count) {
    struct belief belief = prior(smoother);
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        if (i > 0) {
            predict(smoother, &belief);
        }
        sum += correct(&belief, observed[i], variance[i]);
    }
    return sum;
}

/* One step of the backward pass: `after` is the smoothed belief of the next step, `ahead` its prediction from `now`. */
static void look_back(struct belief *now, const struct belief *ahead, const struct belief *after, bool sloped) {
    const double cross_ll = now->ll + (sloped ? now->ls : 0.0), cross_ls = now->ls;
    const double cross_sl = now->ls + (sloped ? now->ss : 0.0), cross_ss = now->ss;
    double gll, gls = 0.0, gsl = 0.0, gss = 0.0;
    if (sloped) {
        const double determinant = ahead->ll * ahead->ss - ahead->ls * ahead->ls;
        const double ill = ahead->ss / determinant, ils = -ahead->ls / determinant, iss = ahead->ll / determinant;
        gll = cross_ll * ill + cross_ls * ils;
        gls = cross_ll * ils + cross_ls * iss;
        gsl = cross_sl * ill + cross_ss * ils;
        gss = cross_sl * ils + cross_ss * iss;
    } else {
        gll = ahead->ll > 0.0 ? cross_ll / ahead->ll : 1.0;
    }
    const double dl = after->level - ahead->level, ds = after->slope - ahead->slope;
    const double vll = after->ll - ahead->ll, vls = after->ls - ahead->ls, vss = after->ss - ahead->ss;
    now->level += gll * dl + gls * ds;
    now->slope += gsl * dl + gss * ds;
    now->ll += gll * gll * vll + 2.0 * gll * gls * vls + gls * gls * vss;
    now->ls += gll * gsl * vll + (gll * gss + gls * gsl) * vls + gls * gss * vss;
    now->ss += gsl * gsl * vll + 2.0 * gsl * gss * vls + gss * gss * vss;
}

static bool smooth(const struct smoother *smoother, const double *observed, const double *variance, size_t count,
                   double *level, double *spread) {
    struct belief *filtered = malloc((count + 1) * sizeof *filtered);
    const bool sloped = smoother->swing > 0.0;
    double sum = 0.0;
    if (filtered == NULL) {
        return false;
    }
    struct belief belief = prior(smoother);
    for (size_t i = 0; i < count; i++) {
        if (i > 0) {
            predict(smoother, &belief);
        }
        (void)correct(&belief, observed[i], variance[i]);
        filtered[i] = belief;
    }
    struct belief after = {0};
    for (size_t i = count; i-- > 0;) {
        struct belief now = filtered[i];
        if (i + 1 < count) {
            struct belief ahead = now;
            predict(smoother, &ahead);
            look_back(&now, &ahead, &after, sloped);
        }
        level[i] = now.level;
        sum += now.ll;
        after = now;
    }
    if (spread != NULL) {
        *spread = count > 0 ? sqrt(sum / (double)count) : 0.0;
    }
    free(filtered);
    return true;
}

bool smoother_run(const struct smoother *smoother, const double *observed, const double *variance, size_t count,
                  double *level) {
    if (smoother->absent) {
        memset(level, 0, count * sizeof *level);
        return true;
    }
    return smooth(smoother, observed, variance, count, level, NULL);
}

bool smoother_fit(struct smoother *smoother, const double *observed, const double *variance, size_t count, bool rigid,
                  bool with_slope) {
    struct smoother best = {.absent = false};
    double most = with_slope ? -INFINITY : likelihood(&best, observed, variance, count);
    double drift = CHOICE_FIRST;
    for (int i = 0; i < CHOICES && !rigid; i++, drift *= CHOICE_FACTOR) {
        const struct smoother trial = {.drift = with_slope ? 0.0 : drift, .swing = with_slope ? drift : 0.0};
        const double value = likelihood(&trial, observed, variance, count);
        if (value > most) {
            most = value;
            best = trial;
        }
    }
    if (!with_slope && likelihood_of_noise(observed, variance, count) >= most) {
        *smoother = (struct smoother){.absent = true};
        return true;
    }
    double *level = malloc((count + 1) * sizeof *level);
    const bool done = level != NULL && smooth(&best, observed, variance, count, level, &best.spread);
    free(level);
    *smoother = best;
    return done;
}
