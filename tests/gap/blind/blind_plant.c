#include "blind_plant.h"

#include <math.h>
#include <string.h>

#include "blind_effect.h"

#define SUPPLY_PA 40000.0
#define CRITICAL_RATIO 0.3
#define OPEN_DELAY_US 1500
#define CLOSE_DELAY_US 1000
#define TIP_AGE_US 10000

/* --- valves --- */

static struct blind_opening *last_opening(struct blind_plant *plant, size_t c) {
    return &plant->opening[c][BLIND_OPENINGS - 1];
}

/* The oldest opening is forgotten: it ended long ago, as each period makes at most one. */
static void add_opening(struct blind_plant *plant, size_t c, int64_t from_us, int64_t to_us) {
    memmove(&plant->opening[c][0], &plant->opening[c][1], (BLIND_OPENINGS - 1) * sizeof plant->opening[c][0]);
    *last_opening(plant, c) = (struct blind_opening){from_us, to_us};
}

/* A coil that is energised again before its valve has closed keeps it open; a pulse shorter than the valve needs to open
 * moves nothing. */
static void drive_valve(struct blind_plant *plant, size_t c, const struct blind_pulse *pulse) {
    const int64_t on_us = llround(fmin(fmax(pulse->duty, 0.0), 1.0) * BLIND_PERIOD_US);
    const int64_t from_us = plant->time_us + pulse->delay_us, off_us = from_us + on_us;
    struct blind_opening *last = last_opening(plant, c);
    if (on_us > 0 && last->to_us > from_us) {
        last->to_us = off_us + pulse->close_delay_us;
    } else if (on_us > pulse->open_delay_us) {
        add_opening(plant, c, from_us + pulse->open_delay_us, off_us + pulse->close_delay_us);
    }
}

static void start_period(struct blind_plant *plant) {
    struct blind_pulse pulse[3];
    for (size_t c = 0; c < 3; c++) {
        pulse[c] = (struct blind_pulse){plant->duty[c], 0, OPEN_DELAY_US, CLOSE_DELAY_US};
    }
    for (size_t i = 0; i < plant->effects; i++) {
        if (plant->effect[i]->kind->command != NULL) {
            plant->effect[i]->kind->command(plant->effect[i], plant, pulse);
        }
    }
    for (size_t c = 0; c < 3; c++) {
        drive_valve(plant, c, &pulse[c]);
    }
}

/* Whether chamber `c` fills now; brings `until_us` forward to the valve's next switching. */
static bool fills_now(const struct blind_plant *plant, size_t c, int64_t *until_us) {
    bool fills = false;
    for (size_t k = 0; k < BLIND_OPENINGS; k++) {
        const struct blind_opening *opening = &plant->opening[c][k];
        const bool inside = plant->time_us >= opening->from_us && plant->time_us < opening->to_us;
        const int64_t edge_us = inside ? opening->to_us : opening->from_us;
        fills = fills || inside;
        if (edge_us > plant->time_us && edge_us < *until_us) {
            *until_us = edge_us;
        }
    }
    return fills;
}

/* --- gas and pressure sensors, every millisecond --- */

static void set_ports(struct blind_plant *plant) {
    plant->ports = (struct blind_ports){.supply_pa = SUPPLY_PA * plant->nominal.supply_scale,
                                        .flow_scale = {1.0, 1.0, 1.0},
                                        .critical_ratio = {CRITICAL_RATIO, CRITICAL_RATIO, CRITICAL_RATIO}};
    for (size_t i = 0; i < plant->effects; i++) {
        if (plant->effect[i]->kind->ports != NULL) {
            plant->effect[i]->kind->ports(plant->effect[i], plant, &plant->ports);
        }
    }
}

static void true_pressures(struct blind_plant *plant, double pressure_pa[3]) {
    memcpy(pressure_pa, plant->state, 3 * sizeof pressure_pa[0]);
    for (size_t i = 0; i < plant->effects; i++) {
        if (plant->effect[i]->kind->pressure != NULL) {
            plant->effect[i]->kind->pressure(plant->effect[i], plant, pressure_pa);
        }
    }
}

static void read_pressures(struct blind_plant *plant) {
    true_pressures(plant, plant->reading_pa);
    for (size_t i = 0; i < plant->effects; i++) {
        if (plant->effect[i]->kind->reading != NULL) {
            plant->effect[i]->kind->reading(plant->effect[i], plant, plant->reading_pa);
        }
    }
}

/* --- body and tip sensor, at every sample --- */

static double rubber_area_m2(struct blind_plant *plant) {
    const struct bend_table_module *module = &plant->field->table->module;
    const double none[3] = {0.0, 0.0, 0.0};
    double area_m2[3] = {0.0, 0.0, 0.0};
    plant->failed = !blind_field_at(plant->field, none, BLIND_VOLUME_1, 3, area_m2, NULL) || plant->failed;
    return 0.25 * M_PI * (double)module->outer_diameter_m * (double)module->outer_diameter_m - area_m2[0] - area_m2[1] -
           area_m2[2];
}

static void look_up_body(struct blind_plant *plant) {
    const double step_s = 1e-6 * (double)plant->tip_period_us;
    struct blind_shape *shape = &plant->shape;
    *shape = (struct blind_shape){.stretch = 1.0, .active_share = 1.0};
    true_pressures(plant, plant->load_pa);
    for (size_t c = 0; c < 3; c++) {
        plant->load_pa[c] /= plant->nominal.stiffness_scale;
    }
    for (size_t i = 0; i < plant->effects; i++) {
        if (plant->effect[i]->kind->load != NULL) {
            plant->effect[i]->kind->load(plant->effect[i], plant, plant->load_pa);
        }
    }
    plant->failed = !blind_field_bend(plant->field, plant->load_pa, shape->bend_rad, &shape->stretch) || plant->failed;
    for (size_t i = 0; i < plant->effects; i++) {
        if (plant->effect[i]->kind->shape != NULL) {
            plant->effect[i]->kind->shape(plant->effect[i], plant, step_s, shape);
        }
    }
    blind_body_pose(&plant->field->table->module, rubber_area_m2(plant), plant->nominal.stiffness_scale, shape,
                    &plant->pose);
    plant->bend_most_rad = fmax(plant->bend_most_rad, hypot(shape->bend_rad[0], shape->bend_rad[1]));
    for (size_t c = 0; c < 3; c++) {
        plant->load_most_pa = fmax(plant->load_most_pa, plant->load_pa[c]);
    }
}

static int64_t next_tip_us(const struct blind_plant *plant) {
    return plant->tip_phase_us + plant->tip_next * plant->tip_period_us - plant->tip_latency_us;
}

static void take_sample(struct blind_plant *plant) {
    const double step_s = 1e-6 * (double)plant->tip_period_us;
    const int64_t claimed_us = plant->tip_phase_us + plant->tip_next * plant->tip_period_us;
    struct blind_tip_sample sample = {.measured_us = claimed_us, .arrives_us = claimed_us + plant->tip_age_us};
    look_up_body(plant);
    sample.pose = plant->pose;
    for (size_t i = 0; i < plant->effects; i++) {
        const struct blind_effect_kind *kind = plant->effect[i]->kind;
        if (kind->pose != NULL) {
            kind->pose(plant->effect[i], plant, step_s, &sample.pose);
        }
        if (kind->repeats != NULL) {
            sample.repeated = kind->repeats(plant->effect[i], plant) || sample.repeated;
        }
    }
    plant->tip_next++;
    if (plant->queued == BLIND_TIP_QUEUE) {
        plant->failed = true; /* nobody collects them */
        return;
    }
    plant->queue[plant->queued++] = sample;
}

bool blind_plant_next_tip(struct blind_plant *plant, struct blind_tip_sample *sample) {
    if (plant->queued == 0 || plant->queue[0].arrives_us > plant->time_us) {
        return false;
    }
    *sample = plant->queue[0];
    plant->queued--;
    memmove(&plant->queue[0], &plant->queue[1], plant->queued * sizeof plant->queue[0]);
    return true;
}

/* --- time --- */

void blind_plant_init(struct blind_plant *plant, struct blind_field *field, const struct blind_nominal *nominal,
                      struct blind_effect *const *effect, size_t effects) {
    memset(plant, 0, sizeof *plant);
    plant->field = field;
    plant->nominal = *nominal;
    plant->effects = effects;
    for (size_t i = 0; i < effects; i++) {
        plant->effect[i] = effect[i];
        if (effect[i]->kind->latency_us != NULL) {
            plant->tip_latency_us += effect[i]->kind->latency_us(effect[i]);
        }
    }
    plant->temperature_k = 293.15;
    plant->tip_age_us = TIP_AGE_US;
    set_ports(plant);
    plant->state[3] = plant->ports.supply_pa;
}

void blind_plant_sample_tip(struct blind_plant *plant, int64_t period_us, int64_t phase_us) {
    plant->tip_period_us = period_us;
    plant->tip_phase_us = phase_us;
    while (next_tip_us(plant) <= 0) { /* measured at rest, at or before the start */
        take_sample(plant);
    }
}

void blind_plant_step(struct blind_plant *plant) {
    const int64_t end_us = plant->time_us + BLIND_STEP_US;
    set_ports(plant);
    while (plant->time_us < end_us && !plant->failed) {
        int64_t until_us = end_us;
        bool fills[3];
        for (size_t c = 0; c < 3; c++) {
            fills[c] = fills_now(plant, c, &until_us);
        }
        if (next_tip_us(plant) > plant->time_us && next_tip_us(plant) < until_us) {
            until_us = next_tip_us(plant);
        }
        blind_gas_advance(plant, fills, 1e-6 * (double)(until_us - plant->time_us));
        plant->time_us = until_us;
        if (next_tip_us(plant) == plant->time_us) {
            take_sample(plant);
        }
    }
    read_pressures(plant);
    if (plant->time_us % BLIND_PERIOD_US == 0) {
        start_period(plant);
    }
}
