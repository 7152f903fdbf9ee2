#include "support/synthetic_table.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "control/bend_table_format.h"
#include "control/crc32.h"

static void put(uint8_t *image, size_t offset, const void *value, size_t bytes) {
    memcpy(image + offset, value, bytes);
}

void synthetic_table_seal(struct synthetic_table *synthetic) {
    const size_t covered = BEND_TABLE_OFFSET_CRC + 4u;
    const uint32_t crc = crc32_update(0u, synthetic->image + covered, synthetic->size - covered);
    put(synthetic->image, BEND_TABLE_OFFSET_CRC, &crc, sizeof crc);
}

static void fill_header(struct synthetic_table *synthetic, uint32_t nodes, double most_pa) {
    const uint16_t version = BEND_TABLE_VERSION, header_bytes = BEND_TABLE_HEADER_BYTES;
    const uint32_t size = (uint32_t)synthetic->size, channels = BEND_TABLE_CHANNEL_COUNT;
    const uint64_t hash = 0x0123456789abcdefu;
    const float geometry[8] = {0.025f, 0.055f, 0.055f, 0.005f, 0.005f, (float)most_pa, 1.3f * (float)most_pa, 1.9f};
    uint8_t *image = synthetic->image;
    put(image, 0, BEND_TABLE_MAGIC, 4);
    put(image, BEND_TABLE_OFFSET_VERSION, &version, sizeof version);
    put(image, BEND_TABLE_OFFSET_HEADER_BYTES, &header_bytes, sizeof header_bytes);
    put(image, BEND_TABLE_OFFSET_IMAGE_BYTES, &size, sizeof size);
    put(image, BEND_TABLE_OFFSET_NAME, "synthetic", 10);
    put(image, BEND_TABLE_OFFSET_HASH, &hash, sizeof hash);
    for (size_t a = 0; a < 3; a++) {
        put(image, BEND_TABLE_OFFSET_NODES + 4 * a, &nodes, sizeof nodes);
    }
    put(image, BEND_TABLE_OFFSET_CHANNELS, &channels, sizeof channels);
    put(image, BEND_TABLE_OFFSET_GEOMETRY, geometry, sizeof geometry);
    put(image, BEND_TABLE_OFFSET_CHANNEL_TEXT, BEND_TABLE_CHANNEL_TEXT, sizeof BEND_TABLE_CHANNEL_TEXT);
}

/* A grid with the same number of nodes on each axis; returns where it ends. */
static size_t fill_grid(struct synthetic_table *synthetic, size_t offset, uint32_t nodes,
                        float axis[3][BEND_TABLE_AXIS_NODES_MAX], synthetic_channel formula) {
    const size_t all = (size_t)nodes * nodes * nodes;
    for (size_t a = 0; a < 3; a++) {
        put(synthetic->image, offset, axis[a], 4u * nodes);
        offset += 4u * nodes;
    }
    for (size_t c = 0; c < BEND_TABLE_CHANNEL_COUNT; c++) {
        for (size_t at = 0; at < all; at++) {
            const double point[3] = {(double)axis[0][at / nodes / nodes], (double)axis[1][at / nodes % nodes],
                                     (double)axis[2][at % nodes]};
            const float value = (float)formula((enum bend_table_channel)c, point);
            put(synthetic->image, offset, &value, sizeof value);
            offset += sizeof value;
        }
    }
    memset(synthetic->image + offset, (int)(BEND_TABLE_TAG_VALID | BEND_TABLE_TAG_STABLE), all);
    return (offset + all + 3u) / 4u * 4u;
}

static size_t grid_bytes(uint32_t nodes) {
    const size_t all = (size_t)nodes * nodes * nodes;
    return (4u * (3u * nodes + BEND_TABLE_CHANNEL_COUNT * all) + all + 3u) / 4u * 4u;
}

static void open_again(struct synthetic_table *synthetic) {
    synthetic_table_seal(synthetic);
    assert_int_equal(bend_table_open(&synthetic->table, synthetic->image, synthetic->size, "synthetic"),
                     BEND_TABLE_OK);
}

void synthetic_table_create(struct synthetic_table *synthetic, uint32_t nodes, double most_pa, double exponent,
                            synthetic_channel channel) {
    float axis[3][BEND_TABLE_AXIS_NODES_MAX];
    assert_true(nodes <= BEND_TABLE_AXIS_NODES_MAX);
    synthetic->size = BEND_TABLE_HEADER_BYTES + grid_bytes(nodes);
    synthetic->image = calloc(1, synthetic->size);
    assert_non_null(synthetic->image);
    fill_header(synthetic, nodes, most_pa);
    for (size_t a = 0; a < 3; a++) {
        for (size_t i = 0; i < nodes; i++) {
            axis[a][i] = (float)(most_pa * pow((double)i / (double)(nodes - 1), exponent));
        }
    }
    assert_int_equal(fill_grid(synthetic, BEND_TABLE_HEADER_BYTES, nodes, axis, channel), synthetic->size);
    open_again(synthetic);
}

void synthetic_table_add_ballooned(struct synthetic_table *synthetic, uint32_t nodes, double least_m2, double most_m2,
                                   double others_pa, float jump_up_pa, float jump_down_pa, synthetic_channel channel) {
    float axis[3][BEND_TABLE_AXIS_NODES_MAX];
    const size_t end = synthetic->size;
    synthetic->size += grid_bytes(nodes);
    uint8_t *image = realloc(synthetic->image, synthetic->size);
    assert_non_null(image);
    synthetic->image = image;
    for (size_t i = 0; i < nodes; i++) {
        const double share = (double)i / (double)(nodes - 1);
        axis[0][i] = (float)(least_m2 * pow(most_m2 / least_m2, share));
        axis[1][i] = axis[2][i] = (float)(others_pa * share);
    }
    assert_int_equal(fill_grid(synthetic, end, nodes, axis, channel), synthetic->size);
    const uint32_t size = (uint32_t)synthetic->size;
    put(image, BEND_TABLE_OFFSET_IMAGE_BYTES, &size, sizeof size);
    for (size_t a = 0; a < 3; a++) {
        put(image, BEND_TABLE_OFFSET_BALLOONED + 4 * a, &nodes, sizeof nodes);
    }
    put(image, BEND_TABLE_OFFSET_JUMPS, &jump_up_pa, sizeof jump_up_pa);
    put(image, BEND_TABLE_OFFSET_JUMPS + 4, &jump_down_pa, sizeof jump_down_pa);
    open_again(synthetic);
}

void synthetic_table_free(struct synthetic_table *synthetic) {
    free(synthetic->image);
    synthetic->image = NULL;
}

double synthetic_module(enum bend_table_channel channel, const double pressure_pa[3]) {
    double vector[2] = {0.0, 0.0}, stretch = 1.0;
    for (int c = 0; c < 3; c++) {
        const double curvature = 1e-3 * pressure_pa[c] + 2e-7 * pressure_pa[c] * pressure_pa[c];
        vector[0] -= curvature * cos(c * 2.0 * M_PI / 3.0);
        vector[1] -= curvature * sin(c * 2.0 * M_PI / 3.0);
        stretch += 1e-5 * pressure_pa[c];
    }
    switch (channel) {
    case BEND_TABLE_CURVATURE_X:
        return vector[0];
    case BEND_TABLE_CURVATURE_Y:
        return vector[1];
    case BEND_TABLE_STRETCH:
        return stretch;
    case BEND_TABLE_VOLUME_1:
    case BEND_TABLE_VOLUME_2:
    case BEND_TABLE_VOLUME_3:
        return 2e-5 + 4e-9 * pressure_pa[(int)channel - (int)BEND_TABLE_VOLUME_1];
    case BEND_TABLE_VON_MISES:
        return 20.0 * pressure_pa[0];
    case BEND_TABLE_STRETCH_MAX:
        return 1.0 + 1e-4 * pressure_pa[0];
    case BEND_TABLE_WIDTH_MAX:
        return 0.025 + 1e-6 * pressure_pa[0];
    case BEND_TABLE_CHANNEL_COUNT:
    default:
        return 0.0;
    }
}
