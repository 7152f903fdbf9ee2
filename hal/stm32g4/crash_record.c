#include "stm32g4/crash_record.h"

#include <stddef.h>

#include "control/crc32.h"

#define CRASH_MAGIC 0x43525348u
#define RUNNING_CHECK 0x52554e21u

void crash_record_seal(struct crash_record *record) {
    record->magic = CRASH_MAGIC;
    record->crc = crc32_update(0u, record, offsetof(struct crash_record, crc));
}

bool crash_record_is_sound(const struct crash_record *record) {
    return record->magic == CRASH_MAGIC && record->cause != (uint32_t)CRASH_NONE &&
           record->crc == crc32_update(0u, record, offsetof(struct crash_record, crc));
}

void running_mark_set(struct running_mark *mark, uint32_t step, uint32_t state) {
    mark->step = step;
    mark->state = state;
    mark->check = step ^ (state << 16) ^ RUNNING_CHECK;
}

bool running_mark_is_sound(const struct running_mark *mark) {
    return mark->check == (mark->step ^ (mark->state << 16) ^ RUNNING_CHECK);
}
