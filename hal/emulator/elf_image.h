/* A 32-bit little-endian ARM ELF file: its loadable segments and its symbols. Nothing else of it is looked
 * at. */
#ifndef TRIBEND_EMULATOR_ELF_IMAGE_H
#define TRIBEND_EMULATOR_ELF_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* False: refused, `error` says why. */
typedef bool (*elf_segment)(void *context, uint32_t address, const uint8_t *bytes, uint32_t size);

/* Hand each loadable segment to `take`, at its load address. False: `error` names what is wrong with the
 * file. */
bool elf_load(const char *path, elf_segment take, void *context, char *error, size_t error_bytes);
/* False: the file has no symbol of that name. */
bool elf_symbol(const char *path, const char *name, uint32_t *address, uint32_t *bytes);

#endif
