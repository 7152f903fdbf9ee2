#include "sim/chamber.h"

#include <math.h>
#include <string.h>

void table_point_at(struct table_point *point, const struct bend_table *table, const double pressure_pa[3]) {
    float inside[3];
    point->table = table;
    for (size_t a = 0; a < 3; a++) {
        const double start = (double)table->axis_pa[a][0], end = (double)table->axis_pa[a][table->nodes[a] - 1];
        inside[a] = (float)fmin(fmax(pressure_pa[a], start), end);
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

/* Four nodes along the last axis at once. */
typedef float four __attribute__((vector_size(16)));

static four load4(const float *from) {
    four value;
    memcpy(&value, from, sizeof value);
    return value;
}

static double dot4(four a, four b) {
    const four product = a * b;
    return (double)((product[0] + product[1]) + (product[2] + product[3]));
}

void table_point_values(const struct table_point *point, enum bend_table_channel first, double value[3],
                        double gradient[3][3]) {
    const struct bend_table *table = point->table;
    const struct bend_table_stencil *stencil = &point->stencil;
    const size_t plane = (size_t)table->nodes[2] * table->nodes[1];
    const size_t start = stencil->first[2] + table->nodes[2] * (size_t)stencil->first[1] + plane * stencil->first[0];
    four sum[3] = {{0.0f}, {0.0f}, {0.0f}}, along0[3] = {{0.0f}, {0.0f}, {0.0f}}, along1[3] = {{0.0f}, {0.0f}, {0.0f}};
    for (size_t i = 0; i < 4; i++) {
        four line[3] = {{0.0f}, {0.0f}, {0.0f}};
        for (size_t j = 0; j < 4; j++) {
            const size_t at = start + plane * i + table->nodes[2] * j;
            for (size_t c = 0; c < 3; c++) {
                const four row = load4(table->channel[(size_t)first + c] + at);
                line[c] += stencil->weight[1][j] * row;
                along1[c] += stencil->weight[0][i] * stencil->derivative[1][j] * row;
            }
        }
        for (size_t c = 0; c < 3; c++) {
            sum[c] += stencil->weight[0][i] * line[c];
            along0[c] += stencil->derivative[0][i] * line[c];
        }
    }
    const four weight = load4(stencil->weight[2]), derivative = load4(stencil->derivative[2]);
    for (size_t c = 0; c < 3; c++) {
        const double slope[3] = {dot4(along0[c], weight), dot4(along1[c], weight), dot4(sum[c], derivative)};
        value[c] = dot4(sum[c], weight);
        for (size_t a = 0; a < 3; a++) {
            value[c] += slope[a] * point->beyond_pa[a];
            gradient[c][a] = slope[a];
        }
    }
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

/* The state in the grid that knows it, whose first axis is chamber `first` (0 where none has ballooned). */
static size_t point_of(const struct chambers *chambers, const struct bend_table *table, struct table_point *point) {
    const bool beyond = chambers->ballooned != CHAMBERS_NONE;
    const size_t first = beyond ? chambers->ballooned : 0;
    double at[3];
    for (size_t a = 0; a < 3; a++) {
        const size_t c = (first + a) % 3;
        at[a] = chambers->coordinate[c] / (c == chambers->ballooned ? 1.0 : chambers->stiffness_scale);
    }
    table_point_at(point, beyond ? &chambers->beyond : table, at);
    return first;
}

/* Pressures, volumes and capacities at the present coordinates. */
static void look_up(struct chambers *chambers, const struct gas_parameters *parameters,
                    const struct bend_table *table) {
    const double length_m = (double)table->module.chamber_length_m, scale = chambers->stiffness_scale;
    struct table_point point;
    double values[3], gradients[3][3];
    const size_t first = point_of(chambers, table, &point);
    table_point_values(&point, BEND_TABLE_VOLUME_1, values, gradients);
    for (size_t a = 0; a < 3; a++) {
        const size_t c = (first + a) % 3;
        const bool by_volume = c == chambers->ballooned;
        double *const gradient = gradients[a];
        const double value = values[a];
        for (size_t d = 0; d < 3; d++) {
            gradient[d] *= by_volume ? scale : 1.0;
            gradient[d] /= (first + d) % 3 == chambers->ballooned ? 1.0 : scale;
        }
        const double volume_m2 = by_volume ? chambers->coordinate[c] : value;
        chambers->pressure_pa[c] = by_volume ? scale * value : chambers->coordinate[c];
        chambers->volume_m3[c] = parameters->tube_volume_m3 + chambers->extra_volume_m3[c] + length_m * volume_m2;
        chambers->own_slope[c] = by_volume ? gradient[a] : 1.0;
        const double pressure_pa_abs = parameters->ambient_pa_abs + chambers->pressure_pa[c];
        for (size_t d = 0; d < 3; d++) {
            /* a gradient is one of the pressure or of the volume: the other is the coordinate */
            chambers->capacity[c][(first + d) % 3] =
                by_volume ? chambers->volume_m3[c] * gradient[d] : pressure_pa_abs * length_m * gradient[d];
        }
        if (by_volume) {
            chambers->capacity[c][c] += pressure_pa_abs * length_m;
        } else {
            chambers->capacity[c][c] = fmax(chambers->capacity[c][c], 0.0) + chambers->volume_m3[c];
        }
    }
}

void chambers_curvature(const struct chambers *chambers, const struct bend_table *table, double curvature_1pm[2]) {
    struct table_point point;
    const double turn = 2.0 * M_PI / 3.0 * (double)point_of(chambers, table, &point);
    const double x = table_point_value(&point, BEND_TABLE_CURVATURE_X, NULL);
    const double y = table_point_value(&point, BEND_TABLE_CURVATURE_Y, NULL);
    curvature_1pm[0] = x * cos(turn) - y * sin(turn);
    curvature_1pm[1] = x * sin(turn) + y * cos(turn);
}

double chambers_stretch(const struct chambers *chambers, const struct bend_table *table) {
    struct table_point point;
    (void)point_of(chambers, table, &point);
    return table_point_value(&point, BEND_TABLE_STRETCH, NULL);
}

void chambers_init(struct chambers *chambers, const struct gas_parameters *parameters, const struct bend_table *table) {
    memset(chambers, 0, sizeof *chambers);
    chambers->ballooned = CHAMBERS_NONE;
    chambers->stiffness_scale = parameters->stiffness_scale;
    chambers->snaps = bend_table_ballooned(table, &chambers->beyond);
    look_up(chambers, parameters, table);
    for (size_t c = 0; c < 3; c++) {
        chambers->gas[c] = parameters->ambient_pa_abs * chambers->volume_m3[c];
    }
}

void chambers_set_pressure(struct chambers *chambers, const struct gas_parameters *parameters,
                           const struct bend_table *table, const double pressure_pa[3]) {
    chambers->ballooned = CHAMBERS_NONE;
    memcpy(chambers->coordinate, pressure_pa, sizeof chambers->coordinate);
    look_up(chambers, parameters, table);
    for (size_t c = 0; c < 3; c++) {
        chambers->gas[c] = (parameters->ambient_pa_abs + chambers->pressure_pa[c]) * chambers->volume_m3[c];
    }
}

/* 3 x 3 by Cramer's rule; the matrix is near diagonal in units of its own and never singular. */
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

/* Coordinates from the gas, one Newton step. */
static void meet_gas(struct chambers *chambers, const struct gas_parameters *parameters) {
    double step[3], gap[3];
    for (size_t c = 0; c < 3; c++) {
        gap[c] = chambers->gas[c] - (parameters->ambient_pa_abs + chambers->pressure_pa[c]) * chambers->volume_m3[c];
    }
    solve3(chambers->capacity, gap, step);
    for (size_t c = 0; c < 3; c++) {
        chambers->coordinate[c] += step[c];
    }
}

/* Both grids know the states between the first two volumes of the ballooned one: the change is made there, at either end,
 * and the gas stays what it was. */
static void choose_grid(struct chambers *chambers, const struct gas_parameters *parameters,
                        const struct bend_table *table) {
    const double length_m = (double)table->module.chamber_length_m;
    const uint32_t before = chambers->ballooned;
    if (before == CHAMBERS_NONE) {
        uint32_t largest = 0;
        for (uint32_t c = 1; c < 3; c++) {
            largest = chambers->volume_m3[c] > chambers->volume_m3[largest] ? c : largest;
        }
        const double volume_m2 =
            (chambers->volume_m3[largest] - chambers->extra_volume_m3[largest] - parameters->tube_volume_m3) / length_m;
        if (volume_m2 > (double)chambers->beyond.axis_pa[0][1]) {
            chambers->ballooned = largest;
            chambers->coordinate[largest] = volume_m2;
        }
    } else if (chambers->coordinate[before] < (double)chambers->beyond.axis_pa[0][0]) {
        chambers->ballooned = CHAMBERS_NONE;
        chambers->coordinate[before] = chambers->pressure_pa[before];
    }
    if (chambers->ballooned != before) {
        look_up(chambers, parameters, table);
        meet_gas(chambers, parameters);
        look_up(chambers, parameters, table);
    }
}

struct port {
    const struct gas_parameters *parameters;
    double conductance;
    double vent_conductance;
    double leak_conductance;
    double supply_pa_abs; /* ambient while the shut-off valve is shut */
    double slope; /* of the pressure by the gas, 1/m3 */
    bool backward; /* the rail takes air as well */
};

/* Rate of p V through the valve, Pa m3/s. */
static double valve_rate(const struct port *port, bool fills, double chamber_pa_abs) {
    const struct gas_parameters *parameters = port->parameters;
    const double other = fills ? port->supply_pa_abs : parameters->ambient_pa_abs;
    const double conductance = fills ? port->conductance : port->vent_conductance;
    double flow = gas_mass_flow(parameters, conductance, other, chamber_pa_abs);
    if (!fills || port->backward) {
        flow -= gas_mass_flow(parameters, conductance, chamber_pa_abs, other);
    }
    return parameters->gas_constant * parameters->temperature_k * flow;
}

static double leak_rate(const struct port *port, double chamber_pa_abs) {
    const struct gas_parameters *parameters = port->parameters;
    return parameters->gas_constant * parameters->temperature_k *
           gas_mass_flow(parameters, port->leak_conductance, chamber_pa_abs, parameters->ambient_pa_abs);
}

/* One stretch of time with the valve at rest, by the midpoint rule; pressure moves by the chamber's own capacity. Returns
 * what came through the valve. */
static double integrate(const struct port *port, bool fills, double duration_s, double *gas, double *pressure_pa_abs) {
    const double half = 0.5 * duration_s * port->slope;
    const double start = valve_rate(port, fills, *pressure_pa_abs) - leak_rate(port, *pressure_pa_abs);
    const double middle_pa_abs = fmax(*pressure_pa_abs + half * start, 0.0);
    const double through = valve_rate(port, fills, middle_pa_abs);
    const double middle = through - leak_rate(port, middle_pa_abs);
    *gas += duration_s * middle;
    *pressure_pa_abs += duration_s * middle * port->slope;
    if (!fills && *pressure_pa_abs < port->parameters->ambient_pa_abs && port->slope > 0.0) {
        *gas += (port->parameters->ambient_pa_abs - *pressure_pa_abs) / port->slope;
        *pressure_pa_abs = port->parameters->ambient_pa_abs; /* a vent ends at ambient, it does not overshoot */
    }
    return duration_s * through;
}

/* More or less dead volume appears at the chamber's pressure: no air moves. */
static void resize(struct chambers *chambers, const struct gas_parameters *parameters,
                   const struct chamber_influence *influence) {
    for (size_t c = 0; c < 3; c++) {
        const double change_m3 = influence->extra_volume_m3[c] - chambers->extra_volume_m3[c];
        chambers->extra_volume_m3[c] = influence->extra_volume_m3[c];
        chambers->volume_m3[c] += change_m3;
        chambers->capacity[c][c] += change_m3;
        chambers->gas[c] += (parameters->ambient_pa_abs + chambers->pressure_pa[c]) * change_m3;
    }
}

void chambers_step(struct chambers *chambers, const struct gas_parameters *parameters, const struct bend_table *table,
                   const struct valve valve[3], const struct chamber_influence *influence, bool supply_open,
                   int64_t from_us, int64_t to_us) {
    double change[3], drawn = 0.0;
    resize(chambers, parameters, influence);
    for (size_t c = 0; c < 3; c++) {
        const double before = chambers->gas[c];
        const struct port port = {
            .parameters = parameters,
            .conductance = parameters->sonic_conductance * influence->conductance_scale[c],
            .vent_conductance = parameters->sonic_conductance *
                                (influence->conductance_scale[c] + influence->vent_scale_change[c]),
            .leak_conductance = influence->leak_conductance[c],
            .supply_pa_abs = parameters->ambient_pa_abs + (supply_open ? influence->supply_pa : 0.0),
            .slope = chambers->own_slope[c] / chambers->capacity[c][c],
            .backward = supply_open || influence->rail_vents};
        double pressure_pa_abs = parameters->ambient_pa_abs + chambers->pressure_pa[c];
        for (int64_t at_us = from_us; at_us < to_us;) {
            const int64_t switch_us = valve_next_switch_us(&valve[c], at_us);
            const int64_t end_us = switch_us < to_us ? switch_us : to_us;
            const bool fills = valve_fills(&valve[c], at_us);
            const double through =
                integrate(&port, fills, 1e-6 * (double)(end_us - at_us), &chambers->gas[c], &pressure_pa_abs);
            drawn += fills ? fmax(through, 0.0) : 0.0;
            at_us = end_us;
        }
        change[c] = chambers->gas[c] - before;
    }
    chambers->supply_flow_kgps =
        drawn / (parameters->gas_constant * parameters->temperature_k * 1e-6 * (double)(to_us - from_us));
    for (size_t c = 0; c < 3; c++) {
        const size_t next = (c + 1) % 3;
        const double moved = influence->bridge_kgpspa[c] * (chambers->pressure_pa[c] - chambers->pressure_pa[next]) *
                             parameters->gas_constant * parameters->temperature_k * 1e-6 * (double)(to_us - from_us);
        change[c] -= moved;
        change[next] += moved;
        chambers->gas[c] -= moved;
        chambers->gas[next] += moved;
    }
    /* coordinates: the coupled linear step, then one Newton correction against the table */
    double step[3];
    solve3(chambers->capacity, change, step);
    for (size_t c = 0; c < 3; c++) {
        chambers->coordinate[c] += step[c];
    }
    look_up(chambers, parameters, table);
    meet_gas(chambers, parameters);
    if (chambers->snaps) {
        look_up(chambers, parameters, table);
        choose_grid(chambers, parameters, table);
    } else {
        memcpy(chambers->pressure_pa, chambers->coordinate, sizeof chambers->pressure_pa);
    }
}
