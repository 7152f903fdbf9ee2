#include "gap/plan_library.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sim/random.h"

#define WORKING_SHARE 0.9 /* of the working pressure: what a loop overshoots stays below it */
#define REST_S 1.0        /* without pressure before the first one, so that the rest pose is seen */
#define SETTLE_S 3.0      /* and behind the last one: what is left in the pose */
#define HOLD_S 30.0
#define RANDOM_S 30.0

/* What experiments are made of. */
struct maker {
    const struct bend_table *table;
    size_t lead; /* 0 to 2 */
    double bend_rad;
    struct plan *plan;
};

double plan_library_pressure(const struct bend_table *table, size_t chamber, double bend_rad) {
    double low_pa = 0.0, high_pa = WORKING_SHARE * (double)table->module.working_pressure_pa;
    for (int i = 0; i < 40; i++) {
        const double middle_pa = 0.5 * (low_pa + high_pa);
        float pressure_pa[3] = {0.0f, 0.0f, 0.0f};
        pressure_pa[chamber - 1] = (float)middle_pa;
        *(plan_bend_at(table, pressure_pa) < bend_rad ? &low_pa : &high_pa) = middle_pa;
    }
    return low_pa;
}

/* Of the chamber `after` places behind the lead. */
static double height_pa(const struct maker *maker, size_t after, double share) {
    return plan_library_pressure(maker->table, (maker->lead + after) % 3 + 1, share * maker->bend_rad);
}

/* The library's plans are far shorter than a plan has room for, so adding never fails. */
static void hold(const struct maker *maker, double length_s, size_t after, double share) {
    double pressure_pa[3] = {0.0, 0.0, 0.0};
    pressure_pa[(maker->lead + after) % 3] = share > 0.0 ? height_pa(maker, after, share) : 0.0;
    (void)plan_add_pressure(maker->plan, length_s, pressure_pa);
}

static void ramp(const struct maker *maker, double length_s, size_t after, double share) {
    double pressure_pa[3] = {0.0, 0.0, 0.0};
    pressure_pa[(maker->lead + after) % 3] = share > 0.0 ? height_pa(maker, after, share) : 0.0;
    (void)plan_add_ramp(maker->plan, length_s, pressure_pa);
}

/* Not by a vent: that drops the valves inside a PWM period, which duties alone cannot tell. */
static void rest(const struct maker *maker, double length_s) {
    const double none_pa[3] = {0.0, 0.0, 0.0};
    (void)plan_add_pressure(maker->plan, length_s, none_pa);
}

static void slow_loop(const struct maker *maker) {
    ramp(maker, 14.0, 0, 1.0);
    ramp(maker, 14.0, 0, 0.0);
}

static void three_heights(const struct maker *maker) {
    static const double shares[3] = {0.2, 0.5, 1.0};
    for (size_t i = 0; i < 3; i++) {
        hold(maker, 8.0, 0, shares[i]);
    }
}

static void steps_up_and_down(const struct maker *maker) {
    static const double shares[12] = {0.1, 0.4, 1.0, 0.3, 0.05, 0.7, 0.0, 0.9, 0.5, 0.15, 0.6, 0.02};
    for (size_t i = 0; i < 12; i++) {
        hold(maker, 2.0, 0, shares[i]);
    }
}

/* Too quick to settle: the valves work, and the chambers pass through all pressures in both directions. */
static void quick_steps(const struct maker *maker) {
    static const double shares[5] = {1.0, 0.02, 0.5, 0.1, 0.8};
    static const double lengths_s[3] = {0.15, 0.4, 0.8};
    for (size_t i = 0; i < 40; i++) {
        hold(maker, lengths_s[i % 3], i / 5 % 3, shares[i % 5]);
    }
    rest(maker, 1.0);
}

/* Periods without a common multiple within the length; starts and stays between none and the height. */
static void multisine(const struct maker *maker) {
    static const double periods_s[3][2] = {{7.3, 1.1}, {9.7, 1.7}, {12.1, 2.3}};
    struct plan_tone tone[6];
    for (size_t i = 0; i < 6; i++) {
        const size_t after = i / 2, slow = i % 2 == 0;
        const double mean_pa = height_pa(maker, after, 0.9) * (slow ? 0.35 : 0.15);
        tone[i] = (struct plan_tone){.amplitude_pa = mean_pa,
                                     .mean_pa = mean_pa,
                                     .period_s = periods_s[after][i % 2],
                                     .phase_rad = -0.5 * M_PI};
        tone[i].chamber[(maker->lead + after) % 3] = true;
    }
    (void)plan_add_sine(maker->plan, 28.0, tone, 6);
}

static void one_chamber_at_a_time(const struct maker *maker) {
    for (size_t after = 0; after < 3; after++) {
        ramp(maker, 3.0, after, 1.0);
        hold(maker, 3.0, after, 1.0);
        ramp(maker, 2.5, after, 0.0);
        rest(maker, 1.5);
    }
}

static void cycles(const struct maker *maker, size_t count, double period_s, double share) {
    for (size_t i = 0; i < count; i++) {
        ramp(maker, 0.5 * period_s, 0, share);
        ramp(maker, 0.5 * period_s, 0, 0.0);
    }
}

static void warm_up(const struct maker *maker) {
    cycles(maker, 1, 5.0, 0.7);
    rest(maker, 3.0);
    cycles(maker, 5, 2.5, 1.0);
    rest(maker, 3.0);
    cycles(maker, 1, 5.0, 0.7);
}

static void growing_cycles(const struct maker *maker) {
    static const double shares[4] = {0.15, 0.4, 0.7, 1.0};
    for (size_t i = 0; i < 4; i++) {
        cycles(maker, 2, 4.0, shares[i]);
    }
}

static void long_hold(const struct maker *maker) {
    hold(maker, 24.0, 0, 0.9);
    rest(maker, 10.0);
}

/* Round in steps of 60 degrees; the table says which pressures bend it so, as the controller does. */
static void round_tour(const struct maker *maker) {
    for (size_t turn = 0; turn < 2; turn++) {
        for (size_t i = 0; i < 6; i++) {
            (void)plan_add_bend(maker->plan, 2.5, (turn == 0 ? 0.45 : 0.95) * maker->bend_rad,
                                (double)i * M_PI / 3.0, 0.0);
        }
    }
}

/* The lead chamber against the two others: lengthens the module, and bends it by a difference of pressures.
 */
static void co_contraction(const struct maker *maker) {
    static const double shares[4][3] = {
        {0.25, 0.25, 0.25}, {0.8, 0.25, 0.25}, {0.25, 0.6, 0.6}, {0.7, 0.05, 0.45}};
    for (size_t i = 0; i < 4; i++) {
        double pressure_pa[3];
        for (size_t after = 0; after < 3; after++) {
            pressure_pa[(maker->lead + after) % 3] = height_pa(maker, after, shares[i][after]);
        }
        (void)plan_add_ramp(maker->plan, 3.0, pressure_pa);
        (void)plan_add_pressure(maker->plan, 3.5, pressure_pa);
    }
}

static void random_steps(const struct maker *maker, uint64_t seed) {
    struct random_stream random;
    random_seed(&random, seed, 0);
    for (double left_s = RANDOM_S; left_s > 0.0;) {
        const double length_s = fmin(0.3 + 2.2 * random_uniform(&random), left_s);
        double pressure_pa[3];
        for (size_t c = 0; c < 3; c++) {
            pressure_pa[c] = random_uniform(&random) * height_pa(maker, c, 1.0);
        }
        (void)plan_add_pressure(maker->plan, length_s, pressure_pa);
        left_s -= length_s;
    }
}

struct recipe {
    const char *name;
    const char *what;
    void (*make)(const struct maker *maker);
};

static const struct recipe recipes[] = {
    {"slow loop", "up and down once, too slowly for valves to matter", slow_loop},
    {"three heights", "low, half and high, each held until it has settled", three_heights},
    {"steps", "up and down, each step held for two seconds", steps_up_and_down},
    {"quick steps", "steps too quick to settle, in all chambers", quick_steps},
    {"multisine", "all chambers at once, each with two periods of its own", multisine},
    {"one chamber at a time", "each chamber alone, up, held and down", one_chamber_at_a_time},
    {"warm-up", "a cycle, five greater ones, the same cycle again; the rest pose each time", warm_up},
    {"growing cycles", "two cycles of each height, each higher than the last", growing_cycles},
    {"long hold", "held for long, then without pressure for long", long_hold},
    {"round tour", "one bend towards all sides, then twice the bend", round_tour},
    {"co-contraction", "chambers against each other", co_contraction}};

static void start(struct maker *maker, const char *name, const char *what,
                  struct plan_experiment *experiment) {
    char note[PLAN_NOTE_BYTES];
    (void)snprintf(note, sizeof note, "%s: %s", name, what);
    experiment->name = name;
    experiment->what = what;
    maker->plan = &experiment->plan;
    plan_init(&experiment->plan, maker->table->module.name, note);
    rest(maker, REST_S);
}

size_t plan_library_make(const struct bend_table *table, size_t lead, double bend_rad,
                         struct plan_experiment experiment[PLAN_LIBRARY_MAX]) {
    const size_t count = sizeof recipes / sizeof recipes[0];
    for (size_t i = 0; i < count; i++) {
        struct maker maker = {.table = table, .lead = lead - 1, .bend_rad = bend_rad};
        start(&maker, recipes[i].name, recipes[i].what, &experiment[i]);
        recipes[i].make(&maker);
        rest(&maker, SETTLE_S);
    }
    return count;
}

void plan_library_hold(const struct bend_table *table, size_t lead, double bend_rad,
                       struct plan_experiment *experiment) {
    struct maker maker = {.table = table, .lead = lead - 1, .bend_rad = bend_rad};
    start(&maker, "constant hold", "one chamber, held all the time", experiment);
    hold(&maker, HOLD_S, 0, 1.0);
}

void plan_library_random(const struct bend_table *table, double bend_rad, uint64_t seed,
                         struct plan_experiment *experiment) {
    struct maker maker = {.table = table, .lead = 0, .bend_rad = bend_rad};
    start(&maker, "random steps", "random heights at random times, in all chambers", experiment);
    random_steps(&maker, seed);
    rest(&maker, SETTLE_S);
}
