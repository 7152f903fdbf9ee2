/* On what residuals depend, on synthetic ones: what is planted is found and comes first, what is not planted is found no more
 * often than the bound on false discoveries says. */
#include "support/test.h"

#include <stdlib.h>

#include "gap/locate.h"

#define ROWS 1200 /* two runs of 60 s at 0.1 s */
#define RUN_ROWS 600
#define STEP_S 0.1
#define SEEDS 200
#define RESIDUALS 9
#define MEMORY_S 0.5 /* of the noise */

enum { PRESSURE, RATE = PRESSURE + 3, LOADING = RATE + 3, TIME = LOADING + 3, CYCLES, BEND, DIRECTION, TEMPERATURE, VARIABLES };
static const char *const variable_names[VARIABLES] = {"pressure", "pressure", "pressure", "rate", "rate", "rate", "loading",
                                                      "loading", "loading", "time", "cycles", "bend", "direction", "temperature"};

static double variable[VARIABLES][ROWS];
static double residual[RESIDUALS][ROWS];
static uint64_t state;

static double uniform(void) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) / 9007199254740992.0;
}

static double normal(void) {
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        sum += uniform();
    }
    return sum;
}

/* Noise that remembers for MEMORY_S, of variance one. */
static void noise(double *to) {
    const double kept = exp(-STEP_S / MEMORY_S);
    double now = normal();
    for (size_t i = 0; i < ROWS; i++) {
        to[i] = now;
        now = kept * now + sqrt(1.0 - kept * kept) * normal();
    }
}

/* A recording: ramps and holds at random levels, with rests; cycles come faster in the middle of a run. */
static void draw_variables(uint64_t seed) {
    state = 77 + 1000003 * seed;
    for (size_t c = 0; c < 3; c++) {
        double *pressure = variable[PRESSURE + c], level = 0.0, speed = 0.0;
        size_t until = 0;
        for (size_t i = 0; i < ROWS; i++) {
            const bool middle = i % RUN_ROWS > RUN_ROWS / 3 && i % RUN_ROWS < 2 * RUN_ROWS / 3;
            if (i % RUN_ROWS == 0) {
                pressure[i] = level = 0.0;
                until = i + 10;
            } else {
                const double way = level - pressure[i - 1];
                pressure[i] = pressure[i - 1] + (fabs(way) < speed ? way : copysign(speed, way));
            }
            if (i >= until) {
                level = uniform() < 0.25 ? 0.0 : 10.0 * uniform();
                speed = 0.1 + 1.5 * uniform() * uniform();
                until = i + (size_t)((middle ? 8.0 : 25.0) * (1.0 + uniform()));
            }
        }
        for (size_t i = 0; i < ROWS; i++) {
            const double rate = i % RUN_ROWS > 0 ? (pressure[i] - pressure[i - 1]) / STEP_S : 0.0;
            variable[RATE + c][i] = rate;
            variable[LOADING + c][i] = rate > 0.3 ? 1.0 : rate < -0.3 ? -1.0 : 0.0;
        }
    }
    double cycles = 0.0, warm = 293.0;
    for (size_t i = 0; i < ROWS; i++) {
        const double x = variable[PRESSURE][i] - 0.5 * (variable[PRESSURE + 1][i] + variable[PRESSURE + 2][i]);
        const double y = 0.866 * (variable[PRESSURE + 1][i] - variable[PRESSURE + 2][i]);
        cycles = i % RUN_ROWS == 0 ? 0.0 : cycles;
        for (size_t c = 0; c < 3; c++) {
            cycles += i > 0 && variable[PRESSURE + c][i] > 4.0 && variable[PRESSURE + c][i - 1] <= 4.0 ? 1.0 : 0.0;
        }
        warm += 0.05 * normal() + 0.03 * (295.0 - warm); /* slower ones move too seldom in a minute to be told from chance */
        variable[TIME][i] = STEP_S * (double)(i % RUN_ROWS);
        variable[CYCLES][i] = cycles;
        variable[BEND][i] = 8.0 * hypot(x, y);
        variable[DIRECTION][i] = hypot(x, y) > 0.5 ? 57.3 * atan2(y, x) : NAN;
        variable[TEMPERATURE][i] = warm;
    }
}

static void make_table(struct locate_table *table) {
    *table = (struct locate_table){.rows = ROWS, .residuals = RESIDUALS, .variables = VARIABLES};
    for (size_t r = 0; r < RESIDUALS; r++) {
        table->residual[r] =
            (struct locate_residual){r < 3 ? "r1_pressure" : "r2_position", "channel", r < 3 ? r + 1 : 0, residual[r]};
    }
    for (size_t v = 0; v < VARIABLES; v++) {
        table->variable[v] = (struct locate_variable){.name = variable_names[v],
                                                      .unit = "",
                                                      .chamber = v < TIME ? v % 3 + 1 : 0,
                                                      .categories = v >= LOADING && v < TIME,
                                                      .value = variable[v]};
    }
}

/* Nothing depends on anything: any discovery is false, so at most one recording in twenty may have one. Of 200 recordings with
 * exactly that chance, more than 19 have one in less than 1 % of cases. */
static void chance_alone_finds_hardly_anything(void **unused) {
    static struct locate_dependence found[LOCATE_FOUND_MAX];
    struct locate_table table;
    size_t with_any = 0, tests = 0;
    (void)unused;
    for (uint64_t seed = 0; seed < SEEDS; seed++) {
        size_t tested = 0;
        draw_variables(seed);
        for (size_t r = 0; r < RESIDUALS; r++) {
            noise(residual[r]);
        }
        make_table(&table);
        const size_t count = locate_find(&table, 1, found, &tested);
        assert_true(count != SIZE_MAX);
        with_any += count > 0 ? 1 : 0;
        tests += tested;
    }
    print_message("%zu of %d recordings with a false discovery, %zu pairs tested\n", with_any, SEEDS, tests);
    assert_int_equal(tests, SEEDS * (RESIDUALS * VARIABLES + 1));
    assert_in_range(with_any, 0, 19);
}

/* A smooth bump over a variable's range, of a step for a category: not linear, so that a correlation would miss some. */
static double planted(size_t v, double value, double low, double high) {
    const double share = high > low ? (value - low) / (high - low) : 0.0;
    if (isnan(value)) {
        return 0.0;
    }
    return v >= LOADING && v < TIME ? value : v == CYCLES || v == TIME || v == TEMPERATURE ? 2.0 * share : sin(4.0 * share);
}

static void plant(size_t v, double size, double *to) {
    double low = INFINITY, high = -INFINITY;
    for (size_t i = 0; i < ROWS; i++) {
        low = fmin(low, variable[v][i]);
        high = fmax(high, variable[v][i]);
    }
    for (size_t i = 0; i < ROWS; i++) {
        to[i] += size * planted(v, variable[v][i], low, high);
    }
}

/* On one residual of nine, as large as the noise or so. */
static void planted_dependence_is_found_first(void **unused) {
    static struct locate_dependence found[LOCATE_FOUND_MAX];
    enum { TRIES = 6, CHANCE_MISSES = 1 };
    struct locate_table table;
    (void)unused;
    for (size_t v = 0; v < VARIABLES; v++) {
        size_t missed = 0, second = 0;
        for (uint64_t seed = 0; seed < TRIES; seed++) {
            size_t tested = 0;
            draw_variables(300 + seed);
            for (size_t r = 0; r < RESIDUALS; r++) {
                noise(residual[r]);
            }
            plant(v, 2.0, residual[v % RESIDUALS]);
            make_table(&table);
            const size_t count = locate_find(&table, 1, found, &tested);
            size_t k = 0;
            while (k < count && (found[k].variable != v || found[k].residual != v % RESIDUALS)) {
                k++;
            }
            missed += k == count ? 1 : 0;
            second += k > 0 && k < count && found[0].variable != LOCATE_VARIABLES_MAX ? 1 : 0; /* that one chamber errs most is true as well */
        }
        if (missed + second > CHANCE_MISSES) {
            fail_msg("%s (%zu): missed in %zu of %d, not first in %zu", variable_names[v], v, missed, TRIES, second);
        }
    }
}

static void share_and_place_are_those_planted(void **unused) {
    static struct locate_dependence found[LOCATE_FOUND_MAX];
    struct locate_table table;
    size_t tested = 0;
    double square = 0.0, with = 0.0;
    (void)unused;
    draw_variables(5);
    for (size_t r = 0; r < RESIDUALS; r++) {
        noise(residual[r]);
    }
    for (size_t i = 0; i < ROWS; i++) { /* from 8 kPa on, one chamber reads 3 too much */
        const double more = variable[PRESSURE + 1][i] > 8.0 ? 3.0 : 0.0;
        residual[4][i] += more;
        with += more / ROWS;
        square += more * more / ROWS;
    }
    make_table(&table);
    const size_t count = locate_find(&table, 1, found, &tested);
    const double variance = square - with * with;
    assert_in_range(count, 1, tested);
    assert_int_equal(found[0].variable, PRESSURE + 1);
    assert_int_equal(found[0].residual, 4);
    assert_close(found[0].share, variance / (variance + 1.0), 0.15);
    assert_true(found[0].from > 6.0 && found[0].to > 8.0);
    assert_close(found[0].off, 3.0, 1.0);
    assert_true(found[0].p <= 0.001 && found[0].q <= LOCATE_FALSE_SHARE);
}

static void the_chamber_that_errs_is_named(void **unused) {
    static struct locate_dependence found[LOCATE_FOUND_MAX];
    struct locate_table table;
    size_t tested = 0, k = 0;
    (void)unused;
    draw_variables(6);
    for (size_t r = 0; r < RESIDUALS; r++) {
        noise(residual[r]);
    }
    for (size_t i = 0; i < ROWS; i++) {
        residual[1][i] *= 2.5;
    }
    make_table(&table);
    const size_t count = locate_find(&table, 1, found, &tested);
    while (k < count && found[k].variable != LOCATE_VARIABLES_MAX) {
        k++;
    }
    assert_true(k < count);
    assert_int_equal(found[k].residual, 1);
    assert_close(found[k].from, 2.0, 0.0);
    assert_close(found[k].off, 2.5, 0.7);
}

static void same_seed_same_answer(void **unused) {
    static struct locate_dependence one[LOCATE_FOUND_MAX], two[LOCATE_FOUND_MAX];
    struct locate_table table;
    size_t tested = 0;
    (void)unused;
    draw_variables(7);
    for (size_t r = 0; r < RESIDUALS; r++) {
        noise(residual[r]);
    }
    plant(BEND, 1.0, residual[5]);
    make_table(&table);
    const size_t count = locate_find(&table, 3, one, &tested);
    assert_in_range(count, 1, tested);
    assert_int_equal(locate_find(&table, 3, two, &tested), count);
    for (size_t k = 0; k < count; k++) {
        assert_true(one[k].variable == two[k].variable && one[k].residual == two[k].residual);
        assert_close(one[k].p, two[k].p, 0.0);
    }
}

static void what_was_not_measured_is_not_tested(void **unused) {
    static struct locate_dependence found[LOCATE_FOUND_MAX];
    struct locate_table table;
    size_t tested = 1;
    (void)unused;
    draw_variables(8);
    for (size_t i = 0; i < ROWS; i++) {
        variable[TEMPERATURE][i] = NAN;
        variable[BEND][i] = 12.0; /* never moved */
        for (size_t r = 0; r < RESIDUALS; r++) {
            residual[r][i] = r == 3 ? NAN : residual[r][i];
        }
    }
    for (size_t r = 0; r < RESIDUALS; r++) {
        if (r != 3) {
            noise(residual[r]);
        }
    }
    make_table(&table);
    assert_true(locate_find(&table, 1, found, &tested) != SIZE_MAX);
    assert_int_equal(tested, (RESIDUALS - 1) * (VARIABLES - 2) + 1);
    table.rows = 10;
    assert_int_equal(locate_find(&table, 1, found, &tested), 0);
    assert_int_equal(tested, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(chance_alone_finds_hardly_anything), cmocka_unit_test(planted_dependence_is_found_first),
        cmocka_unit_test(share_and_place_are_those_planted),  cmocka_unit_test(the_chamber_that_errs_is_named),
        cmocka_unit_test(same_seed_same_answer),              cmocka_unit_test(what_was_not_measured_is_not_tested)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
