#include "gap/close.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "link/sim_link.h"
#include "log/run_log.h"

#define READY_WITHIN_US 2000000
#define REPEAT_US 100000
#define SAMPLE_US 10000             /* errors are means over a PWM period, or taken at its end */
#define DIRECTION_FROM_RAD 0.087    /* 5 degrees: a tip that hardly bends has no direction */
#define DIRECTION_SEEN_RAD 0.035
#define GAP_LEAST 1.05              /* an error that is no more than this over that without gap is none */

/* --- the recorded command --- */

struct columns {
    int time, bend, direction, pressure[3];
};

static double cell(const struct run_log *log, size_t row, int column) {
    return column < 0 ? NAN : log->value[row * log->columns + (size_t)column];
}

static bool column_has_values(const struct run_log *log, int column) {
    bool any = false;
    for (size_t row = 0; row < log->rows && !any; row++) {
        any = !isnan(cell(log, row, column));
    }
    return any;
}

static bool column_varies(const struct run_log *log, int column) {
    double first = NAN;
    bool varies = false;
    for (size_t row = 0; row < log->rows && !varies; row++) {
        const double value = cell(log, row, column);
        first = isnan(first) ? value : first;
        varies = !isnan(value) && fabs(value - first) > 0.0;
    }
    return varies;
}

/* Rows without a bend are those between commands: vented. Pressures hold where a row leaves them out. */
static struct controller_command command_at(const struct close_recording *recording, const struct run_log *log,
                                            const struct columns *columns, size_t row,
                                            const struct controller_command *before) {
    struct controller_command command = {.kind = COMMAND_PRESSURE};
    if (recording->kind == CLOSE_BEND) {
        const double bend_rad = cell(log, row, columns->bend);
        command.kind = isnan(bend_rad) ? COMMAND_VENT : COMMAND_BEND;
        command.bend_rad = isnan(bend_rad) ? 0.0f : (float)bend_rad;
        command.direction_rad = isnan(bend_rad) ? 0.0f : (float)cell(log, row, columns->direction);
        return command;
    }
    for (size_t c = 0; c < 3; c++) {
        const double pressure_pa = cell(log, row, columns->pressure[c]);
        command.pressure_pa[c] = isnan(pressure_pa) ? before->pressure_pa[c] : (float)pressure_pa;
    }
    return command;
}

static bool same_command(const struct controller_command *a, const struct controller_command *b) {
    bool same = a->kind == b->kind && !(fabsf(a->bend_rad - b->bend_rad) > 0.0f) &&
                !(fabsf(a->direction_rad - b->direction_rad) > 0.0f);
    for (size_t c = 0; c < 3; c++) {
        same = same && !(fabsf(a->pressure_pa[c] - b->pressure_pa[c]) > 0.0f);
    }
    return same;
}

static void take_commands(struct close_recording *recording, const struct run_log *log, const struct columns *columns) {
    struct controller_command before = {.kind = COMMAND_NONE};
    /* on the grid of PWM periods, as the diagnosis counts time */
    recording->start_s = floor(cell(log, 0, columns->time) * 1e6 / SAMPLE_US) * SAMPLE_US * 1e-6;
    recording->duration_us = llround(1e6 * (cell(log, log->rows - 1, columns->time) - recording->start_s));
    for (size_t row = 0; row < log->rows; row++) {
        const struct controller_command command = command_at(recording, log, columns, row, &before);
        if (!same_command(&command, &before)) {
            recording->command[recording->count++] = (struct close_command){
                llround(1e6 * (cell(log, row, columns->time) - recording->start_s)), command};
        }
        before = command;
    }
}

/* Is there a command in it that can be followed? */
static bool find_kind(struct close_recording *recording, const struct run_log *log, const struct columns *columns,
                      const char *path, char *error, size_t error_bytes) {
    bool pressures = false;
    for (size_t c = 0; c < 3; c++) {
        pressures = pressures || column_has_values(log, columns->pressure[c]);
    }
    recording->kind = column_has_values(log, columns->bend) ? CLOSE_BEND : CLOSE_PRESSURE;
    if (recording->kind == CLOSE_PRESSURE && !pressures) {
        (void)snprintf(error, error_bytes,
                       "%s: no command was recorded: a closed loop needs the columns bend_cmd_rad and direction_cmd_rad, or "
                       "p1_cmd_pa to p3_cmd_pa",
                       path);
        return false;
    }
    for (size_t row = 0; row < log->rows && recording->kind == CLOSE_BEND; row++) {
        const bool bends = !isnan(cell(log, row, columns->bend));
        if (bends && isnan(cell(log, row, columns->direction))) {
            (void)snprintf(error, error_bytes,
                           "%s: column direction_cmd_rad: it is empty at %g s, where bend_cmd_rad is not: give both", path,
                           cell(log, row, columns->time));
            return false;
        }
    }
    return true;
}

bool close_recording_read(struct close_recording *recording, const char *path, char *error, size_t error_bytes) {
    struct run_log log;
    memset(recording, 0, sizeof *recording);
    if (!run_log_read(path, &log, error, error_bytes)) {
        return false;
    }
    const struct columns columns = {
        .time = run_log_column(&log, "time_s"),
        .bend = run_log_column(&log, "bend_cmd_rad"),
        .direction = run_log_column(&log, "direction_cmd_rad"),
        .pressure = {run_log_column(&log, "p1_cmd_pa"), run_log_column(&log, "p2_cmd_pa"),
                     run_log_column(&log, "p3_cmd_pa")}};
    bool taken = find_kind(recording, &log, &columns, path, error, error_bytes);
    recording->command = taken ? malloc(log.rows * sizeof *recording->command) : NULL;
    if (taken && recording->command == NULL) {
        (void)snprintf(error, error_bytes, "%s: out of memory", path);
        taken = false;
    }
    if (taken) {
        (void)snprintf(recording->module, sizeof recording->module, "%s", log.module);
        recording->supply_measured = column_varies(&log, run_log_column(&log, "supply_pa"));
        take_commands(recording, &log, &columns);
    }
    run_log_free(&log);
    return taken;
}

void close_recording_free(struct close_recording *recording) {
    free(recording->command);
    memset(recording, 0, sizeof *recording);
}

/* --- following it --- */

struct sums {
    double square[CLOSE_WINDOWS][CLOSE_QUANTITIES];
    double count[CLOSE_WINDOWS][CLOSE_QUANTITIES];
    uint32_t faults;
    bool never_ready;
};

struct job {
    const struct close_recording *recording;
    const struct bend_table *table;
    const struct calibration *calibration;
    const struct calibrated_controller *calibrated;
    enum close_variant variant;
    enum close_feedback feedback;
    uint64_t seed;
    int64_t measure_from_us;
    struct sums sums;
    bool room; /* for its effects */
};

/* A run under way. */
struct follower {
    struct job *job;
    struct sim_link link;
    struct link interface;
    struct link_report report;
    size_t next;          /* command to come */
    int64_t next_send_us;
    int64_t changed_us;   /* when the present command came */
    double pressure_pa[3]; /* summed since the last sample */
};

static void open_follower(struct follower *follower, struct job *job) {
    struct sim_link_setup setup;
    const bool gap = job->variant != CLOSE_WITHOUT_GAP;
    memset(follower, 0, sizeof *follower);
    follower->job = job;
    sim_link_default_setup(&setup, job->table, job->seed);
    if (gap) {
        calibration_scale_plant(job->calibration, &setup.sim.plant);
    }
    if (job->variant == CLOSE_AFTER) {
        setup.controller_table = &job->calibrated->table.table;
        setup.controller = job->calibrated->parameters;
    }
    sim_link_open_setup(&follower->link, &setup, &follower->interface);
    job->room = !gap || calibration_add_effects(job->calibration, job->recording->start_s, &follower->link.sim);
    follower->link.sim.faults.tip_stops = job->feedback == CLOSE_NO_TIP_SENSOR;
    follower->link.sim.faults.supply_unknown = !job->recording->supply_measured;
}

static const struct controller_command *present_command(const struct follower *follower) {
    return &follower->job->recording->command[follower->next - 1].command;
}

/* Send what is due. Before the controller is ready it refuses commands, as it did when the run was recorded. */
static void command(struct follower *follower) {
    const struct close_recording *recording = follower->job->recording;
    const int64_t now_us = follower->link.sim.time_us;
    const size_t before = follower->next;
    while (follower->next < recording->count && recording->command[follower->next].time_us <= now_us) {
        follower->next++;
    }
    const bool changed = follower->next != before;
    follower->changed_us = changed ? now_us : follower->changed_us;
    const enum supervisor_state state = follower->report.status.state;
    const bool listens = state != SUPERVISOR_BOOT && state != SUPERVISOR_SELFTEST; /* a stream from before is refused */
    if (listens && follower->next > 0 && (changed || now_us >= follower->next_send_us)) {
        follower->next_send_us = now_us + REPEAT_US;
        (void)follower->interface.send(follower->interface.context, present_command(follower));
    }
}

static void add(struct sums *sums, bool settled, enum close_quantity quantity, double error) {
    const enum close_window last = settled ? CLOSE_SETTLED : CLOSE_WHOLE;
    for (int w = CLOSE_WHOLE; w <= (int)last; w++) {
        sums->square[w][quantity] += error * error;
        sums->count[w][quantity] += 1.0;
    }
}

static void measure_bend(struct follower *follower, const struct controller_command *wanted, bool settled) {
    const struct body_shape *shape = &follower->link.sim.plant.shape; /* the true one, of the sample just taken */
    const double bend_rad = hypot(shape->bend_x_rad, shape->bend_y_rad);
    struct sums *sums = &follower->job->sums;
    add(sums, settled, CLOSE_BEND_RAD, bend_rad - (double)wanted->bend_rad);
    if ((double)wanted->bend_rad >= DIRECTION_FROM_RAD && bend_rad >= DIRECTION_SEEN_RAD) {
        const double direction_rad = atan2(shape->bend_y_rad, shape->bend_x_rad);
        add(sums, settled, CLOSE_DIRECTION_RAD, remainder(direction_rad - (double)wanted->direction_rad, 2.0 * M_PI));
    }
}

static void measure(struct follower *follower) {
    const struct sim *sim = &follower->link.sim;
    const struct controller_command *wanted = present_command(follower);
    const bool settled = sim->time_us - follower->changed_us >= (int64_t)(1e6 * CLOSE_SETTLED_S);
    if (sim->time_us < follower->job->measure_from_us) {
        return;
    }
    if (wanted->kind == COMMAND_BEND) {
        measure_bend(follower, wanted, settled);
    }
    for (size_t c = 0; c < 3 && wanted->kind == COMMAND_PRESSURE; c++) {
        const double mean_pa = follower->pressure_pa[c] * (double)CONTROLLER_STEP_US / (double)SAMPLE_US;
        add(&follower->job->sums, settled, CLOSE_PRESSURE_PA, mean_pa - (double)wanted->pressure_pa[c]);
    }
}

/* One control step; errors are looked at at the end of each PWM period. */
static void step(struct follower *follower) {
    const struct sim *sim = &follower->link.sim;
    command(follower);
    (void)follower->interface.receive(follower->interface.context, &follower->report);
    for (size_t c = 0; c < 3; c++) {
        follower->pressure_pa[c] += sim->plant.pressure_pa[c];
    }
    if (sim->time_us % SAMPLE_US == 0) {
        const enum supervisor_state state = follower->report.status.state;
        if ((state == SUPERVISOR_ACTIVE || state == SUPERVISOR_HOLD) && follower->next > 0) {
            measure(follower);
        }
        memset(follower->pressure_pa, 0, sizeof follower->pressure_pa);
    }
}

static void run_job(struct job *job, struct follower *follower) {
    open_follower(follower, job);
    const int64_t end_us = job->recording->duration_us;
    bool ready = false, faulted = false;
    for (int64_t time_us = 0; job->room && time_us < end_us && !faulted; time_us += CONTROLLER_STEP_US) {
        step(follower);
        const enum supervisor_state state = follower->report.status.state;
        faulted = state == SUPERVISOR_FAULT;
        ready = ready || (state != SUPERVISOR_BOOT && state != SUPERVISOR_SELFTEST && state != SUPERVISOR_FAULT);
    }
    job->sums.faults = follower->report.status.faults;
    job->sums.never_ready = !ready && end_us > READY_WITHIN_US;
    follower->interface.close(follower->interface.context);
}

/* --- together --- */

static void take_figure(struct close_figure *figure, const struct job *jobs, size_t seeds, int window, int quantity) {
    double sum = 0.0, squares = 0.0;
    for (size_t s = 0; s < seeds; s++) {
        const struct sums *sums = &jobs[s].sums;
        if (sums->count[window][quantity] > 0.0) {
            const double rms = sqrt(sums->square[window][quantity] / sums->count[window][quantity]);
            sum += rms;
            squares += rms * rms;
            figure->seeds++;
        }
    }
    const double n = (double)figure->seeds;
    figure->mean = n > 0.0 ? sum / n : NAN;
    figure->spread = n > 1.0 ? sqrt(fmax(squares - n * figure->mean * figure->mean, 0.0) / (n - 1.0)) : 0.0;
}

static void take_result(struct close_result *result, const struct job *jobs, size_t seeds) {
    const size_t f = (size_t)jobs->feedback, v = (size_t)jobs->variant;
    for (int window = 0; window < CLOSE_WINDOWS; window++) {
        for (int quantity = 0; quantity < CLOSE_QUANTITIES; quantity++) {
            take_figure(&result->figure[f][window][quantity][v], jobs, seeds, window, quantity);
        }
    }
    for (size_t s = 0; s < seeds; s++) {
        result->faults[f][v] |= jobs[s].sums.faults;
        result->never_ready[f][v] = result->never_ready[f][v] || jobs[s].sums.never_ready;
    }
}

/* All of them, spread over the cores. False: out of memory. */
static bool run_jobs(struct job *jobs, size_t count) {
    bool sound = true;
#pragma omp parallel for schedule(dynamic) reduction(&& : sound)
    for (size_t j = 0; j < count; j++) {
        struct follower *follower = malloc(sizeof *follower);
        if (follower != NULL) {
            run_job(&jobs[j], follower);
        }
        sound = sound && follower != NULL && jobs[j].room;
        free(follower);
    }
    return sound;
}

bool close_run(struct close_result *result, const struct close_recording *recording, const struct bend_table *table,
               const struct calibration *calibration, const struct calibrated_controller *calibrated, size_t seeds,
               char *error, size_t error_bytes) {
    /* pressure commands make no use of the tip sensor */
    const size_t feedbacks = recording->kind == CLOSE_BEND ? CLOSE_FEEDBACKS : 1;
    const size_t count = feedbacks * CLOSE_VARIANTS * seeds;
    struct job *jobs = calloc(count, sizeof *jobs);
    memset(result, 0, sizeof *result);
    result->measured_from_s = fmax(calibration_onset_s(calibration), recording->start_s);
    for (size_t j = 0; j < count && jobs != NULL; j++) {
        jobs[j] = (struct job){.recording = recording,
                               .table = table,
                               .calibration = calibration,
                               .calibrated = calibrated,
                               .feedback = (enum close_feedback)(j / seeds / CLOSE_VARIANTS),
                               .variant = (enum close_variant)(j / seeds % CLOSE_VARIANTS),
                               .seed = 1 + j % seeds,
                               .measure_from_us = llround(1e6 * (result->measured_from_s - recording->start_s))};
    }
    const bool sound = jobs != NULL && run_jobs(jobs, count);
    for (size_t j = 0; j < count && sound; j += seeds) {
        take_result(result, &jobs[j], seeds);
    }
    free(jobs);
    if (!sound) {
        (void)snprintf(error, error_bytes, "out of memory for the simulation");
    }
    return sound;
}

double close_share(const struct close_figure figure[CLOSE_VARIANTS]) {
    const double before = figure[CLOSE_BEFORE].mean, after = figure[CLOSE_AFTER].mean;
    const double without = figure[CLOSE_WITHOUT_GAP].mean;
    const bool gap = before > GAP_LEAST * without;
    return gap ? (before * before - after * after) / (before * before - without * without) : NAN;
}
