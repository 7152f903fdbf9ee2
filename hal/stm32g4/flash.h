/* The flash memory behind struct hal_storage: one operation at a time, started here, finished by the chip. */
#ifndef TRIBEND_STM32G4_FLASH_H
#define TRIBEND_STM32G4_FLASH_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

/* Binds `storage`. False: the option bytes have the two banks as one; every operation is then refused. */
bool flash_start(struct hal_storage *storage);
/* True once after an operation in the bank that the firmware runs from: the core may have stood still since.
 */
bool flash_take_stall(void);
/* Whether the byte at `offset` of bank 1 or 2 lies in one of the areas of hal_storage. */
bool flash_is_storage(bool second_bank, uint32_t offset);

#endif
