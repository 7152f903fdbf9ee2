/* The smallest bend table there is, in static memory: four nodes an axis, for programs that run without
 * cmocka. */
#ifndef TRIBEND_TINY_TABLE_H
#define TRIBEND_TINY_TABLE_H

#include "control/bend_table.h"

#define TINY_TABLE_BYTES 2704u

struct tiny_table {
    _Alignas(8) uint8_t image[TINY_TABLE_BYTES];
    uint32_t bytes;
    struct bend_table table;
};

/* Three soft chambers up to 9 kPa. Ends the program where the table is not sound. */
void tiny_table_make(struct tiny_table *tiny);

#endif
