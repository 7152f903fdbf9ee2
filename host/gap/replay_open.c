#include "gap/replay_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/noise_floor.h"

#define PRESSURE_BLOCK_US ((int64_t)(REPLAY_PRESSURE_BLOCK_S * 1e6 + 0.5))
#define HELD_OUT_S 2.5   /* lengths of the blocks that are kept from the fit, every other one */
#define VENTED_PA 1500.0 /* no more than that at the start: vented */

/* --- blocks --- */

size_t replay_block_of_step(const struct replay *replay, size_t step) {
    return step / (size_t)(PRESSURE_BLOCK_US / replay->step_us);
}

double replay_block_position(const struct replay *replay, double step) {
    return step * (double)replay->step_us / (double)PRESSURE_BLOCK_US - 0.5;
}

size_t replay_tip_block(const struct replay_run *run, size_t tip) {
    const double since_s = run->run->tip[tip].time_s - 1e-6 * (double)run->start_us;
    return since_s > 0.0 ? (size_t)(since_s / REPLAY_TIP_BLOCK_S) : 0;
}

static bool held_out_at(size_t run, double since_s) {
    return ((size_t)(since_s / HELD_OUT_S) + run) % 2 == 1;
}

static void pick_tips(struct replay_run *run) {
    run->picks = 0;
    for (size_t i = 0; i < run->run->tips;) {
        const size_t first = i, block = replay_tip_block(run, i);
        while (i < run->run->tips && replay_tip_block(run, i) == block) {
            i++;
        }
        run->pick[run->picks++] = (uint32_t)((first + i - 1) / 2);
    }
}

static bool lay_out(struct replay *replay, size_t index) {
    struct replay_run *run = &replay->run[index];
    const struct gap_run *data = run->run;
    const int64_t period_us = replay->nominal.valve.period_us;
    const int64_t first_us = llround(1e6 * data->time_s[0]),
                  last_us = llround(1e6 * data->time_s[data->rows - 1]);
    const int64_t step_us = replay->step_us;
    run->start_us = first_us / period_us * period_us;
    run->blocks = (size_t)((last_us - run->start_us) / PRESSURE_BLOCK_US) + 2;
    run->steps = (run->blocks - 1) * (size_t)(PRESSURE_BLOCK_US / step_us);
    run->tip_blocks = data->tips > 0 ? replay_tip_block(run, data->tips - 1) + 1 : 0;
    run->row_step = malloc(data->rows * sizeof *run->row_step);
    run->variance = malloc(3 * run->blocks * sizeof *run->variance);
    run->pick = malloc((run->tip_blocks + 1) * sizeof *run->pick);
    if (run->row_step == NULL || run->variance == NULL || run->pick == NULL) {
        return false;
    }
    for (size_t row = 0; row < data->rows; row++) {
        const int64_t since_us = llround(1e6 * data->time_s[row]) - run->start_us;
        run->row_step[row] = (uint32_t)((since_us + step_us - 1) / step_us);
    }
    pick_tips(run);
    run->pressure_at = replay->residuals;
    run->supply_at = run->pressure_at + 3 * run->blocks;
    run->tip_at = run->supply_at + run->blocks;
    replay->residuals = run->tip_at + REPLAY_TIP_CHANNELS * run->tip_blocks;
    return true;
}

/* Mean of the first tenth of a second; what is near zero counts as vented. */
static void find_start(struct replay_run *run) {
    const struct gap_run *data = run->run;
    for (size_t c = 0; c < 3; c++) {
        double sum = 0.0;
        size_t count = 0;
        for (size_t row = 0; row < data->rows && data->time_s[row] < data->time_s[0] + 0.1; row++) {
            if (!isnan(data->reading_pa[3 * row + c])) {
                sum += data->reading_pa[3 * row + c];
                count++;
            }
        }
        const double mean_pa = count > 0 ? sum / (double)count : 0.0;
        run->initial_pa[c] = mean_pa > VENTED_PA ? mean_pa : 0.0;
    }
}

static void mark_held_out(struct replay *replay, size_t index) {
    const struct replay_run *run = &replay->run[index];
    const double block_s = REPLAY_PRESSURE_BLOCK_S;
    for (size_t b = 0; b < run->blocks; b++) {
        const uint8_t out = held_out_at(index, (double)b * block_s);
        for (size_t c = 0; c < 3; c++) {
            replay->held_out[run->pressure_at + 3 * b + c] = out;
        }
        replay->held_out[run->supply_at + b] = out;
    }
    for (size_t b = 0; b < run->tip_blocks; b++) {
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
            replay->held_out[run->tip_at + REPLAY_TIP_CHANNELS * b + k] =
                held_out_at(index, (double)b * REPLAY_TIP_BLOCK_S);
        }
    }
}

/* --- opening --- */

static bool open_with_step(struct replay *replay, const struct gap_data *data, const struct bend_table *table,
                           const struct plant_parameters *nominal, int64_t step_us) {
    memset(replay, 0, sizeof *replay);
    replay->data = data;
    replay->table = table;
    replay->nominal = *nominal;
    replay->step_us = step_us;
    replay->elsewhere.stiffness_scale = 1.0;
    for (size_t i = 0; i < data->runs; i++) {
        replay->run[i].run = &data->run[i];
        replay->runs++;
        if (!lay_out(replay, i) || !replay_find_noise(&replay->run[i])) {
            replay_close(replay);
            return false;
        }
        find_start(&replay->run[i]);
        replay_find_variance(replay, &replay->run[i]);
    }
    replay->weight = calloc(replay->residuals, sizeof *replay->weight);
    replay->held_out = calloc(replay->residuals, sizeof *replay->held_out);
    replay->apart = calloc(replay->residuals, sizeof *replay->apart);
    replay->lasting = calloc(replay->residuals, sizeof *replay->lasting);
    if (replay->weight == NULL || replay->held_out == NULL || replay->apart == NULL ||
        replay->lasting == NULL) {
        replay_close(replay);
        return false;
    }
    for (size_t i = 0; i < data->runs; i++) {
        mark_held_out(replay, i);
        noise_floor_mark(replay, i);
    }
    return true;
}

bool replay_open(struct replay *replay, const struct gap_data *data, const struct bend_table *table,
                 const struct plant_parameters *nominal) {
    return open_with_step(replay, data, table, nominal, REPLAY_STEP_US);
}

bool replay_open_coarse(struct replay *coarse, const struct replay *fine) {
    const bool divides = fine->nominal.valve.period_us % REPLAY_COARSE_STEP_US == 0;
    if (!open_with_step(coarse, fine->data, fine->table, &fine->nominal,
                        divides ? REPLAY_COARSE_STEP_US : REPLAY_STEP_US)) {
        return false;
    }
    coarse->coarse = true;
    replay_follow(coarse, fine);
    return true;
}

void replay_follow(struct replay *coarse, const struct replay *fine) {
    coarse->rigid = fine->rigid;
    coarse->elsewhere = fine->elsewhere;
    memcpy(coarse->noise_most, fine->noise_most, sizeof fine->noise_most);
    memcpy(coarse->weight, fine->weight, fine->residuals * sizeof *fine->weight);
    memcpy(coarse->lasting, fine->lasting, fine->residuals * sizeof *fine->lasting);
    for (size_t i = 0; i < fine->runs; i++) {
        memcpy(coarse->run[i].smoother, fine->run[i].smoother, sizeof fine->run[i].smoother);
        coarse->run[i].duty_from_next_period = fine->run[i].duty_from_next_period;
    }
}

void replay_close(struct replay *replay) {
    for (size_t i = 0; i < replay->runs; i++) {
        free(replay->run[i].row_step);
        free(replay->run[i].variance);
        free(replay->run[i].pick);
    }
    free(replay->weight);
    free(replay->held_out);
    free(replay->apart);
    free(replay->lasting);
    memset(replay, 0, sizeof *replay);
}

bool replay_state_open(struct replay_state *state, const struct replay *replay) {
    bool sound = true;
    memset(state, 0, sizeof *state);
    double ***const parts[4] = {&state->pressure_pa, &state->difference, &state->supply, &state->correction};
    for (size_t p = 0; p < 4; p++) {
        *parts[p] = calloc(replay->runs, sizeof **parts[p]);
        for (size_t i = 0; i < replay->runs && *parts[p] != NULL; i++) {
            const struct replay_run *run = &replay->run[i];
            (*parts[p])[i] = calloc(p == 0 ? 3 * (run->steps + 1) : 3 * run->blocks, sizeof(double));
            sound = sound && (*parts[p])[i] != NULL;
        }
        sound = sound && *parts[p] != NULL;
    }
    return sound;
}

void replay_state_close(struct replay_state *state, const struct replay *replay) {
    double **const parts[4] = {state->pressure_pa, state->difference, state->supply, state->correction};
    for (size_t p = 0; p < 4; p++) {
        for (size_t i = 0; i < replay->runs && parts[p] != NULL; i++) {
            free(parts[p][i]);
        }
        free(parts[p]);
    }
    memset(state, 0, sizeof *state);
}
