/* The LCM types of host/lcm/: their fields, and what of them goes into a run log. A test holds the two
 * together. */
#ifndef TRIBEND_LCM_TYPE_H
#define TRIBEND_LCM_TYPE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "log/event_rows.h"

#define LCM_FIELD_COUNT_MAX 4
#define LCM_FIELDS_MAX 16

struct lcm_field {
    const char *type; /* int8_t, int16_t, int32_t or int64_t */
    const char *name;
    size_t count;                            /* 0: a scalar */
    const char *column[LCM_FIELD_COUNT_MAX]; /* of the run log, one an element; NULL: goes nowhere */
    double factor;                           /* to SI */
    int only_of_kind; /* above 0: only of commands of this enum controller_command_kind */
};

struct lcm_type {
    const char *name;
    const char *channel;
    size_t fields;
    struct lcm_field field[LCM_FIELDS_MAX]; /* utime first */
};

extern const struct lcm_type lcm_types[];
extern const size_t lcm_type_count;

/* The 64 bits that lcm-gen puts in front of every message of this type (lcm-proj/lcm, lcmgen.c,
 * lcm_struct_hash, and the rotation by one that generated code adds). */
uint64_t lcm_type_fingerprint(const struct lcm_type *type);
/* Of a message with its fingerprint. */
size_t lcm_type_bytes(const struct lcm_type *type);
/* Columns of a message of lcm_type_bytes() into `values`; returns how many. */
size_t lcm_type_decode(const struct lcm_type *type, const uint8_t *message, int64_t *utime_us,
                       struct event_value values[LCM_FIELDS_MAX * LCM_FIELD_COUNT_MAX]);

#endif
