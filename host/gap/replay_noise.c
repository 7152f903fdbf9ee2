#include "gap/replay_parts.h"

#include <math.h>
#include <stdlib.h>

#include "gap/replay_elsewhere.h"

/* Least noise of one sample that is believed. */
#define READING_LEAST_PA 20.0
#define POSITION_LEAST_M 2e-5
#define ANGLE_LEAST_RAD (0.008 * M_PI / 180.0)
#define MAD_TO_SIGMA 1.4826
#define UNCLIPPED 8        /* readings in a row without a zero: the chamber is under pressure */
#define UNCLIPPED_LEAST 50 /* so many of them that their noise is known */

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, size_t count) {
    if (count == 0) {
        return 0.0;
    }
    qsort(values, count, sizeof *values, compare);
    return values[count / 2];
}

/* From the second differences of readings that are not clipped; a ramp drops out. Only those count that
 * follow on at least `unclipped` others without a zero in between. NAN: there are none. */
static double noise_of(const double *value, size_t stride, size_t count, size_t unclipped, double least,
                       double *room) {
    size_t used = 0, in_a_row = 0;
    double before[2] = {NAN, NAN};
    for (size_t i = 0; i < count; i++) {
        const double now = value[i * stride];
        in_a_row = now == 0.0 ? 0 : in_a_row + (isnan(now) ? 0u : 1u);
        if (isnan(now) || now == 0.0) {
            continue;
        }
        if (!isnan(before[1]) && (unclipped == 0 || in_a_row > unclipped)) {
            room[used++] = fabs(now - 2.0 * before[0] + before[1]);
        }
        before[1] = before[0];
        before[0] = now;
    }
    return used < UNCLIPPED_LEAST && unclipped > 0
               ? NAN
               : fmax(MAD_TO_SIGMA * median(room, used) / sqrt(6.0), least);
}

/* Of the middle one of the chambers that are under pressure for long enough; of all where none is. A vented
 * chamber's reading is clipped half of the time, and what is left of its noise looks too small. */
static double reading_noise(const struct gap_run *data, double *room) {
    double chamber[3];
    size_t known = 0;
    for (size_t c = 0; c < 3; c++) {
        const double noise_pa =
            noise_of(data->reading_pa + c, 3, data->rows, UNCLIPPED, READING_LEAST_PA, room);
        if (!isnan(noise_pa)) {
            chamber[known++] = noise_pa;
        }
    }
    for (size_t c = 0; c < 3 && known == 0; c++) {
        chamber[c] = noise_of(data->reading_pa + c, 3, data->rows, 0, READING_LEAST_PA, room);
    }
    return median(chamber, known > 0 ? known : 3);
}

bool replay_find_noise(struct replay_run *run) {
    const struct gap_run *data = run->run;
    const size_t most = data->rows > data->tips ? data->rows : data->tips;
    double *room = malloc((most + 1) * sizeof *room), *values = malloc((most + 1) * sizeof *values);
    if (room == NULL || values == NULL) {
        free(room);
        free(values);
        return false;
    }
    run->reading_noise_pa = reading_noise(data, room);
    run->supply_noise_pa = noise_of(data->supply_pa, 1, data->rows, 0, READING_LEAST_PA, room);
    for (size_t kind = 0; kind < 2; kind++) {
        const double least = kind == 0 ? POSITION_LEAST_M : ANGLE_LEAST_RAD;
        double sum = 0.0;
        for (size_t k = 0; k < 3; k++) {
            for (size_t i = 0; i < data->tips; i++) {
                values[i] = kind == 0 ? data->tip[i].position_m[k] : 2.0 * data->tip[i].quaternion[1 + k];
                values[i] -= data->sim_tip == NULL ? 0.0 : replay_elsewhere_noise_part(data, i, kind, k);
            }
            sum += pow(noise_of(values, 1, data->tips, 0, least, room), 2.0) / 3.0;
        }
        run->tip_noise[kind] = sqrt(sum);
    }
    free(room);
    free(values);
    return true;
}

void replay_find_variance(const struct replay *replay, struct replay_run *run) {
    const struct gap_run *data = run->run;
    const double one = run->reading_noise_pa * run->reading_noise_pa;
    for (size_t i = 0; i < 3 * run->blocks; i++) {
        run->variance[i] = 0.0; /* counts first */
    }
    for (size_t row = 0; row < data->rows; row++) {
        for (size_t c = 0; c < 3; c++) {
            run->variance[3 * replay_block_of_step(replay, run->row_step[row]) + c] +=
                !isnan(data->reading_pa[3 * row + c]);
        }
    }
    for (size_t i = 0; i < data->breaks; i++) {
        const size_t row = data->break_row[i], block = replay_block_of_step(replay, run->row_step[row]);
        for (size_t c = 0; c < 3 && replay_block_of_step(replay, run->row_step[row - 1]) == block; c++) {
            run->variance[3 * block + c] = 0.0; /* readings from both sides: their mean is neither's */
        }
    }
    for (size_t i = 0; i < 3 * run->blocks; i++) {
        const double count = run->variance[i];
        run->variance[i] = count > 0.0 ? one / count + READING_FLOOR_PA * READING_FLOOR_PA : INFINITY;
    }
}
