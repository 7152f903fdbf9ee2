/* ADC1 with its part of DMA1 and DMAMUX1: regular sequences begun by a trigger, oversampled, moved to RAM.
 * RM0440, chapters 21, 12 and 13. What a pin carries is asked when its conversion starts. */
#ifndef TRIBEND_EMULATOR_ADC_H
#define TRIBEND_EMULATOR_ADC_H

#include "emulator/core.h"

#define ADC_CHANNELS 19u
#define ADC_CHANNEL_VREFINT 18u
#define ADC_FULL_SCALE 4095u

struct dma_channel {
    uint32_t flags, control, count, count_reload, peripheral, memory, memory_start, request;
};

struct adc {
    struct core *core;
    /* What the pin of `channel` carries now, as a share of the reference voltage; noise included. */
    double (*sample)(void *context, uint32_t channel);
    void *context;
    uint32_t status, enables, control, configuration[2], sampling[2], sequence[4], data, common;
    struct dma_channel dma;
    uint32_t core_hz;
    uint32_t rank; /* of the conversion under way */
    uint32_t code; /* of it, summed */
    bool converting;
    bool fails;      /* injected: no conversion ever ends */
    uint32_t missed; /* triggers while a sequence was under way */
    uint32_t sequences;
    uint16_t raw[16]; /* of the last sequence, by rank */
    size_t slot, calibration_slot;
};

void adc_init(struct adc *adc, struct core *core);
void adc_reset(struct adc *adc, uint32_t core_hz);
void adc_clock(struct adc *adc, uint32_t core_hz);
bool adc_read(void *context, uint32_t offset, uint32_t *value);
bool adc_write(void *context, uint32_t offset, uint32_t value);
bool adc_common_read(void *context, uint32_t offset, uint32_t *value);
bool adc_common_write(void *context, uint32_t offset, uint32_t value);
bool adc_dma_read(void *context, uint32_t offset, uint32_t *value);
bool adc_dma_write(void *context, uint32_t offset, uint32_t value);
bool adc_mux_read(void *context, uint32_t offset, uint32_t *value);
bool adc_mux_write(void *context, uint32_t offset, uint32_t value);
/* TIM3's trigger output rises. */
void adc_trigger(struct adc *adc);

#endif
