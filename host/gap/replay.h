/* The chain replayed on the logged inputs, one stage at a time.
 *
 *   r1  pressure readings, simulated from the logged duties
 *   r2  tip pose, simulated from the measured pressures: what r1's replay says, corrected by the smoothed difference
 *   r3  tip pose, simulated from the duties alone
 *
 * Residuals are measured minus simulated, averaged over short blocks, then divided by what noise alone would make of such
 * a block. Layout of a vector of residuals, run by run: pressure blocks x 3 chambers, supply blocks, tip blocks x 6
 * (position, then rotation vector). A weight of zero: nothing was measured there. */
#ifndef TRIBEND_GAP_REPLAY_H
#define TRIBEND_GAP_REPLAY_H

#include <stdint.h>

#include "gap/gap_data.h"
#include "gap/gap_model.h"
#include "gap/smoother.h"

#define REPLAY_TIP_CHANNELS 6
#define REPLAY_STEP_US 2000           /* of the gas; valves switch in between, where they do */
#define REPLAY_COARSE_STEP_US 5000
#define REPLAY_PRESSURE_BLOCK_S 0.02  /* two PWM periods */
#define REPLAY_TIP_BLOCK_S 0.05

struct replay_run {
    const struct gap_run *run;
    int64_t start_us;
    size_t steps;           /* of the replay's step */
    size_t blocks;          /* of pressure */
    size_t tip_blocks;
    size_t pressure_at;     /* where its residuals start in the vector */
    size_t supply_at;
    size_t tip_at;
    double initial_pa[3];
    double reading_noise_pa;
    double supply_noise_pa;
    double tip_noise[2];    /* m, rad: of one sample */
    uint32_t *row_step;     /* [rows] the step that ends at or after the row */
    struct smoother smoother[3];
    bool duty_from_next_period; /* a duty in the row of a period's start counts for the period after it */
    double *variance;       /* [3 * blocks] of a block's mean reading, Pa^2; infinite: none */
    size_t picks;
    uint32_t *pick;         /* [picks] the tip sample in the middle of each block that has any */
};

/* Another simulator as the baseline (gap/replay_elsewhere.h): how our table model compares. */
struct replay_elsewhere {
    double stiffness_scale; /* with which it moves most like the other simulator; 1 while that is not known */
    double apart_m;         /* rms, about the mean, that is then left between the two tips .. */
    double moves_m;         /* .. while the other's moves by so much about its mean */
};

/* Residuals are judged apart by what was measured: pressures with the supply, and the tip. */
enum fit_group { FIT_PRESSURE, FIT_TIP, FIT_GROUPS };

struct replay {
    const struct gap_data *data;
    const struct bend_table *table;
    struct plant_parameters nominal;
    size_t runs;
    struct replay_run run[GAP_RUNS_MAX];
    size_t residuals;
    int64_t step_us;
    bool coarse;       /* longer steps, and of each tip block one sample: see replay_open_coarse() */
    bool rigid;        /* pressures are as the duties make them, but for a constant: the tip then tells of them finest */
    double *weight;    /* [residuals] 1 / (noise of a block) */
    /* What noise may at most make of a mean square by neighbours' differences: twice what it makes where nothing pulses, by their
     * median. What differs by more is an error that alternates, as that of a pulse's timing does. Infinite without duties. */
    double noise_most[FIT_GROUPS];
    uint8_t *held_out; /* [residuals] 1: not used to fit */
    struct replay_elsewhere elsewhere;
    double *lasting;   /* [residuals] share of a block's noise that its neighbours have too; see noise_floor.h */
    uint8_t *apart;    /* [residuals] 1: its difference from the block before says nothing of the noise; see noise_floor.h */
};

/* What a replay of one model leaves behind; one for each thread. */
struct replay_state {
    double **pressure_pa; /* [run][3 * (steps + 1)] true pressures at the end of each step, from duties */
    double **difference;  /* [run][3 * blocks] reading less simulated, block means, Pa */
    double **supply;      /* [run][blocks] the same of the supply */
    double **correction;  /* [run][3 * blocks] smoothed difference */
};

/* `data` and `table` are kept by pointer. Finds noise levels and smoothing on the nominal model. False: out of memory. */
bool replay_open(struct replay *replay, const struct gap_data *data, const struct bend_table *table,
                 const struct plant_parameters *nominal);
/* The same of some of the cost, for differences between models: what a model's change does is told by a coarse replay of
 * both, and added to a fine replay of one (the additive correction of Kennedy and O'Hagan 2000). False: out of memory. */
bool replay_open_coarse(struct replay *coarse, const struct replay *fine);
/* Weights, smoothing and timing of the fine one, which may have been tuned since. */
void replay_follow(struct replay *coarse, const struct replay *fine);
void replay_close(struct replay *replay);
bool replay_state_open(struct replay_state *state, const struct replay *replay);
void replay_state_close(struct replay_state *state, const struct replay *replay);

/* Pressures under `model` from the duties (or, without duties, from the readings). */
void replay_pressures(const struct replay *replay, const struct gap_model *model, struct replay_state *state);
/* What the sensors show of the state's pressures under `model`; the pressures stay. For runs with duties. */
void replay_readings(const struct replay *replay, const struct gap_model *model, struct replay_state *state);
/* Smooth the differences again. */
void replay_correct(const struct replay *replay, struct replay_state *state);
/* Tip residuals into `residual`, from the state's pressures; `from_duties`: r3 instead of r2. */
void replay_tip(const struct replay *replay, const struct gap_model *model, const struct replay_state *state,
                bool from_duties, double *residual);
/* Does the model ask for every tip sample, in a coarse replay too? */
bool replay_needs_samples(const struct replay *replay, const struct gap_model *model);
/* Pressure and supply residuals of the state into `residual`. */
void replay_take_pressures(const struct replay *replay, const struct replay_state *state, double *residual);
/* Once, on the nominal model: when the logged duties count, then as replay_tune(). */
bool replay_prepare(struct replay *replay, const struct gap_model *model, struct replay_state *state);
/* How freely the measured pressure may wander about the simulated one, and the weights that follow from it. */
bool replay_tune(struct replay *replay, const struct gap_model *model, struct replay_state *state);

#endif
