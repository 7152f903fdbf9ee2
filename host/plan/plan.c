#include "plan/plan.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define DEGREES (180.0 / M_PI)
#define CHECK_EVERY_S 0.02    /* commands within a step are looked at this often, */
#define CHECKS_PER_STEP 20000 /* at most so many times */
#define PERIOD_LEAST_S 0.05   /* five PWM periods: no chamber follows anything faster */
#define ROUNDING 1e-6         /* relative: a limit that is a float32 may be named in decimals */
#define NONE_PA 1e-3          /* what rounding leaves of no pressure */

/* --- making one --- */

void plan_init(struct plan *plan, const char *module, const char *note) {
    memset(plan, 0, sizeof *plan);
    (void)snprintf(plan->module, sizeof plan->module, "%s", module);
    (void)snprintf(plan->note, sizeof plan->note, "%s", note);
}

static bool add_step(struct plan *plan, const struct plan_step *step) {
    if (plan->steps == PLAN_STEPS_MAX) {
        return false;
    }
    plan->step[plan->steps++] = *step;
    return true;
}

static bool add_pressures(struct plan *plan, enum plan_step_kind kind, double length_s,
                          const double pressure_pa[3]) {
    struct plan_step step = {.kind = kind, .length_s = length_s};
    memcpy(step.pressure_pa, pressure_pa, sizeof step.pressure_pa);
    return add_step(plan, &step);
}

bool plan_add_pressure(struct plan *plan, double length_s, const double pressure_pa[3]) {
    return add_pressures(plan, PLAN_PRESSURE, length_s, pressure_pa);
}

bool plan_add_ramp(struct plan *plan, double length_s, const double pressure_pa[3]) {
    return add_pressures(plan, PLAN_RAMP, length_s, pressure_pa);
}

bool plan_add_sine(struct plan *plan, double length_s, const struct plan_tone *tone, size_t tones) {
    const struct plan_step step = {
        .kind = PLAN_SINE, .length_s = length_s, .first_tone = plan->tones, .tones = tones};
    if (plan->tones + tones > PLAN_TONES_MAX || !add_step(plan, &step)) {
        return false;
    }
    memcpy(&plan->tone[plan->tones], tone, tones * sizeof *tone);
    plan->tones += tones;
    return true;
}

bool plan_add_bend(struct plan *plan, double length_s, double bend_rad, double direction_rad,
                   double co_contraction_pa) {
    const struct plan_step step = {.kind = PLAN_BEND,
                                   .length_s = length_s,
                                   .bend_rad = bend_rad,
                                   .direction_rad = direction_rad,
                                   .co_contraction_pa = co_contraction_pa};
    return add_step(plan, &step);
}

bool plan_add_vent(struct plan *plan, double length_s) {
    const struct plan_step step = {.kind = PLAN_VENT, .length_s = length_s};
    return add_step(plan, &step);
}

bool plan_append(struct plan *plan, const struct plan *after) {
    if (plan->steps + after->steps > PLAN_STEPS_MAX || plan->tones + after->tones > PLAN_TONES_MAX) {
        return false;
    }
    for (size_t i = 0; i < after->steps; i++) {
        struct plan_step step = after->step[i];
        step.first_tone += plan->tones;
        plan->step[plan->steps + i] = step;
    }
    memcpy(&plan->tone[plan->tones], after->tone, after->tones * sizeof *after->tone);
    plan->steps += after->steps;
    plan->tones += after->tones;
    return true;
}

/* --- following it --- */

double plan_start_s(const struct plan *plan, size_t step) {
    double start_s = 0.0;
    for (size_t i = 0; i < step && i < plan->steps; i++) {
        start_s += plan->step[i].length_s;
    }
    return start_s;
}

double plan_length_s(const struct plan *plan) {
    return plan_start_s(plan, plan->steps);
}

size_t plan_step_at(const struct plan *plan, double time_s) {
    double end_s = 0.0;
    for (size_t i = 0; i + 1 < plan->steps; i++) {
        end_s += plan->step[i].length_s;
        if (time_s < end_s) {
            return i;
        }
    }
    return plan->steps > 0 ? plan->steps - 1 : 0;
}

static void sum_of_sines(const struct plan *plan, const struct plan_step *step, double since_s,
                         double pressure_pa[3]) {
    for (size_t i = 0; i < step->tones; i++) {
        const struct plan_tone *tone = &plan->tone[step->first_tone + i];
        const double value_pa =
            tone->mean_pa + tone->amplitude_pa * sin(2.0 * M_PI * since_s / tone->period_s + tone->phase_rad);
        for (size_t c = 0; c < 3; c++) {
            pressure_pa[c] += tone->chamber[c] ? value_pa : 0.0;
        }
    }
}

/* Pressures that a step ends at, which a ramp behind it starts from; none after a vent, a bend, or before the
 * plan. */
static void end_of_step(const struct plan *plan, size_t step, double pressure_pa[3]) {
    const struct plan_step *at = &plan->step[step];
    memset(pressure_pa, 0, 3 * sizeof *pressure_pa);
    if (at->kind == PLAN_SINE) {
        sum_of_sines(plan, at, at->length_s, pressure_pa);
    } else if (at->kind == PLAN_PRESSURE || at->kind == PLAN_RAMP) {
        memcpy(pressure_pa, at->pressure_pa, sizeof at->pressure_pa);
    }
}

static void pressures_at(const struct plan *plan, size_t step, double since_s, double pressure_pa[3]) {
    const struct plan_step *at = &plan->step[step];
    const double within_s = fmin(fmax(since_s, 0.0), at->length_s);
    memset(pressure_pa, 0, 3 * sizeof *pressure_pa);
    if (at->kind == PLAN_SINE) {
        sum_of_sines(plan, at, within_s, pressure_pa);
    } else if (at->kind == PLAN_RAMP) {
        if (step > 0) {
            end_of_step(plan, step - 1, pressure_pa);
        }
        for (size_t c = 0; c < 3; c++) {
            pressure_pa[c] += (at->pressure_pa[c] - pressure_pa[c]) * within_s / at->length_s;
        }
    } else {
        memcpy(pressure_pa, at->pressure_pa, sizeof at->pressure_pa);
    }
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = fabs(pressure_pa[c]) < NONE_PA ? 0.0 : pressure_pa[c];
    }
}

static void command_in_step(const struct plan *plan, size_t step, double since_s,
                            struct controller_command *command) {
    const struct plan_step *at = &plan->step[step];
    double pressure_pa[3];
    *command = (struct controller_command){.kind = COMMAND_VENT};
    if (at->kind == PLAN_BEND) {
        *command = (struct controller_command){.kind = COMMAND_BEND,
                                               .bend_rad = (float)at->bend_rad,
                                               .direction_rad = (float)at->direction_rad,
                                               .co_contraction_pa = (float)at->co_contraction_pa};
    } else if (at->kind != PLAN_VENT) {
        command->kind = COMMAND_PRESSURE;
        pressures_at(plan, step, since_s, pressure_pa);
        for (size_t c = 0; c < 3; c++) {
            command->pressure_pa[c] = (float)pressure_pa[c];
        }
    }
}

void plan_command_at(const struct plan *plan, double time_s, struct controller_command *command) {
    if (plan->steps == 0) {
        *command = (struct controller_command){.kind = COMMAND_VENT};
        return;
    }
    const size_t step = plan_step_at(plan, time_s);
    command_in_step(plan, step, time_s - plan_start_s(plan, step), command);
}

/* --- checking it --- */

struct check {
    const struct plan *plan;
    const struct bend_table *table;
    struct plan_fault *fault;
};

static bool reject(const struct check *check, size_t step, const char *key, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
static bool reject(const struct check *check, size_t step, const char *key, const char *format, ...) {
    va_list arguments;
    check->fault->step = step;
    check->fault->key = key;
    va_start(arguments, format);
    (void)vsnprintf(check->fault->text, sizeof check->fault->text, format, arguments);
    va_end(arguments);
    return false;
}

static const char *key_of(enum plan_step_kind kind) {
    static const char *const keys[] = {[PLAN_PRESSURE] = "pressure",
                                       [PLAN_RAMP] = "ramp_to",
                                       [PLAN_SINE] = "sine", /* in a file also: sines */
                                       [PLAN_BEND] = "bend",
                                       [PLAN_VENT] = "vent"};
    return keys[kind];
}

static bool check_tones(const struct check *check, size_t step) {
    const struct plan_step *at = &check->plan->step[step];
    for (size_t i = 0; i < at->tones; i++) {
        const struct plan_tone *tone = &check->plan->tone[at->first_tone + i];
        if (!(tone->period_s >= PERIOD_LEAST_S)) {
            return reject(check, step, "period", "%g s is shorter than %g s, which no chamber can follow",
                          tone->period_s, PERIOD_LEAST_S);
        }
        if (!(tone->amplitude_pa >= 0.0)) {
            return reject(check, step, "amplitude",
                          "%g mbar is negative; turn a sine over with phase: 180deg",
                          1e-2 * tone->amplitude_pa);
        }
        if (!tone->chamber[0] && !tone->chamber[1] && !tone->chamber[2]) {
            return reject(check, step, "chambers", "name at least one of 1, 2 and 3");
        }
    }
    return true;
}

static bool check_bend(const struct check *check, size_t step) {
    const struct plan_step *at = &check->plan->step[step];
    const struct bend_table_module *module = &check->table->module;
    const double limit_rad = (double)module->bend_limit_rad, working_pa = (double)module->working_pressure_pa;
    if (!(at->bend_rad >= 0.0)) {
        return reject(check, step, "bend",
                      "%.4g deg is negative; a bend the other way is toward: an angle turned by 180deg",
                      DEGREES * at->bend_rad);
    }
    if (at->bend_rad > limit_rad * (1.0 + ROUNDING)) {
        return reject(check, step, "bend", "%.4g deg is over the bend limit of module %s, %.4g deg",
                      DEGREES * at->bend_rad, module->name, DEGREES * limit_rad);
    }
    if (!(at->co_contraction_pa >= 0.0) || at->co_contraction_pa > working_pa * (1.0 + ROUNDING)) {
        return reject(check, step, "co_contraction",
                      "%.4g mbar is not between 0 and the working pressure of module %s, %.4g mbar",
                      1e-2 * at->co_contraction_pa, module->name, 1e-2 * working_pa);
    }
    return true;
}

double plan_bend_at(const struct bend_table *table, const float pressure_pa[3]) {
    struct bend_table_stencil stencil;
    bend_table_locate(table, pressure_pa, &stencil);
    return (double)table->module.active_length_m *
           hypot((double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_X),
                 (double)bend_table_value(table, &stencil, BEND_TABLE_CURVATURE_Y));
}

/* Pressures of one moment. */
static bool check_pressures(const struct check *check, size_t step, double since_s,
                            const float pressure_pa[3]) {
    const struct bend_table_module *module = &check->table->module;
    const char *key = key_of(check->plan->step[step].kind);
    const double working_pa = (double)module->working_pressure_pa, limit_rad = (double)module->bend_limit_rad;
    struct bend_table_stencil stencil;
    for (size_t c = 0; c < 3; c++) {
        if (!((double)pressure_pa[c] >= 0.0)) {
            return reject(check, step, key,
                          "%.4g mbar in chamber %zu at %.2f s of the step is below ambient; the valves can "
                          "fill and vent only",
                          1e-2 * (double)pressure_pa[c], c + 1, since_s);
        }
        if ((double)pressure_pa[c] > working_pa * (1.0 + ROUNDING)) {
            return reject(check, step, key,
                          "%.4g mbar in chamber %zu at %.2f s of the step is over the working pressure of "
                          "module %s, %.4g mbar",
                          1e-2 * (double)pressure_pa[c], c + 1, since_s, module->name, 1e-2 * working_pa);
        }
    }
    const double bend_rad = plan_bend_at(check->table, pressure_pa);
    if (bend_rad > limit_rad * (1.0 + ROUNDING)) {
        return reject(check, step, key,
                      "%.4g, %.4g, %.4g mbar at %.2f s of the step bend module %s by %.1f deg, over its bend "
                      "limit of %.4g deg; lower them",
                      1e-2 * (double)pressure_pa[0], 1e-2 * (double)pressure_pa[1],
                      1e-2 * (double)pressure_pa[2], since_s, module->name, DEGREES * bend_rad,
                      DEGREES * limit_rad);
    }
    bend_table_locate(check->table, pressure_pa, &stencil);
    if (!bend_table_is_valid(check->table, &stencil)) {
        return reject(check, step, key,
                      "%.4g, %.4g, %.4g mbar at %.2f s of the step are outside the domain where the table of "
                      "module %s holds; lower them",
                      1e-2 * (double)pressure_pa[0], 1e-2 * (double)pressure_pa[1],
                      1e-2 * (double)pressure_pa[2], since_s, module->name);
    }
    return true;
}

static bool check_course(const struct check *check, size_t step) {
    const double length_s = check->plan->step[step].length_s;
    const double every_s = fmax(CHECK_EVERY_S, length_s / CHECKS_PER_STEP);
    const size_t last = check->plan->step[step].kind == PLAN_PRESSURE ? 0 : (size_t)ceil(length_s / every_s);
    for (size_t i = 0; i <= last; i++) {
        const double since_s = fmin((double)i * every_s, length_s);
        struct controller_command command;
        command_in_step(check->plan, step, since_s, &command);
        if (!check_pressures(check, step, since_s, command.pressure_pa)) {
            return false;
        }
    }
    return true;
}

static bool check_step(const struct check *check, size_t step) {
    const struct plan_step *at = &check->plan->step[step];
    if (!(at->length_s > 0.0) || !(at->length_s <= PLAN_LENGTH_MOST_S)) {
        return reject(check, step, "for", "%g s is not between 0 and a day", at->length_s);
    }
    switch (at->kind) {
    case PLAN_VENT:
        return true;
    case PLAN_BEND:
        return check_bend(check, step);
    case PLAN_RAMP:
        if (step > 0 && check->plan->step[step - 1].kind == PLAN_BEND) {
            return reject(check, step, "ramp_to",
                          "the pressures at the end of a bend are not known beforehand; put a step of "
                          "pressure between them");
        }
        return check_course(check, step);
    case PLAN_SINE:
        return check_tones(check, step) && check_course(check, step);
    case PLAN_PRESSURE:
    default:
        return check_course(check, step);
    }
}

bool plan_check(const struct plan *plan, const struct bend_table *table, struct plan_fault *fault) {
    const struct check check = {plan, table, fault};
    if (plan->steps == 0) {
        return reject(&check, 0, "steps", "the plan has no step");
    }
    for (size_t i = 0; i < plan->steps; i++) {
        if (!check_step(&check, i)) {
            return false;
        }
    }
    if (plan_length_s(plan) > PLAN_LENGTH_MOST_S) {
        return reject(&check, plan->steps - 1, "for", "the plan takes %g s, more than a day",
                      plan_length_s(plan));
    }
    return true;
}
