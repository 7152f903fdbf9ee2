#include "gap/table_scaled.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/bend_table_format.h"
#include "control/crc32.h"

/* Floats among the geometry at BEND_TABLE_OFFSET_GEOMETRY. */
enum { ACTIVE_LENGTH = 2, WORKING_PRESSURE = 5, BURST_PRESSURE = 6 };
enum { JUMPS = 2 };

void table_scales_none(struct table_scales *scales) {
    *scales = (struct table_scales){.stiffness = 1.0, .gain = {1.0, 1.0, 1.0}, .active_fraction = 1.0};
}

/* The place in the new image of what stands in the old one. */
static float *place_of(const struct table_scaled *scaled, const struct bend_table *from, const float *old) {
    return (float *)(void *)(scaled->image + ((const unsigned char *)old - from->image));
}

static void multiply(float *value, size_t count, double factor) {
    for (size_t i = 0; i < count; i++) {
        value[i] = (float)((double)value[i] * factor);
    }
}

static void multiply_at(unsigned char *image, size_t offset, double factor) {
    float value;
    memcpy(&value, image + offset, sizeof value);
    multiply(&value, 1, factor);
    memcpy(image + offset, &value, sizeof value);
}

static size_t nodes_of(const struct bend_table *grid) {
    return (size_t)grid->nodes[0] * grid->nodes[1] * grid->nodes[2];
}

/* --- header --- */

/* FNV-1a 64 (Fowler, Noll, Vo) of the scales on top of the table's own inputs: another table has another hash. */
static void mix_hash(unsigned char *image, const struct table_scales *scales) {
    const unsigned char *byte = (const unsigned char *)scales;
    uint64_t hash;
    memcpy(&hash, image + BEND_TABLE_OFFSET_HASH, sizeof hash);
    for (size_t i = 0; i < sizeof *scales; i++) {
        hash = (hash ^ byte[i]) * 1099511628211u;
    }
    memcpy(image + BEND_TABLE_OFFSET_HASH, &hash, sizeof hash);
}

static void scale_header(unsigned char *image, const struct table_scales *scales) {
    const double limits = fmin(scales->stiffness, 1.0);
    multiply_at(image, BEND_TABLE_OFFSET_GEOMETRY + ACTIVE_LENGTH * sizeof(float), scales->active_fraction);
    multiply_at(image, BEND_TABLE_OFFSET_GEOMETRY + WORKING_PRESSURE * sizeof(float), limits);
    multiply_at(image, BEND_TABLE_OFFSET_GEOMETRY + BURST_PRESSURE * sizeof(float), limits);
    for (size_t i = 0; i < JUMPS; i++) {
        multiply_at(image, BEND_TABLE_OFFSET_JUMPS + i * sizeof(float), scales->stiffness);
    }
    mix_hash(image, scales);
}

/* --- grids --- */

/* What chamber `c` adds to the bend, with the others as they are, points elsewhere: at every node, from the old table. */
static void turn_chamber(const struct table_scaled *scaled, const struct bend_table *from, size_t c, double azimuth_rad) {
    const size_t stride[3] = {(size_t)from->nodes[1] * from->nodes[2], from->nodes[2], 1};
    const double cosine = cos(azimuth_rad) - 1.0, sine = sin(azimuth_rad);
    const float *old[2] = {from->channel[BEND_TABLE_CURVATURE_X], from->channel[BEND_TABLE_CURVATURE_Y]};
    float *x = place_of(scaled, from, old[0]), *y = place_of(scaled, from, old[1]);
    for (size_t at = 0; at < nodes_of(from); at++) {
        const size_t without = at - at / stride[c] % from->nodes[c] * stride[c];
        const double added_x = (double)old[0][at] - (double)old[0][without];
        const double added_y = (double)old[1][at] - (double)old[1][without];
        x[at] = (float)((double)x[at] + cosine * added_x - sine * added_y);
        y[at] = (float)((double)y[at] + sine * added_x + cosine * added_y);
    }
}

static void scale_grid(const struct table_scaled *scaled, const struct bend_table *from,
                       const struct table_scales *scales) {
    for (size_t c = 0; c < 3; c++) {
        multiply(place_of(scaled, from, from->axis_pa[c]), from->nodes[c], scales->stiffness / scales->gain[c]);
        if (fabs(scales->azimuth_rad[c]) > 0.0) {
            turn_chamber(scaled, from, c, scales->azimuth_rad[c]);
        }
    }
    multiply(place_of(scaled, from, from->channel[BEND_TABLE_VON_MISES]), nodes_of(from), scales->stiffness);
}

/* Of any one chamber, whose gain it cannot know; control never goes there. */
static void scale_ballooned(const struct table_scaled *scaled, const struct bend_table *from,
                            const struct bend_table *grid, const struct table_scales *scales) {
    for (size_t a = 1; a < 3; a++) {
        multiply(place_of(scaled, from, grid->axis_pa[a]), grid->nodes[a], scales->stiffness);
    }
    multiply(place_of(scaled, from, grid->channel[BEND_TABLE_PRESSURE_1]), nodes_of(grid), scales->stiffness);
    multiply(place_of(scaled, from, grid->channel[BEND_TABLE_VON_MISES]), nodes_of(grid), scales->stiffness);
}

static void seal(unsigned char *image, size_t size) {
    const size_t covered = BEND_TABLE_OFFSET_CRC + sizeof(uint32_t);
    const uint32_t crc = crc32_update(0u, image + covered, size - covered);
    memcpy(image + BEND_TABLE_OFFSET_CRC, &crc, sizeof crc);
}

static bool is_none(const struct table_scales *scales) {
    bool none = !(fabs(scales->stiffness - 1.0) > 0.0) && !(fabs(scales->active_fraction - 1.0) > 0.0);
    for (size_t c = 0; c < 3; c++) {
        none = none && !(fabs(scales->gain[c] - 1.0) > 0.0) && !(fabs(scales->azimuth_rad[c]) > 0.0);
    }
    return none;
}

bool table_scaled(struct table_scaled *scaled, const struct bend_table *from, const struct table_scales *scales,
                  char *error, size_t error_bytes) {
    struct bend_table ballooned;
    scaled->image = malloc(from->image_bytes);
    if (scaled->image == NULL) {
        (void)snprintf(error, error_bytes, "out of memory for the calibrated table");
        return false;
    }
    memcpy(scaled->image, from->image, from->image_bytes);
    if (!is_none(scales)) {
        scale_header(scaled->image, scales);
        scale_grid(scaled, from, scales);
        if (bend_table_ballooned(from, &ballooned)) {
            scale_ballooned(scaled, from, &ballooned, scales);
        }
        seal(scaled->image, from->image_bytes);
    }
    const enum bend_table_status status = bend_table_open(&scaled->table, scaled->image, from->image_bytes, NULL);
    if (status != BEND_TABLE_OK) {
        (void)snprintf(error, error_bytes, "the calibrated table does not hold: %s", bend_table_status_text(status));
        table_scaled_free(scaled);
        return false;
    }
    return true;
}

void table_scaled_free(struct table_scaled *scaled) {
    free(scaled->image);
    scaled->image = NULL;
}
