#include "support/test.h"

#include <string.h>

#include "stm32g4/conversions.h"
#include "stm32g4/crash_record.h"

#define CALIBRATION 1655u /* a typical part: 1.212 V of 3.0 V, 12 bits */

static uint16_t raw_of_ratio(double ratio) {
    return (uint16_t)(ratio * (double)RAW_FULL_SCALE + 0.5);
}

/* What the converter reads of the internal reference when its own reference is at `volt`. */
static uint16_t raw_of_reference(double volt) {
    return (uint16_t)(3.0 * CALIBRATION * 16.0 / volt + 0.5);
}

static void a_sensors_ratio_is_its_pressure(void **state) {
    (void)state;
    for (int percent = 5; percent <= 95; percent++) {
        float pressure_pa;
        const double ratio = percent / 100.0;
        /* the sums have steps of 1/65520: 0.95 Pa */
        assert_true(conversions_pressure(
            &chamber_sensor,
            (uint16_t)(raw_of_ratio(ratio) + (percent == 5 ? 1 : 0) - (percent == 95 ? 1 : 0)),
            &pressure_pa));
        assert_close((double)pressure_pa, (ratio - 0.1) / 0.8 * 50000.0, 1.5);
    }
}

static void an_open_or_shorted_sensor_is_out_of_range(void **state) {
    (void)state;
    const double broken[] = {0.0, 0.02, 0.049, 0.951, 0.98, 1.0};
    float pressure_pa;
    for (size_t i = 0; i < sizeof broken / sizeof broken[0]; i++) {
        assert_false(conversions_pressure(&chamber_sensor, raw_of_ratio(broken[i]), &pressure_pa));
        assert_false(conversions_pressure(&supply_sensor, raw_of_ratio(broken[i]), &pressure_pa));
    }
    assert_false(conversions_pressure(&chamber_sensor, 65535u, &pressure_pa));
}

static void the_reference_voltage_is_measured(void **state) {
    (void)state;
    for (double volt = 2.5; volt < 4.0; volt += 0.1) {
        assert_close((double)conversions_reference_v(raw_of_reference(volt), CALIBRATION), volt, 5e-4);
    }
    assert_true(conversions_reference_v(0u, CALIBRATION) == 0.0f);
    assert_true(conversions_reference_v(20000u, 0u) == 0.0f);
    assert_true(conversions_reference_v(20000u, 0xffffu) == 0.0f); /* a chip that was never calibrated */
}

static void without_a_sound_reference_no_channel_is_good(void **state) {
    (void)state;
    uint16_t raw[RAW_CHANNEL_COUNT] = {raw_of_ratio(0.1), raw_of_ratio(0.5), raw_of_ratio(0.2),
                                       raw_of_ratio(0.42), raw_of_reference(3.3)};
    struct hal_pressures pressures;
    conversions_pressures(raw, CALIBRATION, &pressures);
    assert_true(pressures.chamber_ok[0] && pressures.chamber_ok[1] && pressures.chamber_ok[2] &&
                pressures.supply_ok);
    assert_close((double)pressures.chamber_pa[1], 25000.0, 1.0);
    assert_close((double)pressures.supply_pa, 40000.0, 2.0);

    const double bad_volt[] = {2.95, 3.65};
    for (size_t i = 0; i < 2; i++) {
        raw[RAW_REFERENCE] = raw_of_reference(bad_volt[i]);
        conversions_pressures(raw, CALIBRATION, &pressures);
        assert_false(pressures.chamber_ok[0] || pressures.chamber_ok[1] || pressures.chamber_ok[2]);
        assert_false(pressures.supply_ok);
    }
}

static void one_broken_sensor_leaves_the_others_good(void **state) {
    (void)state;
    uint16_t raw[RAW_CHANNEL_COUNT] = {raw_of_ratio(0.1), 0u, raw_of_ratio(0.2), raw_of_ratio(0.42),
                                       raw_of_reference(3.3)};
    struct hal_pressures pressures;
    conversions_pressures(raw, CALIBRATION, &pressures);
    assert_true(pressures.chamber_ok[0] && !pressures.chamber_ok[1] && pressures.chamber_ok[2] &&
                pressures.supply_ok);
}

static void a_valve_period_is_exact_and_fine(void **state) {
    (void)state;
    struct pwm_scale scale;
    assert_true(conversions_pwm_scale(170000000u, 10000u, &scale));
    assert_int_equal(scale.prescaler, 34);
    assert_int_equal(scale.counts, 50000);
    assert_true(conversions_pwm_scale(16000000u, 10000u, &scale));
    assert_int_equal(scale.prescaler * scale.counts, 160000);
    assert_false(conversions_pwm_scale(170000001u, 10000u, &scale));
    assert_false(conversions_pwm_scale(170000000u, 0u, &scale));
    assert_false(conversions_pwm_scale(170000000u, 70000u, &scale)); /* under a count a microsecond */
}

static void duties_become_counts(void **state) {
    (void)state;
    assert_int_equal(conversions_compare(0.0f, 50000u), 0);
    assert_int_equal(conversions_compare(1.0f, 50000u), 50000);
    assert_int_equal(conversions_compare(0.5f, 50000u), 25000);
    assert_int_equal(conversions_compare(2e-5f, 50000u), 1);
    assert_int_equal(conversions_compare(-0.1f, 50000u), 0);
    assert_int_equal(conversions_compare(7.0f, 50000u), 50000);
    assert_int_equal(conversions_compare(NAN, 50000u), 0);
    assert_int_equal(conversions_compare(INFINITY, 50000u), 50000);
}

static double sample_point(const struct can_timing *timing) {
    return (1.0 + timing->segment_1) / (1.0 + timing->segment_1 + timing->segment_2);
}

static void bit_timings_are_exact(void **state) {
    (void)state;
    const uint32_t rates[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 1000000};
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        struct can_timing timing;
        assert_true(conversions_can_timing(170000000u, rates[i], 800u, &can_nominal_limits, &timing));
        assert_int_equal(timing.prescaler * (1u + timing.segment_1 + timing.segment_2) * rates[i], 170000000);
        assert_true(timing.segment_1 <= 256u && timing.segment_2 <= 128u && timing.prescaler <= 512u);
        assert_true(timing.jump >= 1u && timing.jump <= timing.segment_2);
        assert_close(sample_point(&timing), 0.8, 0.01);
    }
}

static void data_bit_timings_fit_their_smaller_fields(void **state) {
    (void)state;
    struct can_timing timing;
    assert_true(conversions_can_timing(170000000u, 5000000u, 760u, &can_data_limits, &timing));
    assert_int_equal(timing.prescaler, 1);
    assert_int_equal(1u + timing.segment_1 + timing.segment_2, 34);
    assert_close(sample_point(&timing), 0.76, 0.015);
    assert_true(conversions_can_timing(170000000u, 2000000u, 760u, &can_data_limits, &timing));
    assert_true(timing.segment_1 <= 32u && timing.segment_2 <= 16u);
    assert_false(
        conversions_can_timing(16000000u, 5000000u, 760u, &can_data_limits, &timing)); /* no divisor */
    assert_false(conversions_can_timing(170000000u, 3000000u, 760u, &can_data_limits, &timing));
    assert_false(conversions_can_timing(170000000u, 0u, 760u, &can_data_limits, &timing));
}

static void length_codes_go_both_ways(void **state) {
    (void)state;
    uint32_t codes = 0;
    for (uint32_t length = 0; length <= 70u; length++) {
        uint32_t code;
        if (conversions_can_code(length, &code)) {
            codes++;
            assert_int_equal(conversions_can_length(code), length);
        }
    }
    assert_int_equal(codes, 16);
    uint32_t code;
    assert_false(conversions_can_code(9u, &code));
    assert_false(conversions_can_code(65u, &code));
}

static void the_serial_rate_is_within_half_a_percent(void **state) {
    (void)state;
    assert_close(170e6 / conversions_baud_divisor(170000000u, 115200u), 115200.0, 576.0);
    assert_close(16e6 / conversions_baud_divisor(16000000u, 115200u), 115200.0, 576.0);
}

/* --- what survives a reset --- */

static void a_sealed_crash_record_is_believed(void **state) {
    (void)state;
    struct crash_record record = {.cause = CRASH_BUS_FAULT, .pc = 0x08001234u, .step = 99u};
    crash_record_seal(&record);
    assert_true(crash_record_is_sound(&record));
}

static void a_record_with_any_bit_flipped_is_not(void **state) {
    (void)state;
    struct crash_record sealed = {.cause = CRASH_HARD_FAULT, .pc = 0x08001234u};
    crash_record_seal(&sealed);
    for (size_t bit = 0; bit < 8 * sizeof sealed; bit++) {
        struct crash_record record = sealed;
        ((uint8_t *)&record)[bit / 8] ^= (uint8_t)(1u << (bit % 8));
        assert_false(crash_record_is_sound(&record));
    }
}

static void memory_after_power_on_is_no_record_and_no_mark(void **state) {
    (void)state;
    for (int fill = 0; fill < 256; fill++) {
        struct crash_record record;
        struct running_mark mark;
        memset(&record, fill, sizeof record);
        memset(&mark, fill, sizeof mark);
        assert_false(crash_record_is_sound(&record));
        assert_false(running_mark_is_sound(&mark));
    }
}

static void a_running_firmware_leaves_its_mark(void **state) {
    (void)state;
    struct running_mark mark;
    running_mark_set(&mark, 123456u, 3u);
    assert_true(running_mark_is_sound(&mark));
    assert_int_equal(mark.step, 123456);
    mark.step++;
    assert_false(running_mark_is_sound(&mark));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sensors_ratio_is_its_pressure),
        cmocka_unit_test(an_open_or_shorted_sensor_is_out_of_range),
        cmocka_unit_test(the_reference_voltage_is_measured),
        cmocka_unit_test(without_a_sound_reference_no_channel_is_good),
        cmocka_unit_test(one_broken_sensor_leaves_the_others_good),
        cmocka_unit_test(a_valve_period_is_exact_and_fine),
        cmocka_unit_test(duties_become_counts),
        cmocka_unit_test(bit_timings_are_exact),
        cmocka_unit_test(data_bit_timings_fit_their_smaller_fields),
        cmocka_unit_test(length_codes_go_both_ways),
        cmocka_unit_test(the_serial_rate_is_within_half_a_percent),
        cmocka_unit_test(a_sealed_crash_record_is_believed),
        cmocka_unit_test(a_record_with_any_bit_flipped_is_not),
        cmocka_unit_test(memory_after_power_on_is_no_record_and_no_mark),
        cmocka_unit_test(a_running_firmware_leaves_its_mark),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
