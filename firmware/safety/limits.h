/* Fault detectors that need no past: pressures against their limits, and the check-sums of what the
 * controller runs on. What follows from them is the supervisor's. Units: Pa gauge. */
#ifndef TRIBEND_LIMITS_H
#define TRIBEND_LIMITS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "control/bend_table.h"

struct limits_parameters {
    float working_pressure_pa; /* greatest commanded pressure */
    float hard_pressure_pa;    /* one sample over it is a fault */
    float over_working_pa;     /* an estimate over it is one after so many steps in a row */
    uint32_t over_working_steps;
    float sensor_least_pa; /* readings outside are a sensor fault */
    float sensor_most_pa;
    uint32_t table_bytes_per_step; /* of the table's image checked in a step that has little else to do ... */
    uint32_t table_bytes_busy;     /* ... and in one that has; none in one that follows a tip sample, or has much to
                                      do and works out duties */
    uint32_t parameter_bytes_per_step; /* of the parameters, in each step */
};

/* A check-sum of some memory, taken in parts. */
struct limits_image {
    uint32_t next; /* first byte not checked yet in this round */
    uint32_t crc;
    bool corrupt; /* a whole round did not match */
};

struct limits {
    struct limits_image table;
    uint32_t over_steps;
};

/* From the table's module, or for the founding paper's module where `table` is NULL. */
void limits_default_parameters(struct limits_parameters *parameters, const struct bend_table *table);
void limits_init(struct limits *limits);
/* Bits of enum supervisor_fault: whether a sensor is broken shows in what it says itself, `shown_pa`, too, whether a
 * chamber bursts in the pressure behind that. */
uint32_t limits_check_pressures(const struct limits_parameters *parameters, const float shown_pa[3],
                                const float pressure_pa[3], const bool pressure_ok[3]);
/* The highest estimate has been over the working limit for too long. */
bool limits_check_working(struct limits *limits, const struct limits_parameters *parameters,
                          float highest_pa);
/* Check the next `count` of `size` bytes; true once a whole round did not match `expected`. */
bool limits_check_image(struct limits_image *image, const uint8_t *bytes, uint32_t size, uint32_t expected,
                        uint32_t count);
/* The same of the table's image. */
bool limits_check_table(struct limits *limits, const struct bend_table *table, uint32_t count);

#endif
