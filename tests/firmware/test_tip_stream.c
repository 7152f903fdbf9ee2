#include "support/test.h"

#include "comms/tip_stream.h"

#define RECORD TIP_STREAM_RECORD_BYTES
#define BYTE_US 87 /* at 115200 8N1 */
#define POSITION_STEP_M (0.9144 / 8192.0)
#define ANGLE_STEP_RAD (M_PI / 8192.0)

static struct tip_stream stream;
static uint64_t random_state;

static uint32_t random_bits(void) {
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(random_state >> 32);
}

static double uniform(double least, double most) {
    return least + (most - least) * (double)random_bits() / 4294967296.0;
}

static void start(void) {
    random_state = 3u;
    tip_stream_init(&stream, TIP_STREAM_AGE_US);
}

/* The unit quaternion that bends z by `bend` towards `direction` and then turns about the tip's axis by
 * `twist`. */
static struct hal_tip_sample pose(double bend, double direction, double twist) {
    const double s = sin(0.5 * bend), c = cos(0.5 * bend);
    const double q[4] = {c, -s * sin(direction), s * cos(direction), 0.0};
    const double cz = cos(0.5 * twist), sz = sin(0.5 * twist);
    return (struct hal_tip_sample){
        .position_m = {0.01f, -0.02f, 0.06f},
        .quaternion = {(float)(q[0] * cz - q[3] * sz), (float)(q[1] * cz + q[2] * sz),
                       (float)(q[2] * cz - q[1] * sz), (float)(q[0] * sz + q[3] * cz)},
        .quality = 11};
}

static double angle_between(const float a[4], const float b[4]) {
    double v[3], w = 0.0;
    for (int i = 0; i < 4; i++) {
        w += (double)a[i] * (double)b[i];
    }
    v[0] = (double)a[0] * (double)b[1] - (double)a[1] * (double)b[0] - (double)a[2] * (double)b[3] +
           (double)a[3] * (double)b[2];
    v[1] = (double)a[0] * (double)b[2] - (double)a[2] * (double)b[0] - (double)a[3] * (double)b[1] +
           (double)a[1] * (double)b[3];
    v[2] = (double)a[0] * (double)b[3] - (double)a[3] * (double)b[0] - (double)a[1] * (double)b[2] +
           (double)a[2] * (double)b[1];
    return 2.0 * atan2(sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), fabs(w));
}

/* `count` bytes, the first of which arrives at `at_us`. */
static void feed(const uint8_t *bytes, size_t count, int64_t at_us) {
    for (size_t i = 0; i < count; i++) {
        tip_stream_byte(&stream, bytes[i], at_us + (int64_t)i * BYTE_US);
    }
}

static void feed_sample(const struct hal_tip_sample *sample, int64_t at_us) {
    uint8_t record[RECORD];
    tip_stream_encode(sample, record);
    feed(record, RECORD, at_us);
}

static uint32_t read_all(struct hal_tip_sample *last) {
    uint32_t count = 0;
    while (tip_stream_read(&stream, last)) {
        count++;
    }
    return count;
}

/* --- the wire format */

static void a_record_has_these_bytes(void **state) {
    (void)state;
    const struct hal_tip_sample sample = {
        .position_m = {(float)(1.0 * POSITION_STEP_M), (float)(-1.0 * POSITION_STEP_M),
                       (float)(300.0 * POSITION_STEP_M)},
        .quaternion = {(float)cos(M_PI / 8.0), 0.0f, 0.0f, (float)sin(M_PI / 8.0)},
        .measured_us = 1000 * 125 + 124,
        .quality = 0x1234,
        .status = 0x1004};
    const uint8_t expected[RECORD] = {0x81, 0x00, 0x7f, 0x7f, 0x2c, 0x02, /* 1, -1, 300 */
                                      0x00, 0x10, 0x00, 0x00, 0x00, 0x00, /* azimuth 45 deg = 2048 */
                                      0x68, 0x07, 0x34, 0x24, 0x04, 0x20};
    uint8_t record[RECORD];
    tip_stream_encode(&sample, record);
    assert_memory_equal(record, expected, RECORD);
}

static void only_the_first_byte_has_bit_seven(void **state) {
    (void)state;
    start();
    for (int tried = 0; tried < 1000; tried++) {
        struct hal_tip_sample sample = pose(uniform(0.0, 3.0), uniform(-4.0, 4.0), uniform(-4.0, 4.0));
        sample.quality = (uint16_t)random_bits();
        sample.status = (uint16_t)random_bits();
        sample.measured_us = (int64_t)random_bits() * 1000;
        uint8_t record[RECORD];
        tip_stream_encode(&sample, record);
        assert_true((record[0] & 0x80u) != 0u);
        for (size_t i = 1; i < RECORD; i++) {
            assert_true((record[i] & 0x80u) == 0u);
        }
    }
}

static void a_pose_comes_back_within_the_sensors_steps(void **state) {
    (void)state;
    start();
    for (int tried = 0; tried < 20000; tried++) {
        struct hal_tip_sample back,
            sample = pose(uniform(0.0, M_PI), uniform(-M_PI, M_PI), uniform(-M_PI, M_PI));
        for (int i = 0; i < 3; i++) {
            sample.position_m[i] = (float)uniform(-0.914, 0.914);
        }
        sample.status = (uint16_t)(random_bits() & 0x3fffu);
        sample.measured_us = 10000 * (int64_t)tried;
        feed_sample(&sample, sample.measured_us + TIP_STREAM_AGE_US);
        assert_true(tip_stream_read(&stream, &back));
        for (int i = 0; i < 3; i++) {
            assert_close(back.position_m[i], sample.position_m[i], 0.501 * POSITION_STEP_M);
        }
        assert_under(angle_between(back.quaternion, sample.quaternion),
                     1.51 * ANGLE_STEP_RAD + 2e-6); /* three angles */
        assert_int_equal(back.status, sample.status);
        assert_int_equal(back.quality, sample.quality);
        assert_close((double)back.measured_us, (double)sample.measured_us, 125.0);
    }
    assert_int_equal(stream.counters.records, 20000);
    assert_int_equal(
        stream.counters.bad_phasing + stream.counters.short_records + stream.counters.out_of_range, 0);
}

/* Bent by a right angle towards x, azimuth and roll turn about the same axis. */
static void a_tip_at_right_angles_comes_back_too(void **state) {
    (void)state;
    start();
    for (int d = 0; d < 360; d++) {
        for (int b = -2; b <= 2; b++) {
            struct hal_tip_sample back;
            struct hal_tip_sample sample = pose(0.5 * M_PI + b * 1e-5, d * M_PI / 180.0, 0.3);
            const struct hal_tip_sample straight = pose(0.5 * M_PI, (d - d % 90) * M_PI / 180.0, 0.0);
            feed_sample(d % 3 == 0 ? &straight : &sample, 10000 * (int64_t)(5 * d + b + 2));
            assert_true(tip_stream_read(&stream, &back));
            assert_under(angle_between(back.quaternion, d % 3 == 0 ? straight.quaternion : sample.quaternion),
                         1.51 * ANGLE_STEP_RAD + 3e-4);
        }
    }
}

static void positions_beyond_the_range_saturate(void **state) {
    (void)state;
    struct hal_tip_sample back, sample = pose(0.1, 0.0, 0.0);
    start();
    sample.position_m[0] = 5.0f;
    sample.position_m[1] = -5.0f;
    sample.position_m[2] = NAN;
    feed_sample(&sample, 20000);
    assert_true(tip_stream_read(&stream, &back));
    assert_close(back.position_m[0], 0.9144 - POSITION_STEP_M, 1e-6);
    assert_close(back.position_m[1], -0.9144, 1e-6);
}

/* --- damage */

/* Garbage of any length and content, then whole records: the first is understood already, and never a third
 * is needed. */
static void after_garbage_the_next_whole_record_is_understood(void **state) {
    (void)state;
    start();
    int64_t now_us = 0;
    for (int tried = 0; tried < 5000; tried++) {
        struct hal_tip_sample last, sample = pose(uniform(0.0, 1.5), uniform(-3.0, 3.0), 0.0);
        uint8_t garbage[64];
        const size_t count = random_bits() % 64u;
        for (size_t i = 0; i < count; i++) {
            garbage[i] = (uint8_t)(random_bits() >> (tried % 3 == 0 ? 25 : 24)); /* a third without bit 7 */
        }
        feed(garbage, count, now_us);
        (void)read_all(&last);
        now_us += 10000;
        const uint32_t records = stream.counters.records;
        feed_sample(&sample, now_us);
        assert_int_equal(stream.counters.records, records + 1u);
        assert_int_equal(read_all(&last), 1);
        assert_under(angle_between(last.quaternion, sample.quaternion), 1.51 * ANGLE_STEP_RAD + 2e-6);
        now_us += 10000;
    }
}

/* One byte lost or doubled anywhere in a record costs that record and no other. */
static void a_lost_or_doubled_byte_costs_one_record(void **state) {
    (void)state;
    for (size_t place = 0; place < RECORD; place++) {
        for (int doubled = 0; doubled < 2; doubled++) {
            struct hal_tip_sample last, sample = pose(0.5, 1.0, 0.0);
            uint8_t record[RECORD];
            start();
            feed_sample(&sample, 0);
            assert_int_equal(read_all(&last), 1);
            tip_stream_encode(&sample, record);
            feed(record, place + (doubled ? 1u : 0u), 10000);
            feed(record + place + (doubled ? 0u : 1u), RECORD - place - (doubled ? 0u : 1u),
                 10000 + (int64_t)place * BYTE_US);
            const uint32_t wrong = read_all(&last);
            assert_true(doubled ||
                        wrong ==
                            0); /* a doubled one can make a wrong record, which plausibility must judge */
            feed_sample(&sample, 20000);
            assert_int_equal(read_all(&last), 1);
            assert_under(angle_between(last.quaternion, sample.quaternion), 1.51 * ANGLE_STEP_RAD + 2e-6);
            assert_true(stream.counters.bad_phasing + stream.counters.short_records >= 1u);
        }
    }
}

static void half_records_are_counted(void **state) {
    (void)state;
    const struct hal_tip_sample sample = pose(0.5, 1.0, 0.0);
    struct hal_tip_sample last;
    uint8_t record[RECORD];
    start();
    tip_stream_encode(&sample, record);
    for (int i = 0; i < 50; i++) {
        feed(record, 9, 5000 * i);
    }
    assert_int_equal(read_all(&last), 0);
    assert_int_equal(stream.counters.short_records, 49);
    feed(record + 9, 9, 251000); /* so late that it cannot be the rest of it */
    assert_int_equal(read_all(&last), 0);
    assert_int_equal(stream.counters.short_records, 50);
    assert_int_equal(stream.counters.bad_phasing, 9);
}

static void records_without_phasing_are_counted_byte_by_byte(void **state) {
    (void)state;
    const struct hal_tip_sample sample = pose(0.5, 1.0, 0.0);
    struct hal_tip_sample last;
    uint8_t record[RECORD];
    start();
    tip_stream_encode(&sample, record);
    record[0] &= 0x7fu;
    feed(record, RECORD, 0);
    assert_int_equal(read_all(&last), 0);
    assert_int_equal(stream.counters.bad_phasing, RECORD);
}

static void an_elevation_that_no_sensor_sends_is_refused(void **state) {
    (void)state;
    const struct hal_tip_sample sample = pose(0.0, 0.0, 0.0);
    struct hal_tip_sample last;
    uint8_t record[RECORD];
    start();
    tip_stream_encode(&sample, record);
    const unsigned words[] = {4096u, 4097u, 8191u, 8192u, 16384u - 4097u, 16384u - 4096u};
    for (size_t w = 0; w < 6; w++) {
        record[8] = (uint8_t)(words[w] & 0x7fu);
        record[9] = (uint8_t)(words[w] >> 7 & 0x7fu);
        feed(record, RECORD, 10000 * (int64_t)w);
        assert_int_equal(read_all(&last), w == 0 || w == 5 ? 1 : 0);
    }
    assert_int_equal(stream.counters.out_of_range, 4);
}

/* Zeros are no pose, with phasing or without, whatever clock and quality say; with a status they tell that much. */
static void zeros_are_no_pose(void **state) {
    (void)state;
    const struct hal_tip_sample good = pose(0.5, 1.0, 0.0);
    struct hal_tip_sample last;
    uint8_t record[RECORD] = {0};
    start();
    feed(record, RECORD, 0);
    assert_int_equal(read_all(&last), 0);
    assert_int_equal(stream.counters.bad_phasing, RECORD);
    record[0] = 0x80u;
    for (int i = 0; i < 50; i++) {
        record[12] = (uint8_t)(40 * i % 128); /* the clock goes on */
        record[14] = (uint8_t)i;
        feed(record, RECORD, 10000 * (int64_t)(i + 1));
        assert_int_equal(read_all(&last), 0);
    }
    assert_int_equal(stream.counters.out_of_range, 50);
    assert_int_equal(stream.counters.records, 0);
    record[16] = 0x04u; /* saturated */
    feed(record, RECORD, 600000);
    assert_int_equal(read_all(&last), 1);
    assert_int_equal(last.status, 4);
    feed_sample(&good, 610000);
    assert_int_equal(read_all(&last), 1);
    assert_under(angle_between(last.quaternion, good.quaternion), 1.51 * ANGLE_STEP_RAD + 2e-6);
}

/* Nobody reads, or the sensor sends ten times as often: the newest samples are kept, the others counted. */
static void samples_that_nobody_reads_are_counted(void **state) {
    (void)state;
    struct hal_tip_sample sample = pose(0.5, 1.0, 0.0), read;
    start();
    for (uint32_t i = 0; i < 50; i++) {
        sample.quality = (uint16_t)i;
        feed_sample(&sample, 1600 * (int64_t)i);
    }
    assert_int_equal(stream.counters.overflow, 50 - TIP_STREAM_QUEUE);
    for (uint32_t i = 50 - TIP_STREAM_QUEUE; i < 50; i++) {
        assert_true(tip_stream_read(&stream, &read));
        assert_int_equal(read.quality, i);
    }
    assert_false(tip_stream_read(&stream, &read));
}

/* Every byte is part of a record, of one that was cut off, or out of phase. */
static void any_bytes_are_accounted_for(void **state) {
    (void)state;
    struct hal_tip_sample last;
    uint32_t given = 0, read = 0;
    start();
    for (int i = 0; i < 400000; i++) {
        tip_stream_byte(&stream, (uint8_t)(random_bits() >> 24 & (random_bits() % 20u == 0u ? 0xffu : 0x7fu)),
                        (int64_t)i * BYTE_US);
        given++;
        if (i % 7 == 0) {
            read += read_all(&last);
        }
        if (read > 0 && i % 7 == 0) {
            const double norm =
                (double)(last.quaternion[0] * last.quaternion[0] + last.quaternion[1] * last.quaternion[1] +
                         last.quaternion[2] * last.quaternion[2] + last.quaternion[3] * last.quaternion[3]);
            assert_close(norm, 1.0, 1e-5); /* a unit quaternion whatever the words say */
        }
    }
    read += read_all(&last);
    const struct tip_stream_counters *counters = &stream.counters;
    assert_int_equal(counters->records, read + counters->overflow);
    assert_true(counters->records > 50u && counters->out_of_range > 50u && counters->short_records > 1000u);
    const uint32_t whole = RECORD * (counters->records + counters->out_of_range) + counters->bad_phasing;
    assert_true(whole <= given && given - whole <= (RECORD - 1u) * (counters->short_records + 1u));
    assert_true(given - whole >= counters->short_records);
}

/* --- time */

/* The sensor's clock takes out how unevenly records arrive. */
static void uneven_arrival_hardly_moves_the_time(void **state) {
    (void)state;
    start();
    double worst_us = 0.0;
    for (int i = 0; i < 3000; i++) {
        struct hal_tip_sample back, sample = pose(0.5, 1.0, 0.0);
        sample.measured_us = 10000 * (int64_t)i;
        feed_sample(&sample, sample.measured_us + TIP_STREAM_AGE_US + (int64_t)uniform(0.0, 1000.0));
        assert_true(tip_stream_read(&stream, &back));
        const double error_us = fabs((double)(back.measured_us - sample.measured_us));
        worst_us = i > 100 && error_us > worst_us ? error_us : worst_us;
    }
    print_message("worst error of the time of measurement: %.0f us of 1000 us unevenness\n", worst_us);
    assert_under(worst_us, 450.0);
}

static void a_sensor_whose_clock_drifts_stays_in_time(void **state) {
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        start();
        for (int i = 0; i < 60000; i++) { /* ten minutes, 200 ppm */
            struct hal_tip_sample back, sample = pose(0.5, 1.0, 0.0);
            const int64_t true_us = 10000 * (int64_t)i;
            sample.measured_us = true_us + sign * true_us / 5000 + 100000;
            feed_sample(&sample, true_us + TIP_STREAM_AGE_US);
            assert_true(tip_stream_read(&stream, &back));
            assert_close((double)back.measured_us, (double)true_us, 250.0);
        }
    }
}

static void a_sensor_that_starts_anew_or_pauses_is_followed(void **state) {
    (void)state;
    struct hal_tip_sample back, sample = pose(0.5, 1.0, 0.0);
    start();
    for (int i = 0; i < 2000; i++) {
        const int64_t true_us =
            10000 * (int64_t)i + (i > 700 ? 3456000 : 0); /* a pause of more than the clock's round */
        sample.measured_us = i > 1500 ? true_us - 15432100 : true_us;
        feed_sample(&sample, true_us + TIP_STREAM_AGE_US);
        assert_true(tip_stream_read(&stream, &back));
        if (i != 701 && i != 1501) {
            assert_close((double)back.measured_us, (double)true_us, 5000.0);
        }
        if (i % 700 > 600) {
            assert_close((double)back.measured_us, (double)true_us, 250.0);
        }
    }
}

/* A time word that was garbled on the line moves the time for a few seconds at most, and never by more than
 * 20 ms. */
static void a_garbled_time_is_forgotten(void **state) {
    (void)state;
    struct hal_tip_sample back, sample = pose(0.5, 1.0, 0.0);
    uint8_t record[RECORD];
    for (uint8_t byte = 12; byte < 14; byte++) {
        for (int bit = 0; bit < 7; bit++) {
            start();
            for (int i = 0; i < 1500; i++) {
                sample.measured_us = 10000 * (int64_t)i;
                tip_stream_encode(&sample, record);
                record[byte] ^= (uint8_t)(i == 500 ? 1u << bit : 0u);
                feed(record, RECORD, sample.measured_us + TIP_STREAM_AGE_US);
                assert_true(tip_stream_read(&stream, &back));
                const double error_us = fabs((double)(back.measured_us - sample.measured_us));
                assert_under(error_us, i < 500 || i > 1100 ? 250.0 : 5250.0);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_record_has_these_bytes),
        cmocka_unit_test(only_the_first_byte_has_bit_seven),
        cmocka_unit_test(a_pose_comes_back_within_the_sensors_steps),
        cmocka_unit_test(a_tip_at_right_angles_comes_back_too),
        cmocka_unit_test(positions_beyond_the_range_saturate),
        cmocka_unit_test(after_garbage_the_next_whole_record_is_understood),
        cmocka_unit_test(a_lost_or_doubled_byte_costs_one_record),
        cmocka_unit_test(half_records_are_counted),
        cmocka_unit_test(records_without_phasing_are_counted_byte_by_byte),
        cmocka_unit_test(an_elevation_that_no_sensor_sends_is_refused),
        cmocka_unit_test(zeros_are_no_pose),
        cmocka_unit_test(samples_that_nobody_reads_are_counted),
        cmocka_unit_test(any_bytes_are_accounted_for),
        cmocka_unit_test(uneven_arrival_hardly_moves_the_time),
        cmocka_unit_test(a_sensor_whose_clock_drifts_stays_in_time),
        cmocka_unit_test(a_sensor_that_starts_anew_or_pauses_is_followed),
        cmocka_unit_test(a_garbled_time_is_forgotten),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
