#include "blind_run.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app.h"

#define PRESSURE_NOISE_PA 150.0
#define PRESSURE_RANGE_PA 50000.0
#define PRESSURE_STEP_PA (PRESSURE_RANGE_PA / 4095.0)
#define SUPPLY_NOISE_PA 30.0
#define TEMPERATURE_NOISE_K 0.05
#define TIP_POSITION_NOISE_M 2e-5
#define TIP_POSITION_STEP_M 1.1e-4
#define TIP_ANGLE_NOISE_RAD (0.012 * M_PI / 180.0)
#define TIP_ANGLE_STEP_RAD (0.022 * M_PI / 180.0)
#define STEPS_A_PERIOD (BLIND_PERIOD_US / BLIND_STEP_US)
#define GOOD_QUALITY 100

/* What stands behind the controller's seam. */
struct bench {
    const struct blind_rig *rig;
    struct blind_plant plant;
    struct blind_random noise;
    struct blind_random tip_noise;
    struct blind_record *record;
    struct blind_step *now;
    size_t tips_seen; /* handed to the controller */
};

static double stepped(double value, double step) {
    return step * floor(value / step + 0.5);
}

/* --- sensors --- */

static void read_sensors(struct bench *bench) {
    struct blind_step *now = bench->now;
    for (size_t c = 0; c < 3; c++) {
        const double clean = bench->plant.reading_pa[c];
        const double noisy = stepped(clean + PRESSURE_NOISE_PA * blind_normal(&bench->noise), PRESSURE_STEP_PA);
        now->clean_pa[c] = fmin(fmax(clean, 0.0), PRESSURE_RANGE_PA);
        now->reading_pa[c] = fmin(fmax(noisy, 0.0), PRESSURE_RANGE_PA);
    }
    now->supply_pa = bench->plant.state[3] + SUPPLY_NOISE_PA * blind_normal(&bench->noise);
    now->temperature_k = bench->plant.temperature_k + TEMPERATURE_NOISE_K * blind_normal(&bench->noise);
}

static void rotation_of(const double quaternion[4], double rotation_rad[3]) {
    const double sine = sqrt(quaternion[1] * quaternion[1] + quaternion[2] * quaternion[2] + quaternion[3] * quaternion[3]);
    const double angle = 2.0 * atan2(sine, quaternion[0]);
    for (int i = 0; i < 3; i++) {
        rotation_rad[i] = sine > 1e-12 ? quaternion[1 + i] / sine * angle : 0.0;
    }
}

static void note_tip(struct bench *bench, const struct blind_tip_sample *sample, size_t step) {
    struct blind_record *record = bench->record;
    struct blind_tip *tip = &record->tip[record->tips];
    double rotation[3];
    rotation_of(sample->pose.quaternion, rotation);
    tip->clean = sample->pose;
    for (int i = 0; i < 3; i++) {
        tip->position_m[i] =
            stepped(sample->pose.position_m[i] + TIP_POSITION_NOISE_M * blind_normal(&bench->tip_noise), TIP_POSITION_STEP_M);
        rotation[i] = stepped(rotation[i] + TIP_ANGLE_NOISE_RAD * blind_normal(&bench->tip_noise), TIP_ANGLE_STEP_RAD);
    }
    blind_quaternion_of_rotation(rotation, tip->quaternion);
    if (sample->repeated && record->tips > 0) {
        *tip = record->tip[record->tips - 1];
    }
    tip->step = step;
    record->tips++;
}

static void collect_tips(struct bench *bench, size_t step) {
    struct blind_tip_sample sample;
    while (blind_plant_next_tip(&bench->plant, &sample)) {
        note_tip(bench, &sample, step);
    }
}

/* --- the controller's seam --- */

static int64_t seam_time_us(void *context) {
    return ((const struct bench *)context)->plant.time_us;
}

static bool seam_read_pressures(void *context, struct hal_pressures *pressures) {
    const struct bench *bench = context;
    for (size_t c = 0; c < 3; c++) {
        pressures->chamber_pa[c] = (float)bench->now->reading_pa[c];
        pressures->chamber_ok[c] = true;
    }
    pressures->supply_pa = (float)bench->now->supply_pa;
    pressures->supply_ok = bench->rig->supply_read;
    return true;
}

static bool seam_read_tip(void *context, struct hal_tip_sample *sample) {
    struct bench *bench = context;
    if (bench->tips_seen == bench->record->tips) {
        return false;
    }
    const struct blind_tip *tip = &bench->record->tip[bench->tips_seen++];
    *sample = (struct hal_tip_sample){.measured_us = bench->plant.time_us - bench->plant.tip_age_us, .quality = GOOD_QUALITY};
    for (int i = 0; i < 3; i++) {
        sample->position_m[i] = (float)tip->position_m[i];
    }
    for (int i = 0; i < 4; i++) {
        sample->quaternion[i] = (float)tip->quaternion[i];
    }
    return true;
}

static bool seam_write_outputs(void *context, const struct hal_outputs *outputs) {
    struct bench *bench = context;
    for (size_t c = 0; c < 3; c++) {
        bench->plant.duty[c] = outputs->valves_enabled ? (double)outputs->duty[c] : 0.0;
    }
    return true;
}

/* --- who drives --- */

/* Which of the excitation's values holds. */
static size_t wish_at(const struct bench *bench, const struct blind_excitation *excitation) {
    const size_t at = (size_t)(bench->plant.time_us / BLIND_TARGET_US);
    return at < excitation->count ? at : excitation->count - 1;
}

static void shifted_target(const struct bench *bench, const struct blind_excitation *excitation, double target_pa[3]) {
    const size_t at = wish_at(bench, excitation);
    for (size_t c = 0; c < 3; c++) {
        const double wanted = excitation->target_pa[at][c];
        target_pa[c] = wanted > 0.0 ? fmax(wanted + bench->rig->target_shift_pa[c], 0.0) : 0.0;
    }
}

static void step_controller(struct bench *bench, struct app *app, const struct blind_excitation *excitation) {
    const bool begun = bench->plant.time_us >= (int64_t)(1e6 * BLIND_REST_S);
    if (begun && bench->plant.time_us % BLIND_TARGET_US == 0) {
        struct controller_command command = {.kind = COMMAND_PRESSURE};
        const struct blind_bend *bend = excitation->bend != NULL ? &excitation->bend[wish_at(bench, excitation)] : NULL;
        double target_pa[3];
        shifted_target(bench, excitation, target_pa);
        for (size_t c = 0; c < 3; c++) {
            command.pressure_pa[c] = (float)target_pa[c];
        }
        if (bend != NULL && bend->wanted) {
            command = (struct controller_command){.kind = COMMAND_BEND,
                                                  .bend_rad = (float)bend->bend_rad,
                                                  .direction_rad = (float)bend->direction_rad,
                                                  .co_contraction_pa = (float)bend->co_contraction_pa};
        }
        app_command(app, &command);
    }
    bench->record->faulted = !app_step(app) || bench->record->faulted;
    bench->now->state = app->controller.status.state;
    for (size_t c = 0; c < 3; c++) {
        bench->now->target_pa[c] = (double)app->controller.status.pressure_target_pa[c];
    }
}

static void step_duties(struct bench *bench, const struct blind_excitation *excitation) {
    double target_pa[3];
    shifted_target(bench, excitation, target_pa);
    bench->now->state = bench->plant.time_us >= (int64_t)(1e6 * BLIND_REST_S) ? SUPERVISOR_ACTIVE : SUPERVISOR_SAFE;
    for (size_t c = 0; c < 3; c++) {
        bench->plant.duty[c] = blind_holding_duty(target_pa[c]);
        bench->now->target_pa[c] = NAN;
    }
}

/* The plant's period that starts next takes what was written before its start. */
static void step_again(struct bench *bench, const struct blind_record *again, size_t step) {
    memcpy(bench->plant.duty, again->duty[step / STEPS_A_PERIOD + 1], sizeof bench->plant.duty);
}

/* --- the run --- */

static bool record_open(struct blind_record *record, const struct blind_rig *rig) {
    memset(record, 0, sizeof *record);
    record->steps = (size_t)llround(rig->seconds * 1e6 / BLIND_PERIOD_US) * STEPS_A_PERIOD;
    record->step = calloc(record->steps + 1, sizeof *record->step);
    record->duty = calloc(record->steps / STEPS_A_PERIOD + 2, sizeof *record->duty);
    record->tip = calloc(record->steps / (size_t)(rig->tip_period_us / BLIND_STEP_US) + 64, sizeof *record->tip);
    return record->step != NULL && record->duty != NULL && record->tip != NULL;
}

void blind_record_close(struct blind_record *record) {
    free(record->step);
    free(record->duty);
    free(record->tip);
    memset(record, 0, sizeof *record);
}

static double temperature_at(const struct blind_rig *rig, double time_s) {
    return rig->warming_k[0] + rig->warming_k[1] * (1.0 - exp(-time_s / rig->warming_k[2]));
}

static void bench_open(struct bench *bench, const struct blind_rig *rig, struct blind_field *field,
                       struct blind_effect *const *effect, size_t effects, struct blind_record *record) {
    memset(bench, 0, sizeof *bench);
    bench->rig = rig;
    bench->record = record;
    blind_random_open(&bench->noise, rig->seed, "pressure noise", 0);
    blind_random_open(&bench->tip_noise, rig->seed, "tip noise", 0);
    for (size_t i = 0; i < effects; i++) {
        blind_effect_reset(effect[i], rig->seed);
    }
    blind_plant_init(&bench->plant, field, &rig->nominal, effect, effects);
    bench->plant.temperature_k = temperature_at(rig, 0.0);
    blind_plant_sample_tip(&bench->plant, rig->tip_period_us, rig->tip_phase_us);
}

bool blind_run(const struct blind_rig *rig, struct blind_field *field, struct blind_effect *const *effect, size_t effects,
               const struct blind_excitation *excitation, const struct blind_record *again, struct blind_record *record) {
    struct bench bench;
    struct app app;
    struct controller_parameters parameters;
    if (!record_open(record, rig)) {
        return false;
    }
    bench_open(&bench, rig, field, effect, effects, record);
    const struct hal hal = {.context = &bench,
                            .time_us = seam_time_us,
                            .read_pressures = seam_read_pressures,
                            .read_tip = seam_read_tip,
                            .write_outputs = seam_write_outputs};
    controller_default_parameters(&parameters, field->table);
    parameters.tip_period_us = rig->tip_period_us;
    app_init(&app, &hal, field->table, &parameters);
    for (size_t step = 0; step <= record->steps && !bench.plant.failed; step++) {
        bench.now = &record->step[step];
        bench.plant.temperature_k = temperature_at(rig, blind_time_s(&bench.plant));
        collect_tips(&bench, step);
        read_sensors(&bench);
        if (rig->drive == BLIND_DRIVE_CONTROLLER) {
            step_controller(&bench, &app, excitation);
        } else if (rig->drive == BLIND_DRIVE_DUTIES) {
            step_duties(&bench, excitation);
        } else {
            step_again(&bench, again, step);
        }
        blind_plant_step(&bench.plant);
        if (bench.plant.time_us % BLIND_PERIOD_US == 0) {
            memcpy(record->duty[bench.plant.time_us / BLIND_PERIOD_US], bench.plant.duty, sizeof record->duty[0]);
        }
    }
    record->measure = bench.plant.measure;
    record->bend_most_rad = bench.plant.bend_most_rad;
    record->load_most_pa = bench.plant.load_most_pa;
    return !bench.plant.failed;
}
