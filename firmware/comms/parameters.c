#include "comms/parameters.h"

#include <stddef.h>
#include <string.h>

#include "control/crc32.h"
#include "control/real_math.h"

#define ID_MOST 255u
#define MAGIC 0x4d504254u /* "TBPM" */
#define AT_VERSION 4u
#define AT_COUNT 6u
#define AT_SEQUENCE 8u
#define AT_CRC 12u

/* --- the table */

#define VENTED true
#define START true
#define ANY_TIME false
#define REAL_LEAST(x) (x)
#define REAL_WHOLE(x) 0u
#define U32_LEAST(x) 0.0f
#define U32_WHOLE(x) (x##u)
#define TIME_LEAST(x) 0.0f
#define TIME_WHOLE(x) (x##u)
#define PARAMETER(id, name, type, member, unit, least, most, when, comment)                                  \
    {id,                                                                                                     \
     (uint16_t)offsetof(struct parameters, member),                                                          \
     PARAMETER_TYPE_##type,                                                                                  \
     when,                                                                                                   \
     type##_LEAST(least),                                                                                    \
     type##_LEAST(most),                                                                                     \
     type##_WHOLE(least),                                                                                    \
     type##_WHOLE(most)},
static const struct parameter_row rows[PARAMETER_COUNT] = {
#include "comms/parameters.def"
};

static const uint8_t index_of_id[ID_MOST + 1u] = {
#define PARAMETER(id, name, type, member, unit, least, most, when, comment)                                  \
    [id] = (uint8_t)PARAMETER_##name + 1u,
#include "comms/parameters.def"
};
_Static_assert((uint32_t)PARAMETER_COUNT < ID_MOST, "index_of_id holds bytes");
_Static_assert(sizeof(struct parameters) < 65536u, "offsets have 16 bits");

const struct parameter_row *parameter_row(enum parameter_index index) {
    return &rows[index];
}

bool parameter_find(uint32_t id, enum parameter_index *index) {
    if (id > ID_MOST || index_of_id[id] == 0u) {
        return false;
    }
    *index = (enum parameter_index)(index_of_id[id] - 1u);
    return true;
}

void parameters_default(struct parameters *parameters, const struct bend_table *table) {
    (void)memset(parameters, 0, sizeof *parameters);
    controller_default_parameters(&parameters->controller, table);
    parameters->node = (struct node_parameters){.node_id = 1u,
                                                .bit_rate = 1000000u,
                                                .data_bit_rate = 2000000u,
                                                .can_fd = 0u,
                                                .telemetry_slowdown = 1u};
}

/* --- one parameter */

static uint32_t read_member(const struct parameters *parameters, const struct parameter_row *row) {
    const uint8_t *member = (const uint8_t *)parameters + row->at;
    int64_t time_us = 0;
    uint32_t value = 0u;
    if (row->type == PARAMETER_TYPE_TIME) {
        (void)memcpy(&time_us, member, sizeof time_us);
        return (uint32_t)time_us;
    }
    (void)memcpy(&value, member, sizeof value);
    return value;
}

static void write_member(struct parameters *parameters, const struct parameter_row *row, uint32_t value) {
    uint8_t *member = (uint8_t *)parameters + row->at;
    const int64_t time_us = (int64_t)value;
    if (row->type == PARAMETER_TYPE_TIME) {
        (void)memcpy(member, &time_us, sizeof time_us);
    } else {
        (void)memcpy(member, &value, sizeof value);
    }
}

static bool within_bounds(const struct parameter_row *row, uint32_t value) {
    float real = 0.0f;
    if (row->type != PARAMETER_TYPE_REAL) {
        return value >= row->least_whole && value <= row->most_whole;
    }
    (void)memcpy(&real, &value, sizeof real);
    return real >= row->least && real <= row->most; /* not of NaN */
}

bool parameters_agree(const struct parameters *parameters, const struct bend_table *table) {
    const struct limits_parameters *limits = &parameters->controller.limits;
    bool agree = limits->working_pressure_pa < limits->hard_pressure_pa &&
                 limits->hard_pressure_pa < limits->sensor_most_pa;
    if (table != NULL) {
        agree = agree && limits->working_pressure_pa <= table->module.working_pressure_pa &&
                limits->hard_pressure_pa < table->module.burst_pressure_pa;
    }
    return agree;
}

enum parameter_status parameter_get(const struct parameters *parameters, uint32_t id, uint32_t *value) {
    enum parameter_index index;
    if (!parameter_find(id, &index)) {
        return PARAMETER_UNKNOWN;
    }
    *value = read_member(parameters, &rows[index]);
    return PARAMETER_OK;
}

enum parameter_status parameter_set(struct parameters *parameters, uint32_t id, uint32_t value, bool vented,
                                    const struct bend_table *table) {
    enum parameter_index index;
    if (!parameter_find(id, &index)) {
        return PARAMETER_UNKNOWN;
    }
    const struct parameter_row *row = &rows[index];
    if (!within_bounds(row, value)) {
        return PARAMETER_OUT_OF_BOUNDS;
    }
    if (row->vented && !vented) {
        return PARAMETER_NOT_NOW;
    }
    const uint32_t before = read_member(parameters, row);
    write_member(parameters, row, value);
    if (!parameters_agree(parameters, table)) {
        write_member(parameters, row, before);
        return PARAMETER_CONFLICT;
    }
    return PARAMETER_OK;
}

/* --- images */

static void put_u16(uint8_t *image, uint32_t at, uint16_t value) {
    (void)memcpy(image + at, &value, sizeof value);
}

static void put_u32(uint8_t *image, uint32_t at, uint32_t value) {
    (void)memcpy(image + at, &value, sizeof value);
}

static uint16_t get_u16(const uint8_t *image, uint32_t at) {
    uint16_t value = 0u;
    (void)memcpy(&value, image + at, sizeof value);
    return value;
}

static uint32_t get_u32(const uint8_t *image, uint32_t at) {
    uint32_t value = 0u;
    (void)memcpy(&value, image + at, sizeof value);
    return value;
}

static uint32_t crc_of_header(const uint8_t *image, uint32_t records_crc) {
    return crc32_update(records_crc, image, AT_CRC);
}

static bool make_record(const struct parameters *parameters, const struct parameters *defaults,
                        uint32_t index, uint8_t record[PARAMETERS_RECORD_BYTES]) {
    const uint32_t value = read_member(parameters, &rows[index]);
    put_u32(record, 0u, rows[index].id);
    put_u32(record, 4u, value);
    return value != read_member(defaults, &rows[index]);
}

bool parameters_record(const struct parameters *parameters, const struct bend_table *table,
                       enum parameter_index index, uint8_t record[PARAMETERS_RECORD_BYTES]) {
    struct parameters defaults;
    parameters_default(&defaults, table);
    return make_record(parameters, &defaults, (uint32_t)index, record);
}

void parameters_seal(uint8_t *image, uint32_t count, uint32_t sequence, uint32_t records_crc) {
    put_u32(image, 0u, MAGIC);
    put_u16(image, AT_VERSION, (uint16_t)PARAMETERS_VERSION);
    put_u16(image, AT_COUNT, (uint16_t)count);
    put_u32(image, AT_SEQUENCE, sequence);
    put_u32(image, AT_CRC, crc_of_header(image, records_crc));
}

uint32_t parameters_write(const struct parameters *parameters, const struct bend_table *table,
                          uint32_t sequence, uint8_t *image) {
    struct parameters defaults;
    uint8_t *records = image + PARAMETERS_IMAGE_HEADER_BYTES;
    uint32_t count = 0u;
    parameters_default(&defaults, table);
    for (uint32_t i = 0; i < (uint32_t)PARAMETER_COUNT; i++) {
        count += make_record(parameters, &defaults, i, records + count * PARAMETERS_RECORD_BYTES) ? 1u : 0u;
    }
    parameters_seal(image, count, sequence, crc32_update(0u, records, count * PARAMETERS_RECORD_BYTES));
    return PARAMETERS_IMAGE_HEADER_BYTES + count * PARAMETERS_RECORD_BYTES;
}

uint32_t parameters_image_bytes(const uint8_t *image, uint32_t size) {
    if (size < PARAMETERS_IMAGE_HEADER_BYTES || get_u32(image, 0u) != MAGIC) {
        return 0u;
    }
    const uint32_t bytes = PARAMETERS_IMAGE_HEADER_BYTES + get_u16(image, AT_COUNT) * PARAMETERS_RECORD_BYTES;
    return bytes <= size ? bytes : 0u;
}

uint32_t parameters_image_sequence(const uint8_t *image) {
    return get_u32(image, AT_SEQUENCE);
}

enum parameters_image_status parameters_image_check(const uint8_t *image, uint32_t size,
                                                    uint32_t records_crc) {
    if (size < PARAMETERS_IMAGE_HEADER_BYTES) {
        return PARAMETERS_IMAGE_TOO_SHORT;
    }
    if (get_u32(image, 0u) != MAGIC) {
        return PARAMETERS_IMAGE_BAD_MAGIC;
    }
    if (parameters_image_bytes(image, size) == 0u) {
        return PARAMETERS_IMAGE_TOO_SHORT;
    }
    if (crc_of_header(image, records_crc) != get_u32(image, AT_CRC)) {
        return PARAMETERS_IMAGE_BAD_CRC;
    }
    return get_u16(image, AT_VERSION) == PARAMETERS_VERSION ? PARAMETERS_IMAGE_OK
                                                            : PARAMETERS_IMAGE_BAD_VERSION;
}

void parameters_take(struct parameters *parameters, const uint8_t record[PARAMETERS_RECORD_BYTES],
                     struct parameters_image_report *report) {
    enum parameter_index index;
    const uint32_t value = get_u32(record, 4u);
    if (!parameter_find(get_u32(record, 0u), &index)) {
        report->unknown++;
    } else if (!within_bounds(&rows[index], value)) {
        report->refused++;
    } else {
        write_member(parameters, &rows[index], value);
    }
}

void parameters_settle(struct parameters *parameters, const struct bend_table *table,
                       struct parameters_image_report *report) {
    if (!parameters_agree(parameters, table)) {
        limits_default_parameters(&parameters->controller.limits, table);
        report->refused++;
    }
}

enum parameters_image_status parameters_read(struct parameters *parameters, const struct bend_table *table,
                                             const uint8_t *image, uint32_t size,
                                             struct parameters_image_report *report) {
    const uint8_t *records = image + PARAMETERS_IMAGE_HEADER_BYTES;
    const uint32_t bytes = parameters_image_bytes(image, size);
    const uint32_t record_bytes = bytes != 0u ? bytes - PARAMETERS_IMAGE_HEADER_BYTES : 0u;
    *report = (struct parameters_image_report){.unknown = 0u};
    parameters_default(parameters, table);
    const enum parameters_image_status status =
        parameters_image_check(image, size, crc32_update(0u, records, record_bytes));
    if (status != PARAMETERS_IMAGE_OK) {
        return status;
    }
    for (uint32_t at = 0; at < record_bytes; at += PARAMETERS_RECORD_BYTES) {
        parameters_take(parameters, records + at, report);
    }
    parameters_settle(parameters, table, report);
    return status;
}

const char *parameter_status_text(enum parameter_status status) {
#define PARAMETER_STATUS_TEXT(NAME, text) text,
    static const char *const texts[PARAMETER_STATUS_COUNT] = {PARAMETER_STATUSES(PARAMETER_STATUS_TEXT)};
#undef PARAMETER_STATUS_TEXT
    return (uint32_t)status < (uint32_t)PARAMETER_STATUS_COUNT ? texts[status] : "unknown";
}
