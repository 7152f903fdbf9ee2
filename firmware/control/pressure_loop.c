#include "control/pressure_loop.h"

#include "control/real_math.h"

#define SECONDS_PER_US 1e-6f
#define INNOVATION_SHARE 0.0625f
#define INNOVATION_SIGMAS 0.81f /* 4.5 sigma of an average over 1/16, sqrt(1/31) of one sample's: in minutes by chance */
#define CLIPPED_SIGMAS 3.0f     /* closer to zero than this, readings are clipped and say little */
#define PULSE_MARGIN_US 100.0f  /* a pulse is this much longer than the open delay, or left out */
#define CAPACITY_LEAST_M3 1e-6f

void pressure_loop_default_parameters(struct pressure_loop_parameters *parameters) {
    *parameters = (struct pressure_loop_parameters){
        .pwm_period_us = 10000,
        .open_delay_us = 1500,
        .close_delay_us = 1000,
        .ambient_pa_abs = 101325.0f,
        .flow_factor = 2e-10f * 1.185f * 287.0f * 293.15f,
        .vent_factor = 2e-10f * 1.185f * 287.0f * 293.15f,
        .critical_ratio = 0.3f,
        .nominal_supply_pa = 40000.0f,
        .tube_volume_m3 = 2e-6f,
        .nominal_capacity_m3 = 1.5e-4f,
        .sensor_noise_pa = 150.0f,
        .gain = 0.008f,
        .gain_fast = 0.1f,
        .bias_gain_per_s = 4.0f,
        .bias_limit = 0.3f,
    };
}

void pressure_loop_init(struct pressure_loop *loop) {
    *loop = (struct pressure_loop){.estimate_pa = 0.0f};
}

/* p V flow through an opening at 293.15 K (ISO 6358-1:2013): zero against the pressure. */
static float gas_flow(const struct pressure_loop_parameters *parameters, float factor, float up_pa_abs,
                      float down_pa_abs) {
    if (!(up_pa_abs > down_pa_abs)) {
        return 0.0f;
    }
    const float ratio = down_pa_abs / up_pa_abs, b = parameters->critical_ratio;
    const float choked = factor * up_pa_abs;
    if (ratio <= b) {
        return choked;
    }
    const float share = (ratio - b) / (1.0f - b);
    return choked * real_sqrt(1.0f - share * share);
}

/* Rates of pressure while filling and while venting, Pa/s, both positive. */
static void rates(const struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                  float pressure_pa, float supply_pa, float capacity_m3, float *fill, float *vent) {
    const float chamber_pa_abs = parameters->ambient_pa_abs + pressure_pa;
    const float capacity = real_max(capacity_m3, CAPACITY_LEAST_M3);
    float gained = loop->bias;
    if (parameters->leak_factor > 0.0f) {
        gained -= gas_flow(parameters, parameters->leak_factor, chamber_pa_abs, parameters->ambient_pa_abs);
    }
    const float filled =
        gas_flow(parameters, parameters->flow_factor, parameters->ambient_pa_abs + supply_pa, chamber_pa_abs);
    const float vented = gas_flow(parameters, parameters->vent_factor, chamber_pa_abs, parameters->ambient_pa_abs);
    *fill = (filled + gained) / capacity;
    *vent = (vented - gained) / capacity;
}

/* --- the valve's pulses --- */

struct pressure_loop_clock pressure_loop_clock_at(int64_t time_us, int64_t period_start_us, int32_t step_us) {
    return (struct pressure_loop_clock){
        .now_us = (uint32_t)time_us, .phase_us = (int32_t)(time_us - period_start_us), .step_us = step_us};
}

static int32_t most(int32_t a, int32_t b) {
    return a > b ? a : b;
}

static int32_t least(int32_t a, int32_t b) {
    return a < b ? a : b;
}

/* From `from_us` to `to_us`, less than half a wrap apart. */
static int32_t since(uint32_t from_us, uint32_t to_us) {
    return (int32_t)(to_us - from_us);
}

int32_t pressure_loop_vented_us(const struct pressure_loop *loop, const struct pressure_loop_clock *clock) {
    return since(loop->last.close_at_us, clock->now_us);
}

/* Before its time is half a wrap away, a pulse that is long over is made younger. */
static void age_pulses(struct pressure_loop *loop, uint32_t now_us) {
    if (since(loop->last.close_at_us, now_us) > PRESSURE_LOOP_VENTED_MOST_US) {
        loop->last.close_at_us = now_us - (uint32_t)PRESSURE_LOOP_VENTED_MOST_US;
        loop->last.open_at_us = loop->last.close_at_us;
        loop->earlier_count = 0u;
    }
}

/* A valve that is late still has pulses before the last one ahead of it. */
static void keep_pulse(struct pressure_loop *loop) {
    loop->earlier_newest = (loop->earlier_newest + 1u) % PRESSURE_LOOP_EARLIER;
    loop->earlier[loop->earlier_newest] = loop->last;
    loop->earlier_count += loop->earlier_count < PRESSURE_LOOP_EARLIER ? 1u : 0u;
}

static bool open_at(const struct pressure_loop *loop, uint32_t time_us) {
    return since(loop->last.open_at_us, time_us) > 0 && since(loop->last.close_at_us, time_us) < 0;
}

/* The period that starts at `start_us` takes over the duty written last. A valve that is still open when its coil is
 * energised again stays open; a pulse shorter than the open delay does not open it. */
static void start_period(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                         uint32_t start_us) {
    loop->duty = loop->duty_next;
    const int32_t on_us = (int32_t)(loop->duty * (float)(int32_t)parameters->pwm_period_us + 0.5f);
    const uint32_t seen_us = start_us + (uint32_t)parameters->late_us;
    const uint32_t close_at_us = seen_us + (uint32_t)(on_us + (int32_t)parameters->close_delay_us);
    if (on_us > 0 && open_at(loop, seen_us)) {
        loop->last.close_at_us = close_at_us;
    } else if (on_us > (int32_t)parameters->open_delay_us) {
        if (parameters->late_us > 0) {
            keep_pulse(loop);
        }
        loop->last.open_at_us = seen_us + (uint32_t)parameters->open_delay_us;
        loop->last.close_at_us = close_at_us;
    }
}

static int32_t overlap(const struct pressure_loop_pulse *pulse, uint32_t from_us, int32_t length_us) {
    return most(0, least(length_us, since(from_us, pulse->close_at_us)) - most(0, since(from_us, pulse->open_at_us)));
}

/* Of the `length_us` from `from_us` on, how long the valve fills. */
static int32_t filling_us(const struct pressure_loop *loop, uint32_t from_us, int32_t length_us) {
    int32_t sum_us = overlap(&loop->last, from_us, length_us);
    for (uint32_t i = 0; i < loop->earlier_count; i++) {
        const struct pressure_loop_pulse *pulse = &loop->earlier[(loop->earlier_newest - i) % PRESSURE_LOOP_EARLIER];
        if (since(from_us, pulse->close_at_us) <= 0) {
            break; /* the older ones are over sooner still */
        }
        sum_us += overlap(pulse, from_us, length_us);
    }
    return sum_us;
}

/* --- observer --- */

void pressure_loop_predict(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                           float supply_pa, float capacity_m3, const struct pressure_loop_clock *clock) {
    const int32_t step_us = clock->step_us;
    const float share = (float)filling_us(loop, clock->now_us - (uint32_t)step_us, step_us) / (float)step_us;
    const float step_s = (float)step_us * SECONDS_PER_US;
    float fill = 0.0f, vent = 0.0f;
    rates(loop, parameters, loop->estimate_pa, supply_pa, capacity_m3, &fill, &vent);
    loop->estimate_pa += step_s * (share * fill - (1.0f - share) * vent);
    const float bias_pa = step_s * loop->bias / real_max(capacity_m3, CAPACITY_LEAST_M3);
    const float modelled_pa = real_max(loop->estimate_pa - bias_pa, 0.0f);
    loop->filled_share = share;
    loop->fill_pa = step_s * fill - bias_pa;
    loop->vent_pa = step_s * vent + bias_pa;
    loop->estimate_pa = real_max(loop->estimate_pa, 0.0f);
    loop->unmodelled_pa = loop->estimate_pa - modelled_pa;
    loop->shown_pa += step_s / (parameters->reading_lag_s + step_s) * (loop->estimate_pa - loop->shown_pa);
    age_pulses(loop, clock->now_us);
    if (clock->phase_us == 0) {
        start_period(loop, parameters, clock->now_us); /* with the duty of the step before: this one's comes too late */
    }
}

void pressure_loop_correct(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                           float measured_pa, float capacity_m3, int32_t step_us) {
    const float clip_pa = CLIPPED_SIGMAS * parameters->sensor_noise_pa;
    const float innovation_pa = measured_pa - (parameters->reading_lag_s > 0.0f ? loop->shown_pa : loop->estimate_pa);
    if (loop->estimate_pa < clip_pa && measured_pa < 1.5f * clip_pa) {
        loop->innovation_pa = 0.0f;
        loop->unmodelled_pa = 0.0f;
        return;
    }
    loop->innovation_pa += INNOVATION_SHARE * (innovation_pa - loop->innovation_pa);
    const bool off = real_abs(loop->innovation_pa) > INNOVATION_SIGMAS * parameters->sensor_noise_pa;
    const float predicted_pa = loop->estimate_pa;
    const float step_pa = (off ? parameters->gain_fast : parameters->gain) * innovation_pa;
    loop->estimate_pa += step_pa;
    loop->shown_pa += step_pa;
    loop->estimate_pa = real_max(loop->estimate_pa, 0.0f);
    loop->unmodelled_pa += loop->estimate_pa - predicted_pa;
    loop->bias += parameters->bias_gain_per_s * (float)step_us * SECONDS_PER_US * innovation_pa * capacity_m3;
    loop->bias = real_clamp(loop->bias, -parameters->bias_limit, parameters->bias_limit);
}

/* How far the mean of a steady saw lies above its value at a period's start: down for the open delay, up for the fill,
 * down for the rest. */
static float saw_offset(float fill, float vent, float wait_s, float period_s) {
    const float fill_s = vent * period_s / (fill + vent);
    const float rest_s = real_max(period_s - wait_s - fill_s, 0.0f);
    const float low = -vent * wait_s, high = low + fill * fill_s;
    const float area = 0.5f * low * wait_s + 0.5f * (low + high) * fill_s + (high - 0.5f * vent * rest_s) * rest_s;
    return area / period_s;
}

/* Energised time that fills for `fill_us` of a period, from a valve that is closed at its start. */
static float pulse_from_closed(const struct pressure_loop_parameters *parameters, float fill_us) {
    const float period_us = (float)(int32_t)parameters->pwm_period_us;
    const float open_us = (float)(int32_t)parameters->open_delay_us, close_us = (float)(int32_t)parameters->close_delay_us;
    const float shortest_us = close_us + PULSE_MARGIN_US;
    if (fill_us < 0.5f * shortest_us) {
        return 0.0f;
    }
    if (fill_us < shortest_us) {
        return open_us + PULSE_MARGIN_US;
    }
    const float pulse_us = fill_us + open_us - close_us;
    return pulse_us <= period_us - close_us ? pulse_us : period_us;
}

/* The same from a valve that is still open. */
static float pulse_from_open(const struct pressure_loop_parameters *parameters, float fill_us) {
    const float period_us = (float)(int32_t)parameters->pwm_period_us, close_us = (float)(int32_t)parameters->close_delay_us;
    const float pulse_us = real_max(fill_us - close_us, 0.0f);
    if (pulse_us <= period_us - close_us) {
        return pulse_us;
    }
    return pulse_us > period_us - 0.5f * close_us ? period_us : period_us - close_us;
}

/* Where the pressure will be when the valve sees the period that starts in `start_us`, through the pulses that are already
 * on their way. At most a period at a time, so that rates keep up with the pressure. */
static float forecast(const struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                      float supply_pa, float capacity_m3, uint32_t now_us, int32_t start_us) {
    const int32_t seen_us = start_us + parameters->late_us;
    float pressure_pa = loop->estimate_pa;
    int32_t from_us = 0, to_us = start_us;
    while (from_us < seen_us) {
        float fill = 0.0f, vent = 0.0f;
        rates(loop, parameters, pressure_pa, supply_pa, capacity_m3, &fill, &vent);
        const float filling_s = (float)filling_us(loop, now_us + (uint32_t)from_us, to_us - from_us) * SECONDS_PER_US;
        const float left_s = (float)(to_us - from_us) * SECONDS_PER_US;
        pressure_pa = real_max(0.0f, pressure_pa + fill * filling_s - vent * (left_s - filling_s));
        from_us = to_us;
        to_us = least(to_us + (int32_t)parameters->pwm_period_us, seen_us);
    }
    return pressure_pa;
}

/* The nearest duty that a valve with a dead band can be given, as the valve takes it. */
static float beyond_dead_band(const struct pressure_loop_parameters *parameters, float duty) {
    if (!(parameters->least_duty > 0.0f)) {
        return duty;
    }
    const float least = (parameters->least_duty - parameters->lost_duty) / (1.0f - parameters->lost_duty);
    return duty < 0.5f * least ? 0.0f : real_max(duty, least);
}

/* The duty to write for it. */
static float through_dead_band(const struct pressure_loop_parameters *parameters, float duty) {
    const bool lossy = parameters->lost_duty > 0.0f && duty > 0.0f;
    return lossy ? parameters->lost_duty + duty * (1.0f - parameters->lost_duty) : duty;
}

float pressure_loop_same_duty(const struct pressure_loop *loop, const struct pressure_loop_parameters *parameters) {
    return through_dead_band(parameters, loop->duty_next);
}

float pressure_loop_duty(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters, float target_pa,
                         float supply_pa, float capacity_m3, const struct pressure_loop_clock *clock) {
    const int32_t period_us = (int32_t)parameters->pwm_period_us;
    const float period_s = (float)period_us * SECONDS_PER_US;
    if (!(target_pa > 0.0f)) {
        loop->duty_next = 0.0f;
        return 0.0f;
    }
    const int32_t start_us = period_us - clock->phase_us;
    const float start_pa = forecast(loop, parameters, supply_pa, capacity_m3, clock->now_us, start_us);
    /* what the period must do: end where a steady saw about the target starts */
    float fill = 0.0f, vent = 0.0f;
    rates(loop, parameters, 0.5f * (start_pa + target_pa), supply_pa, capacity_m3, &fill, &vent);
    fill = real_max(fill, 1.0f);
    vent = real_max(vent, 0.0f);
    const float wait_s = (float)(int32_t)parameters->open_delay_us * SECONDS_PER_US;
    const float end_pa = target_pa - saw_offset(fill, vent, wait_s, period_s);
    const float fill_us = (end_pa - start_pa + vent * period_s) / (fill + vent) / SECONDS_PER_US;
    const bool still_open = open_at(loop, clock->now_us + (uint32_t)(start_us + parameters->late_us));
    const float pulse_us =
        still_open ? pulse_from_open(parameters, fill_us) : pulse_from_closed(parameters, fill_us);
    loop->duty_next = beyond_dead_band(parameters, real_clamp(pulse_us / (float)period_us, 0.0f, 1.0f));
    return through_dead_band(parameters, loop->duty_next);
}

static void cut(struct pressure_loop_pulse *pulse, uint32_t shut_us) {
    pulse->close_at_us = since(pulse->close_at_us, shut_us) < 0 ? shut_us : pulse->close_at_us;
}

void pressure_loop_vent(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                        const struct pressure_loop_clock *clock) {
    const uint32_t shut_us = clock->now_us + (uint32_t)parameters->close_delay_us;
    loop->duty_next = 0.0f;
    loop->duty = 0.0f;
    cut(&loop->last, shut_us);
    for (uint32_t i = 0; i < loop->earlier_count; i++) {
        cut(&loop->earlier[(loop->earlier_newest - i) % PRESSURE_LOOP_EARLIER], shut_us);
    }
}
