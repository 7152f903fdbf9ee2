#include "campaign/bench.h"

#include <string.h>

#define WATCHDOG_US 20000
#define STREAM 72 /* of random numbers */

static int64_t tap_time_us(void *context) {
    struct bench *bench = context;
    bench->clock_us = bench->clock_stands ? bench->clock_us : bench->hal.time_us(bench->hal.context);
    return bench->clock_us;
}

static bool tap_read_pressures(void *context, struct hal_pressures *pressures) {
    struct bench *bench = context;
    return bench->hal.read_pressures(bench->hal.context, pressures);
}

static bool tap_read_tip(void *context, struct hal_tip_sample *sample) {
    struct bench *bench = context;
    return bench->hal.read_tip(bench->hal.context, sample);
}

static bool tap_write_outputs(void *context, const struct hal_outputs *outputs) {
    struct bench *bench = context;
    return bench->hal.write_outputs(bench->hal.context, outputs);
}

static void tap_read_health(void *context, struct hal_health *health) {
    struct bench *bench = context;
    bench->hal.read_health(bench->hal.context, health);
}

void bench_init(struct bench *bench, const struct bend_table *plant_table, const struct bend_table *table, uint8_t *image,
                const struct plant_parameters *plant, uint64_t seed) {
    struct sim_parameters sim;
    memset(bench, 0, sizeof *bench);
    sim_default_parameters(&sim);
    sim.plant = *plant;
    sim.watchdog_us = WATCHDOG_US;
    sim_init(&bench->sim, plant_table, &sim, seed);
    sim_bind(&bench->sim, &bench->hal);
    bench->tapped = (struct hal){.context = bench,
                                 .time_us = tap_time_us,
                                 .read_pressures = tap_read_pressures,
                                 .read_tip = tap_read_tip,
                                 .write_outputs = tap_write_outputs,
                                 .read_health = tap_read_health};
    bench->table = table;
    bench->image = image;
    bench->flipped_byte = table->image_bytes;
    random_seed(&bench->random, seed, STREAM);
    controller_default_parameters(&bench->parameters, table);
    app_init(&bench->app, &bench->tapped, table, &bench->parameters);
}

void bench_finish(struct bench *bench) {
    if (bench->flipped_byte < bench->table->image_bytes) {
        bench->image[bench->flipped_byte] ^= bench->flipped_bits;
    }
}

static void restart(struct bench *bench) {
    sim_restart(&bench->sim);
    bench->sim.faults.outputs_fail = false; /* what latched up is gone with the reset */
    bench->clock_stands = false;
    bench->leave_out_every = 0;
    bench->steps_left_out = 0;
    app_init(&bench->app, &bench->tapped, bench->table, &bench->parameters);
}

static bool left_out(struct bench *bench) {
    bench->steps++;
    if (bench->steps_left_out > 0) {
        bench->steps_left_out--;
        return true;
    }
    return bench->leave_out_every > 0 && bench->steps % bench->leave_out_every == 0;
}

void bench_step(struct bench *bench, const struct controller_command *command) {
    const bool in_reset = bench->sim.reset;
    if (!in_reset) {
        bench->reset_us = bench->sim.time_us;
    } else if (bench->sim.time_us - bench->reset_us >= BENCH_RESET_US) {
        restart(bench);
    }
    if (command != NULL && !bench->commands_stop) {
        app_command(&bench->app, command);
    }
    if (!bench->sim.reset && !left_out(bench)) {
        (void)app_step(&bench->app); /* a latched fault shows in the status */
    }
    sim_advance(&bench->sim, CONTROLLER_STEP_US);
}

void bench_sample(const struct bench *bench, struct oracle_sample *sample) {
    const struct sim *sim = &bench->sim;
    const struct controller_status *status = &bench->app.controller.status;
    *sample = (struct oracle_sample){.time_us = sim->time_us,
                                     .faults = status->faults,
                                     .warnings = status->warnings,
                                     .air_may_flow = sim->outputs.valves_enabled || sim->outputs.supply_enabled,
                                     .moves = sim->outputs.valves_enabled};
    memcpy(sample->pressure_pa, sim->plant.pressure_pa, sizeof sample->pressure_pa);
}

bool bench_is_safe(const struct bench *bench) {
    return bench->app.controller.status.state == SUPERVISOR_SAFE;
}

void bench_reset(struct bench *bench) {
    sim_reset(&bench->sim);
    bench->reset_us = bench->sim.time_us;
}

static size_t any_below(struct bench *bench, size_t count) {
    return (size_t)(random_uniform(&bench->random) * (double)count);
}

void bench_flip_table(struct bench *bench) {
    if (bench->flipped_byte < bench->table->image_bytes) {
        return; /* once a mission */
    }
    const size_t covered = 16; /* magic and check-sum itself are read at start only */
    bench->flipped_byte = covered + any_below(bench, bench->table->image_bytes - covered);
    bench->flipped_bits = (uint8_t)(1u << any_below(bench, 8));
    bench->image[bench->flipped_byte] ^= bench->flipped_bits;
}

void bench_flip_parameters(struct bench *bench) {
    struct controller *controller = &bench->app.controller;
    const size_t first = sizeof controller->parameters, both = first + sizeof controller->loop_parameters;
    const size_t byte = any_below(bench, both);
    uint8_t *at = byte < first ? (uint8_t *)&controller->parameters + byte
                               : (uint8_t *)controller->loop_parameters + (byte - first);
    *at = (uint8_t)(*at ^ (1u << any_below(bench, 8)));
}
