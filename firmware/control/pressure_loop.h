/* One chamber's pressure: an observer with the valve's and the gas' model, and a duty that reaches the target at the
 * end of the next PWM period as far as flow allows.
 *
 * The valve always fills or vents, so pressure saws within each period; estimate and target are handled sample by
 * sample with that saw in mind. The observer's flow bias (leaks, wrong conductance) is the integral part; it is held
 * back by what the valve can do, so there is nothing to wind up. Units: Pa gauge unless _abs, m3, us. */
#ifndef TRIBEND_PRESSURE_LOOP_H
#define TRIBEND_PRESSURE_LOOP_H

#include <stdbool.h>
#include <stdint.h>

struct pressure_loop_parameters {
    int64_t pwm_period_us;
    int64_t open_delay_us;  /* from energising to fill */
    int64_t close_delay_us; /* from de-energising to vent */
    float ambient_pa_abs;
    float flow_factor;      /* C rho_ref R T, m3/s: times upstream absolute pressure gives p V flow, Pa m3/s */
    float critical_ratio;   /* b of ISO 6358 */
    float nominal_supply_pa;
    float tube_volume_m3;
    float nominal_capacity_m3; /* without a table: V + p_abs dV/dp */
    float sensor_noise_pa;     /* rms of one sample */
    float gain;                /* of a sample's innovation, in steady state */
    float gain_fast;           /* while innovations do not average out */
    float bias_gain_per_s;     /* flow bias: share of innovation times capacity, for each second of step */
    float bias_limit;          /* Pa m3/s */
};

struct pressure_loop {
    float estimate_pa;
    float bias;           /* p V flow that the model does not know, Pa m3/s */
    float innovation_pa;  /* averaged over some 16 samples */
    float unmodelled_pa;  /* change of the estimate in this step that valve and gas do not explain: bias and readings */
    float duty;           /* of the period under way */
    float duty_next;      /* written, taken over at the next period */
    int64_t open_at_us;   /* the valve fills from here ... */
    int64_t close_at_us;  /* ... to here */
};

/* Design page's nominal valve, gas and sensor. */
void pressure_loop_default_parameters(struct pressure_loop_parameters *parameters);
void pressure_loop_init(struct pressure_loop *loop);
/* Carry the estimate from `time_us - step_us` to `time_us`. `capacity_m3` is V + p_abs dV/dp of the chamber and tube. */
void pressure_loop_predict(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                           float supply_pa, float capacity_m3, int64_t time_us, int64_t step_us);
void pressure_loop_correct(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters,
                           float measured_pa, float capacity_m3, int64_t step_us);
/* Duty for the period that starts next; call in every step: only the one before a period's start counts. */
float pressure_loop_duty(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters, float target_pa,
                         float supply_pa, float capacity_m3, int64_t time_us);
/* The valve was gated off at `time_us`: it vents after its close delay. */
void pressure_loop_vent(struct pressure_loop *loop, const struct pressure_loop_parameters *parameters, int64_t time_us);

#endif
