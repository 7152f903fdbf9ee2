#include "sim/sim_hal.h"

#include <math.h>
#include <string.h>

void sim_default_parameters(struct sim_parameters *parameters) {
    *parameters = (struct sim_parameters){.sensor = {.pressure_noise_pa = 150.0,
                                                     .pressure_range_pa = 50000.0,
                                                     .pressure_step_pa = 50000.0 / 4095.0,
                                                     .tip_period_us = 10000,
                                                     .tip_delay_us = 10000,
                                                     .tip_position_noise_m = 2e-5,
                                                     .tip_angle_noise_rad = 0.012 * M_PI / 180.0,
                                                     .tip_position_step_m = 1.1e-4,
                                                     .tip_angle_step_rad = 0.022 * M_PI / 180.0},
                                          .step_us = 1000};
    plant_default_parameters(&parameters->plant);
}

void sim_init(struct sim *sim, const struct bend_table *table, const struct sim_parameters *parameters, uint64_t seed) {
    memset(sim, 0, sizeof *sim);
    sim->table = table;
    sim->parameters = *parameters;
    plant_init(&sim->plant, table, &parameters->plant);
    for (uint64_t c = 0; c < 3; c++) {
        random_seed(&sim->pressure_random[c], seed, 1 + c);
    }
    random_seed(&sim->tip_random, seed, 4);
    random_seed(&sim->chance_random, seed, 5);
}

bool sim_add_effect(struct sim *sim, const struct effect *effect) {
    return plant_add_effect(&sim->plant, effect);
}

/* The body is quasi-static: it is only looked up when a sample is taken, with effects stepping over the time between. */
static void sample_tip(struct sim *sim) {
    struct hal_tip_sample sample;
    plant_sample_tip(&sim->plant, NULL, 1e-6 * (double)sim->time_us,
                     1e-6 * (double)sim->parameters.sensor.tip_period_us, random_uniform(&sim->chance_random));
    sensor_tip(&sim->parameters.sensor, &sim->plant.pose, sim->time_us, &sim->tip_random, &sample);
    if (sim->faults.tip_stops) {
        return;
    }
    if (sim->queued == SIM_TIP_QUEUE) {
        memmove(&sim->queue[0], &sim->queue[1], (SIM_TIP_QUEUE - 1) * sizeof sim->queue[0]);
        sim->queued--;
        sim->tip_dropped++;
    }
    sim->queue[sim->queued++] = sample;
}

static void start_periods(struct sim *sim) {
    double duty[3] = {0.0, 0.0, 0.0};
    for (size_t c = 0; c < 3 && sim->outputs.valves_enabled; c++) {
        duty[c] = (double)sim->outputs.duty[c];
    }
    plant_start_period(&sim->plant, sim->time_us, duty);
}

static void step(struct sim *sim) {
    const int64_t to_us = sim->time_us + sim->parameters.step_us;
    plant_step(&sim->plant, sim->outputs.supply_enabled, sim->time_us, to_us);
    sim->time_us = to_us;
    if (to_us % sim->parameters.plant.valve.period_us == 0) {
        start_periods(sim);
    }
    if (to_us % sim->parameters.sensor.tip_period_us == 0) {
        sample_tip(sim);
    }
}

void sim_advance(struct sim *sim, int64_t duration_us) {
    for (int64_t done_us = 0; done_us < duration_us; done_us += sim->parameters.step_us) {
        step(sim);
    }
}

/* --- behind hal.h --- */

static int64_t hal_time_us(void *context) {
    return ((const struct sim *)context)->time_us;
}

static bool hal_read_pressures(void *context, struct hal_pressures *pressures) {
    struct sim *sim = context;
    if (sim->faults.pressure_bus_fails) {
        return false;
    }
    for (size_t c = 0; c < 3; c++) {
        const double reading_pa =
            sensor_pressure(&sim->parameters.sensor, sim->plant.reading_pa[c], &sim->pressure_random[c]);
        pressures->chamber_pa[c] = sim->faults.reading_replaced[c] ? sim->faults.reading_pa[c] : (float)reading_pa;
        pressures->chamber_ok[c] = !sim->faults.channel_fails[c];
    }
    pressures->supply_pa = (float)sim->plant.influence.supply_pa;
    pressures->supply_ok = !sim->faults.supply_unknown;
    return true;
}

static bool hal_read_tip(void *context, struct hal_tip_sample *sample) {
    struct sim *sim = context;
    if (sim->queued == 0 || sim->queue[0].measured_us + sim->parameters.sensor.tip_delay_us > sim->time_us) {
        return false;
    }
    *sample = sim->queue[0];
    sim->queued--;
    memmove(&sim->queue[0], &sim->queue[1], sim->queued * sizeof sim->queue[0]);
    return true;
}

static bool hal_write_outputs(void *context, const struct hal_outputs *outputs) {
    struct sim *sim = context;
    if (sim->faults.outputs_fail) {
        return false;
    }
    sim->outputs = *outputs;
    for (size_t c = 0; c < 3 && !outputs->valves_enabled; c++) {
        valve_cut(&sim->plant.valve[c], &sim->parameters.plant.valve, sim->time_us);
    }
    return true;
}

void sim_bind(struct sim *sim, struct hal *hal) {
    *hal = (struct hal){.context = sim,
                        .time_us = hal_time_us,
                        .read_pressures = hal_read_pressures,
                        .read_tip = hal_read_tip,
                        .write_outputs = hal_write_outputs};
}
