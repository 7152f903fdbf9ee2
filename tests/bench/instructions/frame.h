/* What host and emulated core hand each other: the readings and the command of one control step, and what came of it.
 *
 * Fixed-width members only, so that both compilers lay it out alike. Read by the host's programs and by image.c. Units
 * as in hal.h and controller.h. */
#ifndef TRIBEND_FRAME_H
#define TRIBEND_FRAME_H

#include <stdint.h>

#define FRAME_FLASH_ADDRESS 0x08000000u
#define FRAME_FLASH_BYTES 0x00040000u
#define FRAME_TABLE_ADDRESS 0x08100000u
#define FRAME_TABLE_BYTES 0x00100000u
#define FRAME_RAM_ADDRESS 0x20000000u
#define FRAME_RAM_BYTES 0x00020000u
#define FRAME_TIP_SAMPLES 4u

/* How the controller of a mission is set up. */
enum frame_variant {
    FRAME_NOMINAL = 0,
    FRAME_CALIBRATED, /* every number of a calibration in use: late valves, lag, leaks, frames, creep */
    FRAME_VARIANT_COUNT
};

struct frame_tip {
    int64_t measured_us;
    float position_m[3];
    float quaternion[4];
    uint32_t quality;
    uint32_t status;
    uint32_t none; /* to a multiple of eight bytes */
};

struct frame_command {
    uint32_t kind; /* enum controller_command_kind */
    float pressure_pa[3];
    float bend_rad;
    float direction_rad;
    float co_contraction_pa;
    uint32_t none;
};

struct frame_input {
    int64_t time_us;
    float chamber_pa[3];
    float supply_pa;
    uint32_t chamber_ok[3];
    uint32_t supply_ok;
    uint32_t pressures_read;
    uint32_t tip_count;
    struct frame_tip tip[FRAME_TIP_SAMPLES];
    struct frame_command command;
};

struct frame_output {
    float duty[3];
    uint32_t valves_enabled;
    uint32_t supply_enabled;
    uint32_t state;
    uint32_t faults;
    uint32_t warnings;
    float target_pa[3];
    float estimate_pa[3];
    float bend_rad;
    float direction_rad;
    float inverse_residual_rad;
    uint32_t inverse_flags;
};

/* One inversion on its own: a bend vector, what the preview says after each step, and the answer. */
struct frame_inversion {
    float bend_rad[2];
    float co_contraction_pa;
    uint32_t previews;
    float preview_pa[3];
    uint32_t done;
    float pressure_pa[3];
    float reached_rad;
    float residual_rad;
    uint32_t flags;
};

struct frame {
    struct frame_input input;
    struct frame_output output;
    struct frame_inversion inversion;
    uint32_t table_bytes; /* for image_open(); at FRAME_TABLE_ADDRESS */
    uint32_t variant;
    uint32_t status; /* of image_open(): enum bend_table_status */
    uint32_t none;
};

#endif
