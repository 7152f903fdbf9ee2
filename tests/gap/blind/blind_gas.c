/* The gas: ISO 6358 flow through valve, line and leaks; chambers whose volumes follow all three pressures through the table. */
#include <math.h>
#include <string.h>

#include "blind_plant.h"

#define AMBIENT_PA_ABS 101325.0
#define GAS_CONSTANT 287.0
#define TEMPERATURE_K 293.15
#define DENSITY_KGPM3 1.185
#define CONDUCTANCE 2e-10
#define CRITICAL_RATIO 0.3
#define TUBE_M3 2e-6
#define HEAT_RATIO 1.4
#define LAMINAR_PA 2.0
#define STEP_MOST_S 4e-4
#define SUPPLY 3 /* place in the state */
#define MASS 4

double blind_flow_kgps(double conductance, double critical_ratio, double up_pa_abs, double down_pa_abs,
                       double up_temperature_k) {
    const double high = fmax(up_pa_abs, down_pa_abs), drop = fabs(up_pa_abs - down_pa_abs);
    const double seen = fmax(drop, LAMINAR_PA); /* below, straight to zero: a root's slope there is infinite */
    const double share = fmax(1.0 - seen / high - critical_ratio, 0.0) / (1.0 - critical_ratio);
    const double flow =
        conductance * DENSITY_KGPM3 * high * sqrt(TEMPERATURE_K / up_temperature_k) * sqrt(1.0 - share * share);
    return (up_pa_abs < down_pa_abs ? -flow : flow) * fmin(drop / LAMINAR_PA, 1.0);
}

struct network {
    struct blind_plant *plant;
    const bool *fills;
    double measure_s; /* length of the step that starts here; 0: nothing is summed up */
};

/* What passes between a chamber and its surroundings, kg/s. */
struct exchange {
    double in[3];  /* at the supply's and the ambient's temperature */
    double out[3]; /* at the chamber's */
    double drawn;  /* from the supply */
};

static double through_line(const struct blind_ports *ports, size_t c, double up, double down, double temperature_k) {
    const double conductance = CONDUCTANCE * ports->flow_scale[c], ratio = ports->critical_ratio[c];
    const double line = ports->line_pas_per_kg[c];
    double low = 0.0, high = 1.0;
    if (!(line > 0.0)) {
        return blind_flow_kgps(conductance, ratio, up, down, temperature_k);
    }
    for (int i = 0; i < 30; i++) { /* share of the drop that the laminar line takes */
        const double share = 0.5 * (low + high), drop = share * (up - down);
        const double flow = blind_flow_kgps(conductance, ratio, up - drop, down, temperature_k);
        *(fabs(flow) * line > fabs(drop) ? &low : &high) = share;
    }
    return 0.5 * (low + high) * (up - down) / line;
}

static void add(struct exchange *exchange, size_t c, double flow) {
    exchange->in[c] += fmax(flow, 0.0);
    exchange->out[c] += fmax(-flow, 0.0);
}

static void sum_up(const struct network *network, size_t c, double line, double other, double own, double leak) {
    struct blind_measure *measure = &network->plant->measure;
    const struct blind_ports *ports = &network->plant->ports;
    if (ports->line_pas_per_kg[c] > 0.0 || ports->flow_scale[c] < 1.0) {
        measure->line_kg += network->measure_s * fabs(line);
        measure->line_nominal_kg +=
            network->measure_s * fabs(blind_flow_kgps(CONDUCTANCE, CRITICAL_RATIO, other, own, TEMPERATURE_K));
    }
    if (ports->orifice_leak[c] > 0.0 || ports->laminar_leak[c] > 0.0) {
        measure->leak_kg += network->measure_s * leak;
        measure->leak_per_conductance +=
            network->measure_s * blind_flow_kgps(1.0, CRITICAL_RATIO, own, AMBIENT_PA_ABS, TEMPERATURE_K);
    }
}

static void exchange_of(const struct network *network, const double *state, const double *temperature_k,
                        struct exchange *exchange) {
    const struct blind_ports *ports = &network->plant->ports;
    memset(exchange, 0, sizeof *exchange);
    for (size_t c = 0; c < 3; c++) {
        const double own = AMBIENT_PA_ABS + state[c];
        const double other = AMBIENT_PA_ABS + (network->fills[c] ? state[SUPPLY] : 0.0);
        const double line = through_line(ports, c, other, own, own > other ? temperature_k[c] : TEMPERATURE_K);
        const double leak = ports->orifice_leak[c] * state[c] / sqrt(fmax(fabs(state[c]), LAMINAR_PA)) +
                            ports->laminar_leak[c] * state[c];
        const double bridge = ports->bridge[c] * (state[c] - state[(c + 1) % 3]);
        add(exchange, c, line);
        add(exchange, c, -leak);
        add(exchange, c, -bridge);
        add(exchange, (c + 1) % 3, bridge);
        exchange->drawn += network->fills[c] ? line : 0.0;
        sum_up(network, c, line, other, own, leak);
    }
}

/* Gauss with row pivots; the matrix is near diagonal. */
static void solve(double matrix[3][4]) {
    for (size_t k = 0; k < 3; k++) {
        size_t best = k;
        for (size_t r = k + 1; r < 3; r++) {
            best = fabs(matrix[r][k]) > fabs(matrix[best][k]) ? r : best;
        }
        for (size_t j = 0; j < 4; j++) {
            const double swapped = matrix[k][j];
            matrix[k][j] = matrix[best][j];
            matrix[best][j] = swapped;
        }
        for (size_t r = 0; r < 3; r++) {
            const double factor = r == k ? 0.0 : matrix[r][k] / matrix[k][k];
            for (size_t j = k; j < 4; j++) {
                matrix[r][j] -= factor * matrix[k][j];
            }
        }
    }
}

/* Isothermal: d(p V)/dt = R T m. Otherwise the first law of an open system with heat through the wall:
 * V dp/dt + g p dV/dt = g R (T_in m_in - T m_out) + (g - 1) h A (T_wall - T), g the ratio of specific heats. */
static void rates(const struct network *network, const double *state, double *rate) {
    struct blind_plant *plant = network->plant;
    const struct blind_ports *ports = &plant->ports;
    const double length_m = (double)plant->field->table->module.chamber_length_m;
    const double stiffness = plant->nominal.stiffness_scale;
    const bool thermal = ports->heat_transfer_wpk > 0.0;
    const double exponent = thermal ? HEAT_RATIO : 1.0;
    const double load_pa[3] = {state[0] / stiffness, state[1] / stiffness, state[2] / stiffness};
    double area_m2[3], slope[3][3], matrix[3][4], temperature_k[3], volume_m3[3];
    struct exchange exchange;
    if (!blind_field_at(plant->field, load_pa, BLIND_VOLUME_1, 3, area_m2, slope)) {
        plant->failed = true;
        return;
    }
    for (size_t c = 0; c < 3; c++) {
        volume_m3[c] = TUBE_M3 + ports->line_volume_m3[c] + length_m * area_m2[c];
        temperature_k[c] = thermal ? (AMBIENT_PA_ABS + state[c]) * volume_m3[c] / (GAS_CONSTANT * state[MASS + c])
                                   : TEMPERATURE_K;
    }
    exchange_of(network, state, temperature_k, &exchange);
    for (size_t c = 0; c < 3; c++) {
        for (size_t d = 0; d < 3; d++) {
            matrix[c][d] = exponent * (AMBIENT_PA_ABS + state[c]) * length_m * slope[c][d] / stiffness;
        }
        matrix[c][c] += volume_m3[c];
        matrix[c][3] =
            exponent * GAS_CONSTANT * (TEMPERATURE_K * exchange.in[c] - temperature_k[c] * exchange.out[c]) +
            (exponent - 1.0) * ports->heat_transfer_wpk * (TEMPERATURE_K - temperature_k[c]);
        rate[MASS + c] = exchange.in[c] - exchange.out[c];
    }
    solve(matrix);
    for (size_t c = 0; c < 3; c++) {
        rate[c] = matrix[c][3] / matrix[c][c];
    }
    rate[SUPPLY] = 0.0;
    if (ports->regulator_pas_per_kg > 0.0) { /* a regulator lets nothing back */
        const double fed = fmax(ports->supply_pa - state[SUPPLY], 0.0) / ports->regulator_pas_per_kg;
        rate[SUPPLY] = GAS_CONSTANT * TEMPERATURE_K * (fed - exchange.drawn) / ports->reservoir_m3;
    }
}

static void moved(const double *from, const double *rate, double step_s, double *to) {
    for (size_t i = 0; i < BLIND_STATES; i++) {
        to[i] = from[i] + step_s * rate[i];
    }
}

/* Classical fourth-order Runge-Kutta. */
static void step(struct blind_plant *plant, const bool fills[3], double step_s) {
    struct network network = {.plant = plant, .fills = fills, .measure_s = step_s};
    double k[4][BLIND_STATES] = {{0.0}}, at[BLIND_STATES];
    rates(&network, plant->state, k[0]);
    network.measure_s = 0.0;
    moved(plant->state, k[0], 0.5 * step_s, at);
    rates(&network, at, k[1]);
    moved(plant->state, k[1], 0.5 * step_s, at);
    rates(&network, at, k[2]);
    moved(plant->state, k[2], step_s, at);
    rates(&network, at, k[3]);
    for (size_t i = 0; i < BLIND_STATES; i++) {
        plant->state[i] += step_s / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    }
}

/* The masses that the present pressures mean at ambient temperature. */
static void weigh(struct blind_plant *plant) {
    const double stiffness = plant->nominal.stiffness_scale;
    const double load_pa[3] = {plant->state[0] / stiffness, plant->state[1] / stiffness, plant->state[2] / stiffness};
    double area_m2[3];
    plant->failed = !blind_field_at(plant->field, load_pa, BLIND_VOLUME_1, 3, area_m2, NULL) || plant->failed;
    for (size_t c = 0; c < 3 && !plant->failed; c++) {
        const double volume_m3 = TUBE_M3 + plant->ports.line_volume_m3[c] +
                                 (double)plant->field->table->module.chamber_length_m * area_m2[c];
        plant->state[MASS + c] = (AMBIENT_PA_ABS + plant->state[c]) * volume_m3 / (GAS_CONSTANT * TEMPERATURE_K);
    }
}

void blind_gas_advance(struct blind_plant *plant, const bool fills[3], double duration_s) {
    const int steps = (int)ceil(duration_s / STEP_MOST_S - 1e-9);
    if (!(plant->ports.regulator_pas_per_kg > 0.0)) {
        plant->state[SUPPLY] = plant->ports.supply_pa;
    }
    if (!(plant->state[MASS] > 0.0)) {
        weigh(plant);
    }
    for (int i = 0; i < steps && !plant->failed; i++) {
        step(plant, fills, duration_s / (double)steps);
    }
}
