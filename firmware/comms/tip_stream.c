#include "comms/tip_stream.h"

#include "control/real_math.h"

#define WORDS 9u
#define WORD_BITS 14u
#define WORD_MASK 0x3fffu
#define WORD_SIGN 0x2000u
#define PHASING 0x80u
#define BYTE_MASK 0x7fu
#define POSITION_STEP_M (0.9144f / 8192.0f)
#define ANGLE_STEP_RAD (REAL_PI / 8192.0f)
#define ELEVATION_MOST 4096
#define CLOCK_TICK_US 125
#define RECORD_US_MOST 4000 /* 18 bytes take 1.6 ms; what takes longer is no one record */
#define DRIFT_SHARE 1024    /* of the time between records: far more than clocks of quartz differ by */
#define LATE_US_MOST 5000   /* one that is off by more comes from a clock that was set anew, or is garbled */

enum word { WORD_X = 0, WORD_AZIMUTH = 3, WORD_ELEVATION, WORD_ROLL, WORD_TIME, WORD_QUALITY, WORD_STATUS };

void tip_stream_init(struct tip_stream *stream, int64_t age_us) {
    *stream = (struct tip_stream){.age_us = age_us};
}

/* --- words */

static uint32_t word_of(const uint8_t *record, uint32_t index) {
    return (uint32_t)(record[2u * index] & BYTE_MASK) | (uint32_t)(record[2u * index + 1u] & BYTE_MASK) << 7u;
}

static int32_t signed_word_of(const uint8_t *record, uint32_t index) {
    return (int32_t)(word_of(record, index) ^ WORD_SIGN) - (int32_t)WORD_SIGN;
}

static void put_word(uint8_t *record, uint32_t index, uint32_t word) {
    record[2u * index] = (uint8_t)(word & BYTE_MASK);
    record[2u * index + 1u] = (uint8_t)(word >> 7u & BYTE_MASK);
}

static uint32_t to_word(float value, float step, float most) {
    const float steps = real_clamp(value / step, -8192.0f, most);
    return (uint32_t)(int32_t)(steps + (steps < 0.0f ? -0.5f : 0.5f)) & WORD_MASK;
}

/* --- orientation */

/* Azimuth about z, elevation about the turned y, roll about the turned x (Diebel 2006, eq. 297). */
static void quaternion_of(const float angle_rad[3], float q[4]) {
    const float cz = real_cos(0.5f * angle_rad[0]), sz = real_sin(0.5f * angle_rad[0]);
    const float cy = real_cos(0.5f * angle_rad[1]), sy = real_sin(0.5f * angle_rad[1]);
    const float cx = real_cos(0.5f * angle_rad[2]), sx = real_sin(0.5f * angle_rad[2]);
    q[0] = cx * cy * cz + sx * sy * sz;
    q[1] = sx * cy * cz - cx * sy * sz;
    q[2] = cx * sy * cz + sx * cy * sz;
    q[3] = cx * cy * sz - sx * sy * cz;
}

/* The reverse; straight up or down, where azimuth and roll turn about the same axis, roll is zero. */
static void angles_of(const float q[4], float angle_rad[3]) {
    const float w = q[0], x = q[1], y = q[2], z = q[3];
    const float r11 = w * w + x * x - y * y - z * z, r21 = 2.0f * (x * y + w * z),
                r31 = 2.0f * (x * z - w * y);
    const float across = real_hypot(r11, r21);
    angle_rad[1] = real_atan2(-r31, across);
    if (across > 1e-4f) {
        angle_rad[0] = real_atan2(r21, r11);
        angle_rad[2] = real_atan2(2.0f * (y * z + w * x), w * w - x * x - y * y + z * z);
    } else {
        angle_rad[0] = real_atan2(2.0f * (w * z - x * y), w * w - x * x + y * y - z * z);
        angle_rad[2] = 0.0f;
    }
}

/* --- time */

/* When the pose was true: the sensor's clock, put where the earliest records say that it is. */
static int64_t measured_at(struct tip_stream *stream, uint32_t clock, int64_t arrived_us) {
    const int64_t passed_us = (int64_t)((clock - stream->clock) & WORD_MASK) * CLOCK_TICK_US;
    const int64_t offset_us = arrived_us - (stream->clock_us + passed_us);
    const int64_t late_us = offset_us - stream->offset_us;
    stream->clock = clock;
    stream->clock_us += passed_us;
    if (!stream->clock_known || late_us > LATE_US_MOST || late_us < -LATE_US_MOST) {
        stream->clock_known = true;
        stream->offset_us = offset_us;
    } else {
        const int64_t drift_us = 1 + passed_us / DRIFT_SHARE;
        stream->offset_us += late_us < drift_us ? late_us : drift_us;
    }
    return stream->clock_us + stream->offset_us - stream->age_us;
}

/* --- records */

static void keep(struct tip_stream *stream, const struct hal_tip_sample *sample) {
    if (stream->queued == TIP_STREAM_QUEUE) {
        stream->first = (stream->first + 1u) % TIP_STREAM_QUEUE;
        stream->queued--;
        stream->counters.overflow++;
    }
    stream->queue[(stream->first + stream->queued) % TIP_STREAM_QUEUE] = *sample;
    stream->queued++;
}

/* No sensor is well, at the transmitter's very centre and turned by nothing: this record was never filled. */
static bool is_blank(const uint8_t *record) {
    uint32_t bits = word_of(record, WORD_STATUS);
    for (uint32_t word = WORD_X; word <= WORD_ROLL; word++) {
        bits |= word_of(record, word);
    }
    return bits == 0u;
}

static void take_record(struct tip_stream *stream) {
    const uint8_t *record = stream->record;
    const int32_t elevation = signed_word_of(record, WORD_ELEVATION);
    struct hal_tip_sample sample;
    float angle_rad[3];
    if (elevation > ELEVATION_MOST || elevation < -ELEVATION_MOST || is_blank(record)) {
        stream->counters.out_of_range++;
        return;
    }
    for (uint32_t i = 0; i < 3u; i++) {
        sample.position_m[i] = (float)signed_word_of(record, WORD_X + i) * POSITION_STEP_M;
        angle_rad[i] = (float)signed_word_of(record, WORD_AZIMUTH + i) * ANGLE_STEP_RAD;
    }
    quaternion_of(angle_rad, sample.quaternion);
    sample.quality = (uint16_t)word_of(record, WORD_QUALITY);
    sample.status = (uint16_t)word_of(record, WORD_STATUS);
    sample.measured_us = measured_at(stream, word_of(record, WORD_TIME), stream->started_us);
    stream->counters.records++;
    keep(stream, &sample);
}

void tip_stream_byte(struct tip_stream *stream, uint8_t byte, int64_t arrived_us) {
    const bool starts = (byte & PHASING) != 0u;
    if (starts || stream->count == 0u || arrived_us - stream->started_us > RECORD_US_MOST) {
        stream->counters.short_records += stream->count > 0u ? 1u : 0u;
        stream->counters.bad_phasing += starts ? 0u : 1u;
        stream->count = 0u;
        if (!starts) {
            return;
        }
        stream->started_us = arrived_us;
    }
    stream->record[stream->count++] = byte;
    if (stream->count == TIP_STREAM_RECORD_BYTES) {
        stream->count = 0u;
        take_record(stream);
    }
}

bool tip_stream_read(struct tip_stream *stream, struct hal_tip_sample *sample) {
    if (stream->queued == 0u) {
        return false;
    }
    *sample = stream->queue[stream->first];
    stream->first = (stream->first + 1u) % TIP_STREAM_QUEUE;
    stream->queued--;
    return true;
}

void tip_stream_encode(const struct hal_tip_sample *sample, uint8_t record[TIP_STREAM_RECORD_BYTES]) {
    float angle_rad[3];
    angles_of(sample->quaternion, angle_rad);
    for (uint32_t i = 0; i < 3u; i++) {
        put_word(record, WORD_X + i, to_word(sample->position_m[i], POSITION_STEP_M, 8191.0f));
        put_word(record, WORD_AZIMUTH + i,
                 to_word(angle_rad[i], ANGLE_STEP_RAD, 8192.0f)); /* half a turn wraps */
    }
    put_word(record, WORD_TIME, (uint32_t)(sample->measured_us / CLOCK_TICK_US) & WORD_MASK);
    put_word(record, WORD_QUALITY, sample->quality & WORD_MASK);
    put_word(record, WORD_STATUS, sample->status & WORD_MASK);
    record[0] = (uint8_t)(record[0] | PHASING);
}
