/* Addresses that the linker script sets. */
#ifndef TRIBEND_STM32G4_LINKER_H
#define TRIBEND_STM32G4_LINKER_H

#include <stdint.h>

extern uint32_t linker_stack_bottom[];
extern uint32_t linker_stack_top[];
extern uint32_t linker_stack_paint_end[]; /* above it the reset handler has its own */
extern uint32_t linker_data_start[];
extern uint32_t linker_data_end[];
extern const uint32_t linker_data_image[];
extern uint32_t linker_bss_start[];
extern uint32_t linker_bss_end[];
extern const uint8_t linker_code_start[];
extern const uint8_t linker_code_end[];
extern const uint8_t linker_table_a[];
extern const uint8_t linker_table_a_end[]; /* of what was flashed */
extern const uint8_t linker_table_b[];
extern const uint8_t linker_parameters_a[];
extern const uint8_t linker_parameters_b[];

#endif
