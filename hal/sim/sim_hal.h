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
    int64_t watchdog_us; /* without outputs written for so long, the board resets; 0: no watchdog */
    int64_t step_us; /* of integration; a divisor of the control step */
};

/* Faults that a test or a drill injects. */
struct sim_faults {
    bool pressure_bus_fails;        /* no pressure can be read at all */
    bool channel_fails[3];          /* one channel cannot be read */
    bool reading_replaced[3];       /* a channel reads this instead */
    float reading_pa[3];
    bool reading_stands[3];         /* a channel repeats its last reading */
    double reading_drift_paps[3];   /* a channel drifts away from now on */
    double reading_gain[3];         /* reads so much more of the pressure: 0 is sound, -1 reads nothing */
    double noise_added_pa[3];       /* rms of noise on top of the sensor's own */
    bool readings_exchanged;        /* channels 1 and 2 */
    bool supply_unknown;            /* the supply is not measured */
    bool tip_stops;                 /* no more tip samples arrive */
    bool tip_stands;                /* samples arrive, all with the same pose */
    bool tip_scatters;              /* samples with poses from nowhere */
    uint16_t tip_status;            /* bits that the tip sensor sets */
    double tip_away_m;              /* it shows positions so far off */
    bool outputs_fail;              /* outputs cannot be written */
    struct hal_health health;       /* what the board says of itself */
};

struct sim {
    const struct bend_table *table;
    struct sim_parameters parameters;
    struct sim_faults faults;
    struct plant plant;
    int64_t time_us;
    struct hal_outputs outputs;      /* written last */
    int64_t written_us;              /* when */
    bool reset;                      /* the board is in reset: sim_restart() ends it */
    float shown_pa[3];               /* readings of the last time */
    double drifted_pa[3];
    struct hal_tip_sample tip_shown; /* the last one */
    struct hal_tip_sample tip_measured; /* the same before faults spoil it */
    struct random_stream fault_random;
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
/* The board resets: all outputs off, inside the running period too, until sim_restart(). */
void sim_reset(struct sim *sim);
/* It starts anew; the caller initialises the firmware. What it says of the reset is in faults.health. */
void sim_restart(struct sim *sim);
/* Bind `hal` to the plant. */
void sim_bind(struct sim *sim, struct hal *hal);
/* Let `duration_us` pass, a multiple of the step. */
void sim_advance(struct sim *sim, int64_t duration_us);

#endif
