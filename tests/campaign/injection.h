/* What the campaign breaks: each injection puts one cause into the bench, of random size and chamber, for a row of
 * faults.def. Every row has one, but for those that `injection_left_out` gives a reason for. */
#ifndef TRIBEND_INJECTION_H
#define TRIBEND_INJECTION_H

#include "campaign/bench.h"

struct injection {
    const char *name;
    const char *row;       /* of faults.def: FAULT_... or WARNING_... */
    uint32_t warnings;     /* any of these counts as seen; a latched fault always does */
    bool stays_open;       /* the shut-off valve alone cannot vent it */
    void (*apply)(struct bench *bench, size_t chamber, struct random_stream *random);
};

size_t injection_count(void);
const struct injection *injection_at(size_t index);
/* Why a row of faults.def has none, or NULL. */
const char *injection_left_out(const char *row);

#endif
