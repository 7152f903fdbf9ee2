#include "support/test.h"

#include <stdlib.h>

#include "comms/parameters.h"
#include "control/crc32.h"
#include "support/synthetic_table.h"

#define TYPE_BYTES(type) ((type) == PARAMETER_TYPE_TIME ? 8u : 4u)

static struct synthetic_table module_table; /* working 11 kPa, burst 15 kPa */

static int create_table(void **state) {
    (void)state;
    synthetic_table_create(&module_table, 5, 10000.0, 1.0, synthetic_module);
    return 0;
}

static int free_table(void **state) {
    (void)state;
    synthetic_table_free(&module_table);
    return 0;
}

static uint32_t bits_of(float value) {
    uint32_t bits = 0;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static float real_of(const struct parameters *parameters, uint32_t id) {
    uint32_t bits = 0;
    float value = 0.0f;
    assert_int_equal(parameter_get(parameters, id, &bits), PARAMETER_OK);
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t least_of(const struct parameter_row *row) {
    return row->type == PARAMETER_TYPE_REAL ? bits_of(row->least) : row->least_whole;
}

static uint32_t most_of(const struct parameter_row *row) {
    return row->type == PARAMETER_TYPE_REAL ? bits_of(row->most) : row->most_whole;
}

/* --- the table */

static bool is_calibrated(size_t at) {
    const size_t loop = offsetof(struct parameters, controller.pressure_loop);
    const size_t from[] = {offsetof(struct pressure_loop_parameters, late_us),
                           offsetof(struct pressure_loop_parameters, leak_factor)};
    return (at >= loop + from[0] && at < loop + from[0] + 8u) ||
           (at >= loop + from[1] && at < loop + sizeof(struct pressure_loop_parameters));
}

/* What aligns a time, or the end, to eight bytes. */
static bool is_padding(size_t at) {
    bool before_time = at + 4u == sizeof(struct parameters);
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
        const struct parameter_row *row = parameter_row((enum parameter_index)i);
        before_time = before_time || (row->type == PARAMETER_TYPE_TIME && row->at == at + 4u);
    }
    return before_time && at % 8u == 4u;
}

/* A tunable that is added to a struct and not to the table is found here: its bytes belong to no row. What a
 * calibration sets in the nominal loop has none; padding is zero, which few tunables are. */
static void every_tunable_has_a_row(void **state) {
    (void)state;
    uint8_t covered[sizeof(struct parameters)] = {0};
    struct parameters defaults;
    parameters_default(&defaults, NULL);
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
        const struct parameter_row *row = parameter_row((enum parameter_index)i);
        for (size_t b = 0; b < TYPE_BYTES(row->type); b++) {
            assert_int_equal(covered[row->at + b]++, 0);
        }
    }
    for (size_t at = 0; at < sizeof covered; at += 4) {
        uint32_t value = 0;
        memcpy(&value, (const uint8_t *)&defaults + at, sizeof value);
        if (covered[at] == 0 && !is_calibrated(at) && (value != 0 || !is_padding(at))) {
            fail_msg("no row of parameters.def is of the four bytes at offset %zu of struct parameters", at);
        }
    }
}

static void ids_are_unique_and_found(void **state) {
    (void)state;
    uint32_t found = 0;
    for (uint32_t id = 0; id < 70000; id++) {
        enum parameter_index index;
        if (parameter_find(id, &index)) {
            assert_int_equal(parameter_row(index)->id, id);
            found++;
        }
    }
    assert_int_equal(found, PARAMETER_COUNT);
}

static void defaults_are_within_their_bounds_and_agree(void **state) {
    (void)state;
    const struct bend_table *tables[] = {NULL, &module_table.table};
    for (int t = 0; t < 2; t++) {
        struct parameters parameters;
        parameters_default(&parameters, tables[t]);
        assert_true(parameters_agree(&parameters, tables[t]));
        for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
            const uint32_t id = parameter_row((enum parameter_index)i)->id;
            uint32_t value = 0;
            assert_int_equal(parameter_get(&parameters, id, &value), PARAMETER_OK);
            assert_int_equal(parameter_set(&parameters, id, value, true, tables[t]), PARAMETER_OK);
        }
    }
}

/* One fact in two places: calibration_limit() must accept what the table accepts, and change what lies
 * beyond. */
static void bounds_of_the_calibration_are_those_that_the_controller_keeps(void **state) {
    (void)state;
    const size_t first = offsetof(struct parameters, controller.calibration);
    uint32_t checked = 0;
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
        const struct parameter_row *row = parameter_row((enum parameter_index)i);
        if (row->at < first || row->at >= first + sizeof(struct controller_calibration)) {
            continue;
        }
        struct parameters parameters;
        for (int end = 0; end < 2; end++) {
            parameters_default(&parameters, NULL);
            const uint32_t value = end == 0 ? least_of(row) : most_of(row);
            assert_int_equal(parameter_set(&parameters, row->id, value, true, NULL), PARAMETER_OK);
            assert_int_equal(calibration_limit(&parameters.controller.calibration), 0);
        }
        uint8_t *member = (uint8_t *)&parameters + row->at;
        if (row->type == PARAMETER_TYPE_REAL) {
            const float beyond = nextafterf(row->most, INFINITY);
            memcpy(member, &beyond, sizeof beyond);
        } else {
            const int64_t beyond = (int64_t)row->most_whole + 1;
            memcpy(member, &beyond, sizeof beyond);
        }
        assert_int_equal(calibration_limit(&parameters.controller.calibration), 1);
        checked++;
    }
    assert_int_equal(checked, 49);
}

/* --- one parameter */

static void a_value_outside_its_bounds_is_refused_and_changes_nothing(void **state) {
    (void)state;
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
        const struct parameter_row *row = parameter_row((enum parameter_index)i);
        struct parameters parameters, before;
        parameters_default(&parameters, NULL);
        before = parameters;
        uint32_t wrong[4] = {most_of(row) + 1u, most_of(row) + 1u, UINT32_MAX, UINT32_MAX};
        if (row->type == PARAMETER_TYPE_REAL) {
            wrong[0] = bits_of(nextafterf(row->least, -INFINITY));
            wrong[1] = bits_of(nextafterf(row->most, INFINITY));
            wrong[2] = bits_of(NAN);
            wrong[3] = bits_of(INFINITY);
        } else if (row->least_whole > 0) {
            wrong[0] = row->least_whole - 1u;
        }
        for (int w = 0; w < 4; w++) {
            assert_int_equal(parameter_set(&parameters, row->id, wrong[w], true, NULL),
                             PARAMETER_OUT_OF_BOUNDS);
        }
        assert_memory_equal(&parameters, &before, sizeof before);
    }
}

static void an_unknown_parameter_is_said_to_be(void **state) {
    (void)state;
    struct parameters parameters;
    uint32_t value = 0;
    parameters_default(&parameters, NULL);
    assert_int_equal(parameter_get(&parameters, 0u, &value), PARAMETER_UNKNOWN);
    assert_int_equal(parameter_get(&parameters, 65535u, &value), PARAMETER_UNKNOWN);
    assert_int_equal(parameter_set(&parameters, 255u, 1u, true, NULL), PARAMETER_UNKNOWN);
}

static void most_parameters_change_only_while_vented(void **state) {
    (void)state;
    struct parameters parameters;
    parameters_default(&parameters, NULL);
    assert_int_equal(parameter_set(&parameters, 100u, bits_of(1.1f), false, NULL), PARAMETER_NOT_NOW);
    assert_close(real_of(&parameters, 100u), 1.0, 0.0);
    assert_int_equal(parameter_set(&parameters, 100u, bits_of(1.1f), true, NULL), PARAMETER_OK);
    assert_close(parameters.controller.calibration.reading_gain[0], 1.1, 1e-6);
    assert_int_equal(parameter_set(&parameters, 56u, bits_of(0.1f), false, NULL),
                     PARAMETER_OK); /* the tip loop's gain */
    assert_close(parameters.controller.tip_loop.gain, 0.1, 1e-6);
    assert_int_equal(parameter_set(&parameters, 16u, 20000u, false, NULL), PARAMETER_OK);
    assert_true(parameters.controller.tip_period_us == 20000);
}

/* The hard limit over the working one, both below what the sensor reads, and never beyond the module's. */
static void limits_that_do_not_go_together_are_refused(void **state) {
    (void)state;
    struct parameters parameters, before;
    const struct bend_table *table = &module_table.table;
    const float working = table->module.working_pressure_pa, burst = table->module.burst_pressure_pa;
    parameters_default(&parameters, table);
    before = parameters;
    assert_int_equal(parameter_set(&parameters, 24u, bits_of(working + 1.0f), true, table),
                     PARAMETER_CONFLICT);
    assert_int_equal(parameter_set(&parameters, 25u, bits_of(burst), true, table), PARAMETER_CONFLICT);
    assert_int_equal(parameter_set(&parameters, 25u, bits_of(working), true, table), PARAMETER_CONFLICT);
    assert_int_equal(parameter_set(&parameters, 27u, bits_of(working), true, table), PARAMETER_CONFLICT);
    assert_memory_equal(&parameters, &before, sizeof before);
    assert_int_equal(parameter_set(&parameters, 24u, bits_of(working - 1.0f), true, table), PARAMETER_OK);
    assert_int_equal(parameter_set(&parameters, 24u, bits_of(working + 1.0f), true, NULL), PARAMETER_OK);
}

/* --- images */

static uint32_t change_all(struct parameters *parameters) {
    uint32_t changed = 0;
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
        const struct parameter_row *row = parameter_row((enum parameter_index)i);
        uint32_t before = 0;
        assert_int_equal(parameter_get(parameters, row->id, &before), PARAMETER_OK);
        const uint32_t value = row->type == PARAMETER_TYPE_REAL
                                   ? bits_of(0.3f * row->least + 0.7f * row->most)
                                   : row->most_whole;
        if (value != before && parameter_set(parameters, row->id, value, true, NULL) == PARAMETER_OK) {
            changed++;
        }
    }
    return changed;
}

static void an_image_brings_back_what_was_written(void **state) {
    (void)state;
    struct parameters parameters, back;
    struct parameters_image_report report;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    parameters_default(&parameters, NULL);
    const uint32_t changed = change_all(&parameters);
    assert_true(changed >= 95);
    const uint32_t bytes = parameters_write(&parameters, NULL, 77u, image);
    assert_int_equal(bytes, PARAMETERS_IMAGE_HEADER_BYTES + 8u * changed);
    assert_int_equal(parameters_image_bytes(image, bytes), bytes);
    assert_int_equal(parameters_image_sequence(image), 77);
    assert_int_equal(parameters_read(&back, NULL, image, bytes, &report), PARAMETERS_IMAGE_OK);
    assert_memory_equal(&back, &parameters, sizeof back);
    assert_int_equal(report.unknown + report.refused, 0);
}

/* So that a new firmware's or a new table's defaults come into force where nobody chose otherwise. */
static void an_image_holds_only_what_differs_from_the_defaults(void **state) {
    (void)state;
    struct parameters parameters, back;
    struct parameters_image_report report;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    parameters_default(&parameters, NULL);
    assert_int_equal(parameters_write(&parameters, NULL, 1u, image), PARAMETERS_IMAGE_HEADER_BYTES);
    assert_int_equal(parameter_set(&parameters, 1u, 9u, true, NULL), PARAMETER_OK);
    const uint32_t bytes = parameters_write(&parameters, NULL, 1u, image);
    assert_int_equal(bytes, PARAMETERS_IMAGE_HEADER_BYTES + 8u);
    module_table.table.module.working_pressure_pa = 8000.0f;
    assert_int_equal(parameters_read(&back, &module_table.table, image, bytes, &report), PARAMETERS_IMAGE_OK);
    module_table.table.module.working_pressure_pa = 11000.0f;
    assert_int_equal(back.node.node_id, 9);
    assert_close(back.controller.limits.working_pressure_pa, 8000.0, 0.0);
}

static void an_image_with_limits_beyond_the_table_leaves_the_defaults(void **state) {
    (void)state;
    struct parameters parameters, back;
    struct parameters_image_report report;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    parameters_default(&parameters, NULL);
    assert_int_equal(parameter_set(&parameters, 25u, bits_of(40000.0f), true, NULL), PARAMETER_OK);
    assert_int_equal(parameter_set(&parameters, 24u, bits_of(30000.0f), true, NULL), PARAMETER_OK);
    assert_int_equal(parameter_set(&parameters, 1u, 2u, true, NULL), PARAMETER_OK);
    const uint32_t bytes = parameters_write(&parameters, NULL, 1u, image);
    assert_int_equal(parameters_read(&back, &module_table.table, image, bytes, &report), PARAMETERS_IMAGE_OK);
    assert_int_equal(report.refused, 1);
    assert_close(back.controller.limits.working_pressure_pa, module_table.table.module.working_pressure_pa,
                 0.0);
    assert_int_equal(back.node.node_id, 2);
}

static void reseal(uint8_t *image) {
    uint16_t count = 0;
    uint32_t sequence = 0, crc = 0;
    memcpy(&count, image + 6, 2);
    memcpy(&sequence, image + 8, 4);
    uint16_t version = 0;
    memcpy(&version, image + 4, 2);
    crc = crc32_update(0, image + PARAMETERS_IMAGE_HEADER_BYTES, (size_t)count * 8u);
    crc = crc32_update(crc, image, 12);
    memcpy(image + 12, &crc, 4);
}

static uint32_t small_image(uint8_t *image) {
    struct parameters parameters;
    parameters_default(&parameters, NULL);
    assert_int_equal(parameter_set(&parameters, 1u, 9u, true, NULL), PARAMETER_OK);
    assert_int_equal(parameter_set(&parameters, 100u, bits_of(1.25f), true, NULL), PARAMETER_OK);
    return parameters_write(&parameters, NULL, 3u, image);
}

static enum parameters_image_status read_small(const uint8_t *image, uint32_t bytes, struct parameters *back,
                                               struct parameters_image_report *report) {
    uint8_t *exact = malloc(bytes > 0 ? bytes : 1); /* so that the sanitizer sees a read beyond the end */
    assert_non_null(exact);
    memcpy(exact, image, bytes);
    const enum parameters_image_status status = parameters_read(back, NULL, exact, bytes, report);
    free(exact);
    return status;
}

static void a_damaged_image_leaves_the_defaults(void **state) {
    (void)state;
    struct parameters defaults, back;
    struct parameters_image_report report;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    const uint32_t bytes = small_image(image);
    parameters_default(&defaults, NULL);
    for (uint32_t bit = 0; bit < 8u * bytes; bit++) {
        image[bit / 8u] = (uint8_t)(image[bit / 8u] ^ (1u << (bit % 8u)));
        assert_int_not_equal(read_small(image, bytes, &back, &report), PARAMETERS_IMAGE_OK);
        assert_memory_equal(&back, &defaults, sizeof back);
        image[bit / 8u] = (uint8_t)(image[bit / 8u] ^ (1u << (bit % 8u)));
    }
    for (uint32_t cut = 0; cut < bytes; cut++) {
        assert_int_equal(read_small(image, cut, &back, &report), PARAMETERS_IMAGE_TOO_SHORT);
        assert_memory_equal(&back, &defaults, sizeof back);
    }
    assert_int_equal(read_small(image, bytes, &back, &report), PARAMETERS_IMAGE_OK);
}

static void another_version_is_refused_whole(void **state) {
    (void)state;
    const uint16_t versions[] = {0, PARAMETERS_VERSION + 1u, 65535};
    for (int v = 0; v < 3; v++) {
        struct parameters back;
        struct parameters_image_report report;
        uint8_t image[PARAMETERS_IMAGE_BYTES];
        const uint32_t bytes = small_image(image);
        memcpy(image + 4, &versions[v], 2);
        reseal(image);
        assert_int_equal(read_small(image, bytes, &back, &report), PARAMETERS_IMAGE_BAD_VERSION);
        assert_int_equal(back.node.node_id, 1);
    }
}

static void unknown_records_and_bad_values_are_left_out_and_counted(void **state) {
    (void)state;
    struct parameters back;
    struct parameters_image_report report;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    const uint32_t bytes = small_image(image), unknown = 254u, wrong = bits_of(NAN);
    memcpy(image + PARAMETERS_IMAGE_HEADER_BYTES, &unknown, 4);
    memcpy(image + PARAMETERS_IMAGE_HEADER_BYTES + 8 + 4, &wrong, 4);
    reseal(image);
    assert_int_equal(read_small(image, bytes, &back, &report), PARAMETERS_IMAGE_OK);
    assert_int_equal(report.unknown, 1);
    assert_int_equal(report.refused, 1);
    assert_int_equal(back.node.node_id, 1);
    assert_close(back.controller.calibration.reading_gain[0], 1.0, 0.0);
}

static void every_status_has_words(void **state) {
    (void)state;
    for (int s = 0; s < (int)PARAMETER_STATUS_COUNT; s++) {
        assert_true(strlen(parameter_status_text((enum parameter_status)s)) >= 4);
    }
    assert_string_equal(parameter_status_text(PARAMETER_STATUS_COUNT), "unknown");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_tunable_has_a_row),
        cmocka_unit_test(ids_are_unique_and_found),
        cmocka_unit_test(defaults_are_within_their_bounds_and_agree),
        cmocka_unit_test(bounds_of_the_calibration_are_those_that_the_controller_keeps),
        cmocka_unit_test(a_value_outside_its_bounds_is_refused_and_changes_nothing),
        cmocka_unit_test(an_unknown_parameter_is_said_to_be),
        cmocka_unit_test(most_parameters_change_only_while_vented),
        cmocka_unit_test(limits_that_do_not_go_together_are_refused),
        cmocka_unit_test(an_image_brings_back_what_was_written),
        cmocka_unit_test(an_image_holds_only_what_differs_from_the_defaults),
        cmocka_unit_test(an_image_with_limits_beyond_the_table_leaves_the_defaults),
        cmocka_unit_test(a_damaged_image_leaves_the_defaults),
        cmocka_unit_test(another_version_is_refused_whole),
        cmocka_unit_test(unknown_records_and_bad_values_are_left_out_and_counted),
        cmocka_unit_test(every_status_has_words),
    };
    return cmocka_run_group_tests(tests, create_table, free_table);
}
