#include "gap/plan_predict.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "link/sim_link.h"
#include "log/rotation.h"

#define STEP_US 1000
#define REPEAT_US 10000
#define SEED 1
#define READY_WITHIN_US 2000000

/* --- in closed loop --- */

static void apply_nominal(const struct plan_bench *bench, const struct gap_model *model,
                          struct plant_parameters *parameters) {
    *parameters = bench->nominal;
    parameters->gas.stiffness_scale *= model->stiffness_scale;
    parameters->supply_pa *= model->supply_scale;
}

static void open_loop_of(const struct plan_bench *bench, const struct gap_model *model, struct sim_link *sim,
                         struct link *link) {
    struct sim_parameters parameters;
    sim_link_open(sim, bench->table, SEED, link);
    sim_default_parameters(&parameters);
    apply_nominal(bench, model, &parameters.plant);
    sim_init(&sim->sim, bench->table, &parameters, SEED);
    for (size_t e = 0; e < model->count; e++) {
        (void)sim_add_effect(&sim->sim, &model->effect[e]); /* a model has fewer than a plant has room for */
    }
}

static void note_reach(const struct sim_link *sim, struct plan_reach *reach) {
    const struct plant *plant = &sim->sim.plant;
    reach->bend_rad = fmax(reach->bend_rad, hypot(plant->shape.bend_x_rad, plant->shape.bend_y_rad));
    for (size_t c = 0; c < 3; c++) {
        reach->pressure_pa = fmax(reach->pressure_pa, plant->pressure_pa[c]);
    }
    reach->fault = reach->fault || sim->report.status.faults != 0u;
}

static void note_duty(const struct sim_link *sim, struct plan_drive *drive) {
    const struct hal_outputs *outputs = &sim->sim.outputs;
    for (size_t c = 0; c < 3; c++) {
        drive->duty[3 * drive->periods + c] = outputs->valves_enabled ? (double)outputs->duty[c] : 0.0;
    }
    drive->periods++;
}

static bool follow(struct sim_link *sim, const struct link *link, const struct plan *plan, int64_t period_us,
                   struct plan_drive *drive, struct plan_reach *reach) {
    struct link_report report;
    do {
        (void)link->receive(link->context, &report);
    } while (report.status.state != SUPERVISOR_SAFE && report.time_us < READY_WITHIN_US);
    const int64_t start_us = (sim->sim.time_us / period_us + 1) * period_us;
    const int64_t end_us = start_us + (int64_t)(1e6 * plan_length_s(plan));
    while (sim->sim.time_us < end_us) {
        const int64_t now_us = sim->sim.time_us;
        if (now_us >= start_us && now_us % REPEAT_US == 0) {
            struct controller_command command;
            plan_command_at(plan, 1e-6 * (double)(now_us - start_us), &command);
            (void)link->send(link->context, &command);
        }
        (void)link->receive(link->context, &report);
        note_reach(sim, reach);
        if (drive != NULL && sim->sim.time_us >= start_us && sim->sim.time_us % period_us == 0) {
            note_duty(sim, drive);
        }
    }
    return report.status.state != SUPERVISOR_BOOT;
}

static bool drive_open(struct plan_drive *drive, size_t periods) {
    drive->periods = 0;
    drive->duty = calloc(3 * periods, sizeof *drive->duty);
    return drive->duty != NULL;
}

bool plan_drive_follow(const struct plan_bench *bench, const struct gap_model *model, const struct plan *plan,
                       struct plan_drive *drive, struct plan_reach *reach) {
    const int64_t period_us = bench->nominal.valve.period_us;
    struct sim_link *sim = calloc(1, sizeof *sim);
    struct link link;
    *reach = (struct plan_reach){.fault = false};
    const bool sound =
        sim != NULL &&
        (drive == NULL || drive_open(drive, (size_t)(1e6 * plan_length_s(plan) / (double)period_us) + 8));
    if (sound) {
        open_loop_of(bench, model, sim, &link);
        reach->fault = !follow(sim, &link, plan, period_us, drive, reach) || reach->fault;
    }
    free(sim);
    return sound;
}

bool plan_drive_record(const struct plan_bench *bench, const struct gap_run *run, struct plan_drive *drive) {
    const double period_s = 1e-6 * (double)bench->nominal.valve.period_us;
    const double first_s = run->time_s[0], length_s = run->time_s[run->rows - 1] - first_s;
    const size_t periods = (size_t)(length_s / period_s) + 1;
    size_t row = 0;
    if (!run->has_duty || !drive_open(drive, periods)) {
        return false;
    }
    for (; drive->periods < periods; drive->periods++) {
        const double now_s = first_s + ((double)drive->periods + 1e-3) * period_s;
        while (row + 1 < run->rows && run->time_s[row + 1] <= now_s) {
            row++;
        }
        memcpy(drive->duty + 3 * drive->periods, run->duty + 3 * row, 3 * sizeof *drive->duty);
    }
    return true;
}

void plan_drive_free(struct plan_drive *drive) {
    free(drive->duty);
    *drive = (struct plan_drive){.periods = 0};
}

/* --- from the duties --- */

static int64_t sample_us(void) {
    return llround(1e6 * PLAN_SAMPLE_S);
}

size_t plan_drive_samples(const struct plan_bench *bench, const struct plan_drive *drive) {
    return (size_t)((int64_t)drive->periods * bench->nominal.valve.period_us / sample_us());
}

bool plan_trace_open(struct plan_trace *trace, size_t samples) {
    trace->samples = samples;
    trace->pressure_pa = calloc(6 * samples + 1, sizeof *trace->pressure_pa);
    trace->reading_pa = trace->pressure_pa == NULL ? NULL : trace->pressure_pa + 3 * samples;
    return trace->pressure_pa != NULL;
}

void plan_trace_close(struct plan_trace *trace) {
    free(trace->pressure_pa);
    *trace = (struct plan_trace){.samples = 0};
}

static void set_up_plant(const struct plan_bench *bench, const struct gap_model *model, struct plant *plant) {
    struct plant_parameters parameters;
    apply_nominal(bench, model, &parameters);
    plant_init(plant, bench->table, &parameters);
    for (size_t e = 0; e < model->count; e++) {
        (void)plant_add_effect(plant, &model->effect[e]);
    }
}

void plan_trace_run(const struct plan_bench *bench, const struct gap_model *model,
                    const struct plan_drive *drive, struct plan_trace *trace) {
    const int64_t period_us = bench->nominal.valve.period_us, block_us = sample_us();
    struct plant plant;
    set_up_plant(bench, model, &plant);
    for (size_t i = 0; i < trace->samples; i++) {
        double sum_pa[3] = {0.0, 0.0, 0.0};
        for (int64_t within_us = 0; within_us < block_us; within_us += STEP_US) {
            const int64_t from_us = (int64_t)i * block_us + within_us;
            if (from_us % period_us == 0) {
                plant_start_period(&plant, from_us, drive->duty + 3 * (from_us / period_us));
            }
            plant_step(&plant, true, from_us, from_us + STEP_US);
            for (size_t c = 0; c < 3; c++) {
                sum_pa[c] += fmax(plant.reading_pa[c], 0.0); /* as the converter clips it */
            }
        }
        for (size_t c = 0; c < 3; c++) {
            trace->pressure_pa[3 * i + c] = plant.pressure_pa[c];
            trace->reading_pa[3 * i + c] = sum_pa[c] * (double)STEP_US / (double)block_us;
        }
    }
}

void plan_poses(const struct plan_bench *bench, const struct gap_model *model, size_t samples,
                const double *pressure_pa, struct random_stream *chance, struct tip_pose *pose) {
    struct plant plant;
    set_up_plant(bench, model, &plant);
    for (size_t i = 0; i < samples; i++) {
        const double time_s = PLAN_SAMPLE_S * (double)(i + 1);
        plant_sample_tip(&plant, pressure_pa + 3 * i, time_s, PLAN_SAMPLE_S,
                         chance != NULL ? random_uniform(chance) : 1.0);
        pose[i] = plant.pose;
    }
}

void plan_rotation(const double from[4], const double to[4], double rotation[3]) {
    double back[4], turn[4];
    rotation_inverse(from, back);
    rotation_multiply(to, back, turn);
    const double sign = turn[0] < 0.0 ? -1.0 : 1.0;
    const double size = sqrt(turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]);
    const double factor = size > 1e-12 ? 2.0 * atan2(size, fabs(turn[0])) / size : 2.0;
    for (size_t k = 0; k < 3; k++) {
        rotation[k] = sign * factor * turn[1 + k];
    }
}
