/* An image into parameters_read() and, as the newest in the storage, into the store. The first byte chooses:
 * odd, the CRC-32 is left as it is, else put right; the rest is the image.
 *
 * Held: what comes out is within every bound and agrees, and writing it gives an image that reads back the
 * same. */
#include "fuzz.h"

#include <string.h>

#include "comms/parameters.h"
#include "comms/store.h"
#include "control/crc32.h"
#include "support/sim_storage.h"

#define IMAGE_MOST 2048u

static struct sim_storage storage;
static struct store store;

static void check(const struct parameters *parameters) {
    struct parameters copy = *parameters, back;
    struct parameters_image_report report;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    fuzz_assert(parameters_agree(parameters, NULL));
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
        const uint32_t id = parameter_row((enum parameter_index)i)->id;
        uint32_t value = 0u;
        fuzz_assert(parameter_get(parameters, id, &value) == PARAMETER_OK);
        fuzz_assert(parameter_set(&copy, id, value, true, NULL) == PARAMETER_OK);
    }
    fuzz_assert(calibration_limit(&copy.controller.calibration) == 0u);
    const uint32_t bytes = parameters_write(parameters, NULL, 1u, image);
    fuzz_assert(parameters_read(&back, NULL, image, bytes, &report) == PARAMETERS_IMAGE_OK);
    fuzz_assert(report.refused == 0u && report.unknown == 0u);
    fuzz_assert(memcmp(&back, parameters, sizeof back) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    struct parameters parameters;
    struct parameters_image_report report;
    if (size == 0u || size - 1u > IMAGE_MOST) {
        return 0;
    }
    const uint32_t image_bytes = (uint32_t)size - 1u;
    uint8_t *image = malloc(image_bytes > 0u ? image_bytes : 1u);
    if (image == NULL) {
        return 0;
    }
    memcpy(image, bytes + 1, image_bytes);
    const uint32_t used = parameters_image_bytes(image, image_bytes);
    if (used != 0u && (bytes[0] & 1u) == 0u) {
        uint32_t crc =
            crc32_update(0u, image + PARAMETERS_IMAGE_HEADER_BYTES, used - PARAMETERS_IMAGE_HEADER_BYTES);
        crc = crc32_update(crc, image, 12u);
        memcpy(image + 12, &crc, sizeof crc);
    }
    const enum parameters_image_status status =
        parameters_read(&parameters, NULL, image, image_bytes, &report);
    check(&parameters);
    sim_storage_init(&storage, 4u * SIM_STORAGE_PAGE);
    memcpy(storage.parameters[0], image, image_bytes);
    store_init(&store, &storage.hal);
    fuzz_assert(store.parameters_found == (status == PARAMETERS_IMAGE_OK));
    (void)store_parameters(&store, NULL, &parameters, &report);
    check(&parameters);
    free(image);
    return 0;
}
