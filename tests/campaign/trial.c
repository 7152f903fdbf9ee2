#include "campaign/trial.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STREAM 73 /* of random numbers */
#define FLIGHT_STEPS (MISSION_LENGTH_US / CONTROLLER_STEP_US)
#define EARLIEST_US 1000000
#define LATEST_US 4000000
#define APART_MOST_US 1000000 /* the second injection after the first, at most */
#define AFTER_US 1500000      /* goes on so long after the chambers have vented */
#define CLEARS_ONE_IN 4
#define FALLING_PA 100.0
#define QUIET_US 700000       /* the operator's commands stop, then go on */

/* What happens in a trial, apart from the mission. */
struct script {
    int64_t at_us[2];
    size_t chamber[2];
    struct random_stream random;
    bool clears;
    int64_t clear_after_us; /* of the fault that latched */
};

/* --- the simulated board */

static int64_t start_bench(void *context, const struct plant_parameters *plant, uint64_t seed) {
    struct trial_place *place = context;
    struct bench *bench = &place->bench;
    bench_init(bench, place->plant_table, &place->table, place->image, plant, seed);
    while (!bench_is_safe(bench) && bench->sim.time_us < EARLIEST_US) {
        bench_step(bench, NULL);
    }
    return bench->sim.time_us;
}

static void inject_bench(void *context, const struct injection *injection, size_t chamber, struct random_stream *random) {
    struct trial_place *place = context;
    injection->apply(&place->bench, chamber, random);
}

static void step_bench(void *context, const struct controller_command *command) {
    struct trial_place *place = context;
    bench_step(&place->bench, command);
}

static void sample_bench(void *context, struct oracle_sample *sample) {
    const struct trial_place *place = context;
    bench_sample(&place->bench, sample);
}

static void finish_bench(void *context) {
    struct trial_place *place = context;
    bench_finish(&place->bench);
}

bool trial_place_open(struct trial_place *place, const struct bend_table *table) {
    memset(place, 0, sizeof *place);
    place->plant_table = table;
    place->vehicle = (struct vehicle){.context = place,
                                      .start = start_bench,
                                      .inject = inject_bench,
                                      .step = step_bench,
                                      .sample = sample_bench,
                                      .finish = finish_bench};
    place->image = aligned_alloc(16, (table->image_bytes + 15u) / 16u * 16u);
    place->flown_pa = calloc(FLIGHT_STEPS, 3 * sizeof place->flown_pa[0]);
    place->twin_pa = calloc(FLIGHT_STEPS, 3 * sizeof place->twin_pa[0]);
    if (place->image == NULL || place->flown_pa == NULL || place->twin_pa == NULL) {
        return false;
    }
    memcpy(place->image, table->image, table->image_bytes);
    return bend_table_open(&place->table, place->image, table->image_bytes, NULL) == BEND_TABLE_OK;
}

void trial_place_close(struct trial_place *place) {
    free(place->image);
    free(place->flown_pa);
    free(place->twin_pa);
}

static double between(struct random_stream *random, double least, double most) {
    return least + (most - least) * random_uniform(random);
}

static void write_script(struct script *script, uint64_t seed) {
    struct random_stream *random = &script->random;
    random_seed(random, seed, STREAM);
    script->at_us[0] = 1000 * (int64_t)between(random, 1e-3 * EARLIEST_US, 1e-3 * LATEST_US);
    script->at_us[1] = script->at_us[0] + 1000 * (int64_t)between(random, 0.0, 1e-3 * APART_MOST_US);
    for (size_t i = 0; i < 2; i++) {
        script->chamber[i] = (size_t)between(random, 0.0, 3.0);
    }
    script->clears = random_uniform(random) * CLEARS_ONE_IN < 1.0;
    script->clear_after_us = 1000 * (int64_t)between(random, 100.0, 3000.0);
}

/* The command of this step, if there is one: the mission's, but for an operator who clears. */
static bool next_command(const struct mission *mission, const struct script *script, int64_t time_us, int64_t latched_at_us,
                         struct controller_command *command) {
    if (script->clears && latched_at_us != ORACLE_NEVER) {
        const int64_t since_us = time_us - latched_at_us - script->clear_after_us;
        if (since_us == 0) {
            *command = (struct controller_command){.kind = COMMAND_CLEAR};
            return true;
        }
        if (since_us > 0 && since_us < QUIET_US) {
            return false;
        }
    }
    return mission_command(mission, time_us, command);
}

static bool is_over(const struct oracle *oracle, bool clears, int64_t time_us) {
    return !clears && oracle->vented_us != ORACLE_NEVER && time_us > oracle->fault_us + oracle->vented_us + AFTER_US;
}

static void inject(const struct vehicle *vehicle, const struct trial *trial, struct script *script, int64_t at_us) {
    for (size_t i = 0; i < 2; i++) {
        if (trial->injection[i] != TRIAL_NONE && at_us == script->at_us[i]) {
            vehicle->inject(vehicle->context, injection_at(trial->injection[i]), script->chamber[i], &script->random);
        }
    }
}

static void fly(const struct trial_place *place, const struct plant_parameters *plant, const struct trial *trial,
                struct oracle *oracle, double *flown_pa) {
    const struct vehicle *vehicle = &place->vehicle;
    struct script script;
    struct mission mission;
    struct oracle_sample sample;
    const struct bend_table_module *module = &place->plant_table->module;
    const struct oracle_limits limits = {(double)module->working_pressure_pa, (double)module->burst_pressure_pa};
    write_script(&script, trial->seed);
    mission_random(&mission, module, trial->seed);
    const int64_t start_us = vehicle->start(vehicle->context, plant, trial->seed);
    const bool nothing = trial->injection[0] == TRIAL_NONE;
    oracle_init(oracle, &limits, start_us + (nothing ? MISSION_LENGTH_US : script.at_us[0]));
    int64_t latched_at_us = ORACLE_NEVER;
    for (int64_t at_us = 0; at_us < MISSION_LENGTH_US; at_us += CONTROLLER_STEP_US) {
        struct controller_command command;
        inject(vehicle, trial, &script, at_us);
        const bool sends = next_command(&mission, &script, at_us, latched_at_us, &command);
        vehicle->step(vehicle->context, sends ? &command : NULL);
        vehicle->sample(vehicle->context, &sample);
        oracle_add(oracle, &sample);
        latched_at_us = latched_at_us == ORACLE_NEVER && sample.faults != 0u ? at_us : latched_at_us;
        memcpy(&flown_pa[3 * (at_us / CONTROLLER_STEP_US)], sample.pressure_pa, sizeof sample.pressure_pa);
        if (is_over(oracle, script.clears, sample.time_us)) {
            break;
        }
    }
    vehicle->finish(vehicle->context);
}

/* How far from anything that the twin's chamber had within a short time before or after. */
static double apart_at(const double *twin_pa, int step, size_t c, double pressure_pa) {
    const int from = step > TRIAL_APART_STEPS ? step - TRIAL_APART_STEPS : 0;
    const int to = step + TRIAL_APART_STEPS < FLIGHT_STEPS ? step + TRIAL_APART_STEPS : FLIGHT_STEPS - 1;
    double least_pa = INFINITY, most_pa = -INFINITY;
    for (int i = from; i <= to; i++) {
        least_pa = fmin(least_pa, twin_pa[3 * (size_t)i + c]);
        most_pa = fmax(most_pa, twin_pa[3 * (size_t)i + c]);
    }
    return fmax(fmax(pressure_pa - most_pa, least_pa - pressure_pa), 0.0);
}

static double apart(const struct trial_place *place) {
    double most_pa = 0.0;
    for (int step = 0; step < FLIGHT_STEPS; step++) {
        for (size_t c = 0; c < 3; c++) {
            most_pa = fmax(most_pa, apart_at(place->twin_pa, step, c, place->flown_pa[3 * (size_t)step + c]));
        }
    }
    return most_pa;
}

static uint32_t warnings_of(const struct trial *trial) {
    uint32_t warnings = 0u;
    for (size_t i = 0; i < 2; i++) {
        warnings |= trial->injection[i] != TRIAL_NONE ? injection_at(trial->injection[i])->warnings : 0u;
    }
    return warnings;
}

void trial_run(struct trial_place *place, const struct plant_parameters *plant, const struct trial *trial,
               struct trial_result *result) {
    const struct trial sound = {.seed = trial->seed, .injection = {TRIAL_NONE, TRIAL_NONE}};
    struct script script;
    struct oracle twin;
    memset(result, 0, sizeof *result);
    write_script(&script, trial->seed);
    memcpy(result->fault_us, script.at_us, sizeof result->fault_us);
    memcpy(result->chamber, script.chamber, sizeof result->chamber);
    result->cleared = script.clears;
    fly(place, plant, trial, &result->oracle, place->flown_pa);
    const int64_t warned_us = oracle_warned_us(&result->oracle, warnings_of(trial));
    result->false_alarm = result->oracle.faults_before != 0u;
    result->seen_us = warned_us;
    if (result->oracle.latched_us != ORACLE_NEVER) {
        result->end = TRIAL_LATCHED;
        const int64_t latched_us = result->oracle.latched_us;
        result->seen_us = warned_us == ORACLE_NEVER || latched_us < warned_us ? latched_us : warned_us;
        return;
    }
    if (warned_us != ORACLE_NEVER || trial->injection[0] == TRIAL_NONE) {
        result->end = TRIAL_WARNED;
        return;
    }
    const bool only_down = !result->oracle.moved && result->oracle.highest_pa < result->oracle.first_pa + FALLING_PA;
    if (!only_down) {
        fly(place, plant, &sound, &twin, place->twin_pa);
        result->apart_pa = apart(place);
    }
    result->end = result->apart_pa < TRIAL_APART_PA ? TRIAL_HARMLESS : TRIAL_UNDETECTED;
}
