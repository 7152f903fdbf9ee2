/* The simulated board of the campaign: app, plant and watchdog, one control step at a time, and what can be broken that
 * is not in the simulated HAL: steps that are left out, a clock that stands, memory that changes, commands that stop. */
#ifndef TRIBEND_CAMPAIGN_BENCH_H
#define TRIBEND_CAMPAIGN_BENCH_H

#include "app.h"
#include "campaign/oracle.h"
#include "sim/sim_hal.h"

#define BENCH_RESET_US 50000 /* a board is back after a reset */

struct bench {
    struct sim sim;
    struct app app;
    struct hal hal;    /* the simulated one, */
    struct hal tapped; /* and as the app sees it */
    const struct bend_table *table; /* the controller's, in `image` */
    uint8_t *image;
    struct controller_parameters parameters;
    struct random_stream random;
    bool commands_stop;
    bool clock_stands;
    int64_t clock_us;
    uint32_t steps_left_out; /* from now on */
    uint32_t leave_out_every; /* 0: none */
    uint32_t steps;
    int64_t reset_us;        /* when the board went into reset */
    size_t flipped_byte;     /* of the image; its length: none */
    uint8_t flipped_bits;
};

/* `plant_table` and `table` hold the same numbers in two places; `image` is the writable one of `table`. All are kept by
 * pointer. */
void bench_init(struct bench *bench, const struct bend_table *plant_table, const struct bend_table *table, uint8_t *image,
                const struct plant_parameters *plant, uint64_t seed);
/* Undo what the mission did to the image. */
void bench_finish(struct bench *bench);
/* One control step of board and plant. `command` NULL: none came. */
void bench_step(struct bench *bench, const struct controller_command *command);
void bench_sample(const struct bench *bench, struct oracle_sample *sample);
bool bench_is_safe(const struct bench *bench);
/* Put the board into reset now. */
void bench_reset(struct bench *bench);
void bench_flip_table(struct bench *bench);
void bench_flip_parameters(struct bench *bench);

#endif
