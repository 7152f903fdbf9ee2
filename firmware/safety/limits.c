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
        .over_working_pa = 1.05f * working_pa, /* a step to the working limit overshoots by 3.4 % at most */
        .over_working_steps = 20u,
        .sensor_least_pa = -2500.0f,
        .sensor_most_pa = 49900.0f,   /* of a range that ends at 50 kPa: a broken wire reads full scale */
        .table_bytes_per_step = 448u, /* a round of the reference table takes about a second */
        .table_bytes_busy = 144u,     /* 1.9 s, were every step busy and the tip sensor at its fastest */
        .parameter_bytes_per_step = 16u,
    };
}

void limits_init(struct limits *limits) {
    *limits = (struct limits){.over_steps = 0u};
}

static bool is_in_range(const struct limits_parameters *parameters, float pressure_pa) {
    return pressure_pa >= parameters->sensor_least_pa && pressure_pa < parameters->sensor_most_pa; /* NaN is not */
}

uint32_t limits_check_pressures(const struct limits_parameters *parameters, const float shown_pa[3],
                                const float pressure_pa[3], const bool pressure_ok[3]) {
    uint32_t faults = 0u;
    for (uint32_t c = 0; c < 3u; c++) {
        const bool known = pressure_ok[c] && is_in_range(parameters, pressure_pa[c]);
        if (!known || !is_in_range(parameters, shown_pa[c])) {
            faults |= 1u << FAULT_SENSOR_RANGE;
        }
        if (known && pressure_pa[c] > parameters->hard_pressure_pa) {
            faults |= 1u << FAULT_OVERPRESSURE;
        }
    }
    return faults;
}

bool limits_check_working(struct limits *limits, const struct limits_parameters *parameters,
                          float highest_pa) {
    limits->over_steps = highest_pa > parameters->over_working_pa ? limits->over_steps + 1u : 0u;
    return limits->over_steps >= parameters->over_working_steps;
}

bool limits_check_image(struct limits_image *image, const uint8_t *bytes, uint32_t size, uint32_t expected,
                        uint32_t count) {
    const uint32_t left = size - image->next, part = left < count ? left : count;
    image->crc = crc32_update(image->crc, bytes + image->next, part);
    image->next += part;
    if (image->next >= size) {
        image->corrupt = image->corrupt || image->crc != expected;
        image->next = 0u;
        image->crc = 0u;
    }
    return image->corrupt;
}

bool limits_check_table(struct limits *limits, const struct bend_table *table, uint32_t count) {
    return limits_check_image(&limits->table, table->image + COVERED_FROM, table->image_bytes - COVERED_FROM,
                              table->image_crc, count);
}
