/* Bytes into the tip stream, 87 us apart; a byte 0xff is followed by one that says after how many
 * milliseconds the next comes. Held: every byte is accounted for, every sample has a unit quaternion and a
 * finite position, and a whole record at the end is understood. */
#include "fuzz.h"

#include <string.h>

#include "comms/tip_stream.h"

#define BYTE_US 87

static uint32_t take(struct tip_stream *stream) {
    struct hal_tip_sample sample;
    uint32_t count = 0u;
    while (tip_stream_read(stream, &sample)) {
        float norm = 0.0f;
        for (int i = 0; i < 4; i++) {
            norm += sample.quaternion[i] * sample.quaternion[i];
        }
        fuzz_assert(norm > 0.99999f && norm < 1.00001f);
        for (int i = 0; i < 3; i++) {
            fuzz_assert(sample.position_m[i] >= -0.9145f && sample.position_m[i] <= 0.9145f);
        }
        fuzz_assert(sample.status < 0x4000u && sample.quality < 0x4000u);
        count++;
    }
    return count;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    const struct hal_tip_sample sample = {.position_m = {0.01f, 0.02f, 0.06f},
                                          .quaternion = {1.0f, 0.0f, 0.0f, 0.0f}};
    uint8_t record[TIP_STREAM_RECORD_BYTES];
    struct tip_stream stream;
    uint32_t given = 0u, read = 0u;
    int64_t now_us = 0;
    tip_stream_init(&stream, TIP_STREAM_AGE_US);
    for (size_t at = 0; at < size; at++) {
        if (bytes[at] == 0xffu && at + 1u < size) {
            now_us += 1000 * (int64_t)bytes[++at];
            read += take(&stream);
            continue;
        }
        tip_stream_byte(&stream, bytes[at], now_us);
        now_us += BYTE_US;
        given++;
    }
    read += take(&stream);
    const struct tip_stream_counters *counters = &stream.counters;
    fuzz_assert(counters->records == read + counters->overflow);
    const uint32_t whole =
        TIP_STREAM_RECORD_BYTES * (counters->records + counters->out_of_range) + counters->bad_phasing;
    fuzz_assert(whole + counters->short_records + (stream.count > 0u ? 1u : 0u) <= given);
    fuzz_assert(given <= whole + (TIP_STREAM_RECORD_BYTES - 1u) * (counters->short_records + 1u));
    tip_stream_encode(&sample, record);
    for (size_t i = 0; i < sizeof record; i++) {
        tip_stream_byte(&stream, record[i], now_us + (int64_t)i * BYTE_US);
    }
    fuzz_assert(take(&stream) == 1u);
    return 0;
}
