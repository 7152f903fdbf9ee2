#include "support/test.h"

#include <stdlib.h>

#include "control/bend_table_format.h"
#include "control/crc32.h"
#include "support/synthetic_table.h"

static int set_up(void **state) {
    static struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 9, 10000.0, 0.8, synthetic_module);
    *state = &synthetic;
    return 0;
}

static int tear_down(void **state) {
    synthetic_table_free(*state);
    return 0;
}

static enum bend_table_status reopen(struct synthetic_table *synthetic) {
    struct bend_table table;
    return bend_table_open(&table, synthetic->image, synthetic->size, NULL);
}

static void crc_matches_the_standards_check_value(void **state) {
    (void)state;
    assert_int_equal(crc32_update(0u, "123456789", 9), 0xcbf43926u); /* the check value of CRC-32/ISO-HDLC */
    const uint32_t first = crc32_update(0u, "1234", 4);
    assert_int_equal(crc32_update(first, "56789", 5), 0xcbf43926u);
}

static void header_reaches_the_caller(void **state) {
    const struct synthetic_table *synthetic = *state;
    const struct bend_table_module *module = &synthetic->table.module;
    assert_string_equal(module->name, "synthetic");
    assert_true(module->inputs_hash == 0x0123456789abcdefu);
    assert_close((double)module->chamber_length_m, 0.055, 1e-9);
    assert_close((double)module->working_pressure_pa, 10000.0, 0.0);
    assert_int_equal(synthetic->table.nodes[1], 9);
}

static void nodes_come_back_as_written(void **state) {
    const struct bend_table *table = &((struct synthetic_table *)*state)->table;
    for (uint32_t i = 0; i < 9; i++) {
        for (uint32_t j = 0; j < 9; j += 4) {
            const float pressure_pa[3] = {table->axis_pa[0][i], table->axis_pa[1][j], table->axis_pa[2][8 - i]};
            const double exact[3] = {(double)pressure_pa[0], (double)pressure_pa[1], (double)pressure_pa[2]};
            struct bend_table_stencil stencil;
            bend_table_locate(table, pressure_pa, &stencil);
            const double expected = synthetic_module(BEND_TABLE_CURVATURE_X, exact);
            assert_close((double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_X), expected,
                         1e-5 + 1e-5 * fabs(expected));
            assert_true(bend_table_is_valid(table, &stencil));
        }
    }
}

static double cubic_free(enum bend_table_channel channel, const double pressure_pa[3]) {
    /* quadratic in each pressure: the three-point slopes and the cubic reproduce it exactly */
    const double x = 1e-4 * pressure_pa[0], y = 1e-4 * pressure_pa[1], z = 1e-4 * pressure_pa[2];
    (void)channel;
    return 1.0 + x - 2.0 * x * x + 0.5 * y * y + x * y * z + z * z;
}

static void quadratics_are_reproduced_between_nodes(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 7, 10000.0, 0.7, cubic_free);
    for (int i = 0; i < 500; i++) {
        const double exact[3] = {20.0 * i, fmod(773.0 * i, 10000.0), fmod(4111.0 * i, 10000.0)};
        const float pressure_pa[3] = {(float)exact[0], (float)exact[1], (float)exact[2]};
        struct bend_table_stencil stencil;
        float gradient[3];
        bend_table_locate(&synthetic.table, pressure_pa, &stencil);
        const double value =
            (double)bend_table_gradient(&synthetic.table, &stencil, BEND_TABLE_VON_MISES, gradient);
        const double x = 1e-4 * exact[0], y = 1e-4 * exact[1], z = 1e-4 * exact[2];
        assert_close(value, cubic_free(BEND_TABLE_VON_MISES, exact), 3e-6);
        assert_close((double)bend_table_value(&synthetic.table, &stencil, BEND_TABLE_VON_MISES), value, 1e-6);
        assert_close((double)gradient[0], 1e-4 * (1.0 - 4.0 * x + y * z), 2e-9);
        assert_close((double)gradient[1], 1e-4 * (y + x * z), 2e-9);
        assert_close((double)gradient[2], 1e-4 * (x * y + 2.0 * z), 2e-9);
    }
    synthetic_table_free(&synthetic);
}

static double wavy(enum bend_table_channel channel, const double pressure_pa[3]) {
    (void)channel;
    return sin(7e-4 * pressure_pa[0]) + cos(5e-4 * pressure_pa[1]) * sin(6e-4 * pressure_pa[2]);
}

static void value_and_slope_are_continuous_across_cells(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 9, 10000.0, 0.8, wavy);
    const struct bend_table *table = &synthetic.table;
    for (uint32_t a = 0; a < 3; a++) {
        for (uint32_t node = 1; node + 1 < 9; node++) {
            float below[3] = {3456.0f, 4567.0f, 5678.0f}, above[3] = {3456.0f, 4567.0f, 5678.0f};
            below[a] = nextafterf(table->axis_pa[a][node], 0.0f);
            above[a] = nextafterf(table->axis_pa[a][node], 1e9f);
            struct bend_table_stencil left, right;
            float slope_left[3], slope_right[3];
            bend_table_locate(table, below, &left);
            bend_table_locate(table, above, &right);
            assert_int_not_equal(left.cell[a], right.cell[a]);
            const double l = (double)bend_table_gradient(table, &left, BEND_TABLE_STRETCH, slope_left);
            const double r = (double)bend_table_gradient(table, &right, BEND_TABLE_STRETCH, slope_right);
            assert_close(l, r, 2e-6);
            for (uint32_t b = 0; b < 3; b++) {
                assert_close((double)slope_left[b], (double)slope_right[b], 2e-9);
            }
        }
    }
    synthetic_table_free(&synthetic);
}

static void pressures_outside_are_clamped_and_say_so(void **state) {
    const struct bend_table *table = &((struct synthetic_table *)*state)->table;
    const float over[3] = {20000.0f, 100.0f, 100.0f}, at[3] = {10000.0f, 100.0f, 100.0f};
    const float not_a_number[3] = {NAN, 100.0f, 100.0f};
    struct bend_table_stencil outside, edge;
    float gradient[3];
    bend_table_locate(table, over, &outside);
    bend_table_locate(table, at, &edge);
    assert_true(outside.clamped);
    assert_false(edge.clamped);
    assert_false(bend_table_is_valid(table, &outside));
    assert_close((double)bend_table_gradient(table, &outside, BEND_TABLE_STRETCH, gradient),
                 (double)bend_table_value(table, &edge, BEND_TABLE_STRETCH), 0.0);
    assert_close((double)gradient[0], 0.0, 0.0);
    bend_table_locate(table, not_a_number, &outside);
    assert_true(outside.clamped);
    assert_true(isfinite((double)bend_table_value(table, &outside, BEND_TABLE_STRETCH)));
}

/* Nodes beyond a fold are not valid: pressures are scaled back to the last cell that holds, along their own direction. */
static void pressures_are_kept_inside_the_valid_domain(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 9, 8000.0, 1.0, synthetic_module);
    const struct bend_table *table = &synthetic.table;
    for (uint32_t i = 0; i < 9; i++) {
        for (uint32_t j = 0; j < 9; j++) {
            for (uint32_t k = 0; k < 9; k++) {
                if (i + j + k > 9) { /* no equilibrium beyond a sum of 9 kPa */
                    synthetic.image[(size_t)(table->tag - synthetic.image) + k + 9 * (j + 9 * i)] = 0;
                }
            }
        }
    }
    float inside_pa[3] = {3100.0f, 2500.0f, 500.0f}, outside_pa[3] = {6000.0f, 6000.0f, 3000.0f};
    assert_true(bend_table_keep_valid(table, inside_pa));
    assert_float_equal(inside_pa[0], 3100.0f, 0.0f);
    assert_false(bend_table_keep_valid(table, outside_pa));
    struct bend_table_stencil stencil;
    bend_table_locate(table, outside_pa, &stencil);
    assert_true(bend_table_is_valid(table, &stencil));
    assert_float_equal(outside_pa[0], outside_pa[1], 1e-3f);
    assert_float_equal(outside_pa[0], 2.0f * outside_pa[2], 1e-3f);
    assert_true(outside_pa[0] > 2500.0f); /* not further back than the cell demands */
    synthetic_table_free(&synthetic);
}

static void every_truncation_is_refused(void **state) {
    const struct synthetic_table *synthetic = *state;
    struct bend_table table;
    for (size_t size = 0; size < synthetic->size; size += size < 600 ? 1 : 997) {
        assert_int_not_equal(bend_table_open(&table, synthetic->image, size, NULL), BEND_TABLE_OK);
    }
}

static void every_flipped_bit_is_refused(void **state) {
    struct synthetic_table *synthetic = *state;
    for (size_t byte = 0; byte < synthetic->size; byte += byte < 600 ? 1 : 211) {
        const uint8_t bit = (uint8_t)(1u << (byte % 8u));
        synthetic->image[byte] = (uint8_t)(synthetic->image[byte] ^ bit);
        const enum bend_table_status status = reopen(synthetic);
        synthetic->image[byte] = (uint8_t)(synthetic->image[byte] ^ bit);
        assert_int_not_equal(status, BEND_TABLE_OK);
    }
    assert_int_equal(reopen(synthetic), BEND_TABLE_OK);
}

static void put_u32(struct synthetic_table *synthetic, size_t offset, uint32_t value) {
    memcpy(synthetic->image + offset, &value, sizeof value);
    synthetic_table_seal(synthetic);
}

static void each_kind_of_nonsense_has_its_own_answer(void **state) {
    struct synthetic_table *synthetic = *state;
    uint8_t *saved = malloc(synthetic->size);
    struct bend_table table;
    assert_non_null(saved);
    memcpy(saved, synthetic->image, synthetic->size);

    synthetic->image[0] = 'X';
    assert_int_equal(reopen(synthetic), BEND_TABLE_BAD_MAGIC);
    memcpy(synthetic->image, saved, synthetic->size);
    synthetic->image[BEND_TABLE_OFFSET_VERSION] = 9;
    assert_int_equal(reopen(synthetic), BEND_TABLE_BAD_VERSION);
    memcpy(synthetic->image, saved, synthetic->size);
    put_u32(synthetic, BEND_TABLE_OFFSET_NODES, 3000000000u);
    assert_int_equal(reopen(synthetic), BEND_TABLE_BAD_AXIS);
    memcpy(synthetic->image, saved, synthetic->size);
    put_u32(synthetic, BEND_TABLE_OFFSET_NODES, 8);
    assert_int_equal(reopen(synthetic), BEND_TABLE_BAD_SIZE);
    memcpy(synthetic->image, saved, synthetic->size);
    put_u32(synthetic, BEND_TABLE_HEADER_BYTES + 4, 0u); /* the axis' second node equals its first */
    assert_int_equal(reopen(synthetic), BEND_TABLE_BAD_AXIS);
    memcpy(synthetic->image, saved, synthetic->size);
    put_u32(synthetic, BEND_TABLE_HEADER_BYTES + 4u * 27u + 400u, 0x7fc00000u); /* NaN in a channel */
    assert_int_equal(reopen(synthetic), BEND_TABLE_BAD_VALUE);
    memcpy(synthetic->image, saved, synthetic->size);
    put_u32(synthetic, BEND_TABLE_OFFSET_GEOMETRY, 0xbf800000u); /* an outer diameter of -1 m */
    assert_int_equal(reopen(synthetic), BEND_TABLE_BAD_VALUE);
    memcpy(synthetic->image, saved, synthetic->size);
    assert_int_equal(bend_table_open(&table, synthetic->image, synthetic->size, "another"), BEND_TABLE_WRONG_MODULE);
    assert_int_equal(bend_table_open(&table, saved + 1, synthetic->size - 1, NULL), BEND_TABLE_MISALIGNED);
    for (int s = 0; s <= (int)BEND_TABLE_MISALIGNED; s++) {
        assert_true(strlen(bend_table_status_text((enum bend_table_status)s)) > 5);
    }
    free(saved);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crc_matches_the_standards_check_value),
        cmocka_unit_test_setup_teardown(header_reaches_the_caller, set_up, tear_down),
        cmocka_unit_test_setup_teardown(nodes_come_back_as_written, set_up, tear_down),
        cmocka_unit_test(quadratics_are_reproduced_between_nodes),
        cmocka_unit_test(value_and_slope_are_continuous_across_cells),
        cmocka_unit_test_setup_teardown(pressures_outside_are_clamped_and_say_so, set_up, tear_down),
        cmocka_unit_test(pressures_are_kept_inside_the_valid_domain),
        cmocka_unit_test_setup_teardown(every_truncation_is_refused, set_up, tear_down),
        cmocka_unit_test_setup_teardown(every_flipped_bit_is_refused, set_up, tear_down),
        cmocka_unit_test_setup_teardown(each_kind_of_nonsense_has_its_own_answer, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
