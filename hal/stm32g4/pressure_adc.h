/* The pressure sensors: five channels of ADC1, sampled 250 us before each control step and put into RAM by
 * DMA. */
#ifndef TRIBEND_STM32G4_PRESSURE_ADC_H
#define TRIBEND_STM32G4_PRESSURE_ADC_H

#include <stdbool.h>
#include <stdint.h>

#include "stm32g4/conversions.h"

/* Calibrates the converter and waits for its trigger. False: it does not start. */
bool pressure_adc_start(void);
/* The newest whole sequence, as the converter gave it. False: none was completed since the last call. */
bool pressure_adc_take(uint16_t raw[RAW_CHANNEL_COUNT]);
/* The factory's reading of the internal reference, for conversions_pressures(). */
uint16_t pressure_adc_calibration(void);
/* Transfers that failed. */
uint32_t pressure_adc_errors(void);

#endif
