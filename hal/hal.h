/* The seam between the firmware and the world: what a board (or a simulated one) gives the firmware.
 *
 * Three small tables of functions, each with the context they get: struct hal (sensors, valves, time), struct
 * hal_bus (CAN), struct hal_storage (flash). All calls return at once; none blocks. The firmware calls them
 * only from its control step. Units: Pa gauge, us, m, unit quaternion (w, x, y, z), duty 0..1. */
#ifndef TRIBEND_HAL_H
#define TRIBEND_HAL_H

#include <stdbool.h>
#include <stdint.h>

struct hal_pressures {
    float chamber_pa[3];
    float supply_pa;    /* meaningful only with supply_ok */
    bool chamber_ok[3]; /* false: the converter could not read this channel */
    bool supply_ok;
};

/* trakSTAR-style pose of the tip face's centre in the base frame. */
struct hal_tip_sample {
    int64_t measured_us; /* when the pose was true, on the clock of time_us */
    float position_m[3];
    float quaternion[4];
    uint16_t quality;
    uint16_t status; /* the sensor's bits; 0 = good */
};

struct hal_outputs {
    float duty[3];       /* 0 = vent, 1 = fill; taken over at the start of the next PWM period */
    bool valves_enabled; /* false: all coils off at once, inside the running period too */
    bool supply_enabled; /* false: the normally closed shut-off valve drops at once */
};

/* What a board knows of itself. */
struct hal_health {
    bool clock_failed;    /* runs on the internal oscillator because the crystal failed */
    bool watchdog_reset;  /* why it started: the watchdog bit, */
    bool brown_out_reset; /* the supply of the electronics dipped, */
    bool crashed;         /* or a fault handler wrote a crash record */
    bool brown_out_low;   /* the electronics' brown-out reset is set lower than the board wants it */
    uint32_t steps_late;  /* control steps that began after the next one was due, since start */
};

struct hal {
    void *context;
    /* Monotonic, from 0 at start. PWM periods start at its multiples of the PWM period. */
    int64_t (*time_us)(void *context);
    /* Latest reading of each sensor; false: no reading at all this step. */
    bool (*read_pressures)(void *context, struct hal_pressures *pressures);
    /* The next tip sample that arrived since the last call; false: none. Bounded by the caller to a few a
     * step. */
    bool (*read_tip)(void *context, struct hal_tip_sample *sample);
    /* False: an output could not be set. A board feeds its watchdog here, and only when all were set: what
     * cannot be set ends in a reset, which vents. */
    bool (*write_outputs)(void *context, const struct hal_outputs *outputs);
    /* NULL: a board that has nothing to say of itself. */
    void (*read_health)(void *context, struct hal_health *health);
};

#define HAL_CAN_DATA_BYTES 64u

struct hal_can_frame {
    uint32_t id;
    bool extended; /* 29-bit id */
    bool fd;       /* CAN FD frame; length may then be over 8 */
    uint8_t length;
    uint8_t data[HAL_CAN_DATA_BYTES];
};

struct hal_can_state {
    uint8_t transmit_errors; /* the controller's error counters */
    uint8_t receive_errors;
    bool error_passive;
    bool bus_off;
    uint32_t bus_off_count; /* since start */
    uint32_t receive_lost;  /* frames for which there was no room */
    uint32_t transmit_lost;
};

/* A CAN controller, classic and FD. It recovers from bus-off by itself and counts that. */
struct hal_bus {
    void *context;
    bool fd; /* it carries frames of up to 64 bytes, as it was brought up; else classic ones alone */
    /* The next frame that arrived; false: none. Frames for other nodes may be among them. */
    bool (*receive)(void *context, struct hal_can_frame *frame);
    /* False: no room to send (counted in transmit_lost), or a frame that the bus cannot carry. */
    bool (*send)(void *context, const struct hal_can_frame *frame);
    void (*state)(void *context, struct hal_can_state *state);
};

enum hal_storage_area {
    HAL_STORAGE_PARAMETERS_A = 0,
    HAL_STORAGE_PARAMETERS_B,
    HAL_STORAGE_TABLE_A,
    HAL_STORAGE_TABLE_B,
    HAL_STORAGE_AREA_COUNT
};

enum hal_storage_status { HAL_STORAGE_IDLE = 0, HAL_STORAGE_BUSY, HAL_STORAGE_FAILED };

#define HAL_STORAGE_WORD_BYTES 8u

/* Flash: erased bytes read 0xff; words of 8 bytes are programmed once between erasures. An erasure or a write
 * that is started goes on in the background; power may fail within it, and the word or page then holds
 * anything. */
struct hal_storage {
    void *context;
    /* The area's bytes, readable at any time no operation is going on in it. */
    const uint8_t *(*map)(void *context, enum hal_storage_area area, uint32_t *bytes);
    /* Start to erase the page that holds `offset`; `page_bytes` says how much that is. False: busy or out of
     * range. */
    bool (*erase_page)(void *context, enum hal_storage_area area, uint32_t offset);
    /* Start to write one word at `offset`, a multiple of 8. False: busy or out of range. */
    bool (*program)(void *context, enum hal_storage_area area, uint32_t offset,
                    const uint8_t word[HAL_STORAGE_WORD_BYTES]);
    /* Of the operation that was started last. */
    enum hal_storage_status (*status)(void *context);
    uint32_t page_bytes;
};

#endif
