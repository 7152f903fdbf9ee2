#include "support/tiny_table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/bend_table_format.h"
#include "control/crc32.h"

#define NODES 4u
#define MOST_PA 9000.0f

static void put(uint8_t *image, uint32_t offset, const void *value, size_t bytes) {
    memcpy(image + offset, value, bytes);
}

static void put_u32(uint8_t *image, uint32_t offset, uint32_t value) {
    put(image, offset, &value, sizeof value);
}

static void put_header(uint8_t *image) {
    const uint16_t version = BEND_TABLE_VERSION, header_bytes = BEND_TABLE_HEADER_BYTES;
    const float geometry[8] = {0.025f, 0.055f, 0.055f, 0.005f, 0.005f, MOST_PA, 1.4f * MOST_PA, 1.9f};
    put(image, 0u, BEND_TABLE_MAGIC, 4u);
    put(image, BEND_TABLE_OFFSET_VERSION, &version, sizeof version);
    put(image, BEND_TABLE_OFFSET_HEADER_BYTES, &header_bytes, sizeof header_bytes);
    put_u32(image, BEND_TABLE_OFFSET_IMAGE_BYTES, TINY_TABLE_BYTES);
    put(image, BEND_TABLE_OFFSET_NAME, "tiny", 5u);
    for (uint32_t a = 0; a < 3u; a++) {
        put_u32(image, BEND_TABLE_OFFSET_NODES + 4u * a, NODES);
    }
    put_u32(image, BEND_TABLE_OFFSET_CHANNELS, BEND_TABLE_CHANNEL_COUNT);
    put(image, BEND_TABLE_OFFSET_GEOMETRY, geometry, sizeof geometry);
}

static float value_of(uint32_t channel, const float p[3]) {
    const float x = -p[0] + 0.5f * (p[1] + p[2]), y = 0.8660254f * (p[2] - p[1]);
    switch (channel) {
    case BEND_TABLE_CURVATURE_X:
        return 3e-3f * x;
    case BEND_TABLE_CURVATURE_Y:
        return 3e-3f * y;
    case BEND_TABLE_STRETCH:
    case BEND_TABLE_STRETCH_MAX:
        return 1.0f + 1e-5f * (p[0] + p[1] + p[2]);
    case BEND_TABLE_VON_MISES:
        return 20.0f * p[0];
    case BEND_TABLE_WIDTH_MAX:
        return 0.025f;
    default:
        return 2e-5f + 4e-9f * p[channel - (uint32_t)BEND_TABLE_VOLUME_1];
    }
}

static uint32_t put_grid(uint8_t *image) {
    uint32_t at = BEND_TABLE_HEADER_BYTES;
    float axis[NODES];
    for (uint32_t i = 0; i < NODES; i++) {
        axis[i] = MOST_PA * (float)i / (float)(NODES - 1u);
    }
    for (uint32_t a = 0; a < 3u; a++, at += (uint32_t)sizeof axis) {
        put(image, at, axis, sizeof axis);
    }
    for (uint32_t c = 0; c < (uint32_t)BEND_TABLE_CHANNEL_COUNT; c++) {
        for (uint32_t i = 0; i < NODES * NODES * NODES; i++, at += 4u) {
            const float p[3] = {axis[i / NODES / NODES], axis[i / NODES % NODES], axis[i % NODES]};
            const float value = value_of(c, p);
            put(image, at, &value, sizeof value);
        }
    }
    memset(image + at, (int)(BEND_TABLE_TAG_VALID | BEND_TABLE_TAG_STABLE), NODES * NODES * NODES);
    return at + NODES * NODES * NODES;
}

void tiny_table_make(struct tiny_table *tiny) {
    const uint32_t from = BEND_TABLE_OFFSET_CRC + 4u;
    memset(tiny, 0, sizeof *tiny);
    put_header(tiny->image);
    tiny->bytes = put_grid(tiny->image);
    put_u32(tiny->image, BEND_TABLE_OFFSET_CRC,
            crc32_update(0u, tiny->image + from, TINY_TABLE_BYTES - from));
    if (tiny->bytes != TINY_TABLE_BYTES ||
        bend_table_open(&tiny->table, tiny->image, tiny->bytes, NULL) != BEND_TABLE_OK) {
        abort();
    }
}
