#include "support/test.h"

#include "comms/codec.h"

#define REALS_TRIED 2000

static uint32_t random_state = 1u;

static uint32_t random_bits(void) {
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8;
}

static uint64_t low_bits(uint32_t bits) {
    return bits < 64u ? ((uint64_t)1u << bits) - 1u : UINT64_MAX;
}

static uint64_t bits_of(const uint8_t *data, uint32_t start, uint32_t bits) {
    uint64_t raw = 0;
    for (uint32_t b = 0; b < bits; b++) {
        raw |= (uint64_t)(data[(start + b) / 8u] >> ((start + b) % 8u) & 1u) << b;
    }
    return raw;
}

/* --- the table */

static void every_field_lies_within_its_message_and_none_overlap(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        uint8_t taken[8 * HAL_CAN_DATA_BYTES] = {0};
        assert_true(row->fields > 0);
        for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
            const struct message_field *field = message_field(f);
            assert_true(field->bits > 0 && field->bits <= 64);
            assert_true(field->start + field->bits <= 8u * row->bytes);
            for (uint32_t b = field->start; b < (uint32_t)field->start + field->bits; b++) {
                assert_int_equal(taken[b]++, 0);
            }
        }
    }
}

static void numbers_are_unique_and_classic_frames_have_eight_bytes(void **state) {
    (void)state;
    uint32_t found = 0;
    for (uint32_t number = 0; number < 4096; number++) {
        enum message_id id;
        if (message_find(number, &id)) {
            assert_int_equal(message_row(id)->number, number);
            found++;
        }
    }
    assert_int_equal(found, MESSAGE_COUNT);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const enum message_id id = (enum message_id)m;
        assert_true(message_row(id)->bytes <= 8u || id == MESSAGE_TELEMETRY);
        assert_int_equal(message_identifier(id, 5u), message_row(id)->number * 16u + 5u);
        assert_true(message_identifier(id, MESSAGE_NODE_MOST) <= 0x7ffu);
    }
}

/* Commands win the bus over telemetry, and telemetry over service. */
static void commands_have_the_lowest_numbers(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        assert_true(row->direction == MESSAGE_TO_HOST || row->number < 16u || row->number >= 64u);
        assert_true(row->period_ms == 0u || row->direction == MESSAGE_TO_HOST);
        assert_true(row->period_ms == 0u || row->phase_ms < row->period_ms);
    }
}

/* Every command begins alike: the node looks at these two bytes before it knows the rest. */
static void every_command_begins_with_sequence_and_protocol(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        if (row->direction == MESSAGE_TO_BOARD && (enum message_id)m != MESSAGE_TRANSFER_DATA) {
            assert_int_equal(message_field(row->first_field)->start, 0);
            assert_int_equal(message_field(row->first_field)->bits, 8);
            assert_int_equal(message_field(row->first_field + 1u)->start, 8);
            assert_int_equal(message_field(row->first_field + 1u)->bits, 4);
        }
    }
}

static void what_lacks_is_outside_of_every_range(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
            const struct message_field *field = message_field(f);
            if (field->kind == MESSAGE_FIELD_REAL) {
                const int32_t span = 1 << (field->bits - (field->is_signed ? 1u : 0u));
                assert_true(field->bits <= 24u);                   /* a float holds every raw value */
                assert_true(field->least <= 0 && field->most > 0); /* quantise() counts on it */
                assert_true(field->least >= (field->is_signed ? -span + (field->may_lack ? 1 : 0) : 0));
                assert_true(field->most <= span - 1 - (field->may_lack && !field->is_signed ? 1 : 0));
                assert_true(field->scale > 0.0f);
            }
        }
    }
}

/* --- packing */

/* Random bits in every field, through unpack and pack: the same bytes, for every message. */
static void whatever_is_unpacked_packs_to_the_same_bytes(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const enum message_id id = (enum message_id)m;
        const struct message_row *row = message_row(id);
        for (int tried = 0; tried < 200; tried++) {
            uint8_t data[HAL_CAN_DATA_BYTES] = {0}, again[HAL_CAN_DATA_BYTES];
            struct message_trouble in = {0}, out = {0};
            union message message;
            memset(&message, 0xa5, sizeof message);
            for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
                const struct message_field *field = message_field(f);
                uint64_t raw =
                    ((uint64_t)random_bits() << 40 | (uint64_t)random_bits() << 20 | random_bits()) &
                    low_bits(field->bits);
                if (field->kind == MESSAGE_FIELD_REAL) {
                    const int64_t span = (int64_t)field->most - field->least + 1;
                    raw = (uint64_t)(field->least + (int64_t)(raw % (uint64_t)span)) & low_bits(field->bits);
                }
                for (uint32_t b = 0; b < field->bits; b++) {
                    const uint32_t at = field->start + b;
                    data[at / 8u] = (uint8_t)(data[at / 8u] | (raw >> b & 1u) << (at % 8u));
                }
            }
            message_unpack(id, data, &message, &in);
            memset(again, 0xff, sizeof again);
            message_pack(id, &message, again, &out);
            assert_memory_equal(again, data, row->bytes);
            assert_int_equal(in.out_of_range + in.lacking + out.out_of_range + out.lacking, 0);
        }
    }
}

/* Layout by hand, so that a change of the table's meaning is noticed. */
static void a_pressure_command_has_these_bytes(void **state) {
    (void)state;
    const struct message_pressure_command command = {
        .sequence = 7, .protocol = 1, .pressure_1 = 1000.0f, .pressure_2 = 2000.4f, .pressure_3 = 60000.0f};
    const uint8_t expected[8] = {0x07, 0x01, 0xe8, 0x03, 0xd0, 0x07, 0x60, 0xea};
    struct message_trouble trouble = {0};
    struct hal_can_frame frame;
    message_frame(MESSAGE_PRESSURE_COMMAND, 3u, &command, &frame, &trouble);
    assert_int_equal(frame.id, 0x043);
    assert_int_equal(frame.length, 8);
    assert_false(frame.fd || frame.extended);
    assert_memory_equal(frame.data, expected, 8);
    assert_int_equal(trouble.out_of_range + trouble.lacking, 0);
}

static void negative_numbers_and_small_fields_have_these_bytes(void **state) {
    (void)state;
    const struct message_bend_command command = {
        .sequence = 255, .protocol = 1, .bend = 1.0472f, .direction = -1.5f, .co_contraction = 0.0f};
    const uint8_t bend[8] = {0xff, 0x01, 0xe8, 0x28, 0x68, 0xc5, 0x00, 0x00};
    const struct message_duties duties = {
        .duty_1 = 1.0f, .duty_2 = 0.0f, .duty_3 = 0.5f, .supply = -2.0f, .valves_enabled = true, .step = 9};
    struct message_trouble trouble = {0};
    uint8_t data[8];
    message_pack(MESSAGE_BEND_COMMAND, &command, data, &trouble);
    assert_memory_equal(data, bend, 8);
    message_pack(MESSAGE_DUTIES, &duties, data, &trouble);
    assert_int_equal(bits_of(data, 0, 14), 10000);
    assert_int_equal(bits_of(data, 14, 14), 0);
    assert_int_equal(bits_of(data, 28, 14), 5000);
    assert_int_equal(bits_of(data, 42, 16), 0xffff);
    assert_int_equal(bits_of(data, 58, 6), 1 + (9 << 2));
    assert_int_equal(trouble.out_of_range, 0);
}

static void a_long_message_goes_in_an_fd_frame(void **state) {
    (void)state;
    const struct message_telemetry telemetry = {
        .time_us = 0x123456789abcu, .tip_measured = 0xbeef, .protocol = 1};
    struct message_trouble trouble = {0};
    struct hal_can_frame frame;
    message_frame(MESSAGE_TELEMETRY, 1u, &telemetry, &frame, &trouble);
    assert_true(frame.fd);
    assert_int_equal(frame.length, 64);
    assert_int_equal(bits_of(frame.data, 0, 48), 0x123456789abcu);
    assert_int_equal(bits_of(frame.data, 432, 16), 0xbeef);
    assert_int_equal(bits_of(frame.data, 504, 4), 1);
}

/* --- numbers that do not fit */

static void numbers_out_of_range_saturate_and_are_counted(void **state) {
    (void)state;
    struct message_pressures given = {.pressure_1 = 1e9f, .pressure_2 = -INFINITY, .pressure_3 = 65535.0f};
    struct message_pressures back;
    struct message_trouble trouble = {0};
    uint8_t data[8];
    message_pack(MESSAGE_PRESSURES, &given, data, &trouble);
    assert_int_equal(trouble.out_of_range, 3);
    assert_int_equal(trouble.lacking, 0);
    message_unpack(MESSAGE_PRESSURES, data, &back, &trouble);
    assert_close(back.pressure_1, 65534.0, 0.0);
    assert_close(back.pressure_2, -65534.0, 0.0);
    assert_close(back.pressure_3, 65534.0, 0.0);
    assert_int_equal(trouble.out_of_range, 3);
}

static void a_rounded_end_of_range_is_within_it(void **state) {
    (void)state;
    struct message_trouble trouble = {0};
    uint8_t data[8];
    const struct message_pressure_command low = {.pressure_1 = -0.49f}, high = {.pressure_1 = 60000.49f};
    const struct message_pressures lowest = {.pressure_1 = -65534.9f};
    message_pack(MESSAGE_PRESSURE_COMMAND, &low, data, &trouble);
    assert_int_equal(bits_of(data, 16, 16), 0);
    message_pack(MESSAGE_PRESSURE_COMMAND, &high, data, &trouble);
    assert_int_equal(bits_of(data, 16, 16), 60000);
    message_pack(MESSAGE_PRESSURES, &lowest, data, &trouble);
    assert_int_equal(bits_of(data, 0, 16), 0x8001);
    assert_int_equal(trouble.out_of_range, 0);
    const struct message_pressure_command below = {.pressure_1 = -0.51f};
    message_pack(MESSAGE_PRESSURE_COMMAND, &below, data, &trouble);
    assert_int_equal(trouble.out_of_range, 1);
}

static void what_lacks_a_value_comes_back_as_nan(void **state) {
    (void)state;
    const struct message_pressures given = {.pressure_1 = NAN, .pressure_2 = 100.0f, .pressure_3 = NAN};
    const struct message_targets targets = {.target_1 = NAN, .target_2 = 1.0f};
    struct message_pressures back;
    struct message_trouble out = {0}, in = {0};
    uint8_t data[8];
    message_pack(MESSAGE_PRESSURES, &given, data, &out);
    assert_int_equal(bits_of(data, 0, 16), 0x8000);
    assert_int_equal(out.lacking, 2);
    assert_int_equal(out.out_of_range, 0);
    message_unpack(MESSAGE_PRESSURES, data, &back, &in);
    assert_true(isnan(back.pressure_1) && isnan(back.pressure_3));
    assert_close(back.pressure_2, 100.0, 0.0);
    assert_int_equal(in.lacking, 2);
    assert_int_equal(in.out_of_range, 0);
    message_pack(MESSAGE_TARGETS, &targets, data, &out);
    assert_int_equal(bits_of(data, 0, 16), 0xffff);
}

/* Commands have no such value: NaN is trouble, and never something that another board would obey. */
static void nan_in_a_command_is_out_of_range(void **state) {
    (void)state;
    const struct message_pressure_command given = {.pressure_1 = NAN};
    struct message_trouble trouble = {0};
    uint8_t data[8];
    message_pack(MESSAGE_PRESSURE_COMMAND, &given, data, &trouble);
    assert_int_equal(trouble.out_of_range, 1);
    assert_int_equal(bits_of(data, 16, 16), 0);
}

static void raw_values_outside_of_the_range_are_counted(void **state) {
    (void)state;
    const uint8_t data[8] = {0, 1, 0x61, 0xea, 0xff, 0xff, 0, 0};
    struct message_pressure_command command;
    struct message_trouble trouble = {0};
    message_unpack(MESSAGE_PRESSURE_COMMAND, data, &command, &trouble);
    assert_int_equal(trouble.out_of_range, 2);
    assert_close(command.pressure_1, 60001.0, 0.0);
}

static void an_integer_over_its_bits_saturates(void **state) {
    (void)state;
    const struct message_status status = {.state = 16, .protocol = 15, .faults = UINT32_MAX};
    struct message_trouble trouble = {0};
    uint8_t data[8];
    message_pack(MESSAGE_STATUS, &status, data, &trouble);
    assert_int_equal(trouble.out_of_range, 1);
    assert_int_equal(bits_of(data, 0, 4), 15);
    assert_int_equal(bits_of(data, 24, 32), UINT32_MAX);
}

/* Every real field: a value within the range comes back within half a step. */
static void reals_come_back_within_half_a_step(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
            const struct message_field *field = message_field(f);
            for (int tried = 0; tried < REALS_TRIED && field->kind == MESSAGE_FIELD_REAL; tried++) {
                const double share = (double)random_bits() / (double)0xffffff;
                const double least = field->least * (double)field->scale,
                             most = field->most * (double)field->scale;
                const float given = (float)(least + share * (most - least));
                union message message, back;
                struct message_trouble trouble = {0};
                uint8_t data[HAL_CAN_DATA_BYTES];
                float got = 0.0f;
                memset(&message, 0, sizeof message);
                memcpy((uint8_t *)&message + field->at, &given, sizeof given);
                message_pack((enum message_id)m, &message, data, &trouble);
                message_unpack((enum message_id)m, data, &back, &trouble);
                memcpy(&got, (uint8_t *)&back + field->at, sizeof got);
                assert_close(got, given, 0.5001 * (double)field->scale + 1e-6 * fabs((double)given));
                assert_int_equal(trouble.out_of_range, 0);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_field_lies_within_its_message_and_none_overlap),
        cmocka_unit_test(numbers_are_unique_and_classic_frames_have_eight_bytes),
        cmocka_unit_test(commands_have_the_lowest_numbers),
        cmocka_unit_test(every_command_begins_with_sequence_and_protocol),
        cmocka_unit_test(what_lacks_is_outside_of_every_range),
        cmocka_unit_test(whatever_is_unpacked_packs_to_the_same_bytes),
        cmocka_unit_test(a_pressure_command_has_these_bytes),
        cmocka_unit_test(negative_numbers_and_small_fields_have_these_bytes),
        cmocka_unit_test(a_long_message_goes_in_an_fd_frame),
        cmocka_unit_test(numbers_out_of_range_saturate_and_are_counted),
        cmocka_unit_test(a_rounded_end_of_range_is_within_it),
        cmocka_unit_test(what_lacks_a_value_comes_back_as_nan),
        cmocka_unit_test(nan_in_a_command_is_out_of_range),
        cmocka_unit_test(raw_values_outside_of_the_range_are_counted),
        cmocka_unit_test(an_integer_over_its_bits_saturates),
        cmocka_unit_test(reals_come_back_within_half_a_step),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
