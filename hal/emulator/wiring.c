#include "emulator/wiring.h"

#include <math.h>
#include <string.h>

#define PORT_A 0u
#define PORT_B 1u
#define PORT_C 2u
#define VALVE_PIN 8u
#define VALVE_FUNCTION 6u
#define SUPPLY_PIN 5u
#define CHANNEL_CHAMBER_1 1u
#define CHANNEL_CHAMBER_2 2u
#define CHANNEL_CHAMBER_3 7u
#define CHANNEL_SUPPLY 6u
#define SUPPLY_INDEX 3u
#define CHAMBER_FULL_PA 50000.0
#define SUPPLY_FULL_PA 100000.0
#define RATIO_AT_ZERO 0.1
#define RATIO_SPAN 0.8
#define REFERENCE_V 1.212 /* VREFINT, typical */
#define SUMMED 16.0
#define STEP_US 1000
#define FOLLOW_US 200 /* the plant does not follow over less */
#define BAUD 115200
#define BITS_A_BYTE 10

void wiring_default_parameters(struct wiring_parameters *parameters) {
    *parameters = (struct wiring_parameters){.sensor = {.pressure_noise_pa = 150.0,
                                                        .tip_period_us = 10000,
                                                        .tip_delay_us = 10000,
                                                        .tip_position_noise_m = 2e-5,
                                                        .tip_angle_noise_rad = 0.012 * M_PI / 180.0},
                                             .converter_noise = 1.0};
    plant_default_parameters(&parameters->plant);
}

static int64_t now_us(const struct wiring *wiring) {
    return wiring->core->now_ticks / TICKS_PER_US;
}

static void follow_to(struct wiring *wiring, int64_t to_us) {
    while (wiring->plant_us < to_us) {
        const int64_t next_us = wiring->plant_us + STEP_US < to_us ? wiring->plant_us + STEP_US : to_us;
        plant_step(&wiring->plant, wiring->supply_open, wiring->plant_us, next_us);
        wiring->plant_us = next_us;
    }
}

void wiring_follow(struct wiring *wiring) {
    follow_to(wiring, now_us(wiring));
}

/* --- outputs --- */

static bool coils_are_driven(const struct wiring *wiring) {
    return (wiring->valves->dead_time & (1u << 15)) != 0 && !wiring->faults.outputs_fail;
}

static double duty_of(const struct wiring *wiring, uint32_t c, bool rest) {
    const bool wired = gpio_is_alternate(&wiring->gpio[PORT_A], VALVE_PIN + c, VALVE_FUNCTION);
    if (!wired || !coils_are_driven(wiring)) {
        return 0.0;
    }
    return rest ? timer_duty_left(wiring->valves, c + 1u) : timer_duty(wiring->valves, c + 1u);
}

static void start_pulses(struct wiring *wiring, int64_t at_us, bool rest) {
    const double duty[3] = {duty_of(wiring, 0u, rest), duty_of(wiring, 1u, rest), duty_of(wiring, 2u, rest)};
    follow_to(wiring, at_us);
    plant_start_period(&wiring->plant, at_us, duty);
}

static void on_period(void *context, int64_t at_ticks) {
    start_pulses(context, at_ticks / TICKS_PER_US, false);
}

static void on_outputs(void *context) {
    struct wiring *wiring = context;
    const bool driven = coils_are_driven(wiring);
    if (driven == wiring->coils_driven) {
        return;
    }
    wiring->coils_driven = driven;
    if (driven) {
        start_pulses(wiring, now_us(wiring), true);
        return;
    }
    wiring->coils_off_us = now_us(wiring);
    follow_to(wiring, wiring->coils_off_us);
    for (size_t c = 0; c < 3; c++) {
        valve_cut(&wiring->plant.valve[c], &wiring->parameters.plant.valve, wiring->coils_off_us);
    }
}

static void on_pins(void *context) {
    struct wiring *wiring = context;
    const bool open = gpio_output_high(&wiring->gpio[PORT_B], SUPPLY_PIN);
    if (open != wiring->supply_open) {
        wiring_follow(wiring);
        wiring->supply_open = open;
        wiring->supply_shut_us = open ? wiring->supply_shut_us : now_us(wiring);
    }
}

bool wiring_fills(const struct wiring *wiring) {
    const int64_t at_us = now_us(wiring);
    return valve_fills(&wiring->plant.valve[0], at_us) || valve_fills(&wiring->plant.valve[1], at_us) ||
           valve_fills(&wiring->plant.valve[2], at_us);
}

/* --- inputs --- */

/* What a chamber's sensor stands at, before its own noise. */
static double spoil_pressure(struct wiring *wiring, uint32_t c) {
    const struct wiring_faults *faults = &wiring->faults;
    const uint32_t from = faults->readings_exchanged && c < 2u ? 1u - c : c;
    wiring->drifted_pa[c] += faults->reading_drift_paps[c] * 1e-6 * STEP_US; /* one sequence a control step */
    double pressure_pa =
        wiring->plant.reading_pa[from] * (1.0 + faults->reading_gain[c]) + wiring->drifted_pa[c];
    if (faults->noise_added_pa[c] > 0.0) {
        pressure_pa += faults->noise_added_pa[c] * random_normal(&wiring->fault_random);
    }
    return pressure_pa;
}

static void draw(struct wiring *wiring, uint32_t index) {
    const struct wiring_faults *faults = &wiring->faults;
    const double stands_pa =
        index == SUPPLY_INDEX ? wiring->plant.influence.supply_pa : spoil_pressure(wiring, index);
    const double noisy_pa = stands_pa + wiring->parameters.sensor.pressure_noise_pa *
                                            random_normal(&wiring->pressure_random[index]);
    if (index == SUPPLY_INDEX || !faults->reading_stands[index]) {
        wiring->shown_pa[index] = noisy_pa;
    }
    if (index != SUPPLY_INDEX && faults->reading_replaced[index]) {
        wiring->shown_pa[index] = (double)faults->reading_pa[index];
    }
}

static double ratio_of(const struct wiring *wiring, uint32_t index) {
    const double full_pa = index == SUPPLY_INDEX ? SUPPLY_FULL_PA : CHAMBER_FULL_PA;
    const bool broken =
        index == SUPPLY_INDEX ? wiring->faults.supply_unknown : wiring->faults.channel_fails[index];
    return broken ? 0.0 : RATIO_AT_ZERO + RATIO_SPAN * wiring->shown_pa[index] / full_pa;
}

double wiring_sample(void *context, uint32_t channel) {
    static const struct {
        uint32_t channel, port, pin, index;
    } wire[4] = {{CHANNEL_CHAMBER_1, PORT_A, 0u, 0u},
                 {CHANNEL_CHAMBER_2, PORT_A, 1u, 1u},
                 {CHANNEL_CHAMBER_3, PORT_C, 1u, 2u},
                 {CHANNEL_SUPPLY, PORT_C, 0u, SUPPLY_INDEX}};
    struct wiring *wiring = context;
    const double noise = wiring->parameters.converter_noise / ADC_FULL_SCALE / sqrt(SUMMED) *
                         random_normal(&wiring->converter_random);
    if (channel == ADC_CHANNEL_VREFINT) {
        return REFERENCE_V / *wiring->supply_v + noise;
    }
    if (now_us(wiring) - wiring->plant_us >= FOLLOW_US) {
        wiring_follow(wiring);
    }
    for (size_t i = 0; i < sizeof wire / sizeof wire[0]; i++) {
        if (wire[i].channel == channel && gpio_is_analog(&wiring->gpio[wire[i].port], wire[i].pin)) {
            draw(wiring, wire[i].index);
            return ratio_of(wiring, wire[i].index) + noise;
        }
    }
    return noise;
}

void wiring_send_bytes(struct wiring *wiring, const uint8_t *bytes, size_t count) {
    const int64_t byte_ticks = TICKS_PER_SECOND * BITS_A_BYTE / BAUD;
    int64_t at_ticks =
        wiring->line_free_ticks > wiring->core->now_ticks ? wiring->line_free_ticks : wiring->core->now_ticks;
    for (size_t i = 0; i < count; i++) {
        at_ticks += byte_ticks;
        (void)usart_line(wiring->tip_line,
                         &(struct usart_byte){.at_ticks = at_ticks, .baud = BAUD, .value = bytes[i]});
    }
    wiring->line_free_ticks = at_ticks;
}

/* The record's first byte ends when the pose is as old as the sensor makes it. */
static void send_record(struct wiring *wiring, const struct hal_tip_sample *tip) {
    uint8_t bytes[WIRING_RECORD_BYTES];
    const int64_t byte_ticks = TICKS_PER_SECOND * BITS_A_BYTE / BAUD;
    const int64_t start_ticks =
        (tip->measured_us + wiring->parameters.sensor.tip_delay_us) * TICKS_PER_US - byte_ticks;
    size_t count = wiring->encode(tip, bytes);
    if (wiring->line_free_ticks > start_ticks + (int64_t)count * byte_ticks) {
        wiring->tip_dropped++; /* a record is still waiting behind the one on the line */
        return;
    }
    count = wiring->tamper != NULL ? wiring->tamper(wiring->tamper_context, bytes, count) : count;
    if (start_ticks > wiring->line_free_ticks) {
        wiring->line_free_ticks = start_ticks;
    }
    wiring_send_bytes(wiring, bytes, count);
}

static float scatter(struct wiring *wiring, double most) {
    return (float)(most * (2.0 * random_uniform(&wiring->fault_random) - 1.0));
}

static void scatter_pose(struct wiring *wiring, struct hal_tip_sample *sample) {
    double norm = 0.0;
    for (size_t i = 0; i < 4; i++) {
        sample->quaternion[i] = scatter(wiring, 1.0);
        norm += (double)sample->quaternion[i] * (double)sample->quaternion[i];
    }
    for (size_t i = 0; i < 4; i++) {
        sample->quaternion[i] = (float)((double)sample->quaternion[i] / sqrt(norm));
    }
    for (size_t i = 0; i < 3; i++) {
        sample->position_m[i] = scatter(wiring, 0.1);
    }
}

static void spoil_tip(struct wiring *wiring, struct hal_tip_sample *sample) {
    const struct wiring_faults *faults = &wiring->faults;
    if (faults->tip_stands) {
        const int64_t measured_us = sample->measured_us;
        *sample = wiring->tip_shown;
        sample->measured_us = measured_us;
    }
    if (faults->tip_scatters) {
        scatter_pose(wiring, sample);
    }
    sample->position_m[0] += (float)faults->tip_away_m;
    sample->status |= faults->tip_status;
    wiring->tip_shown = *sample;
}

/* Samples are taken now and sent later; those under way are in the line's queue. */
static void on_tip(void *context, int64_t at_ticks) {
    struct wiring *wiring = context;
    const struct sensor_parameters *sensor = &wiring->parameters.sensor;
    struct hal_tip_sample tip;
    const int64_t at_us = at_ticks / TICKS_PER_US;
    schedule_set(&wiring->core->schedule, wiring->tip_slot, at_ticks + sensor->tip_period_us * TICKS_PER_US);
    follow_to(wiring, at_us);
    plant_sample_tip(&wiring->plant, NULL, 1e-6 * (double)at_us, 1e-6 * (double)sensor->tip_period_us,
                     random_uniform(&wiring->chance_random));
    sensor_tip(sensor, &wiring->plant.pose, at_us, &wiring->tip_random, &tip);
    wiring->tip_samples++;
    if (!wiring->faults.tip_stops && wiring->encode != NULL) {
        spoil_tip(wiring, &tip);
        send_record(wiring, &tip);
    }
}

static void on_step(void *context, int64_t at_ticks) {
    struct wiring *wiring = context;
    schedule_set(&wiring->core->schedule, wiring->step_slot, at_ticks + STEP_US * TICKS_PER_US);
    wiring_follow(wiring);
    on_outputs(wiring); /* a fault may have been injected meanwhile */
}

void wiring_init(struct wiring *wiring, const struct bend_table *table,
                 const struct wiring_parameters *parameters, uint64_t seed) {
    struct core *core = wiring->core;
    wiring->parameters = *parameters;
    plant_init(&wiring->plant, table, &parameters->plant);
    for (uint64_t i = 0; i < 4; i++) {
        random_seed(&wiring->pressure_random[i], seed, i < 3 ? 1 + i : 7);
    }
    random_seed(&wiring->tip_random, seed, 4);
    random_seed(&wiring->chance_random, seed, 5);
    random_seed(&wiring->converter_random, seed, 6);
    random_seed(&wiring->fault_random, seed, 8);
    wiring->supply_shut_us = wiring->coils_off_us = -1;
    wiring->valves->updated = on_period;
    wiring->valves->outputs_changed = on_outputs;
    wiring->valves->context = wiring;
    for (size_t p = 0; p < GPIO_PORTS; p++) {
        wiring->gpio[p].changed = on_pins;
        wiring->gpio[p].context = wiring;
    }
    wiring->tip_slot = schedule_add(&core->schedule, on_tip, wiring);
    wiring->step_slot = schedule_add(&core->schedule, on_step, wiring);
    schedule_set(&core->schedule, wiring->tip_slot, parameters->sensor.tip_period_us * TICKS_PER_US);
    schedule_set(&core->schedule, wiring->step_slot, STEP_US * TICKS_PER_US);
}
