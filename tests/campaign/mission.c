#include "campaign/mission.h"

#include <math.h>

#include "sim/random.h"

#define SEND_US 50000
#define STREAM 71 /* of random numbers */

static double between(struct random_stream *random, double least, double most) {
    return least + (most - least) * random_uniform(random);
}

static bool once_in(struct random_stream *random, double times) {
    return times * random_uniform(random) < 1.0;
}

static void pressures(struct random_stream *random, double most_pa, double pressure_pa[3]) {
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = once_in(random, 3.0) ? 0.0 : between(random, 0.0, most_pa);
    }
}

static void add_sine(struct plan *plan, struct random_stream *random, double length_s, double most_pa) {
    struct plan_tone tone[3];
    for (size_t c = 0; c < 3; c++) {
        const double mean_pa = between(random, 0.2, 0.6) * most_pa;
        tone[c] = (struct plan_tone){.chamber = {c == 0, c == 1, c == 2},
                                     .amplitude_pa = between(random, 0.1, 0.9) * fmin(mean_pa, most_pa - mean_pa),
                                     .mean_pa = mean_pa,
                                     .period_s = between(random, 0.5, 4.0),
                                     .phase_rad = between(random, 0.0, 6.28)};
    }
    (void)plan_add_sine(plan, length_s, tone, 3);
}

static void add_step(struct plan *plan, struct random_stream *random, const struct bend_table_module *module,
                     double length_s) {
    const double most_pa = MISSION_MOST_SHARE * (double)module->working_pressure_pa;
    double pressure_pa[3];
    pressures(random, most_pa, pressure_pa);
    switch ((int)between(random, 0.0, 10.0)) {
    case 0:
        (void)plan_add_vent(plan, length_s);
        break;
    case 1:
    case 2:
        (void)plan_add_pressure(plan, length_s, pressure_pa);
        break;
    case 3:
        (void)plan_add_ramp(plan, length_s, pressure_pa);
        break;
    case 4:
    case 5:
        add_sine(plan, random, length_s, most_pa);
        break;
    default:
        (void)plan_add_bend(plan, length_s, between(random, 0.05, 0.9) * (double)module->bend_limit_rad,
                            between(random, -3.14, 3.14), once_in(random, 2.0) ? between(random, 0.0, 3000.0) : 0.0);
        break;
    }
}

void mission_random(struct mission *mission, const struct bend_table_module *module, uint64_t seed) {
    struct random_stream random;
    random_seed(&random, seed, STREAM);
    plan_init(&mission->plan, module->name, "random mission");
    mission->holds = 0;
    mission->phase_us = 1000 * (int64_t)between(&random, 0.0, 50.0);
    for (double at_s = 0.0; at_s < 1e-6 * MISSION_LENGTH_US;) {
        const double length_s = between(&random, 0.4, 3.0);
        add_step(&mission->plan, &random, module, length_s);
        at_s += length_s;
        if (mission->holds < MISSION_HOLDS && once_in(&random, 5.0)) {
            mission->hold_from_s[mission->holds] = at_s - 0.4 * length_s;
            mission->hold_to_s[mission->holds++] = at_s;
        }
    }
}

static bool holds(const struct mission *mission, double time_s) {
    for (size_t i = 0; i < mission->holds; i++) {
        if (time_s >= mission->hold_from_s[i] && time_s < mission->hold_to_s[i]) {
            return true;
        }
    }
    return false;
}

bool mission_command(const struct mission *mission, int64_t time_us, struct controller_command *command) {
    const double time_s = 1e-6 * (double)time_us;
    if (time_us < 0 || time_us % SEND_US != mission->phase_us) {
        return false;
    }
    plan_command_at(&mission->plan, time_s, command);
    if (holds(mission, time_s) && command->kind != COMMAND_VENT) {
        *command = (struct controller_command){.kind = COMMAND_HOLD};
    }
    return true;
}
