/* CRC-32 of IEEE 802.3 (reflected, as zlib's): tables are checked when opened and, a part at a time, while running. */
#ifndef TRIBEND_CRC32_H
#define TRIBEND_CRC32_H

#include <stddef.h>
#include <stdint.h>

/* Of `size` bytes, continuing from `crc` (0 to start). */
uint32_t crc32_update(uint32_t crc, const void *bytes, size_t size);

#endif
