/* Noise: half the mean square of successive differences is the variance of a sample, whatever the pressure
 * does slowly (von Neumann 1941). Rate: two means of four samples, 106 Pa rms apart by noise alone: 0.8 kPa is
 * 7.5 sigma. Equal readings: 150 Pa of noise over steps of 12 Pa repeat by chance once in 40. */
#include "safety/sensor_watch.h"

#include "control/real_math.h"
#include "safety/supervisor.h"

#define NOISE_SHARE 0.015625f /* of a low-pass over 64 samples */
#define NOISE_SIGMAS 3.0f

void sensor_watch_default_parameters(struct sensor_watch_parameters *parameters, float noise_pa) {
    *parameters = (struct sensor_watch_parameters){.rate_pa = 800.0f,
                                                   .rate_factor = 2.0f,
                                                   .stuck_samples = 25u,
                                                   .noise_most_pa = NOISE_SIGMAS * noise_pa};
}

void sensor_watch_init(struct sensor_watch *watch) {
    *watch = (struct sensor_watch){.seen = 0u};
}

/* Difference of the mean now and a span ago; zero until there is one. */
static float change(struct sensor_watch *watch, float reading_pa, uint32_t step) {
    float *slot = &watch->means_pa[step % SENSOR_WATCH_SPAN];
    float *recent = watch->recent_pa;
    recent[step % 4u] = reading_pa;
    const float mean_pa = 0.25f * ((recent[0] + recent[1]) + (recent[2] + recent[3]));
    const float change_pa = mean_pa - *slot;
    *slot = mean_pa;
    watch->seen += watch->seen < SENSOR_WATCH_SPAN + 4u ? 1u : 0u;
    return watch->seen < SENSOR_WATCH_SPAN + 4u ? 0.0f : change_pa;
}

uint32_t sensor_watch_step(struct sensor_watch *watch, const struct sensor_watch_parameters *parameters,
                           float reading_pa, bool usable, float step_most_pa, uint32_t step) {
    uint32_t faults = 0u;
    if (!usable) {
        sensor_watch_init(watch);
        return 0u;
    }
    if (watch->seen > 0u) {
        const float difference_pa = reading_pa - watch->before_pa;
        watch->noise_pa2 += NOISE_SHARE * (0.5f * difference_pa * difference_pa - watch->noise_pa2);
        watch->equal = difference_pa == 0.0f && reading_pa > 0.0f ? watch->equal + 1u : 0u;
    }
    watch->before_pa = reading_pa;
    const float most_pa =
        parameters->rate_factor * (float)SENSOR_WATCH_SPAN * step_most_pa + parameters->rate_pa;
    if (real_abs(change(watch, reading_pa, step)) > most_pa) {
        faults |= 1u << FAULT_PRESSURE_RATE;
    }
    if (parameters->stuck_samples > 0u && watch->equal >= parameters->stuck_samples) {
        faults |= 1u << FAULT_SENSOR_STUCK;
    }
    if (watch->noise_pa2 > parameters->noise_most_pa * parameters->noise_most_pa) {
        faults |= 1u << FAULT_SENSOR_NOISY;
    }
    return faults;
}
