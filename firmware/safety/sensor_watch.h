/* Watches one chamber's pressure readings as such: do they jump, stand still, or scatter? From readings alone
 * and what the valve could do; not here: ranges (limits.h), whether they follow the valve (flow_watch.h).
 * Units: Pa, control steps. */
#ifndef TRIBEND_SENSOR_WATCH_H
#define TRIBEND_SENSOR_WATCH_H

#include <stdbool.h>
#include <stdint.h>

#define SENSOR_WATCH_SPAN 8u /* control steps over which a rate is taken */

struct sensor_watch_parameters {
    float rate_pa;          /* a change over the span that noise does not make */
    float rate_factor;      /* and this many times what valve and supply could do in it */
    uint32_t stuck_samples; /* equal readings in a row, above zero; 0: the sensor is quieter than its
                               converter's step */
    float noise_most_pa;    /* rms of a sample */
};

struct sensor_watch {
    float before_pa;
    float recent_pa[4];
    float means_pa[SENSOR_WATCH_SPAN]; /* of four readings each */
    float noise_pa2;                   /* mean square of a sample's noise */
    uint32_t equal;                    /* readings like the one before, in a row */
    uint32_t seen;                     /* good readings since the last bad one, up to what the means need */
};

void sensor_watch_default_parameters(struct sensor_watch_parameters *parameters, float noise_pa);
void sensor_watch_init(struct sensor_watch *watch);
/* Each control step: the reading, whether it can be used, and how far the valve could move the pressure in a
 * step. Returns bits of enum supervisor_fault. */
uint32_t sensor_watch_step(struct sensor_watch *watch, const struct sensor_watch_parameters *parameters,
                           float reading_pa, bool usable, float step_most_pa, uint32_t step);

#endif
