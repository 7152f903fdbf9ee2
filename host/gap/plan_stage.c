#include "gap/plan_stage.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gap/plan_library.h"

#define DEGREES (180.0 / M_PI)
/* White noise of a sample of PLAN_SAMPLE_S: twenty pressure readings of 0.15 kPa; two poses, of which the
 * sensor's noise (0.02 mm, 0.012 deg) and the steps of its words (0.11 mm, 0.022 deg) make about as much
 * again. */
#define READING_NOISE_PA 34.0
#define POSITION_NOISE_M 3e-5
#define ANGLE_NOISE_RAD (0.01 / DEGREES)
/* What no model gets right, with a memory of a cycle: how well real modules repeat themselves (0.1 to 0.7
 * mm), and the valve's flow. */
#define MEMORY_S 0.5
#define READING_FLOOR_PA 60.0
#define POSITION_FLOOR_M 3e-4
#define ANGLE_FLOOR_RAD (0.5 / DEGREES)
#define PRESSURE_SPREAD_PA 15.0 /* of the pressure that the poses are simulated from, after smoothing */
#define NUDGE_PA 20.0
/* Differences. */
#define STEP_SHARE 0.02 /* of a parameter's scale */
#define NOMINAL_STEP 0.01
#define NEAR                                                                                                 \
    0.03 /* a change of stiffness or supply over which the gas follows its derivatives within its noise */
#define CHANCE_SEED 7

/* --- stage --- */

static bool moves_gas(const struct gap_model *model, const struct gap_parameter *parameter) {
    return parameter->effect < 0 || gap_effect_upstream(model->effect[parameter->effect].kind);
}

double plan_stage_step(const struct gap_parameter *parameter) {
    const double step = parameter->effect < 0 ? NOMINAL_STEP : STEP_SHARE * parameter->scale;
    return *parameter->value + step > parameter->most ? -step : step;
}

static bool open_trace(const struct plan_stage *stage, struct plan_view *view) {
    if (view->trace.samples == 0 && !plan_trace_open(&view->trace, stage->samples)) {
        return false;
    }
    plan_trace_run(stage->bench, &view->model, stage->drive, &view->trace);
    return true;
}

static bool open_derivative(const struct plan_stage *stage, struct plan_view *view,
                            const struct gap_parameter *parameter, struct plan_trace *moved) {
    const double kept = *parameter->value, step = plan_stage_step(parameter);
    if (moved->samples == 0 && !plan_trace_open(moved, stage->samples)) {
        return false;
    }
    *parameter->value = kept + step;
    plan_trace_run(stage->bench, &view->model, stage->drive, moved);
    *parameter->value = kept;
    for (size_t k = 0; k < 3 * stage->samples; k++) {
        moved->pressure_pa[k] = (moved->pressure_pa[k] - view->trace.pressure_pa[k]) / step;
        moved->reading_pa[k] = (moved->reading_pa[k] - view->trace.reading_pa[k]) / step;
    }
    return true;
}

static bool open_derivatives(const struct plan_stage *stage, struct plan_view *view) {
    struct gap_parameter parameter[GAP_PARAMETERS_MAX];
    const size_t count = gap_model_parameters(&view->model, parameter);
    for (size_t p = 0; p < count; p++) {
        if (moves_gas(&view->model, &parameter[p]) &&
            !open_derivative(stage, view, &parameter[p], &view->moved[p])) {
            return false;
        }
    }
    return true;
}

static bool copy_trace(const struct plan_trace *from, struct plan_trace *to) {
    if (to->samples == 0 && !plan_trace_open(to, from->samples)) {
        return false;
    }
    memcpy(to->pressure_pa, from->pressure_pa,
           6 * from->samples * sizeof *from->pressure_pa); /* and the readings */
    return true;
}

static bool copy_gas(const struct plan_view *from, struct plan_view *to) {
    bool sound = copy_trace(&from->trace, &to->trace);
    for (size_t p = 0; p < GAP_PARAMETERS_MAX; p++) {
        if (from->moved[p].samples == 0) {
            plan_trace_close(&to->moved[p]);
        } else {
            sound = sound && copy_trace(&from->moved[p], &to->moved[p]);
        }
    }
    return sound;
}

bool plan_view_copy(const struct plan_view *from, struct plan_view *to) {
    to->candidate = from->candidate;
    to->model = from->model;
    return copy_gas(from, to);
}

/* The gas is what costs; what only bends the body or only shows in the tip sensor shares it with the base. */
static bool open_gas(const struct plan_stage *stage, struct plan_view *view) {
    if (!gap_effect_upstream(view->model.effect[view->model.count - 1].kind)) {
        return copy_gas(&stage->base, view);
    }
    return open_trace(stage, view) && open_derivatives(stage, view);
}

bool plan_stage_derive(const struct plan_stage *stage, struct plan_view *view) {
    struct gap_parameter parameter[GAP_PARAMETERS_MAX];
    const size_t count = gap_model_parameters(&view->model, parameter);
    for (size_t p = 0; p < count; p++) {
        const bool own = parameter[p].effect >= 0 && moves_gas(&view->model, &parameter[p]);
        if (own && !open_derivative(stage, view, &parameter[p], &view->moved[p])) {
            return false;
        }
    }
    return true;
}

static bool is_near(const struct gap_model *from, const struct gap_model *model) {
    bool near = fabs(model->stiffness_scale - from->stiffness_scale) < NEAR &&
                fabs(model->supply_scale - from->supply_scale) < NEAR;
    for (size_t e = 0; e < model->count; e++) {
        near = near && !gap_effect_upstream(model->effect[e].kind);
    }
    return near;
}

void plan_stage_gas(const struct plan_stage *stage, const struct plan_view *from,
                    const struct gap_model *model, struct plan_trace *trace) {
    const double stiffness = model->stiffness_scale - from->model.stiffness_scale;
    const double supply = model->supply_scale - from->model.supply_scale;
    if (!is_near(&from->model, model)) {
        plan_trace_run(stage->bench, model, stage->drive, trace);
        return;
    }
    for (size_t k = 0; k < 3 * stage->samples; k++) {
        trace->pressure_pa[k] = from->trace.pressure_pa[k] + stiffness * from->moved[0].pressure_pa[k] +
                                supply * from->moved[1].pressure_pa[k];
        trace->reading_pa[k] = from->trace.reading_pa[k] + stiffness * from->moved[0].reading_pa[k] +
                               supply * from->moved[1].reading_pa[k];
    }
}

static void close_view(struct plan_view *view) {
    plan_trace_close(&view->trace);
    for (size_t p = 0; p < GAP_PARAMETERS_MAX; p++) {
        plan_trace_close(&view->moved[p]);
    }
}

/* Van der Corput's sequence in a base: well spread starts. */
static double spread(size_t index, size_t base) {
    double value = 0.0, share = 1.0 / (double)base;
    for (; index > 0; index /= base, share /= (double)base) {
        value += share * (double)(index % base);
    }
    return value;
}

/* The k-th start: where the candidate stands, hardly anything of it, then half of it with what says how it
 * acts spread over its bounds, the more starts the more there is of that. False: there is no such start. */
static bool place_start(struct effect *effect, size_t k) {
    static const size_t bases[EFFECT_PARAMETERS_MAX] = {2, 3, 5};
    const double amount = k == 0 ? 1.0 : k == 1 ? 0.15 : 0.5;
    size_t spreads = 0;
    for (size_t i = 0; i < effect->kind->parameter_count && i < EFFECT_PARAMETERS_MAX; i++) {
        const struct effect_parameter *parameter = &effect->kind->parameter[i];
        if (!isnan(parameter->none)) {
            effect->parameter[i] = parameter->none + amount * (effect->parameter[i] - parameter->none);
        } else if (k >= 2) {
            const double share = 0.1 + 0.8 * spread(k - 1, bases[i]);
            const bool wide = parameter->least > 0.0 && parameter->most / parameter->least > 20.0;
            effect->parameter[i] = wide ? parameter->least * pow(parameter->most / parameter->least, share)
                                        : parameter->least + share * (parameter->most - parameter->least);
        }
        spreads += isnan(parameter->none) ? 1 : 0;
    }
    return k < 2 + 3 * spreads;
}

static struct plan_view *add_view(struct plan_stage *stage, size_t candidate) {
    struct plan_view *view = &stage->view[stage->views++];
    view->candidate = candidate;
    view->model = stage->candidates->candidate[candidate].model;
    return view;
}

bool plan_stage_spread(struct plan_stage *stage, size_t most) {
    bool sound = open_derivatives(stage, &stage->base);
    for (size_t i = 0; i < stage->candidates->count && sound; i++) {
        sound = open_gas(stage, &stage->view[i]);
        for (size_t k = 1; k < most && sound; k++) {
            struct effect start = stage->view[i].model.effect[stage->view[i].model.count - 1];
            if (!place_start(&start, k)) {
                break;
            }
            struct plan_view *view = add_view(stage, i);
            view->model.effect[view->model.count - 1] = start;
            sound = open_gas(stage, view);
        }
    }
    return sound;
}

void plan_stage_close(struct plan_stage *stage) {
    if (stage != NULL) {
        close_view(&stage->base);
        for (size_t v = 0; v < stage->views; v++) {
            close_view(&stage->view[v]);
        }
        free(stage->part);
        free(stage);
    }
}

static void find_parts(struct plan_stage *stage) {
    static const double shares[PLAN_LEVELS - 1] = {0.125, 0.5}; /* of the bend limit, by that chamber alone */
    const struct bend_table *table = stage->bench->table;
    for (size_t c = 0; c < 3; c++) {
        for (size_t level = 1; level < PLAN_LEVELS; level++) {
            const double from_pa =
                plan_library_pressure(table, c + 1, shares[level - 1] * (double)table->module.bend_limit_rad);
            for (size_t i = 0; i < stage->samples; i++) {
                const size_t place = c == 0 ? 1 : c == 1 ? PLAN_LEVELS : PLAN_LEVELS * PLAN_LEVELS;
                const bool above = stage->base.trace.pressure_pa[3 * i + c] > from_pa;
                stage->part[i] = (unsigned char)(stage->part[i] + (above ? place : 0));
            }
        }
    }
}

struct plan_stage *plan_stage_open(const struct plan_bench *bench, const struct plan_candidates *candidates,
                                   const struct plan_drive *drive) {
    struct plan_stage *stage = calloc(1, sizeof *stage);
    if (stage == NULL) {
        return NULL;
    }
    stage->bench = bench;
    stage->candidates = candidates;
    stage->drive = drive;
    stage->samples = plan_drive_samples(bench, drive);
    stage->residuals = PLAN_CHANNELS * stage->samples;
    stage->part = calloc(stage->samples + 1, sizeof *stage->part);
    stage->base.model = candidates->base;
    bool sound = stage->part != NULL && open_trace(stage, &stage->base);
    for (size_t i = 0; i < candidates->count && sound; i++) {
        sound = open_trace(stage, add_view(stage, i));
    }
    if (!sound) {
        plan_stage_close(stage);
        return NULL;
    }
    find_parts(stage);
    return stage;
}

/* --- room --- */

void plan_room_close(struct plan_room *room) {
    close_view(&room->tried);
    plan_trace_close(&room->trial);
    free(room->pressure_pa);
    free(room->pose);
    free(room->nudged);
    free(room->residual);
    free(room->moved);
    free(room->jacobian);
    memset(room, 0, sizeof *room);
}

bool plan_room_open(struct plan_room *room, const struct plan_stage *stage) {
    memset(room, 0, sizeof *room);
    room->pressure_pa = calloc(3 * stage->samples + 1, sizeof *room->pressure_pa);
    room->pose = calloc(stage->samples + 1, sizeof *room->pose);
    room->nudged = calloc(stage->samples + 1, sizeof *room->nudged);
    room->residual = calloc(stage->residuals + 1, sizeof *room->residual);
    room->moved = calloc(stage->residuals + 1, sizeof *room->moved);
    room->jacobian = calloc(GAP_PARAMETERS_MAX * stage->residuals + 1, sizeof *room->jacobian);
    return plan_trace_open(&room->trial, stage->samples) && room->pressure_pa != NULL && room->pose != NULL &&
           room->nudged != NULL && room->residual != NULL && room->moved != NULL && room->jacobian != NULL;
}

/* --- residuals --- */

/* The poses come from the readings, less what the model says the sensors add. */
static void subtract(const struct plan_stage *stage, const struct plan_truth *truth,
                     const struct gap_model *model, const struct plan_trace *trace,
                     const struct plan_trace *along, double step, struct plan_room *room, double *residual) {
    for (size_t k = 0; k < 3 * stage->samples; k++) {
        const double reading_pa = trace->reading_pa[k] + (along != NULL ? step * along->reading_pa[k] : 0.0);
        const double difference_pa = truth->trace->reading_pa[k] - reading_pa;
        residual[PLAN_CHANNELS * (k / 3) + k % 3] = difference_pa;
        room->pressure_pa[k] =
            trace->pressure_pa[k] + (along != NULL ? step * along->pressure_pa[k] : 0.0) + difference_pa;
    }
    plan_poses(stage->bench, model, stage->samples, room->pressure_pa, NULL, room->pose);
    for (size_t i = 0; i < stage->samples; i++) {
        double *tip = residual + PLAN_CHANNELS * i + 3;
        for (size_t k = 0; k < 3; k++) {
            tip[k] = truth->pose[i].position_m[k] - room->pose[i].position_m[k];
        }
        plan_rotation(room->pose[i].quaternion, truth->pose[i].quaternion, tip + 3);
    }
}

static double white_of(size_t channel) {
    return channel < 3 ? READING_NOISE_PA : channel < 6 ? POSITION_NOISE_M : ANGLE_NOISE_RAD;
}

static double floor_of(size_t channel) {
    return channel < 3 ? READING_FLOOR_PA : channel < 6 ? POSITION_FLOOR_M : ANGLE_FLOOR_RAD;
}

void plan_stage_compare(const struct plan_stage *stage, const struct plan_truth *truth,
                        const struct gap_model *model, const struct plan_trace *trace,
                        const struct plan_trace *along, double step, struct plan_room *room,
                        double *residual) {
    subtract(stage, truth, model, trace, along, step, room, residual);
    for (size_t channel = 0; channel < PLAN_CHANNELS; channel++) {
        plan_noise_whiten(&truth->noise, channel, MEMORY_S, PLAN_SAMPLE_S, residual + channel, PLAN_CHANNELS);
    }
}

/* --- truth --- */

/* Squares of what an uncertain pressure makes of the poses, into the noise's sizes. */
static void add_spread(const struct plan_stage *stage, struct plan_truth *truth, struct plan_room *room) {
    const double *pressure_pa = truth->trace->pressure_pa;
    plan_poses(stage->bench, &stage->base.model, stage->samples, pressure_pa, NULL, room->pose);
    for (size_t c = 0; c < 3; c++) {
        for (size_t k = 0; k < 3 * stage->samples; k++) {
            room->pressure_pa[k] = pressure_pa[k] + (k % 3 == c ? NUDGE_PA : 0.0);
        }
        plan_poses(stage->bench, &stage->base.model, stage->samples, room->pressure_pa, NULL, room->nudged);
        for (size_t i = 0; i < stage->samples; i++) {
            double change[6];
            plan_rotation(room->pose[i].quaternion, room->nudged[i].quaternion, change + 3);
            for (size_t k = 0; k < 6; k++) {
                change[k] = k < 3 ? room->nudged[i].position_m[k] - room->pose[i].position_m[k] : change[k];
                const double size = change[k] / NUDGE_PA * PRESSURE_SPREAD_PA;
                truth->noise.size[(3 + k) * stage->samples + i] += size * size;
            }
        }
    }
}

static void set_noise(const struct plan_stage *stage, struct plan_truth *truth, struct plan_room *room) {
    add_spread(stage, truth, room);
    for (size_t channel = 0; channel < PLAN_CHANNELS; channel++) {
        double *size = truth->noise.size + channel * stage->samples;
        const double floor_size = floor_of(channel);
        for (size_t i = 0; i < stage->samples; i++) {
            size[i] = sqrt(size[i] + floor_size * floor_size);
        }
        plan_noise_prepare(&truth->noise, channel, white_of(channel), MEMORY_S, PLAN_SAMPLE_S);
    }
}

void plan_truth_close(struct plan_truth *truth) {
    free(truth->pose);
    plan_noise_close(&truth->noise);
}

bool plan_truth_open(struct plan_truth *truth, const struct plan_stage *stage, size_t candidate,
                     struct plan_room *room) {
    const struct plan_view *view = &stage->view[candidate];
    struct random_stream chance;
    memset(truth, 0, sizeof *truth);
    truth->trace = &view->trace;
    truth->pose = calloc(stage->samples + 1, sizeof *truth->pose);
    if (truth->pose == NULL || !plan_noise_open(&truth->noise, stage->samples, PLAN_CHANNELS)) {
        plan_truth_close(truth);
        return false;
    }
    random_seed(&chance, CHANCE_SEED, candidate);
    plan_poses(stage->bench, &view->model, stage->samples, view->trace.pressure_pa, &chance, truth->pose);
    set_noise(stage, truth, room);
    return true;
}
