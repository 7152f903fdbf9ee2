#include "stm32g4/conversions.h"

#include "control/real_math.h"

#define REFERENCE_CALIBRATED_V 3.0f
#define REFERENCE_LEAST_V 3.0f
#define REFERENCE_MOST_V 3.6f
#define SAMPLES_SUMMED 16u
#define PWM_COUNTS_MOST 65536u
#define HZ_PER_MHZ 1000000u

const struct sensor_transfer chamber_sensor = {.ratio_at_zero = 0.1f,
                                               .ratio_at_full = 0.9f,
                                               .full_pa = 50000.0f,
                                               .ratio_least = 0.05f,
                                               .ratio_most = 0.95f};
const struct sensor_transfer supply_sensor = {.ratio_at_zero = 0.1f,
                                              .ratio_at_full = 0.9f,
                                              .full_pa = 100000.0f,
                                              .ratio_least = 0.05f,
                                              .ratio_most = 0.95f};

bool conversions_pressure(const struct sensor_transfer *transfer, uint16_t raw, float *pressure_pa) {
    const float ratio = (float)raw / (float)RAW_FULL_SCALE;
    const float span = transfer->ratio_at_full - transfer->ratio_at_zero;
    *pressure_pa = (ratio - transfer->ratio_at_zero) / span * transfer->full_pa;
    return ratio >= transfer->ratio_least && ratio <= transfer->ratio_most;
}

float conversions_reference_v(uint16_t raw, uint16_t calibration) {
    if (raw == 0u || calibration == 0u || calibration > RAW_FULL_SCALE / SAMPLES_SUMMED) {
        return 0.0f;
    }
    return REFERENCE_CALIBRATED_V * (float)(calibration * SAMPLES_SUMMED) / (float)raw;
}

void conversions_pressures(const uint16_t raw[RAW_CHANNEL_COUNT], uint16_t calibration,
                           struct hal_pressures *pressures) {
    const float reference_v = conversions_reference_v(raw[RAW_REFERENCE], calibration);
    const bool sound = reference_v >= REFERENCE_LEAST_V && reference_v <= REFERENCE_MOST_V;
    for (uint32_t c = 0; c < 3u; c++) {
        const bool in_range = conversions_pressure(&chamber_sensor, raw[(uint32_t)RAW_CHAMBER_1 + c],
                                                   &pressures->chamber_pa[c]);
        pressures->chamber_ok[c] = sound && in_range;
    }
    const bool in_range = conversions_pressure(&supply_sensor, raw[RAW_SUPPLY], &pressures->supply_pa);
    pressures->supply_ok = sound && in_range;
}

bool conversions_pwm_scale(uint32_t clock_hz, uint32_t period_us, struct pwm_scale *scale) {
    const uint32_t clock_mhz = clock_hz / HZ_PER_MHZ;
    if (clock_mhz * HZ_PER_MHZ != clock_hz || period_us == 0u) {
        return false;
    }
    for (uint32_t counts_per_us = PWM_COUNTS_MOST / period_us; counts_per_us > 0u; counts_per_us--) {
        if (clock_mhz % counts_per_us == 0u) {
            *scale = (struct pwm_scale){.prescaler = clock_mhz / counts_per_us,
                                        .counts = counts_per_us * period_us};
            return scale->prescaler > 0u;
        }
    }
    return false;
}

uint32_t conversions_compare(float duty, uint32_t counts) {
    if (!(duty > 0.0f)) {
        return 0u;
    }
    return (uint32_t)(real_min(duty, 1.0f) * (float)counts + 0.5f);
}

const struct can_timing_limits can_nominal_limits = {
    .prescaler_most = 512u, .segment_1_most = 256u, .segment_2_most = 128u, .jump_most = 128u};
const struct can_timing_limits can_data_limits = {
    .prescaler_most = 32u, .segment_1_most = 32u, .segment_2_most = 16u, .jump_most = 16u};

/* Rounded to the quantum nearest the wanted sample point. */
static bool split_bit(uint32_t quanta, uint32_t sample_permille, const struct can_timing_limits *limits,
                      struct can_timing *timing) {
    const uint32_t before =
        (quanta * sample_permille + 500u) / 1000u; /* of the sample point, sync quantum included */
    if (before < 2u || before >= quanta) {
        return false;
    }
    timing->segment_1 = before - 1u;
    timing->segment_2 = quanta - before;
    timing->jump = timing->segment_2 < limits->jump_most ? timing->segment_2 : limits->jump_most;
    return timing->segment_1 <= limits->segment_1_most && timing->segment_2 <= limits->segment_2_most;
}

bool conversions_can_timing(uint32_t clock_hz, uint32_t rate, uint32_t sample_permille,
                            const struct can_timing_limits *limits, struct can_timing *timing) {
    if (rate == 0u || clock_hz % rate != 0u) {
        return false;
    }
    const uint32_t cycles = clock_hz / rate;
    for (uint32_t prescaler = 1u; prescaler <= limits->prescaler_most; prescaler++) {
        timing->prescaler = prescaler;
        if (cycles % prescaler == 0u && split_bit(cycles / prescaler, sample_permille, limits, timing)) {
            return true;
        }
    }
    return false;
}

#define LENGTH_CODES 16u
#define LENGTHS_AS_THEY_ARE 8u /* up to this one a length is its own code */

static const uint8_t length_of_code[LENGTH_CODES] = {0u, 1u,  2u,  3u,  4u,  5u,  6u,  7u,
                                           8u, 12u, 16u, 20u, 24u, 32u, 48u, 64u};

uint8_t conversions_can_length(uint32_t code) {
    return length_of_code[code & (LENGTH_CODES - 1u)];
}

bool conversions_can_code(uint32_t length, uint32_t *code) {
    uint32_t i = length < LENGTHS_AS_THEY_ARE ? length : LENGTHS_AS_THEY_ARE;
    while (i < LENGTH_CODES && length_of_code[i] != length) {
        i++;
    }
    *code = i < LENGTH_CODES ? i : 0u;
    return i < LENGTH_CODES;
}

uint32_t conversions_baud_divisor(uint32_t clock_hz, uint32_t baud) {
    return (clock_hz + baud / 2u) / baud;
}
