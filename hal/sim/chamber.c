#include "sim/chamber.h"

#include <math.h>
#include <string.h>

void table_point_at(struct table_point *point, const struct bend_table *table, const double pressure_pa[3]) {
    float inside[3];
    point->table = table;
    for (size_t a = 0; a < 3; a++) {
        const double end = (double)table->axis_pa[a][table->nodes[a] - 1];
        inside[a] = (float)fmin(fmax(pressure_pa[a], 0.0), end);
        point->beyond_pa[a] = pressure_pa[a] - (double)inside[a];
    }
    bend_table_locate(table, inside, &point->stencil);
}

double table_point_value(const struct table_point *point, enum bend_table_channel channel, double gradient[3]) {
    float slope[3];
    double value = (double)bend_table_gradient(point->table, &point->stencil, channel, slope);
    for (size_t a = 0; a < 3; a++) {
        value += (double)slope[a] * point->beyond_pa[a];
        if (gradient != NULL) {
            gradient[a] = (double)slope[a];
        }
    }
    return value;
}

double gas_mass_flow(const struct gas_parameters *parameters, double conductance, double up_pa_abs,
                     double down_pa_abs) {
    if (!(up_pa_abs > down_pa_abs)) {
        return 0.0;
    }
    const double ratio = down_pa_abs / up_pa_abs, b = parameters->critical_ratio;
    const double choked = conductance * parameters->reference_density_kgpm3 * up_pa_abs *
                          sqrt(293.15 / parameters->temperature_k);
    const double share = (ratio - b) / (1.0 - b);
    return ratio <= b ? choked : choked * sqrt(1.0 - share * share);
}

/* Volumes and capacities at the present pressures. */
static void look_up(struct chambers *chambers, const struct gas_parameters *parameters,
                    const struct bend_table *table) {
    const double length_m = (double)table->module.chamber_length_m;
    struct table_point point;
    table_point_at(&point, table, chambers->pressure_pa);
    for (size_t c = 0; c < 3; c++) {
        double gradient[3];
        const enum bend_table_channel channel = (enum bend_table_channel)((size_t)BEND_TABLE_VOLUME_1 + c);
        const double volume_m2 = table_point_value(&point, channel, gradient);
        const double pressure_pa_abs = parameters->ambient_pa_abs + chambers->pressure_pa[c];
        chambers->volume_m3[c] = parameters->tube_volume_m3 + length_m * volume_m2;
        for (size_t d = 0; d < 3; d++) {
            chambers->capacity[c][d] = pressure_pa_abs * length_m * gradient[d];
        }
        chambers->capacity[c][c] = fmax(chambers->capacity[c][c], 0.0) + chambers->volume_m3[c];
    }
}

void chambers_init(struct chambers *chambers, const struct gas_parameters *parameters, const struct bend_table *table) {
    memset(chambers, 0, sizeof *chambers);
    look_up(chambers, parameters, table);
    for (size_t c = 0; c < 3; c++) {
        chambers->gas[c] = parameters->ambient_pa_abs * chambers->volume_m3[c];
    }
}

struct port {
    const struct gas_parameters *parameters;
    double conductance;
    double leak_conductance;
    double supply_pa_abs; /* ambient while the shut-off valve is shut */
    double capacity_m3;
    bool supply_open;
};

/* Rate of p V, Pa m3/s. */
static double gas_rate(const struct port *port, bool fills, double chamber_pa_abs) {
    const struct gas_parameters *parameters = port->parameters;
    const double ambient = parameters->ambient_pa_abs;
    const double other = fills ? port->supply_pa_abs : ambient;
    double flow = -gas_mass_flow(parameters, port->leak_conductance, chamber_pa_abs, ambient);
    flow += gas_mass_flow(parameters, port->conductance, other, chamber_pa_abs);
    if (!fills || port->supply_open) {
        flow -= gas_mass_flow(parameters, port->conductance, chamber_pa_abs, other);
    }
    return parameters->gas_constant * parameters->temperature_k * flow;
}

/* One stretch of time with the valve at rest, by the midpoint rule; pressure moves by the chamber's own capacity. */
static void integrate(const struct port *port, bool fills, double duration_s, double *gas, double *pressure_pa_abs) {
    const double half = 0.5 * duration_s / port->capacity_m3;
    const double start = gas_rate(port, fills, *pressure_pa_abs);
    const double middle = gas_rate(port, fills, fmax(*pressure_pa_abs + half * start, 0.0));
    *gas += duration_s * middle;
    *pressure_pa_abs += duration_s * middle / port->capacity_m3;
    if (!fills && *pressure_pa_abs < port->parameters->ambient_pa_abs) {
        *gas += port->capacity_m3 * (port->parameters->ambient_pa_abs - *pressure_pa_abs);
        *pressure_pa_abs = port->parameters->ambient_pa_abs; /* a vent ends at ambient, it does not overshoot */
    }
}

/* 3 x 3 by Cramer's rule; the matrix is close to diagonal and never singular. */
static void solve3(double a[3][3], const double b[3], double x[3]) {
    const double minor0 = a[1][1] * a[2][2] - a[1][2] * a[2][1];
    const double minor1 = a[1][2] * a[2][0] - a[1][0] * a[2][2];
    const double minor2 = a[1][0] * a[2][1] - a[1][1] * a[2][0];
    const double determinant = a[0][0] * minor0 + a[0][1] * minor1 + a[0][2] * minor2;
    x[0] = (b[0] * minor0 + a[0][1] * (a[1][2] * b[2] - b[1] * a[2][2]) + a[0][2] * (b[1] * a[2][1] - a[1][1] * b[2])) /
           determinant;
    x[1] = (a[0][0] * (b[1] * a[2][2] - a[1][2] * b[2]) + b[0] * minor1 + a[0][2] * (a[1][0] * b[2] - b[1] * a[2][0])) /
           determinant;
    x[2] = (a[0][0] * (a[1][1] * b[2] - b[1] * a[2][1]) + a[0][1] * (b[1] * a[2][0] - a[1][0] * b[2]) + b[0] * minor2) /
           determinant;
}

void chambers_step(struct chambers *chambers, const struct gas_parameters *parameters, const struct bend_table *table,
                   const struct valve valve[3], const struct chamber_influence *influence, bool supply_open,
                   int64_t from_us, int64_t to_us) {
    double change[3];
    for (size_t c = 0; c < 3; c++) {
        const double before = chambers->gas[c];
        const struct port port = {
            .parameters = parameters,
            .conductance = parameters->sonic_conductance * influence->conductance_scale[c],
            .leak_conductance = influence->leak_conductance[c],
            .supply_pa_abs = parameters->ambient_pa_abs + (supply_open ? influence->supply_pa : 0.0),
            .capacity_m3 = chambers->capacity[c][c],
            .supply_open = supply_open};
        double pressure_pa_abs = parameters->ambient_pa_abs + chambers->pressure_pa[c];
        for (int64_t at_us = from_us; at_us < to_us;) {
            const int64_t switch_us = valve_next_switch_us(&valve[c], at_us);
            const int64_t end_us = switch_us < to_us ? switch_us : to_us;
            integrate(&port, valve_fills(&valve[c], at_us), 1e-6 * (double)(end_us - at_us), &chambers->gas[c],
                      &pressure_pa_abs);
            at_us = end_us;
        }
        change[c] = chambers->gas[c] - before;
    }
    /* pressures: the coupled linear step, then one Newton correction against the table */
    double step[3], gap[3];
    solve3(chambers->capacity, change, step);
    for (size_t c = 0; c < 3; c++) {
        chambers->pressure_pa[c] += step[c];
    }
    look_up(chambers, parameters, table);
    for (size_t c = 0; c < 3; c++) {
        gap[c] = chambers->gas[c] - (parameters->ambient_pa_abs + chambers->pressure_pa[c]) * chambers->volume_m3[c];
    }
    solve3(chambers->capacity, gap, step);
    for (size_t c = 0; c < 3; c++) {
        chambers->pressure_pa[c] += step[c];
    }
}
