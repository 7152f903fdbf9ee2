/* What a diagnosis reads of a run log: the columns that it can use, by row, and the tip samples. SI units. */
#ifndef TRIBEND_GAP_DATA_H
#define TRIBEND_GAP_DATA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define GAP_RUNS_MAX 64
#define GAP_PATH_BYTES 256
#define GAP_TIP_AGE_S 0.010 /* a pose is this old in the row in which it arrives (nominal sensor) */

struct gap_tip {
    double time_s;        /* when the pose was true: the row's time less the sensor's nominal age */
    double position_m[3];
    double quaternion[4]; /* w, x, y, z; NAN where only the position was measured */
    bool repeated;        /* the same words as the sample before .. */
    bool telling;         /* .. which is then no coincidence: the tip moves, or the log shows finer steps than its noise */
};

/* The tip in the base frame; the quaternion NAN where only the position is known. */
struct gap_pose {
    double position_m[3];
    double quaternion[4];
};

struct gap_simulator;

struct gap_run {
    char path[GAP_PATH_BYTES];
    size_t header_line;    /* in the file */
    uint64_t table_hash;   /* of the table that the controller had; 0: the log does not say */
    size_t rows;
    double *time_s;
    double *duty;          /* [rows * 3]; holds from its row on */
    double *reading_pa;    /* [rows * 3]; NAN where not measured */
    double *command_pa;    /* [rows * 3] */
    bool *cut;             /* [rows]; the controller de-energises all coils in this row, inside a period too */
    size_t breaks;         /* how often the recording breaks off and goes on elsewhere .. */
    size_t *break_row;     /* [breaks] .. and the rows from which on it does */
    double *supply_pa;     /* [rows] */
    double *temperature_k; /* [rows] */
    bool has_duty;         /* pressures can be simulated without the readings: from duties, or they are another simulator's */
    bool has_reading;
    bool has_command;
    bool has_supply;       /* measured: it is not one constant value */
    bool has_temperature;
    bool has_orientation;
    size_t tips;
    struct gap_tip *tip;
    size_t tips_skipped;   /* with a status bit set, or a quaternion that is none */
    struct gap_simulator *simulator; /* another simulator's columns (gap/baseline.h); NULL: there are none */
    /* Only while another simulator is the baseline: */
    double *sim_pa;            /* [rows * 3] its chamber pressures, without holes; NULL: it gives none */
    struct gap_pose *sim_tip;  /* [tips] its pose at each tip sample; NULL: it gives none */
    size_t rows_without_sim;   /* rows with a measured pressure, and .. */
    size_t tips_without_sim;   /* .. tip samples, where it says nothing: they are left out */
    bool sim_is_copy;          /* its pressures are the measured ones again, and count as none */
    bool sim_as_shown;         /* its poses are as old as the sensor's in the same row */
};

struct gap_data {
    size_t runs;
    struct gap_run run[GAP_RUNS_MAX];
    char module[256];
    bool from_simulator; /* the baseline is another simulator's output: gap_baseline_use() */
};

/* Reads the logs; the baseline is our own replay. False: `error` names file, line, column and remedy. */
bool gap_data_read(struct gap_data *data, const char *const *paths, size_t count, char *error, size_t error_bytes);
/* Samples that repeat the one before, among those where a repeat is no coincidence, over all runs. */
struct gap_repeats {
    double onset_s;  /* hardly any came before, in any run; 0: from the start */
    double share;    /* of the samples since then */
    double samples;  /* since then */
    double run_samples; /* how long repeats go on, mean */
};
struct gap_repeats gap_data_repeats(const struct gap_data *data);
void gap_data_free(struct gap_data *data);
/* Seconds from the first row to the last, over all runs. */
double gap_data_duration_s(const struct gap_data *data);

#endif
