/* An image into bend_table_open(), and what was accepted into look-up and inverse. The CRC-32 is put right
 * first, or nothing past it would ever be reached; an input whose first byte is odd keeps its own.
 *
 * Held: a table that was accepted answers with finite numbers anywhere, its inverse stays within the module's
 * working pressure and the axes, and slices of the check agree with the whole. */
#include "fuzz.h"

#include <string.h>

#include "control/bend_inverse.h"
#include "control/bend_table.h"
#include "control/bend_table_format.h"
#include "control/crc32.h"
#include "control/real_math.h"

static const float places_pa[] = {-1000.0f, 0.0f, 1.0f, 700.0f, 3300.0f, 9999.0f, 1e6f, 3e38f};
#define PLACES (sizeof places_pa / sizeof places_pa[0])

static void look_up(const struct bend_table *table) {
    for (size_t a = 0; a < PLACES; a++) {
        const float pressure_pa[3] = {places_pa[a], places_pa[(a + 3u) % PLACES],
                                      places_pa[(2u * a + 1u) % PLACES]};
        struct bend_table_stencil stencil;
        float gradient[3];
        bend_table_locate(table, pressure_pa, &stencil);
        for (int i = 0; i < 3; i++) {
            fuzz_assert(stencil.first[i] + 4u <= table->nodes[i] && stencil.cell[i] + 2u <= table->nodes[i]);
        }
        for (int c = 0; c < (int)BEND_TABLE_CHANNEL_COUNT; c++) {
            (void)bend_table_value(table, &stencil, (enum bend_table_channel)c);
            (void)bend_table_gradient(table, &stencil, (enum bend_table_channel)c, gradient);
        }
        float kept_pa[3] = {pressure_pa[0], pressure_pa[1], pressure_pa[2]};
        (void)bend_table_is_valid(table, &stencil);
        (void)bend_table_keep_valid(table, kept_pa);
    }
}

static void invert(const struct bend_table *table) {
    for (int b = 0; b < 6; b++) {
        const struct bend_inverse_request request = {0.3f * (float)b, 1.1f * (float)b,
                                                     b == 5 ? 500.0f : 0.0f};
        struct bend_inverse_result result;
        bend_inverse_solve(table, &request, &result);
        for (int c = 0; c < 3; c++) {
            fuzz_assert(result.pressure_pa[c] >= 0.0f);
            fuzz_assert(result.pressure_pa[c] <= table->module.working_pressure_pa);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    struct bend_table table, bound, ballooned;
    uint8_t *image = malloc(size > 0 ? size : 1u); /* aligned, and of that very size for the sanitizer */
    if (image == NULL) {
        return 0;
    }
    memcpy(image, bytes, size);
    if (size > BEND_TABLE_HEADER_BYTES &&
        (bytes[BEND_TABLE_OFFSET_NAME + BEND_TABLE_NAME_BYTES - 1u] & 1u) == 0u) {
        const uint32_t from = BEND_TABLE_OFFSET_CRC + 4u, crc = crc32_update(0u, image + from, size - from);
        memcpy(image + BEND_TABLE_OFFSET_CRC, &crc, sizeof crc);
    }
    const enum bend_table_status status = bend_table_open(&table, image, size, NULL);
    fuzz_assert(bend_table_status_text(status) != NULL);
    if (status == BEND_TABLE_OK) {
        fuzz_assert(bend_table_bind(&bound, image, size, NULL) == BEND_TABLE_OK);
        fuzz_assert(bend_table_is_finite(&bound, 0u, bound.image_bytes / 2u / 4u * 4u));
        look_up(&table);
        invert(&table);
        if (bend_table_ballooned(&table, &ballooned)) {
            look_up(&ballooned);
        }
    }
    free(image);
    return 0;
}
