#include "stm32g4/pressure_adc.h"

#include "stm32g4/core.h"
#include "stm32g4/pins.h"
#include "stm32g4/registers.h"

#define CHANNEL_CHAMBER_1 1u /* PA0 */
#define CHANNEL_CHAMBER_2 2u /* PA1 */
#define CHANNEL_CHAMBER_3 7u /* PC1 */
#define CHANNEL_SUPPLY 6u    /* PC0 */
#define CHANNEL_REFERENCE 18u
#define SEQUENCES 2u
#define TRANSFERS (SEQUENCES * (uint32_t)RAW_CHANNEL_COUNT)
#define REGULATOR_TURNS 2000u /* 20 us at 170 MHz at two cycles a turn */
#define POLLS 200000u

static volatile uint16_t samples[SEQUENCES][RAW_CHANNEL_COUNT];
static uint32_t errors;

static bool power_up(void) {
    RCC->ahb2enr |= RCC_AHB2ENR_ADC12;
    (void)RCC->ahb2enr;
    ADC12_COMMON->ccr = ADC_CCR_CKMODE_QUARTER | ADC_CCR_VREFEN;
    ADC1->cr = 0u; /* out of deep power-down */
    ADC1->cr = ADC_CR_ADVREGEN;
    for (volatile uint32_t i = 0; i < REGULATOR_TURNS; i++) {
    }
    ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADCAL;
    if (!core_await(&ADC1->cr, ADC_CR_ADCAL, 0u, POLLS)) {
        return false;
    }
    for (volatile uint32_t i = 0; i < REGULATOR_TURNS;
         i++) { /* four converter clocks between ADCAL and ADEN */
    }
    ADC1->isr = ADC_ISR_ADRDY;
    ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADEN;
    return core_await(&ADC1->isr, ADC_ISR_ADRDY, ADC_ISR_ADRDY, POLLS);
}

static void set_sequence(void) {
    ADC1->cfgr2 = ADC_CFGR2_ROVSE | ADC_CFGR2_OVSR_16; /* sums, not shifted */
    ADC1->smpr1 = (ADC_SAMPLE_47_5 << (3u * CHANNEL_CHAMBER_1)) |
                  (ADC_SAMPLE_47_5 << (3u * CHANNEL_CHAMBER_2)) |
                  (ADC_SAMPLE_47_5 << (3u * CHANNEL_CHAMBER_3)) | (ADC_SAMPLE_47_5 << (3u * CHANNEL_SUPPLY));
    ADC1->smpr2 = ADC_SAMPLE_247_5 << (3u * (CHANNEL_REFERENCE - 10u)); /* the reference wants 4 us */
    ADC1->sqr1 = ((uint32_t)RAW_CHANNEL_COUNT - 1u) | (CHANNEL_CHAMBER_1 << 6) | (CHANNEL_CHAMBER_2 << 12) |
                 (CHANNEL_CHAMBER_3 << 18) | (CHANNEL_SUPPLY << 24);
    ADC1->sqr2 = CHANNEL_REFERENCE;
    ADC1->cfgr = ADC_CFGR_DMAEN | ADC_CFGR_DMACFG_CIRCULAR | ADC_CFGR_OVRMOD | ADC_CFGR_EXTEN_RISING |
                 ADC_CFGR_EXTSEL_TIM3_TRGO;
}

static void start_transfers(void) {
    DMA1->ccr1 = 0u;
    DMA1->ifcr = DMA_ISR_TCIF1 | DMA_ISR_HTIF1 | DMA_ISR_TEIF1;
    DMA1->cpar1 = (uint32_t)(uintptr_t)&ADC1->dr;
    DMA1->cmar1 = (uint32_t)(uintptr_t)samples;
    DMA1->cndtr1 = TRANSFERS;
    DMA1->ccr1 =
        DMA_CCR_CIRC | DMA_CCR_MINC | DMA_CCR_PSIZE_16 | DMA_CCR_MSIZE_16 | DMA_CCR_PL_HIGH | DMA_CCR_EN;
}

bool pressure_adc_start(void) {
    pins_analog(GPIOA, 0u);
    pins_analog(GPIOA, 1u);
    pins_analog(GPIOC, 0u);
    pins_analog(GPIOC, 1u);
    RCC->ahb1enr |= RCC_AHB1ENR_DMA1 | RCC_AHB1ENR_DMAMUX1;
    (void)RCC->ahb1enr;
    *DMAMUX1_CHANNEL0 = DMAMUX_REQUEST_ADC1;
    if (!power_up()) {
        return false;
    }
    set_sequence();
    start_transfers();
    ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADSTART;
    return true;
}

/* A failed transfer has switched the channel off; the sequence that is then written may start in the middle
 * of one of the converter's, so the converter starts anew, too. */
static void start_again(void) {
    errors++;
    ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADSTP;
    if (core_await(&ADC1->cr, ADC_CR_ADSTART, 0u, POLLS)) {
        start_transfers();
        ADC1->cr = ADC_CR_ADVREGEN | ADC_CR_ADSTART;
    }
}

bool pressure_adc_take(uint16_t raw[RAW_CHANNEL_COUNT]) {
    const uint32_t flags = DMA1->isr;
    DMA1->ifcr = flags & (DMA_ISR_TCIF1 | DMA_ISR_HTIF1);
    if ((flags & DMA_ISR_TEIF1) != 0u) {
        start_again();
        return false;
    }
    if ((flags & (DMA_ISR_TCIF1 | DMA_ISR_HTIF1)) == 0u) {
        return false;
    }
    const uint32_t whole =
        DMA1->cndtr1 > (uint32_t)RAW_CHANNEL_COUNT ? 1u : 0u; /* the other is being written */
    for (uint32_t i = 0; i < (uint32_t)RAW_CHANNEL_COUNT; i++) {
        raw[i] = samples[whole][i];
    }
    return true;
}

uint16_t pressure_adc_calibration(void) {
    return *(const volatile uint16_t *)VREFINT_CALIBRATION_ADDRESS;
}

uint32_t pressure_adc_errors(void) {
    return errors;
}
