/* One chamber's pressure: an observer with the valve's and the gas' model, and a duty that reaches the target at the
 * end of the next PWM period as far as flow allows.
 *
 * The valve always fills or vents, so pressure saws within each period; estimate and target are handled sample by
 * sample with that saw in mind. The observer's flow bias (leaks, wrong conductance) is the integral part; it is held
 * back by what the valve can do, so there is nothing to wind up. A valve that is known to be late is driven by where the
 * pressure will be when it sees the pulse. Units: Pa gauge unless _abs, m3, us. Times inside are 32 bits wide and wrap. */
#ifndef TRIBEND_PRESSURE_LOOP_H
#define TRIBEND_PRESSURE_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#define PRESSURE_LOOP_VENTED_MOST_US (1 << 30)
#define PRESSURE_LOOP_EARLIER 8u /* pulses on their way to a valve that is late, beside the last one */

struct pressure_loop_parameters {
    int64_t pwm_period_us;  /* the three at most some 100 ms: inside, 32 bits do */
    int64_t open_delay_us;  /* from energising to fill */
    int64_t close_delay_us; /* from de-energising to vent */
    float ambient_pa_abs;
    float flow_factor;      /* C rho_ref R T, m3/s: times upstream absolute pressure gives p V flow, Pa m3/s */
    float vent_factor;      /* the same while venting */
    float critical_ratio;   /* b of ISO 6358 */
    float nominal_supply_pa;
    float tube_volume_m3;
    float nominal_capacity_m3; /* without a table: V + p_abs dV/dp */
    float sensor_noise_pa;     /* rms of one sample */
    float gain;                /* of a sample's innovation, in steady state */
    float gain_fast;           /* while innovations do not average out */
    float bias_gain_per_s;     /* flow bias: share of innovation times capacity, for each second of step */
    float bias_limit;          /* Pa m3/s */
    /* what a calibration may say of this chamber (calibration.h); zero otherwise */
    int32_t late_us;           /* from a coil's pulse to the valve's, at most 60 ms */
    float leak_factor;         /* of a leak to ambient, like flow_factor */
    float reading_lag_s;       /* the sensor's time constant */
    float least_duty;          /* smaller duties do nothing ... */
    float lost_duty;           /* ... and larger ones act like (duty - lost) / (1 - lost) */
};

/* When a step is: one for all chambers. */
struct pressure_loop_clock {
    uint32_t now_us;  /* wraps */
    int32_t phase_us; /* since the running PWM period began */
    int32_t step_us;
};

/* The valve fills within [open_at, close_at). */
struct pressure_loop_pulse {
    uint32_t open_at_us;
    uint32_t close_at_us;
};

struct pressure_loop {
    float estimate_pa;
    float bias;           /* p V flow that the model does not know, Pa m3/s */
    float innovation_pa;  /* averaged over some 16 samples */
    float unmodelled_pa;  /* change of the estimate in this step that valve and gas do not explain: bias and readings */
    float shown_pa;       /* what a sensor that lags shows of the estimate */
    float filled_share;   /* of this step in which the valve filled, by the model; */
    float fill_pa;        /* what filling all the step would have brought, */
    float vent_pa;        /* and venting all of it taken */
    float duty;           /* of the period under way, as the valve takes it */
    float duty_next;      /* written, taken over at the next period */
    struct pressure_loop_pulse last; /* the valve fills within it; long after, held at PRESSURE_LOOP_VENTED_MOST_US ago */
    struct pressure_loop_pulse earlier[PRESSURE_LOOP_EARLIER]; /* only of a valve that is late */
    uint32_t earlier_newest; /* in that ring */
    uint32_t earlier_count;
};

/* Design page's nominal valve, gas and sensor. */
void pressure_loop_default_parameters(struct pressure_loop_parameters *parameters);
void pressure_loop_init(struct pressure_loop *loop);
struct pressure_loop_clock pressure_loop_clock_at(int64_t time_us, int64_t period_start_us, int32_t step_us);
/* Carry the estimate through the step that ends now. `capacity_m3` is V + p_abs dV/dp of the chamber and tube. */
void pressure_loop_predict(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                           float supply_pa, float capacity_m3, const struct pressure_loop_clock *clock);
void pressure_loop_correct(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                           float measured_pa, float capacity_m3, int32_t step_us);
/* Duty for the period that starts next; only the one in force when that period starts counts. */
float pressure_loop_duty(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters, float target_pa,
                         float supply_pa, float capacity_m3, const struct pressure_loop_clock *clock);
/* The duty written last, again. */
float pressure_loop_same_duty(const struct pressure_loop *loop, const struct pressure_loop_parameters *parameters);
/* The valve was gated off now: it vents after its close delay. */
void pressure_loop_vent(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                        const struct pressure_loop_clock *clock);
/* Since the valve last filled, negative where that is to come; at most PRESSURE_LOOP_VENTED_MOST_US. */
int32_t pressure_loop_vented_us(const struct pressure_loop *loop, const struct pressure_loop_clock *clock);

#endif
