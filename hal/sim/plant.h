/* The plant: supply, valves, chambers, body and tip, with the effects that one adds. Noise-free; what sensors make of it
 * and the HAL are in sim_hal.h. The caller starts the valves' periods and lets time pass, and asks for the tip pose at
 * whatever chamber pressures, its own or measured ones. */
#ifndef TRIBEND_SIM_PLANT_H
#define TRIBEND_SIM_PLANT_H

#include "sim/effect.h"
#include "sim/valve.h"

#define PLANT_EFFECTS_MAX 16

/* What goes wrong with it; zero: nothing. */
struct plant_faults {
    bool supply_replaced;          /* the regulator lets this through instead */
    double supply_pa;
    double leak_conductance[3];    /* m3/(s Pa) */
    double fill_lost[3];           /* share of the flow that a valve no longer lets in, */
    double vent_lost[3];           /* and out */
    double clock_slow;             /* share by which the board's clock is slow: more flows in what it takes for a step */
};

struct plant_parameters {
    struct gas_parameters gas;
    struct valve_parameters valve;
    double supply_pa;
    bool no_shut_off;        /* the supply-enable output drives nothing */
    bool shut_off_vents;     /* it is a 3/2 valve: shut, it vents the rail behind it */
    double relief_pa;        /* of a relief valve on each chamber; 0: none */
    double supply_relief_pa; /* of one on the supply; 0: none */
};

/* What the pressures were, for a tip sensor whose poses are old. */
#define PLANT_PAST 256
#define PLANT_PAST_SPACING_S 6e-4 /* at least, so that it reaches back 0.15 s */
struct plant_past {
    size_t count;
    size_t newest;
    double time_s[PLANT_PAST];
    double pressure_pa[PLANT_PAST][3];
};

struct plant {
    const struct bend_table *table;
    struct plant_parameters parameters;
    struct plant_faults faults;
    struct effect effect[PLANT_EFFECTS_MAX];
    size_t effect_count;
    bool ages_tip;          /* an effect of it makes poses old: */
    struct plant_past past; /* filled only then */
    struct valve valve[3];
    struct chambers chambers;
    struct chamber_influence influence; /* of the last step */
    double pressure_pa[3];              /* true chamber pressures */
    double reading_pa[3];               /* what noise-free sensors show */
    double temperature_k;               /* of the module, for effects; NAN: not known */
    struct body_shape shape;            /* at the last tip sample */
    struct tip_pose pose;
    bool tip_repeats;                   /* .. for which the sensor gives the sample before again */
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
/* Shape and pose at `pressure_pa` (NULL: at the chambers' own, of as long ago as an effect says that the tip sensor's poses are
 * old), `step_s` after the last sample. */
void plant_sample_tip(struct plant *plant, const double *pressure_pa, double time_s, double step_s, double chance);

#endif
