#include "log/lcm_type.h"

#include <stdio.h>
#include <string.h>

#include "control/controller.h"

#define FINGERPRINT_BYTES 8
#define FIRST_HASH 0x12345678u
#define CONSTANT_DIMENSION 0

const struct lcm_type lcm_types[] = {
    {.name = "status_t",
     .channel = "TRIBEND_STATUS",
     .fields = 11,
     .field = {{.type = "int64_t", .name = "utime"},
               {.type = "int32_t",
                .name = "pressure_pa",
                .count = 3,
                .column = {"p1_pa", "p2_pa", "p3_pa"},
                .factor = 1.0},
               {.type = "int32_t",
                .name = "pressure_target_pa",
                .count = 3,
                .column = {"p1_cmd_pa", "p2_cmd_pa", "p3_cmd_pa"},
                .factor = 1.0},
               {.type = "int32_t", .name = "supply_pa", .column = {"supply_pa"}, .factor = 1.0},
               {.type = "int32_t",
                .name = "duty_ppm",
                .count = 3,
                .column = {"valve1", "valve2", "valve3"},
                .factor = 1e-6},
               {.type = "int8_t", .name = "state", .column = {"state"}, .factor = 1.0},
               {.type = "int32_t", .name = "faults"},
               {.type = "int32_t", .name = "warnings"},
               {.type = "int32_t", .name = "bend_urad"},
               {.type = "int32_t", .name = "direction_urad"},
               {.type = "int8_t", .name = "bend_is_measured"}}},
    {.name = "tip_t",
     .channel = "TRIBEND_TIP",
     .fields = 6,
     .field = {{.type = "int64_t", .name = "utime"},
               {.type = "int64_t", .name = "measured_utime"},
               {.type = "int32_t",
                .name = "position_um",
                .count = 3,
                .column = {"tip_x_m", "tip_y_m", "tip_z_m"},
                .factor = 1e-6},
               {.type = "int32_t",
                .name = "quaternion_nano",
                .count = 4,
                .column = {"tip_qw", "tip_qx", "tip_qy", "tip_qz"},
                .factor = 1e-9},
               {.type = "int32_t", .name = "quality", .column = {"tip_quality"}, .factor = 1.0},
               {.type = "int32_t", .name = "status", .column = {"tip_status"}, .factor = 1.0}}},
    {.name = "command_t",
     .channel = "TRIBEND_COMMAND",
     .fields = 6,
     .field = {{.type = "int64_t", .name = "utime"},
               {.type = "int8_t", .name = "kind"},
               {.type = "int32_t",
                .name = "pressure_pa",
                .count = 3,
                .column = {"p1_cmd_pa", "p2_cmd_pa", "p3_cmd_pa"},
                .factor = 1.0,
                .only_of_kind = COMMAND_PRESSURE},
               {.type = "int32_t",
                .name = "bend_urad",
                .column = {"bend_cmd_rad"},
                .factor = 1e-6,
                .only_of_kind = COMMAND_BEND},
               {.type = "int32_t",
                .name = "direction_urad",
                .column = {"direction_cmd_rad"},
                .factor = 1e-6,
                .only_of_kind = COMMAND_BEND},
               {.type = "int32_t", .name = "co_contraction_pa"}}}};
const size_t lcm_type_count = sizeof lcm_types / sizeof lcm_types[0];

/* lcm-gen computes with int64_t; the same in unsigned, with its arithmetic shift to the right spelled out. */
static uint64_t hash_byte(uint64_t hash, unsigned byte) {
    const uint64_t sign = (hash >> 63) != 0u ? ~(UINT64_MAX >> 55) : 0u;
    return ((hash << 8) ^ ((hash >> 55) | sign)) + byte;
}

static uint64_t hash_text(uint64_t hash, const char *text) {
    hash = hash_byte(hash, (unsigned)strlen(text));
    for (; *text != '\0'; text++) {
        hash = hash_byte(hash, (unsigned)*text);
    }
    return hash;
}

uint64_t lcm_type_fingerprint(const struct lcm_type *type) {
    uint64_t hash = FIRST_HASH;
    for (size_t f = 0; f < type->fields; f++) {
        const struct lcm_field *field = &type->field[f];
        hash = hash_text(hash_text(hash, field->name), field->type);
        hash = hash_byte(hash, field->count > 0 ? 1u : 0u);
        if (field->count > 0) {
            char size[24];
            (void)snprintf(size, sizeof size, "%zu", field->count);
            hash = hash_text(hash_byte(hash, CONSTANT_DIMENSION), size);
        }
    }
    return (hash << 1) + (hash >> 63);
}

/* "int32_t" -> 4 */
static size_t element_bytes(const struct lcm_field *field) {
    return field->type[3] == '8' ? 1 : field->type[3] == '1' ? 2 : field->type[3] == '3' ? 4 : 8;
}

static size_t elements(const struct lcm_field *field) {
    return field->count > 0 ? field->count : 1;
}

size_t lcm_type_bytes(const struct lcm_type *type) {
    size_t bytes = FINGERPRINT_BYTES;
    for (size_t f = 0; f < type->fields; f++) {
        bytes += elements(&type->field[f]) * element_bytes(&type->field[f]);
    }
    return bytes;
}

static int64_t read_signed(const uint8_t *bytes, size_t count) {
    uint64_t value = (bytes[0] & 0x80u) != 0u ? UINT64_MAX : 0u;
    for (size_t b = 0; b < count; b++) {
        value = value << 8 | bytes[b];
    }
    return (int64_t)value;
}

size_t lcm_type_decode(const struct lcm_type *type, const uint8_t *message, int64_t *utime_us,
                       struct event_value values[LCM_FIELDS_MAX * LCM_FIELD_COUNT_MAX]) {
    const uint8_t *at = message + FINGERPRINT_BYTES;
    int64_t kind = 0;
    size_t count = 0;
    for (size_t f = 0; f < type->fields; f++) {
        const struct lcm_field *field = &type->field[f];
        const bool wanted = field->only_of_kind == 0 || field->only_of_kind == kind;
        for (size_t e = 0; e < elements(field); e++) {
            const int64_t value = read_signed(at, element_bytes(field));
            const bool lacks = element_bytes(field) == sizeof(int32_t) && value == INT32_MIN;
            at += element_bytes(field);
            if (f == 0) {
                *utime_us = value;
            } else if (strcmp(field->name, "kind") == 0) {
                kind = value;
            } else if (field->column[e] != NULL && wanted && !lacks) {
                values[count++] = (struct event_value){field->column[e], field->factor * (double)value};
            }
        }
    }
    return count;
}
