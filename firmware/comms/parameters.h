/* The parameter set: every tunable of the firmware by number and name, within bounds, and as an image to be
 * kept.
 *
 * An image holds the parameters that differ from their defaults, so that defaults follow the firmware and the
 * table:
 *
 *     offset  bytes  what
 *          0      4  magic "TBPM"
 *          4      2  version
 *          6      2  number of records
 *          8      4  sequence: the higher of two images is the newer one
 *         12      4  CRC-32 of the records and then of bytes 0 to 11
 *         16      8  each: id (2), zeros (2), value (4): an integer, or the bits of a float. Little-endian
 *
 * Not here: where images are kept (store.h), when the controller takes a change (node.h). */
#ifndef TRIBEND_PARAMETERS_H
#define TRIBEND_PARAMETERS_H

#include "control/controller.h"

#define PARAMETERS_VERSION 1u
#define PARAMETERS_IMAGE_HEADER_BYTES 16u
#define PARAMETERS_RECORD_BYTES 8u

struct node_parameters {
    uint32_t node_id;
    uint32_t bit_rate;
    uint32_t data_bit_rate;
    uint32_t can_fd;
    uint32_t telemetry_slowdown;
};

struct parameters {
    struct controller_parameters controller;
    struct node_parameters node;
};

enum parameter_index {
#define PARAMETER(id, name, type, member, unit, least, most, when, comment) PARAMETER_##name,
#include "comms/parameters.def"
    PARAMETER_COUNT
};

#define PARAMETERS_IMAGE_BYTES                                                                               \
    (PARAMETERS_IMAGE_HEADER_BYTES + (uint32_t)PARAMETER_COUNT * PARAMETERS_RECORD_BYTES)

enum parameter_type { PARAMETER_TYPE_REAL = 0, PARAMETER_TYPE_U32, PARAMETER_TYPE_TIME };

struct parameter_row {
    uint16_t id;
    uint16_t at; /* of its member, bytes */
    enum parameter_type type;
    bool vented; /* changed only while no air can flow */
    float least; /* REAL */
    float most;
    uint32_t least_whole; /* U32 and TIME */
    uint32_t most_whole;
};

/* How a request went. */
#define PARAMETER_STATUSES(X)                                                                                \
    X(OK, "done")                                                                                            \
    X(UNKNOWN, "there is no such parameter in this firmware")                                                \
    X(OUT_OF_BOUNDS, "the value is outside the parameter's bounds, or no number")                            \
    X(CONFLICT, "the value does not go with the other limits, or with the table's module")                   \
    X(NOT_NOW, "only while vented: send VENT first")                                                         \
    X(BUSY, "the storage is at work: try again")                                                             \
    X(NOT_STORED, "the storage failed; the values hold until reset")
enum parameter_status {
#define PARAMETER_STATUS_ENUM(NAME, text) PARAMETER_##NAME,
    PARAMETER_STATUSES(PARAMETER_STATUS_ENUM) PARAMETER_STATUS_COUNT
#undef PARAMETER_STATUS_ENUM
};

enum parameters_image_status {
    PARAMETERS_IMAGE_OK = 0,
    PARAMETERS_IMAGE_TOO_SHORT,
    PARAMETERS_IMAGE_BAD_MAGIC,
    PARAMETERS_IMAGE_BAD_VERSION, /* of a firmware that means other things by these numbers, older or newer */
    PARAMETERS_IMAGE_BAD_CRC
};

/* What of an image could not be taken as it was. */
struct parameters_image_report {
    uint32_t unknown; /* ids that this firmware does not have */
    uint32_t refused; /* values out of bounds, or in conflict */
};

/* The nominal board; limits from the table's module where there is one. */
void parameters_default(struct parameters *parameters, const struct bend_table *table);
const struct parameter_row *parameter_row(enum parameter_index index);
/* False: there is none with this id. */
bool parameter_find(uint32_t id, enum parameter_index *index);
/* `value` is an integer or the bits of a float. */
enum parameter_status parameter_get(const struct parameters *parameters, uint32_t id, uint32_t *value);
/* Changes nothing unless it returns PARAMETER_OK. `vented`: no air can flow now. */
enum parameter_status parameter_set(struct parameters *parameters, uint32_t id, uint32_t value, bool vented,
                                    const struct bend_table *table);
/* Limits do not contradict each other nor go beyond those of the table's module (NULL: none). */
bool parameters_agree(const struct parameters *parameters, const struct bend_table *table);

/* The record of parameter `index` as `parameters` has it; false: it is the default with this table, and needs
 * none. */
bool parameters_record(const struct parameters *parameters, const struct bend_table *table,
                       enum parameter_index index, uint8_t record[PARAMETERS_RECORD_BYTES]);
/* The header before `count` records whose CRC-32 is `records_crc`. */
void parameters_seal(uint8_t *image, uint32_t count, uint32_t sequence, uint32_t records_crc);
/* The whole image, which has room for PARAMETERS_IMAGE_BYTES; returns the bytes used. */
uint32_t parameters_write(const struct parameters *parameters, const struct bend_table *table,
                          uint32_t sequence, uint8_t *image);

/* How long the image is that starts here, as its header says; 0: there is none within `size` bytes. */
uint32_t parameters_image_bytes(const uint8_t *image, uint32_t size);
/* Judges an image of `size` bytes or more by its header and the CRC-32 of its records. */
enum parameters_image_status parameters_image_check(const uint8_t *image, uint32_t size,
                                                    uint32_t records_crc);
uint32_t parameters_image_sequence(const uint8_t *image);
/* Takes over one record of a sound image. */
void parameters_take(struct parameters *parameters, const uint8_t record[PARAMETERS_RECORD_BYTES],
                     struct parameters_image_report *report);
/* After the last record: limits that contradict each other or the table go back to their defaults. */
void parameters_settle(struct parameters *parameters, const struct bend_table *table,
                       struct parameters_image_report *report);
/* All of this: defaults, and what the image changes of them. Other than PARAMETERS_IMAGE_OK: the defaults. */
enum parameters_image_status parameters_read(struct parameters *parameters, const struct bend_table *table,
                                             const uint8_t *image, uint32_t size,
                                             struct parameters_image_report *report);
/* A sentence for people, never NULL. */
const char *parameter_status_text(enum parameter_status status);

#endif
