/* What people see of the messages: words, decoded lines, candump's and cansend's ways to write a frame. */
#include "support/test.h"

#include <stdlib.h>

#include "comms/node.h"
#include "log/can_text.h"
#include "messages/message_decode.h"
#include "messages/message_text.h"
#include "messages/message_words.h"

#define assert_contains(text, part)                                                                          \
    do {                                                                                                     \
        if (strstr(text, part) == NULL) {                                                                    \
            fail_msg("'%s' lacks '%s'", text, part);                                                         \
        }                                                                                                    \
    } while (0)

/* --- words */

static void every_message_and_field_has_a_name_of_its_own(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        assert_true(strlen(message_words((enum message_id)m)->name) >= 3);
        assert_true(strlen(message_words((enum message_id)m)->comment) >= 8);
        for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
            assert_true(strlen(message_field_words(f)->unit) >= 1);
            for (uint32_t g = row->first_field; g < f; g++) {
                assert_string_not_equal(message_field_words(f)->name, message_field_words(g)->name);
            }
        }
    }
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        for (uint32_t n = 0; n < m; n++) {
            assert_string_not_equal(message_words((enum message_id)m)->name,
                                    message_words((enum message_id)n)->name);
        }
    }
}

static void every_named_value_has_a_word_and_its_field_holds_it(void **state) {
    (void)state;
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        const struct message_row *row = message_row((enum message_id)m);
        for (uint32_t f = row->first_field; f < (uint32_t)row->first_field + row->fields; f++) {
            const enum message_values values = message_field_words(f)->values;
            const uint32_t count = message_values_count(values), bits = message_field(f)->bits;
            assert_true(message_values_are_bits(values) ? count <= bits : count <= 1u << bits);
            for (uint32_t v = 0; v < count && values != MESSAGE_VALUES_MESSAGE_NUMBER; v++) {
                assert_non_null(message_value_name(values, v));
                assert_null(strchr(message_value_name(values, v), ' '));
                assert_non_null(message_value_text(values, v));
            }
            assert_null(message_value_name(values, count));
        }
    }
}

/* --- decoding */

static struct hal_can_frame frame_of(enum message_id id, const void *message) {
    struct message_trouble trouble = {0};
    struct hal_can_frame frame;
    message_frame(id, 3u, message, &frame, &trouble);
    return frame;
}

static void a_message_is_said_in_words(void **state) {
    (void)state;
    const struct message_status status = {.state = SUPERVISOR_FAULT,
                                          .protocol = 1,
                                          .faults = 1u << FAULT_COMMAND_TIMEOUT | 1u << 31,
                                          .step = 9};
    const struct message_pressures pressures = {
        .pressure_1 = 1000.0f, .pressure_2 = NAN, .pressure_3 = -4.0f};
    const struct message_refusals refusals = {.reason = NODE_REFUSED_STALE, .message = 5};
    struct message_decoded decoded;
    struct hal_can_frame frame = frame_of(MESSAGE_STATUS, &status);
    char text[1024];
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_DECODED);
    message_decoded_text(&decoded, text, sizeof text);
    assert_string_equal(text, "STATUS from node 3: state FAULT, protocol 1, warnings none, "
                              "faults COMMAND_TIMEOUT+bit 31, step 9");
    frame = frame_of(MESSAGE_PRESSURES, &pressures);
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_DECODED);
    message_decoded_text(&decoded, text, sizeof text);
    assert_string_equal(
        text, "PRESSURES from node 3: pressure_1 1000 Pa, pressure_2 none, pressure_3 -4 Pa, step 0");
    frame = frame_of(MESSAGE_REFUSALS, &refusals);
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_DECODED);
    message_decoded_text(&decoded, text, sizeof text);
    assert_contains(text, "reason STALE, message BEND_COMMAND");
    message_decoded_text(&decoded, text, 12);
    assert_string_equal(text, "REFUSALS fr");
}

static void a_message_is_said_in_json(void **state) {
    (void)state;
    const struct message_bend bend = {.bend = 0.6f, .direction = NAN, .flags = 1u << NODE_BEND_MEASURED};
    const struct hal_can_frame frame = frame_of(MESSAGE_BEND, &bend);
    struct message_decoded decoded;
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_DECODED);
    json_t *object = message_decoded_json(&decoded);
    assert_non_null(object);
    char *text = json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(10));
    assert_string_equal(text, "{\"message\":\"BEND\",\"node\":3,\"fields\":{\"bend\":0.6,\"direction\":null,"
                              "\"tip_status\":0,\"flags\":[\"MEASURED\"],\"step\":0}}");
    free(text);
    json_decref(object);
}

static void what_is_not_ours_is_told_apart(void **state) {
    (void)state;
    struct message_decoded decoded;
    struct hal_can_frame frame = {.id = 0x7ff, .length = 8};
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_OF_OTHERS);
    frame = (struct hal_can_frame){.id = message_identifier(MESSAGE_BEND, 1u), .extended = true, .length = 8};
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_OF_OTHERS);
    frame.extended = false;
    frame.length = 7;
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_WRONG_LENGTH);
    frame = (struct hal_can_frame){.id = message_identifier(MESSAGE_VENT, 0u)};
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_DECODED); /* of no bytes, and obeyed */
}

static void a_value_out_of_its_range_is_marked(void **state) {
    (void)state;
    struct hal_can_frame frame = {.id = message_identifier(MESSAGE_PRESSURE_COMMAND, 1u), .length = 8};
    struct message_decoded decoded;
    char text[512];
    memset(frame.data, 0xff, sizeof frame.data);
    assert_int_equal(message_decode(&frame, &decoded), MESSAGE_DECODED);
    message_decoded_text(&decoded, text, sizeof text);
    assert_contains(text, "pressure_3 65535 Pa (3 out of range)");
}

static void numbers_are_shown_as_short_as_they_are(void **state) {
    (void)state;
    const struct {
        float value;
        const char *text;
    } cases[] = {{1e-4f, "0.0001"},     {60000.0f, "60000"}, {0.0f, "0"},
                 {-3.1416f, "-3.1416"}, {1e-7f, "1e-07"},    {1e9f, "1e+09"}};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        char text[32];
        message_print_real(cases[c].value, text);
        assert_string_equal(text, cases[c].text);
    }
}

/* --- frames as text */

static void each_way_to_write_a_frame_is_read(void **state) {
    (void)state;
    static const struct {
        const char *line;
        uint32_t id;
        uint8_t length;
        uint8_t last; /* byte */
        bool extended;
        bool fd;
        bool has_time;
        bool remote;
    } cases[] = {
        {"051#0102030405060708", 0x51, 8, 8, false, false, false, false},
        {"051#", 0x51, 0, 0, false, false, false, false},
        {"051##10102", 0x51, 2, 2, false, true, false, false},
        {"18FF0011#AA", 0x18ff0011, 1, 0xaa, true, false, false, false},
        {"051#R", 0x51, 0, 0, false, false, false, true},
        {"(1700000000.123456) can0 051#0102", 0x51, 2, 2, false, false, true, false},
        {"  can0  051   [8]  01 02 03 04 05 06 07 08", 0x51, 8, 8, false, false, false, false},
        {"  vcan0  051   [0] ", 0x51, 0, 0, false, false, false, false},
        {"  can0  18FF0011   [2]  01 0A", 0x18ff0011, 2, 10, true, false, false, false},
        {"  can0  051  [02]  01 0B", 0x51, 2, 11, false, true, false, false},
        {" (000.012345)  can0  051   [3]  01 02 0c", 0x51, 3, 12, false, false, true, false},
        {"  can0  051   [8]  remote request", 0x51, 0, 0, false, false, false, true},
        {"  can0  051   [2]  41 42   'AB'", 0x51, 2, 0x42, false, false, false, false},
    };
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        struct can_text text;
        const char *wrong = can_text_parse(cases[c].line, &text);
        if (wrong != NULL) {
            fail_msg("'%s': %s", cases[c].line, wrong);
        }
        assert_int_equal(text.frame.id, cases[c].id);
        assert_int_equal(text.frame.length, cases[c].length);
        assert_int_equal(text.frame.length > 0 ? text.frame.data[text.frame.length - 1] : 0, cases[c].last);
        assert_int_equal(text.frame.extended, cases[c].extended);
        assert_int_equal(text.frame.fd, cases[c].fd);
        assert_int_equal(text.has_time, cases[c].has_time);
        assert_int_equal(text.remote, cases[c].remote);
    }
}

static void each_line_that_is_no_frame_is_refused(void **state) {
    (void)state;
    static const char *const lines[] = {"",
                                        "hello",
                                        "can0",
                                        "can0 051",
                                        "can0  051   [9]  01 02 03 04 05 06 07 08 09",
                                        "can0  051   [8]  01 02",
                                        "can0  051   [65]  01",
                                        "can0  051   [x]  01",
                                        "can0  51   [1]  01",
                                        "can0  FFF   [1]  01",
                                        "51#01",
                                        "051#0",
                                        "051#010203040506070809",
                                        "051##",
                                        "(1.5) can0 051#01",
                                        "(1.500000) can0",
                                        "051#zz"};
    for (size_t l = 0; l < sizeof lines / sizeof lines[0]; l++) {
        struct can_text text;
        if (can_text_parse(lines[l], &text) == NULL) {
            fail_msg("'%s' passed", lines[l]);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_message_and_field_has_a_name_of_its_own),
        cmocka_unit_test(every_named_value_has_a_word_and_its_field_holds_it),
        cmocka_unit_test(a_message_is_said_in_words),
        cmocka_unit_test(a_message_is_said_in_json),
        cmocka_unit_test(what_is_not_ours_is_told_apart),
        cmocka_unit_test(a_value_out_of_its_range_is_marked),
        cmocka_unit_test(numbers_are_shown_as_short_as_they_are),
        cmocka_unit_test(each_way_to_write_a_frame_is_read),
        cmocka_unit_test(each_line_that_is_no_frame_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
