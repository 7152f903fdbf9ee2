/* The smoother against the same Gaussian problem solved densely, and what it chooses on series whose making is known. */
#include "support/test.h"

#include "gap/smoother.h"
#include "sim/random.h"

#define PRIOR_VARIANCE 1e8L /* of level and slope before anything was seen, as the smoother has it */
#define SHORT 24
#define LONG 400
#define SEEDS 40
#define NOISE 30.0 /* of a block of readings, Pa: about what real ones have */

/* --- the dense solution --- */

struct dense {
    double level[SHORT];
    double variance[SHORT];
    double likelihood;
};

/* Covariance of the levels of steps i and j before anything was seen, from the levels' and slopes' independent increments. */
static long double covariance(const struct smoother *smoother, size_t i, size_t j) {
    const size_t least = i < j ? i : j;
    long double sum = PRIOR_VARIANCE + (long double)smoother->drift * (long double)least;
    if (smoother->swing > 0.0) {
        sum += PRIOR_VARIANCE * (long double)i * (long double)j;
        for (size_t m = 1; m < least; m++) {
            sum += (long double)smoother->swing * (long double)(i - m) * (long double)(j - m);
        }
    }
    return sum;
}

/* Cholesky factor of the covariance of what was seen, in place. */
static void factor(long double a[SHORT][SHORT], size_t n) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            long double sum = a[i][j];
            for (size_t k = 0; k < j; k++) {
                sum -= a[i][k] * a[j][k];
            }
            a[i][j] = i == j ? sqrtl(sum) : sum / a[j][j];
        }
    }
}

static void solve_lower(long double a[SHORT][SHORT], size_t n, long double *x) {
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++) {
            x[i] -= a[i][k] * x[k];
        }
        x[i] /= a[i][i];
    }
}

static void solve_densely(const struct smoother *smoother, const double *observed, const double *variance, size_t count,
                          struct dense *out) {
    long double a[SHORT][SHORT], white[SHORT];
    size_t seen[SHORT], n = 0;
    for (size_t i = 0; i < count; i++) {
        if (isfinite(variance[i])) {
            white[n] = (long double)observed[i];
            seen[n++] = i;
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            a[i][j] = covariance(smoother, seen[i], seen[j]) + (i == j ? (long double)variance[seen[i]] : 0.0L);
        }
    }
    factor(a, n);
    solve_lower(a, n, white);
    long double likelihood = 0.0L;
    for (size_t k = 0; k < n; k++) {
        likelihood -= 0.5L * white[k] * white[k] + logl(a[k][k]);
    }
    out->likelihood = (double)likelihood;
    for (size_t i = 0; i < count; i++) {
        long double cross[SHORT], level = 0.0L, left = covariance(smoother, i, i);
        for (size_t k = 0; k < n; k++) {
            cross[k] = covariance(smoother, i, seen[k]);
        }
        solve_lower(a, n, cross);
        for (size_t k = 0; k < n; k++) {
            level += cross[k] * white[k];
            left -= cross[k] * cross[k];
        }
        out->level[i] = (double)level;
        out->variance[i] = (double)left;
    }
}

/* --- series --- */

/* A level that wanders, and its slope too, seen through noise. */
static void draw(uint64_t seed, double drift, double swing, double noise, double *observed, double *variance, size_t count) {
    struct random_stream random;
    double level = 0.0, slope = 0.0;
    random_seed(&random, seed, 5);
    for (size_t i = 0; i < count; i++) {
        observed[i] = level + noise * random_normal(&random);
        variance[i] = noise * noise;
        level += slope + sqrt(drift) * random_normal(&random);
        slope += sqrt(swing) * random_normal(&random);
    }
}

/* Noise that differs from step to step, and steps at which nothing was seen: at the start, in a row, at the end. */
static void draw_with_holes(uint64_t seed, const struct smoother *smoother, double *observed, double *variance) {
    static const size_t holes[] = {0, 6, 7, 8, 15, SHORT - 1};
    draw(seed, smoother->drift, smoother->swing, 1.0, observed, variance, SHORT);
    for (size_t i = 0; i < SHORT; i++) {
        variance[i] = 0.5 + 0.25 * (double)(i % 5);
    }
    for (size_t k = 0; k < sizeof holes / sizeof holes[0]; k++) {
        observed[holes[k]] = NAN;
        variance[holes[k]] = INFINITY;
    }
}

static void assert_is_dense(const struct smoother *smoother, uint64_t seed) {
    double observed[SHORT], variance[SHORT], level[SHORT];
    struct dense dense;
    draw_with_holes(seed, smoother, observed, variance);
    solve_densely(smoother, observed, variance, SHORT, &dense);
    assert_true(smoother_run(smoother, observed, variance, SHORT, level));
    for (size_t i = 0; i < SHORT; i++) {
        assert_close(level[i], dense.level[i], 1e-5 * (1.0 + fabs(dense.level[i])));
    }
}

static void level_that_wanders_is_the_dense_solution(void **state) {
    static const double drifts[] = {0.0, 1e-3, 0.3, 50.0};
    (void)state;
    for (size_t i = 0; i < sizeof drifts / sizeof drifts[0]; i++) {
        assert_is_dense(&(struct smoother){.drift = drifts[i]}, 10 + i);
    }
}

static void level_with_a_slope_is_the_dense_solution(void **state) {
    static const struct smoother both[] = {{.swing = 1e-3}, {.swing = 0.5}, {.swing = 20.0}, {.drift = 0.4, .swing = 0.05}};
    (void)state;
    for (size_t i = 0; i < sizeof both / sizeof both[0]; i++) {
        assert_is_dense(&both[i], 20 + i);
    }
}

static void level_of_which_nothing_was_seen_is_zero(void **state) {
    double observed[SHORT], variance[SHORT], level[SHORT];
    (void)state;
    for (size_t i = 0; i < SHORT; i++) {
        observed[i] = NAN;
        variance[i] = INFINITY;
        level[i] = 1.0;
    }
    assert_true(smoother_run(&(struct smoother){.drift = 1.0}, observed, variance, SHORT, level));
    for (size_t i = 0; i < SHORT; i++) {
        assert_close(level[i], 0.0, 0.0);
    }
}

static void absent_level_is_zero_whatever_was_seen(void **state) {
    double observed[SHORT], variance[SHORT], level[SHORT];
    (void)state;
    draw(1, 4.0, 0.0, 1.0, observed, variance, SHORT);
    memset(level, 0xff, sizeof level);
    assert_true(smoother_run(&(struct smoother){.absent = true, .drift = 4.0}, observed, variance, SHORT, level));
    for (size_t i = 0; i < SHORT; i++) {
        assert_close(level[i], 0.0, 0.0);
    }
}

/* --- the choice --- */

/* No choice five times greater or smaller is likelier by the dense solution, and the spread is that of its variances. */
static void assert_likeliest(uint64_t seed, double drift, double swing, bool with_slope) {
    double observed[SHORT], variance[SHORT], spread2 = 0.0;
    struct smoother chosen;
    struct dense dense, other;
    draw(seed, drift, swing, 1.0, observed, variance, SHORT);
    observed[5] = NAN;
    variance[5] = INFINITY;
    assert_true(smoother_fit(&chosen, observed, variance, SHORT, false, with_slope));
    assert_false(chosen.absent);
    assert_true(with_slope ? chosen.drift == 0.0 && chosen.swing > 0.0 : chosen.swing == 0.0 && chosen.drift > 0.0);
    solve_densely(&chosen, observed, variance, SHORT, &dense);
    for (int i = 0; i < 2; i++) {
        const double factor_of = i == 0 ? 5.0 : 0.2;
        const struct smoother beside = {.drift = factor_of * chosen.drift, .swing = factor_of * chosen.swing};
        solve_densely(&beside, observed, variance, SHORT, &other);
        assert_under(other.likelihood, dense.likelihood);
    }
    for (size_t i = 0; i < SHORT; i++) {
        spread2 += dense.variance[i] / SHORT;
    }
    assert_relative(chosen.spread, sqrt(spread2), 1e-4);
}

static void choice_is_the_likeliest_by_the_dense_solution(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 8; seed++) {
        assert_likeliest(100 + seed, 9.0, 0.0, false);
        assert_likeliest(200 + seed, 0.0, 1.0, true);
    }
}

/* Choices are a factor of five apart: half of that on a logarithmic scale is what their grid alone leaves. */
static void assert_recovered(double drift, double swing, double noise) {
    static double observed[LONG], variance[LONG];
    double sum = 0.0;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        struct smoother chosen;
        draw(300 + seed, drift, swing, noise, observed, variance, LONG);
        assert_true(smoother_fit(&chosen, observed, variance, LONG, false, swing > 0.0));
        const double found = log((swing > 0.0 ? chosen.swing : chosen.drift) / (swing > 0.0 ? swing : drift));
        assert_close(found, 0.0, log(7.0));
        sum += found / SEEDS;
    }
    assert_close(sum, 0.0, log(2.0));
}

static void drift_of_a_walk_is_recovered(void **state) {
    (void)state;
    assert_recovered(0.1, 0.0, 1.0);
    assert_recovered(1.0, 0.0, 1.0);
    assert_recovered(40.0, 0.0, NOISE);
}

static void swing_of_a_slope_is_recovered(void **state) {
    (void)state;
    assert_recovered(0.0, 0.01, 1.0);
    assert_recovered(0.0, 3.0, NOISE);
}

/* Noise about zero, of which the mean is as said. */
static void draw_about(uint64_t seed, double mean, double *observed, double *variance) {
    double sum = 0.0;
    draw(seed, 0.0, 0.0, NOISE, observed, variance, LONG);
    for (size_t i = 0; i < LONG; i++) {
        sum += observed[i] / LONG;
    }
    for (size_t i = 0; i < LONG; i++) {
        observed[i] += mean - sum;
    }
}

static void noise_alone_is_seen_as_such(void **state) {
    static double observed[LONG], variance[LONG];
    size_t absent = 0;
    (void)state;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        struct smoother chosen;
        draw(500 + seed, 0.0, 0.0, NOISE, observed, variance, LONG);
        assert_true(smoother_fit(&chosen, observed, variance, LONG, false, false));
        absent += chosen.absent && chosen.drift == 0.0 && chosen.swing == 0.0;
        /* without duties the level is what is sought: it is never taken for absent */
        assert_true(smoother_fit(&chosen, observed, variance, LONG, false, true));
        assert_false(chosen.absent);
    }
    assert_in_range(absent, SEEDS * 95 / 100, SEEDS);
}

static void level_of_five_standard_errors_stands(void **state) {
    static double observed[LONG], variance[LONG], level[LONG];
    const double error = NOISE / sqrt(LONG);
    (void)state;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            struct smoother chosen;
            draw_about(600 + seed, sign * 5.0 * error, observed, variance);
            assert_true(smoother_fit(&chosen, observed, variance, LONG, false, false));
            assert_false(chosen.absent);
            assert_true(smoother_run(&chosen, observed, variance, LONG, level));
            assert_close(level[LONG / 2], sign * 5.0 * error, 3.0 * error);
        }
    }
}

/* --- rigid --- */

static void rigid_level_is_a_constant_or_absent(void **state) {
    static double observed[LONG], variance[LONG], level[LONG];
    size_t constant = 0, absent = 0;
    (void)state;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        struct smoother chosen;
        double sum = 0.0;
        draw(700 + seed, seed % 2 == 0 ? 400.0 : 0.0, 0.0, NOISE, observed, variance, LONG);
        assert_true(smoother_fit(&chosen, observed, variance, LONG, true, false));
        assert_true(chosen.drift == 0.0 && chosen.swing == 0.0);
        assert_true(smoother_run(&chosen, observed, variance, LONG, level));
        for (size_t i = 0; i < LONG; i++) {
            sum += observed[i] / LONG;
        }
        for (size_t i = 0; i < LONG; i++) {
            assert_close(level[i], chosen.absent ? 0.0 : sum, 1e-3 + 1e-5 * fabs(sum));
        }
        constant += seed % 2 == 0 && !chosen.absent;
        absent += seed % 2 == 1 && chosen.absent;
    }
    assert_in_range(constant, SEEDS / 2 - 3, SEEDS / 2); /* a walk comes out with a mean of about zero now and then */
    assert_in_range(absent, SEEDS / 2 - 1, SEEDS / 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(level_that_wanders_is_the_dense_solution),
                                       cmocka_unit_test(level_with_a_slope_is_the_dense_solution),
                                       cmocka_unit_test(level_of_which_nothing_was_seen_is_zero),
                                       cmocka_unit_test(absent_level_is_zero_whatever_was_seen),
                                       cmocka_unit_test(choice_is_the_likeliest_by_the_dense_solution),
                                       cmocka_unit_test(drift_of_a_walk_is_recovered),
                                       cmocka_unit_test(swing_of_a_slope_is_recovered),
                                       cmocka_unit_test(noise_alone_is_seen_as_such),
                                       cmocka_unit_test(level_of_five_standard_errors_stands),
                                       cmocka_unit_test(rigid_level_is_a_constant_or_absent)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
