#include "gap/plan_noise.h"

#include <math.h>
#include <stdlib.h>

bool plan_noise_open(struct plan_noise *noise, size_t samples, size_t channels) {
    const size_t all = samples * channels;
    noise->samples = samples;
    noise->size = calloc(3 * all + 1, sizeof *noise->size);
    noise->gain = noise->size == NULL ? NULL : noise->size + all;
    noise->scale = noise->size == NULL ? NULL : noise->gain + all;
    return noise->size != NULL;
}

void plan_noise_close(struct plan_noise *noise) {
    free(noise->size);
    *noise = (struct plan_noise){.samples = 0};
}

void plan_noise_prepare(struct plan_noise *noise, size_t channel, double white, double memory_s,
                        double step_s) {
    const double keeps = exp(-step_s / memory_s);
    double variance = 1.0; /* of the slow part in units of its size */
    for (size_t i = channel * noise->samples; i < (channel + 1) * noise->samples; i++) {
        const double size = noise->size[i];
        const double innovation2 = size * size * variance + white * white;
        noise->gain[i] = variance * size / innovation2;
        noise->scale[i] = 1.0 / sqrt(innovation2);
        variance -= noise->gain[i] * size * variance;
        variance = keeps * keeps * variance + 1.0 - keeps * keeps;
    }
}

void plan_noise_whiten(const struct plan_noise *noise, size_t channel, double memory_s, double step_s,
                       double *signal, size_t stride) {
    const double keeps = exp(-step_s / memory_s);
    const size_t first = channel * noise->samples;
    double slow = 0.0;
    for (size_t i = 0; i < noise->samples; i++) {
        const double innovation = signal[i * stride] - noise->size[first + i] * slow;
        signal[i * stride] = innovation * noise->scale[first + i];
        slow = keeps * (slow + noise->gain[first + i] * innovation);
    }
}
