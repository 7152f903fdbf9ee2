#include "gap/calibration_use.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Half the width over which the catalogue's dead band gives way: a pulse this much longer surely opens the valve. */
#define DEAD_BAND_MARGIN 0.005
#define SPECTRUM_SPREAD 6.0 /* of the time constants of creep's form 1 */
#define TIP_LATE_MOST_S 0.045
#define LAMINAR_REFERENCE_PA 10000.0 /* difference at which line_resistance's form 1 has the share of its parameter */

/* --- the simulated module --- */

void calibration_scale_plant(const struct calibration *calibration, struct plant_parameters *plant) {
    plant->gas.stiffness_scale *= calibration->stiffness_scale;
    plant->supply_pa *= calibration->supply_scale;
}

bool calibration_add_effects(const struct calibration *calibration, double start_s, struct sim *sim) {
    for (size_t e = 0; e < calibration->effects; e++) {
        struct effect effect = calibration->effect[e];
        effect.onset_s = fmax(effect.onset_s - start_s, 0.0);
        if (!sim_add_effect(sim, &effect)) {
            return false;
        }
    }
    return true;
}

/* --- the controller --- */

/* What the effects of a calibration change. */
struct knowledge {
    struct calibrated_controller *controller;
    struct controller_calibration *calibration;
    struct table_scales scales;
    double working_pressure_pa;
    double supply_pa;
};

typedef void (*effect_use)(struct knowledge *knowledge, const struct effect *effect);

static void note(struct calibrated_controller *controller, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
static void note(struct calibrated_controller *controller, const char *format, ...) {
    va_list arguments;
    if (controller->notes == CALIBRATION_NOTES_MAX) {
        return;
    }
    va_start(arguments, format);
    (void)vsnprintf(controller->note[controller->notes++], CALIBRATION_NOTE_BYTES, format, arguments);
    va_end(arguments);
}

static bool acts_on(const struct effect *effect, size_t c) {
    return effect->chamber == 0 || effect->chamber == c + 1;
}

static void use_dead_time(struct knowledge *knowledge, const struct effect *effect) {
    for (size_t c = 0; c < 3; c++) {
        knowledge->calibration->valve_late_us[c] += acts_on(effect, c) ? llround(1e6 * effect->parameter[0]) : 0;
    }
}

static void use_dead_band(struct knowledge *knowledge, const struct effect *effect) {
    const double least = effect->parameter[0], lost = effect->parameter[1] * least;
    for (size_t c = 0; c < 3; c++) {
        if (acts_on(effect, c) && least > 0.0) {
            knowledge->calibration->least_duty[c] = (float)(least + DEAD_BAND_MARGIN);
            knowledge->calibration->lost_duty[c] = (float)lost;
        }
    }
}

static void scale_flow(struct knowledge *knowledge, const struct effect *effect, double fill, double vent) {
    for (size_t c = 0; c < 3; c++) {
        knowledge->calibration->fill_scale[c] *= acts_on(effect, c) ? (float)fill : 1.0f;
        knowledge->calibration->vent_scale[c] *= acts_on(effect, c) ? (float)vent : 1.0f;
    }
}

static void use_flow(struct knowledge *knowledge, const struct effect *effect) {
    scale_flow(knowledge, effect, effect->parameter[0], effect->parameter[0]);
}

/* The share that a valve and a laminar tube in series let pass of the valve's flow alone, flow being what squared is the
 * valve's drop: x^2 + r x = difference, r from the share at LAMINAR_REFERENCE_PA (Hagen and Poiseuille). */
static double laminar_share(double share, double difference_pa) {
    const double r = sqrt(LAMINAR_REFERENCE_PA) * (1.0 - share * share) / share;
    return 0.5 * (sqrt(r * r + 4.0 * difference_pa) - r) / sqrt(difference_pa);
}

/* Form 1, a laminar tube, by its shares at half the working pressure. */
static void use_resistance(struct knowledge *knowledge, const struct effect *effect) {
    const double middle_pa = 0.5 * knowledge->working_pressure_pa, share = effect->parameter[0];
    if (effect->form == 0) {
        use_flow(knowledge, effect);
    } else {
        scale_flow(knowledge, effect, laminar_share(share, knowledge->supply_pa - middle_pa),
                   laminar_share(share, middle_pa));
    }
}

static void use_volume(struct knowledge *knowledge, const struct effect *effect) {
    for (size_t c = 0; c < 3; c++) {
        knowledge->calibration->extra_volume_m3[c] += acts_on(effect, c) ? (float)effect->parameter[0] : 0.0f;
    }
}

static void use_leak(struct knowledge *knowledge, const struct effect *effect) {
    struct plant_parameters nominal;
    plant_default_parameters(&nominal);
    const float scale = (float)(effect->parameter[0] / nominal.gas.sonic_conductance);
    for (size_t c = 0; c < 3; c++) {
        knowledge->calibration->leak_scale[c] += acts_on(effect, c) ? scale : 0.0f;
    }
}

static void use_offset(struct knowledge *knowledge, const struct effect *effect) {
    for (size_t c = 0; c < 3; c++) {
        knowledge->calibration->reading_offset_pa[c] += acts_on(effect, c) ? (float)effect->parameter[0] : 0.0f;
    }
}

/* On what an offset before it has left. */
static void use_gain(struct knowledge *knowledge, const struct effect *effect) {
    for (size_t c = 0; c < 3; c++) {
        const float gain = acts_on(effect, c) ? (float)effect->parameter[0] : 1.0f;
        knowledge->calibration->reading_gain[c] *= gain;
        knowledge->calibration->reading_offset_pa[c] *= gain;
    }
}

static void use_lag(struct knowledge *knowledge, const struct effect *effect) {
    for (size_t c = 0; c < 3; c++) {
        knowledge->calibration->reading_lag_s[c] += acts_on(effect, c) ? (float)effect->parameter[0] : 0.0f;
    }
}

static void use_asymmetry(struct knowledge *knowledge, const struct effect *effect) {
    knowledge->scales.gain[effect->chamber - 1] *= effect->parameter[0];
    knowledge->scales.azimuth_rad[effect->chamber - 1] += effect->parameter[1];
}

static void use_restraint(struct knowledge *knowledge, const struct effect *effect) {
    knowledge->scales.active_fraction *= effect->parameter[0];
}

static void add_creep(struct knowledge *knowledge, double share, double time_s) {
    struct controller_calibration *calibration = knowledge->calibration;
    for (size_t k = 0; k < CALIBRATION_CREEP_TERMS; k++) {
        if (!(calibration->creep_share[k] > 0.0f)) {
            calibration->creep_share[k] = (float)share;
            calibration->creep_time_s[k] = (float)time_s;
            return;
        }
    }
    note(knowledge->controller, "creep: the controller follows %u time constants and leaves out that of %g s",
         CALIBRATION_CREEP_TERMS, time_s);
}

static void use_creep(struct knowledge *knowledge, const struct effect *effect) {
    const double share = effect->parameter[0], time_s = effect->parameter[1];
    if (effect->form == 0) {
        add_creep(knowledge, share, time_s);
    } else {
        for (int k = -1; k <= 1; k++) {
            add_creep(knowledge, share / 3.0, time_s * pow(SPECTRUM_SPREAD, k));
        }
    }
}

static void add3(float *to, const struct effect *effect) {
    for (size_t i = 0; i < 3; i++) {
        to[i] += (float)effect->parameter[i];
    }
}

static void use_tip_offset(struct knowledge *knowledge, const struct effect *effect) {
    add3(knowledge->calibration->tip_offset_m, effect);
}

static void use_tip_arm(struct knowledge *knowledge, const struct effect *effect) {
    add3(knowledge->calibration->tip_arm_m, effect);
}

static void use_tip_angle(struct knowledge *knowledge, const struct effect *effect) {
    struct controller_calibration *calibration = knowledge->calibration;
    add3(effect->form == 0 ? calibration->tip_mount_rad : calibration->tip_frame_rad, effect);
}

static void use_tip_latency(struct knowledge *knowledge, const struct effect *effect) {
    if (effect->parameter[0] > TIP_LATE_MOST_S) {
        note(knowledge->controller,
             "tip_latency: the controller remembers its pressures for %g s beyond the sensor's own delay, and counts poses "
             "%g s late as that late",
             TIP_LATE_MOST_S, effect->parameter[0]);
    }
    knowledge->calibration->tip_late_us += llround(1e6 * fmin(effect->parameter[0], TIP_LATE_MOST_S));
}

/* One row an effect: how it is used, in which of its forms, or why not. */
struct use {
    const char *name;
    effect_use use; /* NULL: not */
    size_t forms;   /* the first so many */
    const char *why_not;
};

static const struct use uses[] = {
    {"chamber_asymmetry", use_asymmetry, 1, NULL},
    {"chamber_leak", use_leak, 1, NULL},
    {"contact", NULL, 0,
     "what stands in the way belongs to the surroundings, and pressing harder against it is not wanted"},
    {"creep", use_creep, 2, NULL},
    {"cross_coupling", NULL, 0,
     "each chamber's pressure loop works on its own, and evens out what its neighbours add as it comes"},
    {"end_restraint", use_restraint, 1, NULL},
    {"gravity", NULL, 0,
     "the bend depends on how the module is mounted; the tip loop takes it out where there is a tip sensor"},
    {"hysteresis", NULL, 0,
     "the bend depends on every turn before it; the tip loop takes it out where there is a tip sensor"},
    {"line_resistance", use_resistance, 2, NULL},
    {"line_volume", use_volume, 1, NULL},
    {"mullins", NULL, 0,
     "the softening depends on the greatest load since the rubber was made, which a controller that was just switched on "
     "does not know; the tip loop takes it out where there is a tip sensor"},
    {"pressure_gain", use_gain, 1, NULL},
    {"pressure_lag", use_lag, 1, NULL},
    {"pressure_offset", use_offset, 1, NULL},
    {"supply_droop", NULL, 0, "the controller follows the supply as it is measured, and cannot foresee what all valves draw"},
    {"temperature_stiffness", NULL, 0,
     "there is no thermometer; the tip loop takes it out where there is a tip sensor"},
    {"tip_distortion", NULL, 0, "only orientations are used to control, and they are right"},
    {"tip_freeze", NULL, 0, "a sample that is repeated by chance is only known afterwards"},
    {"tip_latency", use_tip_latency, 1, NULL},
    {"tip_lever_arm", use_tip_arm, 1, NULL},
    {"tip_misalignment", use_tip_angle, 2, NULL},
    {"tip_offset", use_tip_offset, 1, NULL},
    {"tip_payload", NULL, 0,
     "the bend depends on how the module is mounted; the tip loop takes it out where there is a tip sensor"},
    {"valve_dead_band", use_dead_band, 1, NULL},
    {"valve_dead_time", use_dead_time, 1, NULL},
    {"valve_sluggish", use_flow, 1, NULL},
};

static const struct use *use_of(const struct effect_kind *kind) {
    static const struct use none = {"", NULL, 0, "nobody has told it how"};
    for (size_t i = 0; i < sizeof uses / sizeof uses[0]; i++) {
        if (strcmp(uses[i].name, kind->name) == 0) {
            return &uses[i];
        }
    }
    return &none;
}

const char *calibration_why_unused(const struct effect_kind *kind) {
    return use_of(kind)->why_not;
}

static void learn(struct knowledge *knowledge, const struct effect *effect) {
    const struct use *use = use_of(effect->kind);
    if (use->use == NULL) {
        note(knowledge->controller, "%s: the controller cannot use it: %s", effect->kind->name, use->why_not);
        return;
    }
    if (effect->form >= use->forms) {
        note(knowledge->controller, "%s, form %zu (%s): the controller cannot use it: it knows another form only",
             effect->kind->name, effect->form, effect->kind->form_what[effect->form]);
        return;
    }
    use->use(knowledge, effect);
    if (effect->onset_s > 0.0) {
        note(knowledge->controller,
             "%s sets in at %g s of the recording; the controller takes it into account from its start", effect->kind->name,
             effect->onset_s);
    }
}

static void check_bounds(struct calibrated_controller *controller) {
    struct controller_calibration bounded = controller->parameters.calibration;
    const uint32_t changed = calibration_limit(&bounded);
    if (changed > 0u) {
        note(controller, "%u numbers lie outside the controller's own bounds, which it keeps to", changed);
    }
}

bool calibrated_controller_make(struct calibrated_controller *controller, const struct calibration *calibration,
                                const struct bend_table *nominal, char *error, size_t error_bytes) {
    struct controller_calibration known;
    struct plant_parameters plant;
    struct knowledge knowledge = {.controller = controller,
                                  .calibration = &known,
                                  .working_pressure_pa = (double)nominal->module.working_pressure_pa};
    memset(controller, 0, sizeof *controller);
    plant_default_parameters(&plant);
    knowledge.supply_pa = plant.supply_pa * calibration->supply_scale;
    calibration_none(&known);
    table_scales_none(&knowledge.scales);
    knowledge.scales.stiffness = calibration->stiffness_scale;
    for (size_t e = 0; e < calibration->effects; e++) {
        learn(&knowledge, &calibration->effect[e]);
    }
    if (!table_scaled(&controller->table, nominal, &knowledge.scales, error, error_bytes)) {
        return false;
    }
    controller_default_parameters(&controller->parameters, &controller->table.table);
    controller->parameters.calibration = known;
    controller->parameters.pressure_loop.nominal_supply_pa *= (float)calibration->supply_scale;
    controller->parameters.idle_pressure_pa *= (float)calibration->stiffness_scale;
    check_bounds(controller);
    return true;
}

void calibrated_controller_free(struct calibrated_controller *controller) {
    table_scaled_free(&controller->table);
}
