/* The three chambers' gas: ISO 6358 flow in and out, isothermal ideal gas in a volume that follows the pressures.
 *
 * The state is p_abs V of each chamber with its tube (Pa m3, the gas mass but for R T); pressures follow from it and the
 * table's volumes. Beyond the table's axes volumes go on linearly.
 *
 * A chamber of a module that snaps is followed by its volume while it is ballooned: its gas, far softer than the rubber's
 * hysteresis, then decides where on the curve between the two stable branches it stands. One chamber at a time. */
#ifndef TRIBEND_SIM_CHAMBER_H
#define TRIBEND_SIM_CHAMBER_H

#include "control/bend_table.h"
#include "sim/valve.h"

struct gas_parameters {
    double ambient_pa_abs;
    double temperature_k;
    double gas_constant;          /* J/(kg K) */
    double sonic_conductance;     /* m3/(s Pa) at the reference density */
    double reference_density_kgpm3;
    double critical_ratio;
    double tube_volume_m3;
    double stiffness_scale; /* the module's over the table's: its states come at that many times the pressure */
};

#define CHAMBERS_NONE 3u

struct chambers {
    double pressure_pa[3];  /* gauge */
    double volume_m3[3];    /* chamber and tube */
    double gas[3];          /* p_abs V, Pa m3 */
    uint32_t ballooned;     /* the chamber followed by its volume, or CHAMBERS_NONE */
    double coordinate[3];   /* the pressure, or of the ballooned chamber its volume per reference length, m2 */
    double capacity[3][3];  /* d gas_i / d coordinate_j */
    double own_slope[3];    /* d pressure_i / d coordinate_i */
    double extra_volume_m3[3]; /* beside chamber and tube */
    double supply_flow_kgps;   /* drawn from the supply, mean over the last step */
    double stiffness_scale;
    struct bend_table beyond; /* the ballooned states, where `snaps` */
    bool snaps;
};

/* What effects may change for a step: nominal one and zero. */
struct chamber_influence {
    double conductance_scale[3];
    double vent_scale_change[3]; /* added to the scale while the valve vents */
    double leak_conductance[3]; /* to ambient, m3/(s Pa) */
    double extra_volume_m3[3];
    double coupling[3][3];      /* [i][j]: share of chamber j's pressure that stands in chamber i on top of its own */
    double bridge_kgpspa[3];    /* laminar leak from chamber i to the next (1 -> 2 -> 3 -> 1), kg/(s Pa) */
    double supply_pa;
    bool rail_vents;            /* with the supply shut, the rail stands open to ambient */
};

/* Mass flow from upstream to downstream, kg/s (ISO 6358-1:2013); negative pressures differences give zero. */
double gas_mass_flow(const struct gas_parameters *parameters, double conductance, double up_pa_abs, double down_pa_abs);
void chambers_init(struct chambers *chambers, const struct gas_parameters *parameters, const struct bend_table *table);
/* Start again from these gauge pressures, below any snap. */
void chambers_set_pressure(struct chambers *chambers, const struct gas_parameters *parameters,
                           const struct bend_table *table, const double pressure_pa[3]);
/* The section at the chambers' state: curvature (x, y), 1/m, and stretch. */
void chambers_curvature(const struct chambers *chambers, const struct bend_table *table, double curvature_1pm[2]);
double chambers_stretch(const struct chambers *chambers, const struct bend_table *table);
/* From `from_us` to `to_us` (at most a millisecond or so). `supply_open`: the shut-off valve. */
void chambers_step(struct chambers *chambers, const struct gas_parameters *parameters, const struct bend_table *table,
                   const struct valve valve[3], const struct chamber_influence *influence, bool supply_open,
                   int64_t from_us, int64_t to_us);
/* The table at any pressures: inside its axes as it is, outside its tangent at the edge. */
struct table_point {
    const struct bend_table *table;
    struct bend_table_stencil stencil;
    double beyond_pa[3];
};
void table_point_at(struct table_point *point, const struct bend_table *table, const double pressure_pa[3]);
/* `gradient` may be NULL; channel unit per Pa. */
double table_point_value(const struct table_point *point, enum bend_table_channel channel, double gradient[3]);
/* The same of `first` and the two channels after it at once, which is several times faster: gradient[channel][axis]. */
void table_point_values(const struct table_point *point, enum bend_table_channel first, double value[3],
                        double gradient[3][3]);

#endif
