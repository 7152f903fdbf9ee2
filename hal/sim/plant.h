/* The plant: supply, valves, chambers, body and tip, with the effects that one adds. Noise-free; what sensors make of it
 * and the HAL are in sim_hal.h. The caller starts the valves' periods and lets time pass, and asks for the tip pose at
 * whatever chamber pressures, its own or measured ones. */
#ifndef TRIBEND_SIM_PLANT_H
#define TRIBEND_SIM_PLANT_H

#include "sim/effect.h"
#include "sim/valve.h"

#define PLANT_EFFECTS_MAX 16

struct plant_parameters {
    struct gas_parameters gas;
    struct valve_parameters valve;
    double supply_pa;
};

struct plant {
    const struct bend_table *table;
    struct plant_parameters parameters;
    struct effect effect[PLANT_EFFECTS_MAX];
    size_t effect_count;
    struct valve valve[3];
    struct chambers chambers;
    struct chamber_influence influence; /* of the last step */
    double pressure_pa[3];              /* true chamber pressures */
    double reading_pa[3];               /* what noise-free sensors show */
    double temperature_k;               /* of the module, for effects; NAN: not known */
    struct body_shape shape;            /* at the last tip sample */
    struct tip_pose pose;
};

/* The design page's nominal plant. */
void plant_default_parameters(struct plant_parameters *parameters);
/* `table` is kept by pointer. Vented and straight. */
void plant_init(struct plant *plant, const struct bend_table *table, const struct plant_parameters *parameters);
/* False when there is no room for another effect. */
bool plant_add_effect(struct plant *plant, const struct effect *effect);
/* A PWM period starts now. */
void plant_start_period(struct plant *plant, int64_t time_us, const double duty[3]);
/* Gas from `from_us` to `to_us`, at most a millisecond or so; then the sensors' readings. */
void plant_step(struct plant *plant, bool supply_open, int64_t from_us, int64_t to_us);
/* Shape and pose at `pressure_pa` (NULL: at the chambers' own), `step_s` after the last sample. */
void plant_sample_tip(struct plant *plant, const double *pressure_pa, double time_s, double step_s, double chance);

#endif
