#include "gap/replay_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/replay_elsewhere.h"

void replay_set_up_plant(const struct replay *replay, const struct gap_model *model, struct plant *plant) {
    struct plant_parameters parameters = replay->nominal;
    parameters.gas.stiffness_scale *= model->stiffness_scale;
    parameters.supply_pa *= model->supply_scale;
    plant_init(plant, replay->table, &parameters);
    for (size_t e = 0; e < model->count; e++) {
        (void)plant_add_effect(plant, &model->effect[e]); /* a model has fewer than a plant has room for */
    }
}

/* --- readings beside the simulation --- */

/* Mean of a reading that is clipped at zero: E max(0, x + noise). */
static double shown(double pressure_pa, double noise_pa) {
    const double z = pressure_pa / noise_pa;
    if (z > 4.0) {
        return pressure_pa;
    }
    return pressure_pa * 0.5 * erfc(-z * M_SQRT1_2) + noise_pa * exp(-0.5 * z * z) / sqrt(2.0 * M_PI);
}

/* Walks over the rows beside the simulation. */
struct row_walk {
    const struct replay *replay;
    const struct replay_run *run;
    size_t row;     /* next to be met */
    double *sum;    /* [3 * blocks] */
    double *supply; /* [blocks] */
    double *count;  /* [blocks] of supply readings */
};

/* Rows within the step that ends at `step`, between the readings before and after it. */
static void meet_rows(struct row_walk *walk, size_t step, const double before_pa[3], const double after_pa[3],
                      double supply_pa) {
    const struct replay_run *run = walk->run;
    const struct gap_run *data = run->run;
    const int64_t step_us = walk->replay->step_us;
    for (; walk->row < data->rows && run->row_step[walk->row] <= step; walk->row++) {
        const size_t row = walk->row, block = replay_block_of_step(walk->replay, step);
        const double end_s = 1e-6 * (double)(run->start_us + (int64_t)step * step_us);
        const double left = (end_s - data->time_s[row]) / (1e-6 * (double)step_us);
        for (size_t c = 0; c < 3; c++) {
            const double reading_pa = data->reading_pa[3 * row + c];
            if (!isnan(reading_pa)) {
                const double simulated_pa = after_pa[c] + left * (before_pa[c] - after_pa[c]);
                walk->sum[3 * block + c] += reading_pa - shown(simulated_pa, run->reading_noise_pa);
            }
        }
        if (!isnan(data->supply_pa[row])) {
            walk->supply[block] += data->supply_pa[row] - supply_pa;
            walk->count[block] += 1.0;
        }
    }
}

/* Sums to means. */
static void finish_rows(const struct row_walk *walk) {
    const struct replay_run *run = walk->run;
    const double one = run->reading_noise_pa * run->reading_noise_pa;
    for (size_t i = 0; i < 3 * run->blocks; i++) {
        const double mean_of = run->variance[i] - READING_FLOOR_PA * READING_FLOOR_PA;
        walk->sum[i] = isfinite(mean_of) ? walk->sum[i] * mean_of / one : 0.0;
    }
    for (size_t b = 0; b < run->blocks; b++) {
        walk->supply[b] = walk->count[b] > 0.0 ? walk->supply[b] / walk->count[b] : 0.0;
    }
}

/* Sensors beside pressures that are known at the end of each step: sums of differences into the walk. */
static void show_run(const struct replay *replay, const struct gap_model *model, size_t index,
                     struct plant *plant, const double *pressure_pa, struct row_walk *walk) {
    const struct replay_run *run = &replay->run[index];
    double reading_pa[3], before_pa[3];
    replay_set_up_plant(replay, model, plant);
    memset(walk->sum, 0, 3 * run->blocks * sizeof(double));
    walk->row = 0;
    memcpy(before_pa, pressure_pa, sizeof before_pa);
    for (size_t step = 0; step <= run->steps; step++) {
        const double now_s = 1e-6 * (double)(run->start_us + (int64_t)step * replay->step_us);
        struct effect_signals signals = {.time_s = now_s,
                                         .step_s = 1e-6 * (double)replay->step_us,
                                         .temperature_k = NAN,
                                         .table = replay->table,
                                         .stiffness_scale = model->stiffness_scale,
                                         .pressure_pa = pressure_pa + 3 * step,
                                         .reading_pa = reading_pa};
        memcpy(reading_pa, pressure_pa + 3 * step, sizeof reading_pa);
        if (step > 0) {
            effects_run(plant->effect, plant->effect_count, EFFECT_HOOK_READING, &signals);
        }
        meet_rows(walk, step, step > 0 ? before_pa : reading_pa, reading_pa, replay->nominal.supply_pa);
        memcpy(before_pa, reading_pa, sizeof before_pa);
    }
    finish_rows(walk);
}

void replay_readings(const struct replay *replay, const struct gap_model *model, struct replay_state *state) {
    struct plant plant;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        double *room = calloc(2 * run->blocks, sizeof *room);
        struct row_walk walk = {.replay = replay, .run = run, .sum = state->difference[i], .supply = room};
        if (room != NULL) {
            walk.count = room + run->blocks;
            show_run(replay, model, i, &plant, state->pressure_pa[i], &walk);
        }
        free(room);
    }
    replay_correct(replay, state);
}

/* --- from duties --- */

static void duty_at(const struct replay_run *run, size_t *row, int64_t time_us, double duty[3]) {
    const struct gap_run *data = run->run;
    const double limit_s = 1e-6 * (double)time_us + (run->duty_from_next_period ? -5e-7 : 5e-7);
    while (*row + 1 < data->rows && data->time_s[*row + 1] < limit_s) {
        (*row)++;
    }
    const bool any = data->time_s[*row] < limit_s;
    for (size_t c = 0; c < 3; c++) {
        duty[c] = any ? data->duty[3 * *row + c] : 0.0;
    }
}

/* Coils that the controller switches off within the step. */
static void cut_valves(const struct replay_run *run, struct plant *plant, size_t *row, int64_t until_us) {
    for (; *row < run->run->rows && llround(1e6 * run->run->time_s[*row]) < until_us; (*row)++) {
        for (size_t c = 0; c < 3 && run->run->cut[*row]; c++) {
            valve_cut(&plant->valve[c], &plant->parameters.valve, llround(1e6 * run->run->time_s[*row]));
        }
    }
}

double replay_temperature_at(const struct gap_run *data, size_t row) {
    return data->has_temperature && row < data->rows ? data->temperature_k[row] : NAN;
}

static void simulate_run(const struct replay *replay, const struct gap_model *model, size_t index,
                         struct plant *plant, struct row_walk *walk, double *pressure_pa) {
    const struct replay_run *run = &replay->run[index];
    const int64_t period_us = replay->nominal.valve.period_us;
    size_t duty_row = 0, cut_row = 0;
    double before_pa[3];
    replay_set_up_plant(replay, model, plant);
    chambers_set_pressure(&plant->chambers, &plant->parameters.gas, replay->table, run->initial_pa);
    memcpy(pressure_pa, run->initial_pa, sizeof run->initial_pa);
    memcpy(before_pa, run->initial_pa, sizeof before_pa);
    meet_rows(walk, 0, before_pa, before_pa, plant->influence.supply_pa);
    for (size_t step = 1; step <= run->steps; step++) {
        const int64_t from_us = run->start_us + (int64_t)(step - 1) * replay->step_us;
        if (from_us % period_us == 0) {
            double duty[3];
            duty_at(run, &duty_row, from_us, duty);
            plant->temperature_k = replay_temperature_at(run->run, walk->row);
            plant_start_period(plant, from_us, duty);
        }
        cut_valves(run, plant, &cut_row, from_us + replay->step_us);
        plant_step(plant, true, from_us, from_us + replay->step_us);
        memcpy(pressure_pa + 3 * step, plant->pressure_pa, sizeof plant->pressure_pa);
        meet_rows(walk, step, before_pa, plant->reading_pa, plant->influence.supply_pa);
        memcpy(before_pa, plant->reading_pa, sizeof before_pa);
    }
}

/* --- from readings --- */

/* The tip of the row in which a stretch starts is older than the row: its pressures count from a little
 * before it. */
static size_t first_step(const struct replay *replay, const struct replay_run *run, size_t index) {
    if (index == 0) {
        return 0;
    }
    const size_t row = run->run->break_row[index - 1];
    const size_t age = (size_t)(GAP_TIP_AGE_S * 1e6 / (double)replay->step_us) + 2;
    const size_t at = run->row_step[row], before = run->row_step[row - 1];
    return at - before > 2 * age ? at - age : before + (at - before + 1) / 2;
}

struct replay_stretch replay_stretch_at(const struct replay *replay, const struct replay_run *run,
                                        size_t index) {
    const size_t breaks = run->run->breaks;
    struct replay_stretch stretch = {.step = first_step(replay, run, index),
                                     .end_step = index < breaks ? first_step(replay, run, index + 1)
                                                                : run->steps + 1};
    stretch.block =
        index > 0 ? replay_block_of_step(replay, run->row_step[run->run->break_row[index - 1]]) : 0;
    const size_t end = index < breaks
                           ? replay_block_of_step(replay, run->row_step[run->run->break_row[index]])
                           : run->blocks;
    stretch.blocks = end > stretch.block ? end - stretch.block : 1;
    return stretch;
}

double replay_between(const double *value, size_t stride, size_t count, double position) {
    const double last = (double)(count - 1);
    const double at = fmin(fmax(position, 0.0), last);
    const size_t low = (size_t)fmin(floor(at), last - (count > 1 ? 1.0 : 0.0));
    const size_t high = low + (count > 1);
    return value[low * stride] + (at - (double)low) * (value[high * stride] - value[low * stride]);
}

/* Without duties the readings are all there is: what the sensors would show of the present guess is taken
 * off, and the smoothed rest added, until the effects on the sensors have settled. Commanded pressures stand
 * in where nothing was read. */
static void guess_run(const struct replay *replay, const struct gap_model *model, size_t index,
                      struct plant *plant, struct row_walk *walk, double *pressure_pa, double *level) {
    enum { ROUNDS = 3 };
    const struct replay_run *run = &replay->run[index];
    size_t row = 0;
    for (size_t step = 0; step <= run->steps; step++) {
        double wanted[3] = {0.0, 0.0, 0.0};
        if (!run->run->has_reading && run->run->has_command) {
            const double now_s = 1e-6 * (double)(run->start_us + (int64_t)step * replay->step_us);
            while (row + 1 < run->run->rows && run->run->time_s[row + 1] <= now_s + 5e-7) {
                row++;
            }
            memcpy(wanted, run->run->command_pa + 3 * row, sizeof wanted);
        }
        memcpy(pressure_pa + 3 * step, wanted, sizeof wanted);
    }
    for (int round = 0; round < ROUNDS && run->run->has_reading; round++) {
        show_run(replay, model, index, plant, pressure_pa, walk);
        for (size_t c = 0; c < 3; c++) {
            double *observed = level, *variance = level + run->blocks, *smoothed = level + 2 * run->blocks;
            for (size_t b = 0; b < run->blocks; b++) {
                observed[b] = walk->sum[3 * b + c];
                variance[b] = run->variance[3 * b + c];
            }
            for (size_t i = 0; i <= run->run->breaks; i++) {
                const struct replay_stretch part = replay_stretch_at(replay, run, i);
                if (!smoother_run(&run->smoother[c], observed + part.block, variance + part.block,
                                  part.blocks, smoothed)) {
                    continue;
                }
                for (size_t step = part.step; step < part.end_step; step++) {
                    const double position = replay_block_position(replay, (double)step) - (double)part.block;
                    pressure_pa[3 * step + c] += replay_between(smoothed, 1, part.blocks, position);
                }
            }
        }
    }
    memset(walk->sum, 0, 3 * run->blocks * sizeof(double));
}

/* --- whichever there are --- */

void replay_pressures(const struct replay *replay, const struct gap_model *model,
                      struct replay_state *state) {
    struct plant plant;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        struct row_walk walk = {
            .replay = replay, .run = run, .sum = state->difference[i], .supply = state->supply[i]};
        memset(walk.sum, 0, 3 * run->blocks * sizeof(double));
        memset(walk.supply, 0, run->blocks * sizeof(double));
        walk.count = calloc(3 * run->blocks + 3, sizeof(double));
        if (walk.count == NULL) {
            continue; /* the run then counts as matched: no worse than the nominal one */
        }
        if (run->run->sim_pa != NULL) {
            replay_elsewhere_pressures(replay, i, state->pressure_pa[i]);
            show_run(replay, model, i, &plant, state->pressure_pa[i], &walk);
        } else if (run->run->has_duty) {
            simulate_run(replay, model, i, &plant, &walk, state->pressure_pa[i]);
            finish_rows(&walk);
        } else {
            guess_run(replay, model, i, &plant, &walk, state->pressure_pa[i], walk.count);
        }
        free(walk.count);
    }
    replay_correct(replay, state);
}

void replay_correct(const struct replay *replay, struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        memset(state->correction[i], 0, 3 * run->blocks * sizeof(double));
        if (!run->run->has_duty || !run->run->has_reading) {
            continue;
        }
        double *room = malloc(3 * run->blocks * sizeof *room);
        for (size_t c = 0; c < 3 && room != NULL; c++) {
            double *observed = room, *variance = room + run->blocks, *level = room + 2 * run->blocks;
            for (size_t b = 0; b < run->blocks; b++) {
                observed[b] = state->difference[i][3 * b + c];
                variance[b] = run->variance[3 * b + c];
            }
            if (smoother_run(&run->smoother[c], observed, variance, run->blocks, level)) {
                for (size_t b = 0; b < run->blocks; b++) {
                    state->correction[i][3 * b + c] = level[b];
                }
            }
        }
        free(room);
    }
}

void replay_take_pressures(const struct replay *replay, const struct replay_state *state, double *residual) {
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t k = 0; k < 3 * run->blocks; k++) {
            residual[run->pressure_at + k] = state->difference[i][k] * replay->weight[run->pressure_at + k];
        }
        for (size_t b = 0; b < run->blocks; b++) {
            residual[run->supply_at + b] = state->supply[i][b] * replay->weight[run->supply_at + b];
        }
    }
}
