#include "gap/replay.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/noise_floor.h"
#include "gap/replay_elsewhere.h"

#define PRESSURE_BLOCK_US ((int64_t)(REPLAY_PRESSURE_BLOCK_S * 1e6 + 0.5))
#define TIP_BLOCK_S REPLAY_TIP_BLOCK_S
#define HELD_OUT_S 2.5          /* lengths of the blocks that are kept from the fit, every other one */
#define SUPPLY_SPREAD_PA 60.0   /* of a block: how well a supply reading says what the valves feel */
/* What a sensor's steps and the table's interpolation leave in a mean, however many samples it has. */
#define POSITION_FLOOR_M 1.5e-5
#define ANGLE_FLOOR_RAD (0.015 * M_PI / 180.0)
#define READING_FLOOR_PA 4.0
/* Least noise of one sample that is believed. */
#define READING_LEAST_PA 20.0
#define POSITION_LEAST_M 2e-5
#define ANGLE_LEAST_RAD (0.008 * M_PI / 180.0)
#define NUDGE_PA 20.0
#define TIMING_SHARE 0.998 /* of the jumps under the format's own timing, that another must leave fewer than */
#define MAD_TO_SIGMA 1.4826
#define UNCLIPPED 8        /* readings in a row without a zero: the chamber is under pressure */
#define UNCLIPPED_LEAST 50 /* so many of them that their noise is known */

/* --- opening --- */

static size_t block_of_step(const struct replay *replay, size_t step) {
    return step / (size_t)(PRESSURE_BLOCK_US / replay->step_us);
}

static size_t tip_block(const struct replay_run *run, size_t tip) {
    const double since_s = run->run->tip[tip].time_s - 1e-6 * (double)run->start_us;
    return since_s > 0.0 ? (size_t)(since_s / TIP_BLOCK_S) : 0;
}

static bool held_out_at(const struct replay *replay, size_t run, double since_s) {
    (void)replay;
    return ((size_t)(since_s / HELD_OUT_S) + run) % 2 == 1;
}

static void pick_tips(struct replay_run *run) {
    run->picks = 0;
    for (size_t i = 0; i < run->run->tips;) {
        const size_t first = i, block = tip_block(run, i);
        while (i < run->run->tips && tip_block(run, i) == block) {
            i++;
        }
        run->pick[run->picks++] = (uint32_t)((first + i - 1) / 2);
    }
}

static bool lay_out(struct replay *replay, size_t index) {
    struct replay_run *run = &replay->run[index];
    const struct gap_run *data = run->run;
    const int64_t period_us = replay->nominal.valve.period_us;
    const int64_t first_us = llround(1e6 * data->time_s[0]), last_us = llround(1e6 * data->time_s[data->rows - 1]);
    const int64_t step_us = replay->step_us;
    run->start_us = first_us / period_us * period_us;
    run->blocks = (size_t)((last_us - run->start_us) / PRESSURE_BLOCK_US) + 2;
    run->steps = (run->blocks - 1) * (size_t)(PRESSURE_BLOCK_US / step_us);
    run->tip_blocks = data->tips > 0 ? tip_block(run, data->tips - 1) + 1 : 0;
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

/* Mean of the first tenth of a second; what lies within three noise levels of zero counts as vented. */
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
        run->initial_pa[c] = mean_pa > 1500.0 ? mean_pa : 0.0;
    }
}

static void mark_held_out(struct replay *replay, size_t index) {
    const struct replay_run *run = &replay->run[index];
    const double block_s = REPLAY_PRESSURE_BLOCK_S;
    for (size_t b = 0; b < run->blocks; b++) {
        const uint8_t out = held_out_at(replay, index, (double)b * block_s);
        for (size_t c = 0; c < 3; c++) {
            replay->held_out[run->pressure_at + 3 * b + c] = out;
        }
        replay->held_out[run->supply_at + b] = out;
    }
    for (size_t b = 0; b < run->tip_blocks; b++) {
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
            replay->held_out[run->tip_at + REPLAY_TIP_CHANNELS * b + k] = held_out_at(replay, index, (double)b * TIP_BLOCK_S);
        }
    }
}

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

/* From the second differences of readings that are not clipped; a ramp drops out. Only those count that follow on at least
 * `unclipped` others without a zero in between. NAN: there are none. */
static double noise_of(const double *value, size_t stride, size_t count, size_t unclipped, double least, double *room) {
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
    return used < UNCLIPPED_LEAST && unclipped > 0 ? NAN : fmax(MAD_TO_SIGMA * median(room, used) / sqrt(6.0), least);
}

/* Of the middle one of the chambers that are under pressure for long enough; of all where none is. A vented chamber's
 * reading is clipped half of the time, and what is left of its noise looks too small. */
static double reading_noise(const struct gap_run *data, double *room) {
    double chamber[3];
    size_t known = 0;
    for (size_t c = 0; c < 3; c++) {
        const double noise_pa = noise_of(data->reading_pa + c, 3, data->rows, UNCLIPPED, READING_LEAST_PA, room);
        if (!isnan(noise_pa)) {
            chamber[known++] = noise_pa;
        }
    }
    for (size_t c = 0; c < 3 && known == 0; c++) {
        chamber[c] = noise_of(data->reading_pa + c, 3, data->rows, 0, READING_LEAST_PA, room);
    }
    return median(chamber, known > 0 ? known : 3);
}

static bool find_noise(struct replay_run *run) {
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
        double sum = 0.0;
        for (size_t k = 0; k < 3; k++) {
            for (size_t i = 0; i < data->tips; i++) {
                values[i] = kind == 0 ? data->tip[i].position_m[k] : 2.0 * data->tip[i].quaternion[1 + k];
                values[i] -= data->sim_tip == NULL ? 0.0 : replay_elsewhere_noise_part(data, i, kind, k);
            }
            sum += pow(noise_of(values, 1, data->tips, 0, kind == 0 ? POSITION_LEAST_M : ANGLE_LEAST_RAD, room), 2.0) / 3.0;
        }
        run->tip_noise[kind] = sqrt(sum);
    }
    free(room);
    free(values);
    return true;
}

static void find_variance(const struct replay *replay, struct replay_run *run) {
    const struct gap_run *data = run->run;
    const double one = run->reading_noise_pa * run->reading_noise_pa;
    for (size_t i = 0; i < 3 * run->blocks; i++) {
        run->variance[i] = 0.0; /* counts first */
    }
    for (size_t row = 0; row < data->rows; row++) {
        for (size_t c = 0; c < 3; c++) {
            run->variance[3 * block_of_step(replay, run->row_step[row]) + c] += !isnan(data->reading_pa[3 * row + c]);
        }
    }
    for (size_t i = 0; i < data->breaks; i++) {
        const size_t row = data->break_row[i], block = block_of_step(replay, run->row_step[row]);
        for (size_t c = 0; c < 3 && block_of_step(replay, run->row_step[row - 1]) == block; c++) {
            run->variance[3 * block + c] = 0.0; /* readings from both sides: their mean is neither's */
        }
    }
    for (size_t i = 0; i < 3 * run->blocks; i++) {
        const double count = run->variance[i];
        run->variance[i] = count > 0.0 ? one / count + READING_FLOOR_PA * READING_FLOOR_PA : INFINITY;
    }
}

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
        if (!lay_out(replay, i) || !find_noise(&replay->run[i])) {
            replay_close(replay);
            return false;
        }
        find_start(&replay->run[i]);
        find_variance(replay, &replay->run[i]);
    }
    replay->weight = calloc(replay->residuals, sizeof *replay->weight);
    replay->held_out = calloc(replay->residuals, sizeof *replay->held_out);
    replay->apart = calloc(replay->residuals, sizeof *replay->apart);
    replay->lasting = calloc(replay->residuals, sizeof *replay->lasting);
    if (replay->weight == NULL || replay->held_out == NULL || replay->apart == NULL || replay->lasting == NULL) {
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
    if (!open_with_step(coarse, fine->data, fine->table, &fine->nominal, divides ? REPLAY_COARSE_STEP_US : REPLAY_STEP_US)) {
        return false;
    }
    coarse->coarse = true;
    replay_follow(coarse, fine);
    return true;
}

void replay_follow(struct replay *coarse, const struct replay *fine) {
    coarse->rigid = fine->rigid;
    coarse->elsewhere = fine->elsewhere;
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

/* --- pressures --- */

static void set_up_plant(const struct replay *replay, const struct gap_model *model, struct plant *plant) {
    struct plant_parameters parameters = replay->nominal;
    parameters.gas.stiffness_scale *= model->stiffness_scale;
    parameters.supply_pa *= model->supply_scale;
    plant_init(plant, replay->table, &parameters);
    for (size_t e = 0; e < model->count; e++) {
        (void)plant_add_effect(plant, &model->effect[e]); /* a model has fewer than a plant has room for */
    }
}

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
    size_t row;       /* next to be met */
    double *sum;      /* [3 * blocks] */
    double *supply;   /* [blocks] */
    double *count;    /* [blocks] of supply readings */
};

/* Rows within the step that ends at `step`, between the readings before and after it. */
static void meet_rows(struct row_walk *walk, size_t step, const double before_pa[3], const double after_pa[3],
                      double supply_pa) {
    const struct replay_run *run = walk->run;
    const struct gap_run *data = run->run;
    const int64_t step_us = walk->replay->step_us;
    for (; walk->row < data->rows && run->row_step[walk->row] <= step; walk->row++) {
        const size_t row = walk->row, block = block_of_step(walk->replay, step);
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

static double temperature_at(const struct gap_run *data, size_t row) {
    return data->has_temperature && row < data->rows ? data->temperature_k[row] : NAN;
}

static void simulate_run(const struct replay *replay, const struct gap_model *model, size_t index, struct plant *plant,
                         struct row_walk *walk, double *pressure_pa) {
    const struct replay_run *run = &replay->run[index];
    const int64_t period_us = replay->nominal.valve.period_us;
    size_t duty_row = 0, cut_row = 0;
    double before_pa[3];
    set_up_plant(replay, model, plant);
    chambers_set_pressure(&plant->chambers, &plant->parameters.gas, replay->table, run->initial_pa);
    memcpy(pressure_pa, run->initial_pa, sizeof run->initial_pa);
    memcpy(before_pa, run->initial_pa, sizeof before_pa);
    meet_rows(walk, 0, before_pa, before_pa, plant->influence.supply_pa);
    for (size_t step = 1; step <= run->steps; step++) {
        const int64_t from_us = run->start_us + (int64_t)(step - 1) * replay->step_us;
        if (from_us % period_us == 0) {
            double duty[3];
            duty_at(run, &duty_row, from_us, duty);
            plant->temperature_k = temperature_at(run->run, walk->row);
            plant_start_period(plant, from_us, duty);
        }
        cut_valves(run, plant, &cut_row, from_us + replay->step_us);
        plant_step(plant, true, from_us, from_us + replay->step_us);
        memcpy(pressure_pa + 3 * step, plant->pressure_pa, sizeof plant->pressure_pa);
        meet_rows(walk, step, before_pa, plant->reading_pa, plant->influence.supply_pa);
        memcpy(before_pa, plant->reading_pa, sizeof before_pa);
    }
}

static double between(const double *value, size_t stride, size_t count, double position) {
    const double last = (double)(count - 1);
    const double at = fmin(fmax(position, 0.0), last);
    const size_t low = (size_t)fmin(floor(at), last - (count > 1 ? 1.0 : 0.0));
    const size_t high = low + (count > 1);
    return value[low * stride] + (at - (double)low) * (value[high * stride] - value[low * stride]);
}

/* Block of the level at a time in steps: levels stand for their block's middle. */
static double block_position(const struct replay *replay, double step) {
    return step * (double)replay->step_us / (double)PRESSURE_BLOCK_US - 0.5;
}

/* Sensors beside pressures that are known at the end of each step: sums of differences into the walk. */
static void show_run(const struct replay *replay, const struct gap_model *model, size_t index, struct plant *plant,
                     const double *pressure_pa, struct row_walk *walk) {
    const struct replay_run *run = &replay->run[index];
    double reading_pa[3], before_pa[3];
    set_up_plant(replay, model, plant);
    memset(walk->sum, 0, 3 * run->blocks * sizeof(double));
    walk->row = 0;
    memcpy(before_pa, pressure_pa, sizeof before_pa);
    for (size_t step = 0; step <= run->steps; step++) {
        struct effect_signals signals = {.time_s = 1e-6 * (double)(run->start_us + (int64_t)step * replay->step_us),
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

/* A recording that breaks off and goes on elsewhere: pressures are smoothed on either side, never across. */
struct stretch {
    size_t block; /* first of its blocks .. */
    size_t blocks;
    size_t step; /* .. and of its steps */
    size_t end_step;
};

/* The tip of the row in which a stretch starts is older than the row: its pressures count from a little before it. */
static size_t first_step(const struct replay *replay, const struct replay_run *run, size_t index) {
    if (index == 0) {
        return 0;
    }
    const size_t row = run->run->break_row[index - 1], age = (size_t)(GAP_TIP_AGE_S * 1e6 / (double)replay->step_us) + 2;
    const size_t at = run->row_step[row], before = run->row_step[row - 1];
    return at - before > 2 * age ? at - age : before + (at - before + 1) / 2;
}

static struct stretch stretch_of(const struct replay *replay, const struct replay_run *run, size_t index) {
    const size_t breaks = run->run->breaks;
    struct stretch stretch = {.step = first_step(replay, run, index),
                              .end_step = index < breaks ? first_step(replay, run, index + 1) : run->steps + 1};
    stretch.block = index > 0 ? block_of_step(replay, run->row_step[run->run->break_row[index - 1]]) : 0;
    const size_t end = index < breaks ? block_of_step(replay, run->row_step[run->run->break_row[index]]) : run->blocks;
    stretch.blocks = end > stretch.block ? end - stretch.block : 1;
    return stretch;
}

/* Without duties the readings are all there is: what the sensors would show of the present guess is taken off, and the
 * smoothed rest added, until the effects on the sensors have settled. Commanded pressures stand in where nothing was read. */
static void guess_run(const struct replay *replay, const struct gap_model *model, size_t index, struct plant *plant,
                      struct row_walk *walk, double *pressure_pa, double *level) {
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
                const struct stretch part = stretch_of(replay, run, i);
                if (!smoother_run(&run->smoother[c], observed + part.block, variance + part.block, part.blocks, smoothed)) {
                    continue;
                }
                for (size_t step = part.step; step < part.end_step; step++) {
                    const double position = block_position(replay, (double)step) - (double)part.block;
                    pressure_pa[3 * step + c] += between(smoothed, 1, part.blocks, position);
                }
            }
        }
    }
    memset(walk->sum, 0, 3 * run->blocks * sizeof(double));
}

void replay_pressures(const struct replay *replay, const struct gap_model *model, struct replay_state *state) {
    struct plant plant;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        struct row_walk walk = {.replay = replay, .run = run, .sum = state->difference[i], .supply = state->supply[i]};
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

/* --- tip --- */

/* Rotation vector of measured times the inverse of simulated: small where they agree. */
static void rotation_between(const double measured[4], const double simulated[4], double rotation[3]) {
    const double *a = measured, b[4] = {simulated[0], -simulated[1], -simulated[2], -simulated[3]};
    const double w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    const double v[3] = {a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                         a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                         a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
    const double sign = w < 0.0 ? -1.0 : 1.0;
    const double size = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double stretch = size > 1e-12 ? 2.0 * atan2(size, fabs(w)) / size : 2.0;
    for (size_t k = 0; k < 3; k++) {
        rotation[k] = sign * stretch * v[k];
    }
}

/* Pressures at a time, with what was measured of them unless only the duties count. */
static void pressures_at(const struct replay *replay, const struct replay_state *state, size_t index, double time_s,
                         bool from_duties, double nudge_pa, size_t nudged, double pressure_pa[3]) {
    const struct replay_run *run = &replay->run[index];
    const double step = (time_s - 1e-6 * (double)run->start_us) / (1e-6 * (double)replay->step_us);
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = between(state->pressure_pa[index] + c, 3, run->steps + 1, step);
        if (!from_duties) {
            pressure_pa[c] += between(state->correction[index] + c, 3, run->blocks, block_position(replay, step));
        }
        pressure_pa[c] += c == nudged ? nudge_pa : 0.0;
    }
}

bool replay_needs_samples(const struct gap_model *model) {
    for (size_t e = 0; e < model->count; e++) {
        if (model->effect[e].kind->by_sample || model->effect[e].kind->by_chance) {
            return true;
        }
    }
    return false;
}

static void tip_of_run(const struct replay *replay, const struct gap_model *model, const struct replay_state *state,
                       size_t index, bool from_duties, double nudge_pa, size_t nudged, double *mean) {
    const struct replay_run *run = &replay->run[index];
    const struct gap_run *data = run->run;
    struct plant plant;
    size_t block = 0, count = 0, row = 0;
    double sum[REPLAY_TIP_CHANNELS] = {0.0}, before_s = 1e-6 * (double)run->start_us;
    const bool sampled = data->sim_tip != NULL && data->sim_pa == NULL; /* what the sensors show is told at each sample */
    const bool picked = replay->coarse && !replay_needs_samples(model) && !sampled;
    set_up_plant(replay, model, &plant);
    for (size_t n = 0; n < (picked ? run->picks : data->tips); n++) {
        const size_t i = picked ? run->pick[n] : n;
        const struct gap_tip *tip = &data->tip[i];
        double pressure_pa[3], rotation[3] = {0.0, 0.0, 0.0};
        const size_t at = tip_block(run, i);
        if (at != block) {
            memset(sum, 0, sizeof sum);
            count = 0;
            block = at;
        }
        while (data->has_temperature && row + 1 < data->rows && data->time_s[row + 1] <= tip->time_s) {
            row++;
        }
        plant.temperature_k = temperature_at(data, row);
        pressures_at(replay, state, index, tip->time_s, from_duties, nudge_pa, nudged, pressure_pa);
        const double step_s = fmax(tip->time_s - before_s, 1e-6), chance = tip->repeated ? 0.0 : 1.0;
        if (data->sim_tip != NULL) {
            replay_elsewhere_sample(replay, index, state, &plant, i, pressure_pa, step_s, chance);
        } else {
            plant_sample_tip(&plant, pressure_pa, tip->time_s, step_s, chance);
        }
        before_s = tip->time_s;
        if (!isnan(tip->quaternion[0])) {
            rotation_between(tip->quaternion, plant.pose.quaternion, rotation);
        }
        count++;
        for (size_t k = 0; k < 3; k++) {
            sum[k] += tip->position_m[k] - plant.pose.position_m[k];
            sum[3 + k] += rotation[k];
            mean[REPLAY_TIP_CHANNELS * block + k] = sum[k] / (double)count;
            mean[REPLAY_TIP_CHANNELS * block + 3 + k] = sum[3 + k] / (double)count;
        }
    }
}

void replay_tip(const struct replay *replay, const struct gap_model *model, const struct replay_state *state,
                bool from_duties, double *residual) {
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        double *mean = residual + run->tip_at;
        memset(mean, 0, REPLAY_TIP_CHANNELS * run->tip_blocks * sizeof *mean);
        tip_of_run(replay, model, state, i, from_duties, 0.0, 3, mean);
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS * run->tip_blocks; k++) {
            mean[k] *= replay->weight[run->tip_at + k];
        }
    }
}

/* --- weights --- */

/* How freely a pressure wanders is seen within stretches: the jumps between them are taken off. */
static void level_stretches(const struct replay *replay, const struct replay_run *run, double *observed) {
    for (size_t i = 0; i <= run->run->breaks && run->run->breaks > 0 && !run->run->has_duty; i++) {
        const struct stretch part = stretch_of(replay, run, i);
        double sum = 0.0, count = 0.0;
        for (size_t b = part.block; b < part.block + part.blocks; b++) {
            const bool seen = isfinite(observed[run->blocks + b]);
            sum += seen ? observed[b] : 0.0;
            count += seen;
        }
        for (size_t b = part.block; b < part.block + part.blocks && count > 0.0; b++) {
            observed[b] -= sum / count;
        }
    }
}

static bool fit_smoothers(struct replay *replay, struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        struct replay_run *run = &replay->run[i];
        const bool from_readings = !run->run->has_duty;
        double *room = malloc(2 * run->blocks * sizeof *room);
        if (room == NULL) {
            return false;
        }
        for (size_t c = 0; c < 3; c++) {
            for (size_t b = 0; b < run->blocks; b++) {
                room[b] = state->difference[i][3 * b + c];
                room[run->blocks + b] = run->variance[3 * b + c];
            }
            level_stretches(replay, run, room);
            const bool rigid = replay->rigid && run->run->has_duty;
            if (!smoother_fit(&run->smoother[c], room, room + run->blocks, run->blocks, rigid, from_readings)) {
                free(room);
                return false;
            }
        }
        free(room);
    }
    return true;
}

/* Block means of the readings themselves, for a run without duties. */
static void readings_as_differences(const struct replay *replay, struct replay_state *state, size_t index) {
    const struct replay_run *run = &replay->run[index];
    double *count = calloc(3 * run->blocks + 1, sizeof *count);
    memset(state->difference[index], 0, 3 * run->blocks * sizeof(double));
    for (size_t row = 0; row < run->run->rows && count != NULL; row++) {
        for (size_t c = 0; c < 3; c++) {
            const size_t at = 3 * block_of_step(replay, run->row_step[row]) + c;
            const double reading_pa = run->run->reading_pa[3 * row + c];
            if (!isnan(reading_pa)) {
                count[at] += 1.0;
                state->difference[index][at] += (reading_pa - state->difference[index][at]) / count[at];
            }
        }
    }
    free(count);
}

static size_t tips_in_block(const struct replay_run *run, size_t *tip, size_t block) {
    size_t count = 0;
    for (; *tip < run->run->tips && tip_block(run, *tip) == block; (*tip)++) {
        count++;
    }
    return count;
}

static bool weigh_tip(struct replay *replay, const struct gap_model *model, const struct replay_state *state,
                      size_t index) {
    struct replay_run *run = &replay->run[index];
    const size_t all = REPLAY_TIP_CHANNELS * run->tip_blocks;
    double *mean = calloc(2 * all + 1, sizeof *mean), *spread2 = calloc(all + 1, sizeof *spread2);
    if (mean == NULL || spread2 == NULL) {
        free(mean);
        free(spread2);
        return false;
    }
    tip_of_run(replay, model, state, index, false, 0.0, 3, mean);
    for (size_t c = 0; c < 3 && run->run->has_reading; c++) {
        double *moved = mean + all;
        tip_of_run(replay, model, state, index, false, NUDGE_PA, c, moved);
        for (size_t k = 0; k < all; k++) {
            const double change = (moved[k] - mean[k]) / NUDGE_PA * run->smoother[c].spread;
            spread2[k] += change * change;
        }
    }
    size_t tip = 0;
    for (size_t b = 0; b < run->tip_blocks; b++) {
        const size_t count = tips_in_block(run, &tip, b);
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS; k++) {
            const bool angle = k >= 3;
            const double floor_of = angle ? ANGLE_FLOOR_RAD : POSITION_FLOOR_M, noise = run->tip_noise[angle];
            const bool seen = count > 0 && (!angle || run->run->has_orientation);
            const double variance = noise * noise / fmax((double)count, 1.0) + floor_of * floor_of +
                                    spread2[REPLAY_TIP_CHANNELS * b + k];
            replay->weight[run->tip_at + REPLAY_TIP_CHANNELS * b + k] = seen ? 1.0 / sqrt(variance) : 0.0;
            replay->lasting[run->tip_at + REPLAY_TIP_CHANNELS * b + k] =
                run->run->has_duty ? 0.0 : spread2[REPLAY_TIP_CHANNELS * b + k] / variance;
        }
    }
    free(mean);
    free(spread2);
    return true;
}

static void weigh_pressures(struct replay *replay, size_t index) {
    const struct replay_run *run = &replay->run[index];
    const bool usable = run->run->has_duty && run->run->has_reading;
    for (size_t k = 0; k < 3 * run->blocks; k++) {
        replay->weight[run->pressure_at + k] = usable ? 1.0 / sqrt(run->variance[k]) : 0.0;
    }
    for (size_t b = 0; b < run->blocks; b++) {
        const double spread_pa = hypot(run->supply_noise_pa, SUPPLY_SPREAD_PA);
        replay->weight[run->supply_at + b] = usable && run->run->has_supply ? 1.0 / spread_pa : 0.0;
    }
}

/* By how much the differences jump from block to block: a duty that counts a period too early or late shows there, and the slow
 * errors of a model that lacks something do not. */
static double jumps(const struct replay *replay, const struct replay_state *state) {
    double sum = 0.0;
    for (size_t i = 0; i < replay->runs; i++) {
        const struct replay_run *run = &replay->run[i];
        for (size_t k = 3; k < 3 * run->blocks && run->run->has_duty; k++) {
            const bool seen = isfinite(run->variance[k]) && isfinite(run->variance[k - 3]);
            sum += seen ? fabs(state->difference[i][k] - state->difference[i][k - 3]) : 0.0;
        }
    }
    return sum;
}

/* Logs differ in whether the duty of a row that stands at a period's start is the one that this period has. Both are
 * tried on the nominal model; the first, which the run log's format means, unless the other fits better. */
static void choose_duty_timing(struct replay *replay, const struct gap_model *model, struct replay_state *state) {
    double cost[2];
    for (int late = 0; late < 2; late++) {
        for (size_t i = 0; i < replay->runs; i++) {
            replay->run[i].duty_from_next_period = late == 1;
        }
        replay_pressures(replay, model, state);
        cost[late] = jumps(replay, state);
    }
    for (size_t i = 0; i < replay->runs; i++) {
        replay->run[i].duty_from_next_period = cost[1] < TIMING_SHARE * cost[0];
    }
}

bool replay_prepare(struct replay *replay, const struct gap_model *model, struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        weigh_pressures(replay, i);
    }
    choose_duty_timing(replay, model, state);
    if (replay->data->from_simulator) {
        if (!replay_tune(replay, model, state)) {
            return false;
        }
        replay_elsewhere_match(replay, state);
    }
    return replay_tune(replay, model, state);
}

bool replay_tune(struct replay *replay, const struct gap_model *model, struct replay_state *state) {
    for (size_t i = 0; i < replay->runs; i++) {
        weigh_pressures(replay, i);
        if (!replay->run[i].run->has_duty) {
            readings_as_differences(replay, state, i);
        }
    }
    replay_pressures(replay, model, state);
    for (size_t i = 0; i < replay->runs; i++) {
        if (!replay->run[i].run->has_duty) {
            readings_as_differences(replay, state, i);
        }
    }
    if (!fit_smoothers(replay, state)) {
        return false;
    }
    replay_pressures(replay, model, state);
    for (size_t i = 0; i < replay->runs; i++) {
        if (!weigh_tip(replay, model, state, i)) {
            return false;
        }
    }
    return true;
}
