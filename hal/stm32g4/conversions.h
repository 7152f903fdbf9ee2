/* Between the numbers that peripherals count in and the units of hal.h, and what a peripheral is set to for a
 * wish in units.
 *
 * Pure, without a register: the host builds it too, so that recorded raw readings replay there to the same
 * bits. Not here: which pin a sensor is on, and when it is read (pressure_adc.h). */
#ifndef TRIBEND_STM32G4_CONVERSIONS_H
#define TRIBEND_STM32G4_CONVERSIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

/* --- pressures --- */

/* One sequence of the converter, in this order; each the sum of sixteen 12-bit samples. */
enum raw_channel {
    RAW_CHAMBER_1 = 0,
    RAW_CHAMBER_2,
    RAW_CHAMBER_3,
    RAW_SUPPLY,
    RAW_REFERENCE,
    RAW_CHANNEL_COUNT
};

#define RAW_FULL_SCALE 65520u /* 16 x 4095 */

/* A ratiometric sensor: its output over its supply is linear in the gauge pressure. Outside [least, most] no
 * sensor that works can read: a wire is broken or shorted. */
struct sensor_transfer {
    float ratio_at_zero;
    float ratio_at_full;
    float full_pa;
    float ratio_least;
    float ratio_most;
};
extern const struct sensor_transfer chamber_sensor; /* 0 to 50 kPa over 10 to 90 % */
extern const struct sensor_transfer supply_sensor;  /* 0 to 100 kPa over 10 to 90 % */

/* False: out of range; `pressure_pa` is then what the line would say. */
bool conversions_pressure(const struct sensor_transfer *transfer, uint16_t raw, float *pressure_pa);
/* Voltage of the converter's reference, which supplies the sensors, from the raw reading of the internal
 * reference and the factory's reading of it at 3.0 V (12 bits). 0 where either makes no sense. */
float conversions_reference_v(uint16_t raw, uint16_t calibration);
/* A whole sequence. Without a sound reference (3.0 to 3.6 V) no channel is good. */
void conversions_pressures(const uint16_t raw[RAW_CHANNEL_COUNT], uint16_t calibration,
                           struct hal_pressures *pressures);

/* --- valves --- */

struct pwm_scale {
    uint32_t prescaler; /* the timer's clock is divided by this */
    uint32_t counts;    /* a period, at most 65536 */
};
/* A period of `period_us` in whole counts a microsecond, as many as a 16-bit timer allows. False: the clock
 * is no whole number of MHz. */
bool conversions_pwm_scale(uint32_t clock_hz, uint32_t period_us, struct pwm_scale *scale);
/* Counts that the output is on; a duty outside 0..1 is clamped, NaN is 0. */
uint32_t conversions_compare(float duty, uint32_t counts);

/* --- CAN --- */

struct can_timing_limits {
    uint32_t prescaler_most;
    uint32_t segment_1_most;
    uint32_t segment_2_most;
    uint32_t jump_most;
};
extern const struct can_timing_limits can_nominal_limits; /* of the FDCAN's nominal and data bits */
extern const struct can_timing_limits can_data_limits;

/* In time quanta; a bit is 1 + segment_1 + segment_2. */
struct can_timing {
    uint32_t prescaler;
    uint32_t segment_1;
    uint32_t segment_2;
    uint32_t jump;
};
/* Exactly `rate` from `clock_hz`, with the smallest prescaler and the sample point nearest `sample_permille`.
 * False: the clock has no such divisor. */
bool conversions_can_timing(uint32_t clock_hz, uint32_t rate, uint32_t sample_permille,
                            const struct can_timing_limits *limits, struct can_timing *timing);
/* Length codes of ISO 11898-1, 0..15. */
uint8_t conversions_can_length(uint32_t code);
/* False: no code stands for just `length` bytes. */
bool conversions_can_code(uint32_t length, uint32_t *code);

/* --- serial --- */

/* Divisor of a UART that samples sixteen times a bit, rounded. */
uint32_t conversions_baud_divisor(uint32_t clock_hz, uint32_t baud);

#endif
