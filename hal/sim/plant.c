#include "sim/plant.h"

#include <math.h>
#include <string.h>

void plant_default_parameters(struct plant_parameters *parameters) {
    *parameters = (struct plant_parameters){.gas = {.ambient_pa_abs = 101325.0,
                                                    .temperature_k = 293.15,
                                                    .gas_constant = 287.0,
                                                    .sonic_conductance = 2e-10,
                                                    .reference_density_kgpm3 = 1.185,
                                                    .critical_ratio = 0.3,
                                                    .tube_volume_m3 = 2e-6,
                                                    .stiffness_scale = 1.0},
                                            .valve = {.period_us = 10000, .open_delay_us = 1500, .close_delay_us = 1000},
                                            .supply_pa = 40000.0};
}

#define RELIEF_CONDUCTANCE 4e-10 /* full open: twice a valve's */
#define RELIEF_OPENS_OVER_PA 500.0

/* A relief valve opens in proportion from its opening pressure on. */
static double relief(double opening_pa, double pressure_pa) {
    const double over = opening_pa > 0.0 ? (pressure_pa - opening_pa) / RELIEF_OPENS_OVER_PA : 0.0;
    return RELIEF_CONDUCTANCE * fmin(fmax(over, 0.0), 1.0);
}

static void scale_flow(struct chamber_influence *influence, size_t c, double fill, double vent) {
    if (fill == 1.0 && vent == 1.0) {
        return; /* not a bit of a sound plant changes */
    }
    const double vented = influence->conductance_scale[c] + influence->vent_scale_change[c];
    influence->conductance_scale[c] *= fill;
    influence->vent_scale_change[c] = vented * vent - influence->conductance_scale[c];
}

/* On top of what effects do. */
static void add_faults(struct plant *plant) {
    struct chamber_influence *influence = &plant->influence;
    const struct plant_parameters *parameters = &plant->parameters;
    const struct plant_faults *faults = &plant->faults;
    const double pace = 1.0 + faults->clock_slow;
    influence->rail_vents = parameters->shut_off_vents;
    influence->supply_pa = faults->supply_replaced ? faults->supply_pa : influence->supply_pa;
    if (parameters->supply_relief_pa > 0.0) {
        influence->supply_pa = fmin(influence->supply_pa, parameters->supply_relief_pa);
    }
    for (size_t c = 0; c < 3; c++) {
        scale_flow(influence, c, pace * (1.0 - faults->fill_lost[c]), pace * (1.0 - faults->vent_lost[c]));
        influence->leak_conductance[c] += faults->leak_conductance[c];
        influence->leak_conductance[c] += relief(parameters->relief_pa, plant->chambers.pressure_pa[c]);
        influence->leak_conductance[c] *= pace;
    }
}

static void reset_influence(struct plant *plant) {
    plant->influence =
        (struct chamber_influence){.conductance_scale = {1.0, 1.0, 1.0}, .supply_pa = plant->parameters.supply_pa};
}

void plant_init(struct plant *plant, const struct bend_table *table, const struct plant_parameters *parameters) {
    memset(plant, 0, sizeof *plant);
    plant->table = table;
    plant->parameters = *parameters;
    plant->temperature_k = NAN;
    chambers_init(&plant->chambers, &parameters->gas, table);
    for (size_t c = 0; c < 3; c++) {
        valve_init(&plant->valve[c]);
    }
    reset_influence(plant);
    body_shape_of(table, &plant->chambers, &plant->shape);
    body_tip_pose(&table->module, &plant->shape, &plant->pose);
}

bool plant_add_effect(struct plant *plant, const struct effect *effect) {
    if (plant->effect_count == PLANT_EFFECTS_MAX) {
        return false;
    }
    plant->effect[plant->effect_count++] = *effect;
    plant->ages_tip = plant->ages_tip || effect->kind->age_s != NULL;
    return true;
}

static struct effect_signals signals_at(struct plant *plant, double time_s, double step_s) {
    return (struct effect_signals){.time_s = time_s,
                                   .step_s = step_s,
                                   .temperature_k = plant->temperature_k,
                                   .chance = 1.0,
                                   .table = plant->table,
                                   .stiffness_scale = plant->parameters.gas.stiffness_scale,
                                   .pressure_pa = plant->pressure_pa,
                                   .supply_flow_kgps = plant->chambers.supply_flow_kgps};
}

void plant_start_period(struct plant *plant, int64_t time_us, const double duty[3]) {
    double changed[3] = {duty[0], duty[1], duty[2]}, late_s[3] = {0.0, 0.0, 0.0};
    struct effect_signals signals =
        signals_at(plant, 1e-6 * (double)time_us, 1e-6 * (double)plant->parameters.valve.period_us);
    signals.duty = changed;
    signals.late_s = late_s;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_COMMAND, &signals);
    for (size_t c = 0; c < 3; c++) {
        valve_start_period(&plant->valve[c], &plant->parameters.valve, time_us, llround(1e6 * late_s[c]), changed[c]);
    }
}

/* --- old poses --- */

/* The newest entry gives way to the next while it is too near the one before. */
static void remember(struct plant *plant, double time_s) {
    struct plant_past *past = &plant->past;
    const size_t before = (past->newest + PLANT_PAST - 1) % PLANT_PAST;
    if (past->count < 2 || past->time_s[past->newest] - past->time_s[before] >= PLANT_PAST_SPACING_S) {
        past->newest = past->count > 0 ? (past->newest + 1) % PLANT_PAST : 0;
        past->count += past->count < PLANT_PAST;
    }
    past->time_s[past->newest] = time_s;
    memcpy(past->pressure_pa[past->newest], plant->pressure_pa, sizeof plant->pressure_pa);
}

/* From before it began: as it then was. */
static void recall(const struct plant *plant, double time_s, double pressure_pa[3]) {
    const struct plant_past *past = &plant->past;
    size_t after = past->newest, at = past->newest;
    for (size_t back = 1; back < past->count && past->time_s[at] > time_s; back++) {
        after = at;
        at = (at + PLANT_PAST - 1) % PLANT_PAST;
    }
    const double length_s = past->time_s[after] - past->time_s[at];
    const double share = length_s > 0.0 ? fmin(fmax((time_s - past->time_s[at]) / length_s, 0.0), 1.0) : 0.0;
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = past->pressure_pa[at][c] + share * (past->pressure_pa[after][c] - past->pressure_pa[at][c]);
    }
}

static void recall_or_now(const struct plant *plant, double time_s, double age_s, double pressure_pa[3]) {
    memcpy(pressure_pa, plant->pressure_pa, sizeof plant->pressure_pa);
    if (age_s > 0.0) {
        recall(plant, time_s - age_s, pressure_pa);
    }
}

void plant_step(struct plant *plant, bool supply_open, int64_t from_us, int64_t to_us) {
    struct effect_signals signals = signals_at(plant, 1e-6 * (double)from_us, 1e-6 * (double)(to_us - from_us));
    reset_influence(plant);
    signals.influence = &plant->influence;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_GAS, &signals);
    add_faults(plant);
    chambers_step(&plant->chambers, &plant->parameters.gas, plant->table, plant->valve, &plant->influence,
                  supply_open || plant->parameters.no_shut_off, from_us, to_us);
    for (size_t c = 0; c < 3; c++) {
        plant->pressure_pa[c] = plant->chambers.pressure_pa[c];
        for (size_t d = 0; d < 3; d++) {
            plant->pressure_pa[c] += plant->influence.coupling[c][d] * plant->chambers.pressure_pa[d];
        }
    }
    if (plant->ages_tip) {
        remember(plant, 1e-6 * (double)to_us);
    }
    memcpy(plant->reading_pa, plant->pressure_pa, sizeof plant->reading_pa);
    signals = signals_at(plant, 1e-6 * (double)to_us, 1e-6 * (double)(to_us - from_us));
    signals.reading_pa = plant->reading_pa;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_READING, &signals);
}

void plant_sample_tip(struct plant *plant, const double *pressure_pa, double time_s, double step_s, double chance) {
    const double scale = plant->parameters.gas.stiffness_scale;
    /* beyond the snap its own past is not told by pressures: there the pose hook has to do */
    const bool aged = pressure_pa == NULL && plant->past.count > 0 && plant->chambers.ballooned == CHAMBERS_NONE;
    const double age_s = aged ? effects_age_s(plant->effect, plant->effect_count, time_s) : 0.0;
    double past_pa[3];
    recall_or_now(plant, time_s, age_s, past_pa);
    const double *pressure = pressure_pa != NULL ? pressure_pa : past_pa;
    double load_pa[3] = {pressure[0] / scale, pressure[1] / scale, pressure[2] / scale};
    struct effect_signals signals = signals_at(plant, fmax(time_s - age_s, fmin(time_s, 0.0)), step_s);
    signals.aged = aged;
    signals.chance = chance;
    signals.pressure_pa = pressure;
    signals.load_pa = load_pa;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_LOAD, &signals);
    if (pressure_pa == NULL && plant->chambers.ballooned != CHAMBERS_NONE) {
        body_shape_of(plant->table, &plant->chambers, &plant->shape); /* beyond the snap the pressures alone say nothing */
    } else {
        body_shape_at(plant->table, load_pa, &plant->shape);
    }
    signals.shape = &plant->shape;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_SHAPE, &signals);
    body_tip_pose(&plant->table->module, &plant->shape, &plant->pose);
    signals.pose = &plant->pose;
    effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_POSE, &signals);
    plant->tip_repeats = signals.repeats;
}
