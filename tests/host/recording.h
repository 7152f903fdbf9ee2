/* Recordings of the simulated module under its controller, as a diagnosis reads them, with effects that the test knows. Header
 * only: the model's tests do not link the plant. */
#ifndef TRIBEND_TEST_RECORDING_H
#define TRIBEND_TEST_RECORDING_H

#include <stdlib.h>
#include <unistd.h>

#include "gap/gap_data.h"
#include "link/sim_link.h"
#include "log/run_log.h"
#include "program/table_file.h"
#include "support/scratch.h"
#include "support/test.h"

#define RECORDING_TABLE "tables/paper-semicircle.tbt"
#define RECORDING_EFFECTS 3
#define RECORDING_RUNS_MAX 3
#define RECORDING_COMMAND_US 100000

/* What the module is like, and how long it is watched. */
struct recording {
    const char *effect[RECORDING_EFFECTS]; /* as for --effect; NULL: none */
    double stiffness_scale;                /* 0: one */
    double supply_scale;                   /* 0: one */
    double seconds;                        /* of each run */
    size_t runs;                           /* 0: one */
    uint64_t seed;                         /* of the sensors' noise; what is commanded is the same with each */
    bool silent;                           /* sensors without noise and steps */
    bool still;                            /* it stays vented throughout */
    bool one_chamber;                      /* only the first is ever filled */
};

static struct table_file recording_table; /* the reference table, between the group's set-up and tear-down */

static inline int recording_set_up(void **state) {
    (void)state;
    return table_file_open(&recording_table, RECORDING_TABLE, NULL);
}

static inline int recording_tear_down(void **state) {
    (void)state;
    table_file_close(&recording_table);
    return 0;
}

/* Each chamber to a random pressure every half second or so, in every fourth stretch to none. */
static inline void recording_draw(const struct recording *recording, struct random_stream *random,
                                  struct controller_command *command, int64_t *until_us) {
    const bool rest = random_uniform(random) < 0.25 || recording->still;
    *until_us += (int64_t)(1e6 * (0.5 + 0.5 * random_uniform(random)));
    *command = (struct controller_command){.kind = COMMAND_PRESSURE};
    for (size_t c = 0; c < 3; c++) {
        const double pressure_pa = 8000.0 * random_uniform(random);
        command->pressure_pa[c] = rest || (recording->one_chamber && c > 0) ? 0.0f : (float)pressure_pa;
    }
}

static inline void recording_open_link(const struct recording *recording, size_t run, struct sim_link *sim, struct link *link) {
    struct sim_link_setup setup;
    char error[512];
    sim_link_default_setup(&setup, &recording_table.table, 100 * recording->seed + run);
    setup.sim.plant.gas.stiffness_scale *= recording->stiffness_scale > 0.0 ? recording->stiffness_scale : 1.0;
    setup.sim.plant.supply_pa *= recording->supply_scale > 0.0 ? recording->supply_scale : 1.0;
    if (recording->silent) {
        struct sensor_parameters *sensor = &setup.sim.sensor;
        sensor->pressure_noise_pa = sensor->pressure_step_pa = 0.0;
        sensor->tip_position_noise_m = sensor->tip_position_step_m = 0.0;
        sensor->tip_angle_noise_rad = sensor->tip_angle_step_rad = 0.0;
    }
    sim_link_open_setup(sim, &setup, link);
    for (size_t e = 0; e < RECORDING_EFFECTS && recording->effect[e] != NULL; e++) {
        struct effect effect;
        if (!effect_parse(recording->effect[e], &effect, error, sizeof error) || !sim_add_effect(&sim->sim, &effect)) {
            fail_msg("%s: %s", recording->effect[e], error);
        }
    }
}

static inline void recording_write_run(const struct recording *recording, size_t run, const char *path) {
    static struct sim_link sim;
    struct link link;
    struct link_report report = {.time_us = 0};
    struct run_log_writer log;
    struct random_stream random;
    struct controller_command command = {.kind = COMMAND_VENT};
    char error[512];
    const struct run_log_metadata metadata = {.module = recording_table.table.module.name, .rate_hz = 1000.0, .note = ""};
    int64_t until_us = 1000000;
    recording_open_link(recording, run, &sim, &link);
    if (!run_log_create(&log, path, &metadata, error, sizeof error)) {
        fail_msg("%s", error);
    }
    random_seed(&random, 11 + run, 2);
    for (int64_t step = 0; step < llround(recording->seconds * 1000.0); step++) {
        if (report.time_us >= until_us) {
            recording_draw(recording, &random, &command, &until_us);
        }
        if (report.time_us % RECORDING_COMMAND_US == 0) {
            assert_true(link.send(link.context, &command));
        }
        assert_true(link.receive(link.context, &report));
        run_log_append(&log, &report, &command); /* every step: the duty of the last one before a period's start acts */
    }
    link.close(link.context);
    assert_int_equal(report.status.faults, 0); /* a sensor that lags is no broken valve */
    assert_int_equal(report.status.state, SUPERVISOR_ACTIVE);
    assert_true(run_log_finish(&log, error, sizeof error));
}

/* Records it and reads it back. Free with gap_data_free(). */
static inline void recording_take(const struct recording *recording, struct gap_data *data) {
    static char path[RECORDING_RUNS_MAX][SCRATCH_BYTES];
    const char *paths[RECORDING_RUNS_MAX];
    char error[512];
    const size_t runs = recording->runs > 0 ? recording->runs : 1;
    for (size_t i = 0; i < runs; i++) {
        const int file = scratch_file(path[i]);
        assert_true(file >= 0 && close(file) == 0);
        paths[i] = path[i];
        recording_write_run(recording, i, path[i]);
    }
    const bool read = gap_data_read(data, paths, runs, error, sizeof error);
    for (size_t i = 0; i < runs; i++) {
        (void)remove(path[i]);
    }
    if (!read) {
        fail_msg("%s", error);
    }
}

#endif
