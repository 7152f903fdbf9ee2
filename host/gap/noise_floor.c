#include "gap/noise_floor.h"

#include <math.h>

#include "gap/replay.h"

#define MOVED_SIGMAS 8.0     /* of one reading's noise: by more than that the pressure moved between two rows, */
#define MOVED_LEAST_PA 500.0 /* and by that */

/* Marks tip and pressure blocks that hold a time, and that the time before them. */
static void mark_at(struct replay *replay, size_t index, double time_s, double until_s) {
    const struct replay_run *run = &replay->run[index];
    const double start_s = 1e-6 * (double)run->start_us;
    const double tip_s = fmax(time_s - GAP_TIP_AGE_S - start_s, 0.0), last_s = fmax(until_s - GAP_TIP_AGE_S - start_s, 0.0);
    const size_t first = (size_t)(tip_s / REPLAY_TIP_BLOCK_S), last = (size_t)(last_s / REPLAY_TIP_BLOCK_S);
    for (size_t b = first; b <= last && b < run->tip_blocks; b++) {
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
            replay->apart[run->tip_at + REPLAY_TIP_CHANNELS * b + k] = 1;
        }
    }
    const size_t block = (size_t)(fmax(time_s - start_s, 0.0) / REPLAY_PRESSURE_BLOCK_S);
    for (size_t c = 0; c < 3 && block < run->blocks; c++) {
        replay->apart[run->pressure_at + 3 * block + c] = 1;
    }
}

static bool moves_in(const struct replay_run *run, size_t row) {
    const struct gap_run *data = run->run;
    const double *pressure_pa = data->has_reading ? data->reading_pa : data->command_pa;
    const double noise_pa = data->has_reading ? MOVED_SIGMAS * run->reading_noise_pa : 0.0;
    bool moves = false;
    for (size_t c = 0; c < 3; c++) { /* a NaN moves nothing */
        moves = moves || fabs(pressure_pa[3 * row + c] - pressure_pa[3 * (row - 1) + c]) > fmax(noise_pa, MOVED_LEAST_PA);
    }
    return moves;
}

void noise_floor_mark(struct replay *replay, size_t index) {
    const struct replay_run *run = &replay->run[index];
    const struct gap_run *data = run->run;
    for (size_t i = 0; i < data->breaks; i++) {
        const double time_s = data->time_s[data->break_row[i]];
        mark_at(replay, index, time_s, time_s);
    }
    for (size_t row = 1; row < data->rows && !data->has_duty && (data->has_reading || data->has_command); row++) {
        if (moves_in(run, row)) {
            mark_at(replay, index, data->time_s[row], data->time_s[row] + (data->has_reading ? 0.0 : NOISE_FLOOR_ARRIVES_S));
        }
    }
}
