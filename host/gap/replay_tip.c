#include "gap/replay_parts.h"

#include <math.h>
#include <string.h>

#include "gap/replay_elsewhere.h"

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
static void pressures_at(const struct replay *replay, const struct replay_state *state, size_t index,
                         double time_s, bool from_duties, double nudge_pa, size_t nudged,
                         double pressure_pa[3]) {
    const struct replay_run *run = &replay->run[index];
    const double step = (time_s - 1e-6 * (double)run->start_us) / (1e-6 * (double)replay->step_us);
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = replay_between(state->pressure_pa[index] + c, 3, run->steps + 1, step);
        if (!from_duties) {
            pressure_pa[c] += replay_between(state->correction[index] + c, 3, run->blocks,
                                             replay_block_position(replay, step));
        }
        pressure_pa[c] += c == nudged ? nudge_pa : 0.0;
    }
}

bool replay_needs_samples(const struct replay *replay, const struct gap_model *model) {
    for (size_t e = 0; e < model->count; e++) {
        const struct effect_kind *kind = model->effect[e].kind;
        /* old poses of another simulator are found between its samples */
        if (kind->by_chance || (kind->age_s != NULL && replay->data->from_simulator)) {
            return true;
        }
    }
    return false;
}

/* The model without what only makes poses old. */
static struct gap_model without_age(const struct gap_model *model) {
    struct gap_model rest = *model;
    rest.count = 0;
    for (size_t e = 0; e < model->count; e++) {
        if (model->effect[e].kind->age_s == NULL) {
            gap_model_add(&rest, &model->effect[e]);
        }
    }
    return rest;
}

void replay_tip_of_run(const struct replay *replay, const struct gap_model *model,
                       const struct replay_state *state, size_t index, bool from_duties, double nudge_pa,
                       size_t nudged, double *mean) {
    const struct replay_run *run = &replay->run[index];
    const struct gap_run *data = run->run;
    struct plant plant;
    size_t block = 0, count = 0, row = 0;
    double sum[REPLAY_TIP_CHANNELS] = {0.0}, before_s = 1e-6 * (double)run->start_us;
    const bool sampled =
        data->sim_tip != NULL && data->sim_pa == NULL; /* what the sensors show is told at each sample */
    const bool picked = replay->coarse && !replay_needs_samples(replay, model) && !sampled;
    /* another simulator's poses are known at its samples only */
    const struct gap_model prompt = data->sim_tip != NULL ? *model : without_age(model);
    replay_set_up_plant(replay, &prompt, &plant);
    for (size_t n = 0; n < (picked ? run->picks : data->tips); n++) {
        const size_t i = picked ? run->pick[n] : n;
        const struct gap_tip *tip = &data->tip[i];
        double pressure_pa[3], rotation[3] = {0.0, 0.0, 0.0};
        const size_t at = replay_tip_block(run, i);
        if (at != block) {
            memset(sum, 0, sizeof sum);
            count = 0;
            block = at;
        }
        while (data->has_temperature && row + 1 < data->rows && data->time_s[row + 1] <= tip->time_s) {
            row++;
        }
        plant.temperature_k = replay_temperature_at(data, row);
        /* not before it began: there nothing acts */
        const double age_s = data->sim_tip != NULL ? 0.0 : effects_age_s(model->effect, model->count, tip->time_s);
        const double time_s = fmax(tip->time_s - age_s, fmin(tip->time_s, 1e-6 * (double)run->start_us));
        pressures_at(replay, state, index, time_s, from_duties, nudge_pa, nudged, pressure_pa);
        const double step_s = fmax(time_s - before_s, 1e-6), chance = tip->repeated ? 0.0 : 1.0;
        if (data->sim_tip != NULL) {
            replay_elsewhere_sample(replay, index, state, &plant, i, pressure_pa, step_s, chance);
        } else {
            plant_sample_tip(&plant, pressure_pa, time_s, step_s, chance);
        }
        before_s = time_s;
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
        replay_tip_of_run(replay, model, state, i, from_duties, 0.0, 3, mean);
        for (size_t k = 0; k < REPLAY_TIP_CHANNELS * run->tip_blocks; k++) {
            mean[k] *= replay->weight[run->tip_at + k];
        }
    }
}
