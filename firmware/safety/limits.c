#include "safety/limits.h"

#include "control/bend_table_format.h"
#include "control/crc32.h"
#include "control/real_math.h"
#include "safety/supervisor.h"

#define COVERED_FROM (BEND_TABLE_OFFSET_CRC + 4u)

void limits_default_parameters(struct limits_parameters *parameters, const struct bend_table *table) {
    const float working_pa = table != NULL ? table->module.working_pressure_pa : 11000.0f;
    const float burst_pa = table != NULL ? table->module.burst_pressure_pa : 15000.0f;
    *parameters = (struct limits_parameters){
        .working_pressure_pa = working_pa,
        /* half-way to bursting: with 0.15 kPa of noise, 2 kPa over the working pressure is no noise */
        .hard_pressure_pa = 0.5f * (working_pa + burst_pa),
        .sensor_least_pa = -2500.0f,
        .sensor_most_pa = 49900.0f, /* of a range that ends at 50 kPa: a broken wire reads full scale */
        .table_bytes_per_step = 256u,
    };
}

void limits_init(struct limits *limits) {
    *limits = (struct limits){.table_next = COVERED_FROM, .table_crc = 0u, .table_corrupt = false};
}

uint32_t limits_check_pressures(const struct limits_parameters *parameters, const float pressure_pa[3],
                                const bool pressure_ok[3]) {
    uint32_t faults = 0u;
    for (uint32_t c = 0; c < 3u; c++) {
        const float p = pressure_pa[c];
        if (!pressure_ok[c] || !(p >= parameters->sensor_least_pa) || !(p < parameters->sensor_most_pa)) {
            faults |= 1u << FAULT_SENSOR_RANGE;
        } else if (p > parameters->hard_pressure_pa) {
            faults |= 1u << FAULT_OVERPRESSURE;
        }
    }
    return faults;
}

bool limits_check_table(struct limits *limits, const struct limits_parameters *parameters,
                        const struct bend_table *table) {
    const uint32_t left = table->image_bytes - limits->table_next;
    const uint32_t count = left < parameters->table_bytes_per_step ? left : parameters->table_bytes_per_step;
    limits->table_crc = crc32_update(limits->table_crc, table->image + limits->table_next, count);
    limits->table_next += count;
    if (limits->table_next >= table->image_bytes) {
        limits->table_corrupt = limits->table_corrupt || limits->table_crc != table->image_crc;
        limits->table_next = COVERED_FROM;
        limits->table_crc = 0u;
    }
    return limits->table_corrupt;
}
