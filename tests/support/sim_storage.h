/* Flash behind struct hal_storage, in RAM: words are programmed once between erasures, operations take some
 * polls to end, and the power can fail within any of them: the word or page then holds anything, and nothing
 * more happens. */
#ifndef TRIBEND_SIM_STORAGE_H
#define TRIBEND_SIM_STORAGE_H

#include "hal.h"

#define SIM_STORAGE_PAGE 256u
#define SIM_STORAGE_PARAMETERS_BYTES 2048u
#define SIM_STORAGE_TABLE_BYTES (800u * 256u)

/* What a word or page holds after power failed while it was written or erased. */
enum sim_storage_tear {
    SIM_TEAR_UNTOUCHED = 0, /* as it was */
    SIM_TEAR_WHOLE,         /* as it was to be */
    SIM_TEAR_HALF,          /* its first half as it was to be */
    SIM_TEAR_GARBAGE,
    SIM_TEAR_COUNT
};

struct sim_storage {
    struct hal_storage hal;
    uint32_t table_bytes; /* of a slot that is used, a multiple of the page */
    uint32_t operations;  /* erasures and writes that were started */
    uint32_t cut_after;   /* power fails in the operation of this number, from 1; 0: never */
    enum sim_storage_tear tear;
    uint32_t polls; /* an operation is busy for so many */
    bool fails;     /* operations end in failure */
    bool refuses;   /* operations do not start */
    bool off;       /* power failed */
    uint32_t busy;
    uint32_t misuses; /* words written twice between erasures, out of range or off their alignment */
    uint64_t random;
    uint8_t parameters[2][SIM_STORAGE_PARAMETERS_BYTES];
    uint8_t table[2][SIM_STORAGE_TABLE_BYTES];
};

/* Erased, with slots of `table_bytes`. */
void sim_storage_init(struct sim_storage *storage, uint32_t table_bytes);
/* The power comes back: what was written is still there. */
void sim_storage_power_up(struct sim_storage *storage);

#endif
