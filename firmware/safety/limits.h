/* Fault detectors: pure conditions on one step's inputs. What follows from them is the supervisor's. */
#ifndef TRIBEND_LIMITS_H
#define TRIBEND_LIMITS_H

#include <stdbool.h>
#include <stdint.h>

#include "control/bend_table.h"

struct limits_parameters {
    float working_pressure_pa; /* greatest commanded pressure */
    float hard_pressure_pa;    /* one sample over it is a fault */
    float sensor_least_pa;     /* readings outside are a sensor fault */
    float sensor_most_pa;
    uint32_t table_bytes_per_step; /* of the table's image checked in each step */
};

struct limits {
    uint32_t table_next;  /* first byte not checked yet in this round */
    uint32_t table_crc;
    bool table_corrupt;
};

/* From the table's module, or for the founding paper's module where `table` is NULL. */
void limits_default_parameters(struct limits_parameters *parameters, const struct bend_table *table);
void limits_init(struct limits *limits);
/* Bits of enum supervisor_fault that these readings show. */
uint32_t limits_check_pressures(const struct limits_parameters *parameters, const float pressure_pa[3],
                                const bool pressure_ok[3]);
/* Check the next part of the table's image; true once a whole round did not match its CRC-32. */
bool limits_check_table(struct limits *limits, const struct limits_parameters *parameters,
                        const struct bend_table *table);

#endif
