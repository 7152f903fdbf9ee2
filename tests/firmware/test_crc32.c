/* The CRC-32 that tables and images carry: the published check value, and any division into parts. */
#include "support/test.h"

#include "control/crc32.h"

/* Bit by bit, polynomial 0x04c11db7 reflected. */
static uint32_t by_bits(const uint8_t *byte, size_t size) {
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < 8 * size; i++) {
        const uint32_t bit = (crc ^ (uint32_t)(byte[i / 8] >> (i % 8))) & 1u;
        crc = (crc >> 1) ^ (bit != 0u ? 0xedb88320u : 0u);
    }
    return ~crc;
}

static void the_check_value_of_the_nine_digits(void **state) {
    (void)state;
    assert_int_equal(crc32_update(0u, "123456789", 9), 0xcbf43926u);
}

/* Every entry of the four tables is used. */
static void any_part_at_any_alignment_is_as_by_bits(void **state) {
    (void)state;
    uint8_t bytes[1031];
    uint32_t random = 1u;
    for (size_t i = 0; i < sizeof bytes; i++) {
        random = random * 1664525u + 1013904223u;
        bytes[i] = (uint8_t)(random >> 24);
    }
    for (size_t first = 0; first < 8; first++) {
        for (size_t size = 0; size + first <= sizeof bytes; size += size < 40 ? 1 : 97) {
            assert_int_equal(crc32_update(0u, bytes + first, size), by_bits(bytes + first, size));
            const size_t cut = size / 3;
            const uint32_t part = crc32_update(0u, bytes + first, cut);
            assert_int_equal(crc32_update(part, bytes + first + cut, size - cut), by_bits(bytes + first, size));
        }
    }
    for (unsigned value = 0; value < 256; value++) {
        for (size_t at = 0; at < 4; at++) {
            uint8_t word[4] = {0, 0, 0, 0};
            word[at] = (uint8_t)value;
            assert_int_equal(crc32_update(0u, word, 4), by_bits(word, 4));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_check_value_of_the_nine_digits),
        cmocka_unit_test(any_part_at_any_alignment_is_as_by_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
