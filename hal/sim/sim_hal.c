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
    random_seed(&sim->fault_random, seed, 6);
}

bool sim_add_effect(struct sim *sim, const struct effect *effect) {
    return plant_add_effect(&sim->plant, effect);
}

static float scatter(struct sim *sim, double most) {
    return (float)(most * (2.0 * random_uniform(&sim->fault_random) - 1.0));
}

static void spoil_tip(struct sim *sim, struct hal_tip_sample *sample) {
    const struct sim_faults *faults = &sim->faults;
    if (faults->tip_stands) {
        const int64_t measured_us = sample->measured_us;
        *sample = sim->tip_shown;
        sample->measured_us = measured_us;
    }
    if (faults->tip_scatters) {
        double norm = 0.0;
        for (size_t i = 0; i < 4; i++) {
            sample->quaternion[i] = scatter(sim, 1.0);
            norm += (double)sample->quaternion[i] * (double)sample->quaternion[i];
        }
        for (size_t i = 0; i < 4; i++) {
            sample->quaternion[i] = (float)((double)sample->quaternion[i] / sqrt(norm));
        }
        for (size_t i = 0; i < 3; i++) {
            sample->position_m[i] = scatter(sim, 0.1);
        }
    }
    sample->position_m[0] += (float)faults->tip_away_m;
    sample->status |= faults->tip_status;
    sim->tip_shown = *sample;
}

/* The body is quasi-static: it is only looked up when a sample is taken, with effects stepping over the time between. */
static void sample_tip(struct sim *sim) {
    struct hal_tip_sample sample;
    plant_sample_tip(&sim->plant, NULL, 1e-6 * (double)sim->time_us,
                     1e-6 * (double)sim->parameters.sensor.tip_period_us, random_uniform(&sim->chance_random));
    sensor_tip(&sim->parameters.sensor, &sim->plant.pose, sim->time_us, &sim->tip_random, &sample);
    if (sim->plant.tip_repeats) {
        memcpy(sample.position_m, sim->tip_measured.position_m, sizeof sample.position_m);
        memcpy(sample.quaternion, sim->tip_measured.quaternion, sizeof sample.quaternion);
    }
    sim->tip_measured = sample;
    if (sim->faults.tip_stops) {
        return;
    }
    spoil_tip(sim, &sample);
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

void sim_reset(struct sim *sim) {
    sim->reset = true;
    sim->outputs = (struct hal_outputs){.valves_enabled = false};
    for (size_t c = 0; c < 3; c++) {
        valve_cut(&sim->plant.valve[c], &sim->parameters.plant.valve, sim->time_us);
    }
}

void sim_restart(struct sim *sim) {
    sim->reset = false;
    sim->written_us = sim->time_us;
}

static void watch_dog(struct sim *sim) {
    const int64_t most_us = sim->parameters.watchdog_us;
    if (most_us > 0 && !sim->reset && sim->time_us - sim->written_us >= most_us) {
        sim->faults.health.watchdog_reset = true;
        sim_reset(sim);
    }
}

static void step(struct sim *sim) {
    watch_dog(sim);
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

/* What the sensor stands at, before its own noise, steps and limits. */
static double spoil_pressure(struct sim *sim, size_t c) {
    const struct sim_faults *faults = &sim->faults;
    const size_t from = faults->readings_exchanged && c < 2 ? 1 - c : c;
    sim->drifted_pa[c] += faults->reading_drift_paps[c] * 1e-6 * (double)sim->parameters.step_us;
    double pressure_pa = sim->plant.reading_pa[from] * (1.0 + faults->reading_gain[c]) + sim->drifted_pa[c];
    if (faults->noise_added_pa[c] > 0.0) {
        pressure_pa += faults->noise_added_pa[c] * random_normal(&sim->fault_random);
    }
    return pressure_pa;
}

static bool hal_read_pressures(void *context, struct hal_pressures *pressures) {
    struct sim *sim = context;
    if (sim->faults.pressure_bus_fails) {
        return false;
    }
    for (size_t c = 0; c < 3; c++) {
        const double reading_pa =
            sensor_pressure(&sim->parameters.sensor, spoil_pressure(sim, c), &sim->pressure_random[c]);
        sim->shown_pa[c] = sim->faults.reading_stands[c] ? sim->shown_pa[c] : (float)reading_pa;
        pressures->chamber_pa[c] = sim->faults.reading_replaced[c] ? sim->faults.reading_pa[c] : sim->shown_pa[c];
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
    if (sim->faults.outputs_fail || sim->reset) {
        return false;
    }
    sim->outputs = *outputs;
    sim->written_us = sim->time_us;
    for (size_t c = 0; c < 3 && !outputs->valves_enabled; c++) {
        valve_cut(&sim->plant.valve[c], &sim->parameters.plant.valve, sim->time_us);
    }
    return true;
}

static void hal_read_health(void *context, struct hal_health *health) {
    *health = ((const struct sim *)context)->faults.health;
}

void sim_bind(struct sim *sim, struct hal *hal) {
    *hal = (struct hal){.context = sim,
                        .time_us = hal_time_us,
                        .read_pressures = hal_read_pressures,
                        .read_tip = hal_read_tip,
                        .write_outputs = hal_write_outputs,
                        .read_health = hal_read_health};
}
