/* What an experiment would show under a model of the module: the controller drives the module on the bench,
 * and each model says what the sensors then read. All without noise. */
#ifndef TRIBEND_GAP_PLAN_PREDICT_H
#define TRIBEND_GAP_PLAN_PREDICT_H

#include "gap/gap_data.h"
#include "gap/gap_model.h"
#include "plan/plan.h"
#include "sim/random.h"

#define PLAN_SAMPLE_S 0.02 /* of predictions: two PWM periods */
#define PLAN_CHANNELS 9    /* three pressures, position, rotation vector */

struct plan_bench {
    const struct bend_table *table;
    struct plant_parameters nominal;
};

/* The duties of every PWM period. */
struct plan_drive {
    size_t periods;
    double *duty; /* [3 * periods] */
};

/* How far an experiment went. */
struct plan_reach {
    double bend_rad;
    double pressure_pa; /* true */
    bool fault;         /* the controller latched one */
};

/* What the gas does under a model and a drive. */
struct plan_trace {
    size_t samples;
    double *pressure_pa; /* [3 * samples] true, at the end of a sample */
    double *reading_pa;  /* [3 * samples] shown, mean over a sample */
};

/* The plan followed in closed loop by a module that is `model`. `drive` may be NULL: only the reach is
 * wanted. False: out of memory. */
bool plan_drive_follow(const struct plan_bench *bench, const struct gap_model *model, const struct plan *plan,
                       struct plan_drive *drive, struct plan_reach *reach);
/* The duties that a run logged. False: it has none, or out of memory. */
bool plan_drive_record(const struct plan_bench *bench, const struct gap_run *run, struct plan_drive *drive);
void plan_drive_free(struct plan_drive *drive);

/* A trace of so many samples, and what the model makes of a drive, written into it. False: out of memory. */
size_t plan_drive_samples(const struct plan_bench *bench, const struct plan_drive *drive);
bool plan_trace_open(struct plan_trace *trace, size_t samples);
void plan_trace_close(struct plan_trace *trace);
void plan_trace_run(const struct plan_bench *bench, const struct gap_model *model,
                    const struct plan_drive *drive, struct plan_trace *trace);

/* Poses [samples] that the tip sensor shows at these true pressures. `chance` NULL: nothing happens by
 * chance. */
void plan_poses(const struct plan_bench *bench, const struct gap_model *model, size_t samples,
                const double *pressure_pa, struct random_stream *chance, struct tip_pose *pose);
/* Rotation vector of `to` times the inverse of `from`. */
void plan_rotation(const double from[4], const double to[4], double rotation[3]);

#endif
