/* What hangs on the board's pins, as hal/stm32g4/WIRING.md has it: the plant of hal/sim with its valves on
 * TIM1's outputs and the shut-off valve on PB5, pressure sensors on the converter's pins, the tip sensor on
 * USART3. Ratiometric sensors of 10 to 90 % of the reference: chambers 0 to 50 kPa, supply 0 to 100 kPa. */
#ifndef TRIBEND_EMULATOR_WIRING_H
#define TRIBEND_EMULATOR_WIRING_H

#include "emulator/adc.h"
#include "emulator/gpio.h"
#include "emulator/timer.h"
#include "emulator/usart.h"
#include "sim/plant.h"
#include "sim/sensors.h"

#define WIRING_RECORD_BYTES 64u

/* Faults that a test or a drill injects, by the names that the simulated HAL has; those of valves and gas are
 * in the plant. */
struct wiring_faults {
    bool pressure_bus_fails;  /* the converter never finishes */
    bool channel_fails[3];    /* the sensor's wire is broken */
    bool reading_replaced[3]; /* a sensor shows this pressure instead */
    float reading_pa[3];
    bool reading_stands[3];       /* a sensor goes on showing its last value */
    double reading_drift_paps[3]; /* a sensor drifts away from now on */
    double reading_gain[3];       /* it shows so much more of the pressure: 0 is sound, -1 shows nothing */
    double noise_added_pa[3];     /* rms of noise on top of the sensor's own */
    bool readings_exchanged;      /* the wires of sensors 1 and 2 */
    bool supply_unknown;          /* the supply sensor's wire is broken */
    bool tip_stops;               /* no more bytes from the tip sensor */
    bool tip_stands;              /* samples arrive, all with the same pose */
    bool tip_scatters;            /* samples with poses from nowhere */
    uint16_t tip_status;          /* bits that the tip sensor sets */
    double tip_away_m;            /* it shows positions so far off */
    bool outputs_fail;            /* a break of TIM1 that does not go away */
};

/* What the tip sensor sends of a sample; returns the number of bytes. */
typedef size_t (*wiring_encode)(const struct hal_tip_sample *sample, uint8_t bytes[WIRING_RECORD_BYTES]);
/* Changes the bytes on their way; returns how many there then are. */
typedef size_t (*wiring_tamper)(void *context, uint8_t bytes[WIRING_RECORD_BYTES], size_t count);

struct wiring_parameters {
    struct plant_parameters plant;
    struct sensor_parameters sensor;
    double converter_noise; /* rms of a single conversion, in steps of the converter */
};

struct wiring {
    struct core *core;
    struct gpio *gpio; /* [GPIO_PORTS] */
    struct timer *valves;
    struct usart *tip_line;
    const double *supply_v; /* of the electronics */
    struct wiring_parameters parameters;
    struct wiring_faults faults;
    struct plant plant;
    int64_t plant_us;
    struct random_stream pressure_random[4], converter_random, tip_random, chance_random;
    double shown_pa[4]; /* by each sensor, in the sequence under way */
    double drifted_pa[3];
    struct hal_tip_sample tip_shown; /* the last one */
    struct random_stream fault_random;
    wiring_encode encode;
    wiring_tamper tamper;
    void *tamper_context;
    bool coils_driven, supply_open;
    int64_t line_free_ticks; /* of the tip sensor's transmitter */
    size_t tip_slot, step_slot;
    uint32_t tip_samples;
    uint32_t tip_dropped;                 /* by the sensor, whose line was busy */
    int64_t supply_shut_us, coils_off_us; /* when it last happened; -1: never */
};

/* The design page's plant and sensors. */
void wiring_default_parameters(struct wiring_parameters *parameters);
/* `table` is kept by pointer. Everything that the pointers in `wiring` name is set by the caller before. */
void wiring_init(struct wiring *wiring, const struct bend_table *table,
                 const struct wiring_parameters *parameters, uint64_t seed);
/* Let the plant follow up to the present. */
void wiring_follow(struct wiring *wiring);
/* For the converter: what the pin of a channel carries, as a share of the reference. */
double wiring_sample(void *wiring, uint32_t channel);
/* Bytes on the tip sensor's line, one after the other from now. */
void wiring_send_bytes(struct wiring *wiring, const uint8_t *bytes, size_t count);
/* A valve of the plant lets air in. */
bool wiring_fills(const struct wiring *wiring);

#endif
