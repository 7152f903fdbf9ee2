#include "log/lcm_log.h"

#include <stdlib.h>
#include <string.h>

#include "log/event_rows.h"
#include "log/lcm_type.h"
#include "program/input_file.h"

#define SYNC_WORD 0xEDA1DA01u
#define HEADER_BYTES 28u /* sync word, event number, timestamp, lengths of channel and data */
#define CHANNEL_BYTES_MAX 255u
#define UTIME_MOST_US 4000000000000000
#define MERGE_US 0 /* events of one control step carry the same utime */

struct lcm_reader {
    const uint8_t *bytes;
    size_t size;
    size_t at;
    struct event_rows rows;
    struct lcm_log_counts *counts;
    char other[CHANNEL_BYTES_MAX + 1]; /* a channel that is not ours, for the message */
};

struct lcm_event {
    const uint8_t *channel;
    size_t channel_bytes;
    const uint8_t *data;
    size_t data_bytes;
};

static uint64_t read_big_endian(const uint8_t *bytes, size_t count) {
    uint64_t value = 0;
    for (size_t b = 0; b < count; b++) {
        value = value << 8 | bytes[b];
    }
    return value;
}

/* An event that starts at `at`; false: there is none, or not all of it. */
static bool event_at(const struct lcm_reader *reader, size_t at, struct lcm_event *event) {
    const uint8_t *bytes = reader->bytes + at;
    if (reader->size - at < HEADER_BYTES || read_big_endian(bytes, 4) != SYNC_WORD) {
        return false;
    }
    const uint64_t channel_bytes = read_big_endian(bytes + 20, 4),
                   data_bytes = read_big_endian(bytes + 24, 4);
    if (channel_bytes == 0 || channel_bytes > CHANNEL_BYTES_MAX ||
        channel_bytes + data_bytes > reader->size - at - HEADER_BYTES) {
        return false;
    }
    *event = (struct lcm_event){bytes + HEADER_BYTES, channel_bytes, bytes + HEADER_BYTES + channel_bytes,
                                data_bytes};
    return true;
}

/* The next whole event; false: there is none. Bytes on the way are counted: of an event that is cut off when
 * a sync word stands there and no event follows, else skipped. */
static bool next_event(struct lcm_reader *reader, struct lcm_event *event) {
    size_t from = reader->at;
    while (from < reader->size && !event_at(reader, from, event)) {
        from++;
    }
    const size_t passed = from - reader->at;
    const bool found = from < reader->size;
    if (!found && passed >= 4 && read_big_endian(reader->bytes + reader->at, 4) == SYNC_WORD) {
        reader->counts->cut_off_bytes = passed;
    } else {
        reader->counts->skipped_bytes += passed;
    }
    reader->at = found ? from + HEADER_BYTES + event->channel_bytes + event->data_bytes : from;
    return found;
}

static const struct lcm_type *type_of(const struct lcm_event *event) {
    for (size_t t = 0; t < lcm_type_count; t++) {
        if (strlen(lcm_types[t].channel) == event->channel_bytes &&
            memcmp(lcm_types[t].channel, event->channel, event->channel_bytes) == 0) {
            return &lcm_types[t];
        }
    }
    return NULL;
}

static bool take(struct lcm_reader *reader, const struct lcm_event *event) {
    struct event_value values[LCM_FIELDS_MAX * LCM_FIELD_COUNT_MAX];
    const struct lcm_type *type = type_of(event);
    int64_t utime_us = 0;
    reader->counts->events++;
    if (type == NULL) {
        reader->counts->other_channel++;
        memcpy(reader->other, event->channel, event->channel_bytes);
        reader->other[event->channel_bytes] = '\0';
        return true;
    }
    if (event->data_bytes < 8 || read_big_endian(event->data, 8) != lcm_type_fingerprint(type)) {
        reader->counts->other_version++;
        return true;
    }
    if (event->data_bytes != lcm_type_bytes(type)) {
        reader->counts->wrong_size++;
        return true;
    }
    const size_t count = lcm_type_decode(type, event->data, &utime_us, values);
    if (utime_us < 0 || utime_us > UTIME_MOST_US) {
        reader->counts->wrong_time++;
        return true;
    }
    reader->counts->decoded++;
    return event_rows_add(&reader->rows, utime_us, values, count);
}

static bool check(const struct lcm_reader *reader, const char *path, char *error, size_t error_bytes) {
    const struct lcm_log_counts *counts = reader->counts;
    if (counts->events == 0) {
        (void)snprintf(error, error_bytes,
                       "%s: not one whole LCM event in %zu bytes; is this a log of lcm-logger?", path,
                       reader->size);
        return false;
    }
    if (reader->rows.log->rows < 2) {
        (void)snprintf(
            error, error_bytes,
            "%s: %zu events, and fewer than two rows out of them: %zu of other channels (such as '%.64s'), "
            "%zu of "
            "another version of our types, %zu of the wrong size; ours are TRIBEND_STATUS, TRIBEND_TIP and "
            "TRIBEND_COMMAND of host/lcm",
            path, counts->events, counts->other_channel, reader->other, counts->other_version,
            counts->wrong_size);
        return false;
    }
    return true;
}

static bool note_counts(struct run_log *log, const struct lcm_log_counts *counts) {
    char text[320];
    (void)snprintf(
        text, sizeof text,
        "LCM, %zu events, %zu decoded, %zu of other channels, %zu of another version, %zu of the "
        "wrong size, %zu with no sensible time, %zu bytes skipped, %zu bytes of an event that is cut off",
        counts->events, counts->decoded, counts->other_channel, counts->other_version, counts->wrong_size,
        counts->wrong_time, counts->skipped_bytes, counts->cut_off_bytes);
    return run_log_set_metadata(log, "imported", text);
}

bool lcm_log_read(const char *path, struct run_log *log, struct lcm_log_counts *counts, char *error,
                  size_t error_bytes) {
    struct lcm_reader reader = {.counts = counts};
    struct lcm_event event = {.channel = NULL};
    memset(counts, 0, sizeof *counts);
    memset(log, 0, sizeof *log);
    unsigned char *bytes = input_file_read(path, &reader.size, error, error_bytes);
    if (bytes == NULL) {
        return false;
    }
    reader.bytes = bytes;
    event_rows_start(&reader.rows, log, MERGE_US);
    bool memory = true;
    while (memory && next_event(&reader, &event)) {
        memory = take(&reader, &event);
    }
    memory = memory && event_rows_finish(&reader.rows) && note_counts(log, counts);
    free(bytes);
    if (!memory) {
        (void)snprintf(error, error_bytes, "%s: out of memory", path);
    }
    const bool sound = memory && check(&reader, path, error, error_bytes);
    if (!sound) {
        run_log_free(log);
    }
    return sound;
}
