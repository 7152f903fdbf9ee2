/* The simulated HAL: a plant behind hal.h. The caller alternates app_step() and sim_advance().
 *
 * A period's duty is the one written before the period starts: what the controller writes at the very start of a period
 * counts for the next one, as on a board whose timer has taken over its register by then. */
#ifndef TRIBEND_SIM_HAL_H
#define TRIBEND_SIM_HAL_H

#include "hal.h"
#include "sim/plant.h"
#include "sim/sensors.h"

#define SIM_TIP_QUEUE 8

struct sim_parameters {
    struct plant_parameters plant;
    struct sensor_parameters sensor;
    int64_t step_us; /* of integration; a divisor of the control step */
};

/* Faults that a test or a drill injects. */
struct sim_faults {
    bool pressure_bus_fails;        /* no pressure can be read at all */
    bool channel_fails[3];          /* one channel cannot be read */
    bool reading_replaced[3];       /* a channel reads this instead */
    float reading_pa[3];
    bool supply_unknown;            /* the supply is not measured */
    bool tip_stops;                 /* no more tip samples arrive */
    bool outputs_fail;              /* outputs cannot be written */
};

struct sim {
    const struct bend_table *table;
    struct sim_parameters parameters;
    struct sim_faults faults;
    struct plant plant;
    int64_t time_us;
    struct hal_outputs outputs;      /* written last */
    struct random_stream pressure_random[3];
    struct random_stream tip_random;
    struct random_stream chance_random;
    struct hal_tip_sample queue[SIM_TIP_QUEUE]; /* measured, not arrived or not read yet, oldest first */
    size_t queued;
    uint32_t tip_dropped;            /* samples that nobody read in time */
};

/* The design page's nominal plant. */
void sim_default_parameters(struct sim_parameters *parameters);
/* `table` is kept by pointer. Vented and straight, at time 0. */
void sim_init(struct sim *sim, const struct bend_table *table, const struct sim_parameters *parameters, uint64_t seed);
/* False when there is no room for another effect. */
bool sim_add_effect(struct sim *sim, const struct effect *effect);
/* Bind `hal` to the plant. */
void sim_bind(struct sim *sim, struct hal *hal);
/* Let `duration_us` pass, a multiple of the step. */
void sim_advance(struct sim *sim, int64_t duration_us);

#endif
