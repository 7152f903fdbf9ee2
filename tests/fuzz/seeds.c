/* Writes inputs from which a fuzz target starts: seeds TARGET DIRECTORY. They are sound frames, records,
 * tables and parameter images, so that what lies behind the first checks is reached at once. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "comms/node.h"
#include "control/bend_table_format.h"
#include "control/crc32.h"
#include "support/tiny_table.h"

#define ROOM 65536u
#define STEPS 255u /* as a control byte: 128 steps */

static uint8_t bytes[ROOM];
static uint32_t used;
static const char *directory;
static uint32_t written;
static uint8_t sequence;

static void put(const void *from, size_t count) {
    if (count > ROOM - used) {
        abort();
    }
    memcpy(bytes + used, from, count);
    used += (uint32_t)count;
}

static void put_byte(unsigned byte) {
    const uint8_t one = (uint8_t)byte;
    put(&one, 1u);
}

static void finish(void) {
    char path[4096];
    (void)snprintf(path, sizeof path, "%s/seed%02u", directory, written++);
    FILE *file = fopen(path, "wb");
    if (file == NULL || fwrite(bytes, 1u, used, file) != used || fclose(file) != 0) {
        (void)fprintf(stderr, "seeds: %s cannot be written\n", path);
        exit(5);
    }
    used = 0u;
}

/* --- frames */

static void put_message(enum message_id id, const void *message) {
    struct message_trouble trouble = {0};
    struct hal_can_frame frame;
    message_frame(id, 1u, message, &frame, &trouble);
    put_byte(0u);
    put_byte(frame.id & 0xffu);
    put_byte(frame.id >> 8u);
    put_byte(frame.length);
    put(frame.data, frame.length);
}

static void put_steps(unsigned steps) {
    for (; steps >= 128u; steps -= 128u) {
        put_byte(STEPS);
    }
    if (steps > 0u) {
        put_byte(127u + steps);
    }
}

static void put_bend(void) {
    const struct message_bend_command bend = {++sequence, MESSAGE_PROTOCOL, 0.5f, 0.3f, 0.0f};
    put_message(MESSAGE_BEND_COMMAND, &bend);
}

static void seed_motion(void) {
    const struct message_host_heartbeat heartbeat = {7u, MESSAGE_PROTOCOL};
    const struct message_hold hold = {8u, MESSAGE_PROTOCOL};
    const struct message_clear clear = {20u, MESSAGE_PROTOCOL, MESSAGE_CLEAR_KEY,
                                        1u << FAULT_COMMAND_TIMEOUT};
    const struct message_vent vent = {30u, MESSAGE_PROTOCOL};
    sequence = 0u;
    put_steps(60u);
    put_bend();
    put_steps(20u);
    put_bend();
    put_steps(20u);
    put_message(MESSAGE_HOST_HEARTBEAT, &heartbeat);
    put_message(MESSAGE_HOLD, &hold);
    put_steps(640u);
    put_message(MESSAGE_CLEAR, &clear);
    put_steps(200u);
    put_message(MESSAGE_VENT, &vent);
    finish();
}

/* Flying while the board is switched on; then a pause. */
static void seed_restart(void) {
    put_byte(3u);
    sequence = 0u;
    for (int i = 0; i < 3; i++) {
        put_bend();
        put_steps(250u);
    }
    put_steps(400u);
    put_bend();
    put_steps(20u);
    finish();
}

static void seed_parameters_by_frame(void) {
    const struct message_parameter_get get = {0u, MESSAGE_PROTOCOL, 100u};
    const struct message_parameter_set set = {0u, MESSAGE_PROTOCOL, 5u, 3u};
    const struct message_parameter_action save = {0u, MESSAGE_PROTOCOL, NODE_ACTION_SAVE};
    const struct message_parameter_action defaults = {0u, MESSAGE_PROTOCOL, NODE_ACTION_DEFAULTS};
    put_steps(60u);
    put_message(MESSAGE_PARAMETER_GET, &get);
    put_steps(5u);
    put_message(MESSAGE_PARAMETER_SET, &set);
    put_steps(5u);
    put_message(MESSAGE_PARAMETER_ACTION, &save);
    put_steps(5u);
    put_bend();
    put_steps(300u);
    put_message(MESSAGE_PARAMETER_ACTION, &defaults);
    put_bend();
    put_steps(10u);
    finish();
}

static void seed_transfer(enum transfer_kind kind, const uint8_t *image, uint32_t count) {
    const struct message_transfer_begin begin = {0u, MESSAGE_PROTOCOL, (uint8_t)kind, false, count};
    const struct message_transfer_end end = {0u, MESSAGE_PROTOCOL, crc32_update(0u, image, count)};
    const struct message_reset reset = {0u, MESSAGE_PROTOCOL, MESSAGE_RESET_KEY};
    const struct message_identify identify = {0u, MESSAGE_PROTOCOL};
    put_steps(60u);
    put_message(MESSAGE_TRANSFER_BEGIN, &begin);
    put_steps(5u);
    for (uint32_t at = 0; at < count; at += 7u) {
        struct message_transfer_data data = {(uint8_t)(at / 7u), 0u};
        memcpy(&data.data, image + at, count - at < 7u ? count - at : 7u);
        put_message(MESSAGE_TRANSFER_DATA, &data);
        if (at % 700u == 693u) {
            put_steps(128u);
        }
    }
    put_message(MESSAGE_TRANSFER_END, &end);
    put_steps(400u);
    put_message(MESSAGE_IDENTIFY, &identify);
    put_message(MESSAGE_RESET, &reset);
    finish();
}

/* One frame of each message, to the board and from it. */
static void seed_each_message(void) {
    union message message;
    memset(&message, 0, sizeof message);
    put_steps(60u);
    for (uint32_t m = 0; m < (uint32_t)MESSAGE_COUNT; m++) {
        put_message((enum message_id)m, &message);
    }
    finish();
}

static uint32_t parameter_image(uint8_t *image, uint32_t changes) {
    struct parameters parameters;
    parameters_default(&parameters, NULL);
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT && i < changes; i++) {
        const struct parameter_row *row = parameter_row((enum parameter_index)i);
        uint32_t value = row->least_whole;
        if (row->type == PARAMETER_TYPE_REAL) {
            memcpy(&value, &row->most, sizeof value);
        }
        (void)parameter_set(&parameters, row->id, value, true, NULL);
    }
    return parameters_write(&parameters, NULL, 3u, image);
}

static void seed_frames(void) {
    static struct tiny_table tiny;
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    tiny_table_make(&tiny);
    seed_motion();
    seed_restart();
    seed_parameters_by_frame();
    seed_transfer(TRANSFER_KIND_PARAMETERS, image, parameter_image(image, 3u));
    seed_transfer(TRANSFER_KIND_TABLE, tiny.image, tiny.bytes);
    seed_each_message();
}

/* --- the others */

static void seed_tip_stream(void) {
    uint8_t record[TIP_STREAM_RECORD_BYTES];
    for (int i = 0; i < 5; i++) {
        const struct hal_tip_sample sample = {.position_m = {0.01f * (float)i, -0.02f, 0.06f},
                                              .quaternion = {0.8f, 0.0f, 0.6f, 0.0f},
                                              .measured_us = 10000 * (int64_t)i};
        tip_stream_encode(&sample, record);
        for (int again = 0; again <= i; again++) {
            put(record, i == 4 ? 11u : sizeof record);
            put_byte(0xffu);
            put_byte(8u);
        }
        finish();
    }
}

/* The grid once more, as that of a chamber that has ballooned: its first axis is then a volume. */
static void seed_ballooned_table(const struct tiny_table *tiny) {
    const uint32_t grid = tiny->bytes - BEND_TABLE_HEADER_BYTES, whole = tiny->bytes + grid,
                   nodes[3] = {4u, 4u, 4u};
    const float volumes_m2[4] = {1e-5f, 2e-5f, 4e-5f, 8e-5f}, jumps_pa[2] = {9500.0f, 7000.0f};
    put(tiny->image, tiny->bytes);
    put(tiny->image + BEND_TABLE_HEADER_BYTES, grid);
    memcpy(bytes + BEND_TABLE_OFFSET_IMAGE_BYTES, &whole, sizeof whole);
    memcpy(bytes + BEND_TABLE_OFFSET_BALLOONED, nodes, sizeof nodes);
    memcpy(bytes + BEND_TABLE_OFFSET_JUMPS, jumps_pa, sizeof jumps_pa);
    memcpy(bytes + tiny->bytes, volumes_m2, sizeof volumes_m2);
    finish();
}

static void seed_table(void) {
    static struct tiny_table tiny;
    tiny_table_make(&tiny);
    seed_ballooned_table(&tiny);
    put(tiny.image, tiny.bytes);
    finish();
    put(tiny.image, tiny.bytes / 2u);
    finish();
    put(tiny.image, 288u);
    finish();
}

static void seed_parameters(void) {
    uint8_t image[PARAMETERS_IMAGE_BYTES];
    for (uint32_t changes = 0; changes < 200u; changes += 40u) {
        put_byte(0u);
        put(image, parameter_image(image, changes));
        finish();
    }
}

int main(int argc, char **argv) {
    static const struct {
        const char *target;
        void (*seed)(void);
    } targets[] = {{"frames", seed_frames},
                   {"tip_stream", seed_tip_stream},
                   {"table", seed_table},
                   {"parameters", seed_parameters}};
    for (size_t t = 0; argc == 3 && t < sizeof targets / sizeof targets[0]; t++) {
        if (strcmp(argv[1], targets[t].target) == 0) {
            directory = argv[2];
            targets[t].seed();
            return 0;
        }
    }
    (void)fprintf(stderr, "usage: seeds frames|tip_stream|table|parameters DIRECTORY\n");
    return 2;
}
