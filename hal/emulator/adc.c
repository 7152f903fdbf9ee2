#include "emulator/adc.h"

#include <math.h>
#include <string.h>

#define ISR_ADRDY 1u
#define ISR_EOC 4u
#define ISR_EOS 8u
#define ISR_OVR 0x10u
#define CR_ADEN 1u
#define CR_ADDIS 2u
#define CR_ADSTART 4u
#define CR_ADSTP 0x10u
#define CR_ADVREGEN (1u << 28)
#define CR_DEEPPWD (1u << 29)
#define CR_ADCAL (1u << 31)
#define CFGR_DMAEN 1u
#define CFGR_EXTSEL_SHIFT 5u
#define CFGR_EXTEN_SHIFT 10u
#define EXTSEL_TIM3_TRGO 4u
#define CFGR2_ROVSE 1u
#define CCR_VREFEN (1u << 22)
#define DMA_EN 1u
#define DMA_CIRCULAR 0x20u
#define DMA_MEMORY_INCREMENT 0x80u
#define DMA_COMPLETE 2u
#define DMA_HALF 4u
#define DMA_ERROR 8u
#define DMAMUX_ADC1 5u
#define CALIBRATION_CYCLES 112
#define CONVERSION_HALF_CYCLES 25 /* 12.5 cycles for 12 bits */

static const uint16_t sampling_half_cycles[8] = {5, 13, 25, 49, 95, 185, 495, 1281};

static int64_t cycle_ticks(const struct adc *adc) {
    static const uint8_t by_mode[4] = {1, 1, 2, 4}; /* CKMODE; 00, the asynchronous clock, is not modelled */
    return TICKS_PER_SECOND / adc->core_hz * by_mode[adc->common >> 16 & 3u];
}

static uint32_t oversampling(const struct adc *adc) {
    return (adc->configuration[1] & CFGR2_ROVSE) != 0 ? 2u << (adc->configuration[1] >> 2 & 7u) : 1u;
}

static uint32_t channel_of(const struct adc *adc, uint32_t rank) {
    const uint32_t place = rank + 1u; /* SQR1 holds the length, then ranks 1 to 4; each further one five */
    return adc->sequence[place / 5u] >> (6u * (place % 5u)) & 31u;
}

static uint32_t ranks(const struct adc *adc) {
    return (adc->sequence[0] & 15u) + 1u;
}

static int64_t conversion_ticks(const struct adc *adc, uint32_t channel) {
    const uint32_t code = adc->sampling[channel / 10u] >> (3u * (channel % 10u)) & 7u;
    const int64_t half_cycles = sampling_half_cycles[code] + CONVERSION_HALF_CYCLES;
    return half_cycles * cycle_ticks(adc) / 2 * (int64_t)oversampling(adc);
}

/* The mean of the samples, summed and shifted as the oversampler does. */
static uint32_t convert(const struct adc *adc, uint32_t channel) {
    const double count = (double)oversampling(adc);
    const bool off = channel == ADC_CHANNEL_VREFINT && (adc->common & CCR_VREFEN) == 0;
    const double share = off || adc->sample == NULL ? 0.0 : adc->sample(adc->context, channel);
    const double sum = nearbyint(fmin(fmax(share, 0.0), 1.0) * ADC_FULL_SCALE * count);
    const uint32_t shift = (adc->configuration[1] & CFGR2_ROVSE) != 0 ? adc->configuration[1] >> 5 & 15u : 0u;
    return (uint32_t)sum >> shift;
}

static void start_rank(struct adc *adc) {
    const uint32_t channel = channel_of(adc, adc->rank);
    adc->code = convert(adc, channel);
    schedule_set(&adc->core->schedule, adc->slot,
                 adc->fails ? SCHEDULE_NEVER : adc->core->now_ticks + conversion_ticks(adc, channel));
}

void adc_trigger(struct adc *adc) {
    const bool armed = (adc->control & (CR_ADEN | CR_ADSTART)) == (CR_ADEN | CR_ADSTART) &&
                       (adc->configuration[0] >> CFGR_EXTEN_SHIFT & 3u) == 1u &&
                       (adc->configuration[0] >> CFGR_EXTSEL_SHIFT & 31u) == EXTSEL_TIM3_TRGO;
    if (!armed) {
        return;
    }
    if (adc->converting) {
        adc->missed++;
        return;
    }
    adc->converting = true;
    adc->rank = 0u;
    start_rank(adc);
}

static bool dma_takes(const struct adc *adc) {
    return (adc->configuration[0] & CFGR_DMAEN) != 0 && (adc->dma.control & DMA_EN) != 0 &&
           (adc->dma.request & 127u) == DMAMUX_ADC1 && adc->dma.count > 0u;
}

static void dma_move(struct adc *adc) {
    struct dma_channel *dma = &adc->dma;
    const uint16_t half = (uint16_t)adc->data;
    if (!core_write(adc->core, dma->memory, &half, sizeof half)) {
        dma->flags |= DMA_ERROR | 1u;
        dma->control &= ~DMA_EN;
        return;
    }
    dma->memory += (dma->control & DMA_MEMORY_INCREMENT) != 0 ? 2u : 0u;
    dma->count--;
    dma->flags |= dma->count == dma->count_reload / 2u ? DMA_HALF | 1u : 0u;
    if (dma->count == 0u) {
        dma->flags |= DMA_COMPLETE | 1u;
        if ((dma->control & DMA_CIRCULAR) != 0) {
            dma->count = dma->count_reload;
            dma->memory = dma->memory_start;
        }
    }
}

static void on_converted(void *context, int64_t at_ticks) {
    struct adc *adc = context;
    (void)at_ticks;
    adc->data = adc->code;
    adc->raw[adc->rank] = (uint16_t)adc->code;
    if (dma_takes(adc)) {
        dma_move(adc);
    } else {
        adc->status |= (adc->status & ISR_EOC) != 0 ? ISR_OVR : ISR_EOC;
    }
    if (++adc->rank < ranks(adc)) {
        start_rank(adc);
    } else {
        adc->converting = false;
        adc->sequences++;
        adc->status |= ISR_EOS;
    }
}

static void on_calibrated(void *context, int64_t at_ticks) {
    struct adc *adc = context;
    (void)at_ticks;
    adc->control &= ~CR_ADCAL;
}

void adc_init(struct adc *adc, struct core *core) {
    memset(adc, 0, sizeof *adc);
    adc->core = core;
    adc->slot = schedule_add(&core->schedule, on_converted, adc);
    adc->calibration_slot = schedule_add(&core->schedule, on_calibrated, adc);
}

void adc_reset(struct adc *adc, uint32_t core_hz) {
    adc->status = adc->enables = adc->configuration[0] = adc->configuration[1] = adc->data = adc->common = 0u;
    adc->control = CR_DEEPPWD;
    memset(adc->sampling, 0, sizeof adc->sampling);
    memset(adc->sequence, 0, sizeof adc->sequence);
    memset(&adc->dma, 0, sizeof adc->dma);
    adc->core_hz = core_hz;
    adc->converting = false;
    schedule_set(&adc->core->schedule, adc->slot, SCHEDULE_NEVER);
    schedule_set(&adc->core->schedule, adc->calibration_slot, SCHEDULE_NEVER);
}

void adc_clock(struct adc *adc, uint32_t core_hz) {
    adc->core_hz = core_hz;
}

static void write_control(struct adc *adc, uint32_t value) {
    const bool powered = (value & CR_ADVREGEN) != 0 && (value & CR_DEEPPWD) == 0;
    uint32_t control =
        (value & (CR_ADVREGEN | CR_DEEPPWD)) | (adc->control & (CR_ADEN | CR_ADSTART | CR_ADCAL));
    if (powered && (value & CR_ADCAL) != 0 && (control & (CR_ADEN | CR_ADCAL)) == 0) {
        control |= CR_ADCAL;
        schedule_set(&adc->core->schedule, adc->calibration_slot,
                     adc->fails ? SCHEDULE_NEVER
                                : adc->core->now_ticks + CALIBRATION_CYCLES * cycle_ticks(adc));
    }
    if (powered && (value & CR_ADEN) != 0 && (control & CR_ADCAL) == 0) {
        control |= CR_ADEN;
        adc->status |= adc->fails ? 0u : ISR_ADRDY;
    }
    if ((value & CR_ADSTART) != 0 && (control & CR_ADEN) != 0) {
        control |= CR_ADSTART;
    }
    if ((value & (CR_ADSTP | CR_ADDIS)) != 0) {
        control &= (value & CR_ADDIS) != 0 ? ~(CR_ADSTART | CR_ADEN) : ~CR_ADSTART;
        adc->converting = false;
        schedule_set(&adc->core->schedule, adc->slot, SCHEDULE_NEVER);
    }
    adc->control = control;
}

static uint32_t *plain(struct adc *adc, uint32_t offset) {
    switch (offset) {
    case 0x04u:
        return &adc->enables;
    case 0x0cu:
        return &adc->configuration[0];
    case 0x10u:
        return &adc->configuration[1];
    case 0x14u:
        return &adc->sampling[0];
    case 0x18u:
        return &adc->sampling[1];
    default:
        return offset >= 0x30u && offset <= 0x3cu ? &adc->sequence[(offset - 0x30u) / 4u] : NULL;
    }
}

bool adc_read(void *context, uint32_t offset, uint32_t *value) {
    struct adc *adc = context;
    const uint32_t *word = plain(adc, offset);
    if (word != NULL) {
        *value = *word;
        return true;
    }
    switch (offset) {
    case 0x00u:
        *value = adc->status;
        return true;
    case 0x08u:
        *value = adc->control;
        return true;
    case 0x40u:
        adc->status &= ~ISR_EOC;
        *value = adc->data;
        return true;
    default:
        return false;
    }
}

bool adc_write(void *context, uint32_t offset, uint32_t value) {
    struct adc *adc = context;
    uint32_t *word = plain(adc, offset);
    if (word != NULL) {
        *word = value;
    } else if (offset == 0x00u) {
        adc->status &= ~value;
    } else if (offset == 0x08u) {
        write_control(adc, value);
    } else {
        return false;
    }
    return true;
}

bool adc_common_read(void *context, uint32_t offset, uint32_t *value) {
    *value = ((const struct adc *)context)->common;
    return offset == 0x08u;
}

bool adc_common_write(void *context, uint32_t offset, uint32_t value) {
    ((struct adc *)context)->common = offset == 0x08u ? value : ((struct adc *)context)->common;
    return offset == 0x08u;
}

bool adc_dma_read(void *context, uint32_t offset, uint32_t *value) {
    const struct dma_channel *dma = &((const struct adc *)context)->dma;
    const uint32_t word[6] = {dma->flags, 0u, dma->control, dma->count, dma->peripheral, dma->memory_start};
    *value = offset < sizeof word ? word[offset / 4u] : 0u;
    return offset < sizeof word;
}

bool adc_dma_write(void *context, uint32_t offset, uint32_t value) {
    struct dma_channel *dma = &((struct adc *)context)->dma;
    const bool off = (dma->control & DMA_EN) == 0;
    switch (offset) {
    case 0x04u: /* a set global bit clears all four */
        dma->flags &= (value & 1u) != 0 ? ~15u : ~value;
        return true;
    case 0x08u:
        dma->control = value;
        if (off && (value & DMA_EN) != 0) {
            dma->memory = dma->memory_start;
            dma->count_reload = dma->count;
        }
        return true;
    case 0x0cu:
        dma->count = off ? value & 0xffffu : dma->count;
        return true;
    case 0x10u:
        dma->peripheral = off ? value : dma->peripheral;
        return true;
    case 0x14u:
        dma->memory_start = off ? value : dma->memory_start;
        return true;
    default:
        return false;
    }
}

bool adc_mux_read(void *context, uint32_t offset, uint32_t *value) {
    *value = ((const struct adc *)context)->dma.request;
    return offset == 0u;
}

bool adc_mux_write(void *context, uint32_t offset, uint32_t value) {
    ((struct adc *)context)->dma.request = offset == 0u ? value : ((struct adc *)context)->dma.request;
    return offset == 0u;
}
