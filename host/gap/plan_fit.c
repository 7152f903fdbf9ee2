#include "gap/plan_fit.h"

#include <math.h>
#include <string.h>

#define STIFFNESS_PRIOR 0.5 /* standard deviation of its logarithm: only where nothing else tells */
#define SUPPLY_PRIOR 0.2
/* Nobody would confuse candidates at this distance: once steps bring its square down by less than this share,
 * they stop. */
#define CLEAR 20.0
#define SLOW 0.1
#define ATTEMPTS 4
#define ENOUGH 1e-3 /* change of the sum of squares, relative and absolute, that is worth no further step */

/* A fit's normal equations. */
struct normal {
    size_t size;
    double matrix[GAP_PARAMETERS_MAX][GAP_PARAMETERS_MAX];
    double gradient[GAP_PARAMETERS_MAX];
};

static double square(const double *values, size_t count) {
    double sum = 0.0;
    for (size_t k = 0; k < count; k++) {
        sum += values[k] * values[k];
    }
    return sum;
}

static double cost_of(const struct plan_stage *stage, const struct gap_model *model, const double *residual) {
    const struct gap_model *base = &stage->candidates->base;
    return square(residual, stage->residuals) +
           pow(log(model->stiffness_scale / base->stiffness_scale) / STIFFNESS_PRIOR, 2.0) +
           pow((model->supply_scale - base->supply_scale) / SUPPLY_PRIOR, 2.0);
}

static void fill_column(const struct plan_stage *stage, const struct plan_truth *truth,
                        const struct plan_view *view, struct gap_model *model,
                        const struct gap_parameter *parameter, size_t p, struct plan_room *room) {
    const double kept = *parameter->value, step = plan_stage_step(parameter);
    double *column = room->jacobian + p * stage->residuals;
    *parameter->value = kept + step;
    const struct plan_trace *along = view->moved[p].samples > 0 ? &view->moved[p] : NULL;
    plan_stage_compare(stage, truth, model, &view->trace, along, step, room, column);
    *parameter->value = kept;
    for (size_t k = 0; k < stage->residuals; k++) {
        column[k] = (column[k] - room->residual[k]) / step;
    }
}

static void set_normal(const struct plan_stage *stage, const struct gap_model *model,
                       const struct plan_room *room, size_t size, struct normal *normal) {
    const struct gap_model *base = &stage->candidates->base;
    memset(normal, 0, sizeof *normal);
    normal->size = size;
    for (size_t i = 0; i < size; i++) {
        const double *a = room->jacobian + i * stage->residuals;
        for (size_t k = 0; k < stage->residuals; k++) {
            normal->gradient[i] += a[k] * room->residual[k];
        }
        for (size_t j = 0; j <= i; j++) {
            const double *b = room->jacobian + j * stage->residuals;
            for (size_t k = 0; k < stage->residuals; k++) {
                normal->matrix[i][j] += a[k] * b[k];
            }
            normal->matrix[j][i] = normal->matrix[i][j];
        }
    }
    const double log_slope = 1.0 / (model->stiffness_scale * STIFFNESS_PRIOR);
    normal->matrix[0][0] += log_slope * log_slope;
    normal->gradient[0] += log_slope * log(model->stiffness_scale / base->stiffness_scale) / STIFFNESS_PRIOR;
    normal->matrix[1][1] += 1.0 / (SUPPLY_PRIOR * SUPPLY_PRIOR);
    normal->gradient[1] += (model->supply_scale - base->supply_scale) / (SUPPLY_PRIOR * SUPPLY_PRIOR);
}

/* Cholesky's method on the parameters that are free; the others keep their step. False: not positive
 * definite. */
static bool solve(const struct normal *normal, const bool *is_free, double damping, double *step) {
    double l[GAP_PARAMETERS_MAX][GAP_PARAMETERS_MAX], right[GAP_PARAMETERS_MAX];
    const size_t n = normal->size;
    for (size_t i = 0; i < n; i++) {
        right[i] = -normal->gradient[i];
        for (size_t j = 0; j < n; j++) {
            right[i] -= is_free[j] ? 0.0 : normal->matrix[i][j] * step[j];
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = is_free[i] && is_free[j] ? normal->matrix[i][j] : i == j ? 1.0 : 0.0;
            sum += i == j && is_free[i] ? damping * normal->matrix[i][i] + 1e-12 : 0.0;
            for (size_t k = 0; k < j; k++) {
                sum -= l[i][k] * l[j][k];
            }
            if (i == j && !(sum > 0.0)) {
                return false;
            }
            l[i][j] = i == j ? sqrt(sum) : sum / l[j][j];
        }
    }
    for (size_t i = 0; i < n; i++) {
        right[i] = is_free[i] ? right[i] : step[i];
        for (size_t k = 0; k < i; k++) {
            right[i] -= l[i][k] * right[k];
        }
        right[i] /= l[i][i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) {
            right[i] -= l[k][i] * right[k];
        }
        right[i] /= l[i][i];
    }
    memcpy(step, right, n * sizeof *step);
    return true;
}

/* The step to the least of the quadratic within the bounds, of the parameters in `is_free`: what it would
 * leave by is put on its bound, and the rest is solved again. False: no step. */
static bool find_step(const struct normal *normal, const struct gap_parameter *parameter, bool *is_free,
                      double damping, double *step) {
    bool within = false;
    memset(step, 0, GAP_PARAMETERS_MAX * sizeof *step);
    for (size_t round = 0; round <= normal->size && !within; round++) {
        within = true;
        if (!solve(normal, is_free, damping, step)) {
            return false;
        }
        for (size_t i = 0; i < normal->size; i++) {
            const double room_down = parameter[i].least - *parameter[i].value;
            const double room_up = parameter[i].most - *parameter[i].value;
            if (is_free[i] && (step[i] < room_down || step[i] > room_up)) {
                step[i] = fmin(fmax(step[i], room_down), room_up);
                is_free[i] = false;
                within = false;
            }
        }
    }
    return true;
}

/* All that the residuals depend on. */
static void free_all(const struct normal *normal, bool *is_free) {
    for (size_t i = 0; i < GAP_PARAMETERS_MAX; i++) {
        is_free[i] = i < normal->size && normal->matrix[i][i] > 0.0;
    }
}

/* What the quadratic promises of a step. */
static double promised(const struct normal *normal, const double *step) {
    double change = 0.0;
    for (size_t i = 0; i < normal->size; i++) {
        double row = 2.0 * normal->gradient[i];
        for (size_t j = 0; j < normal->size; j++) {
            row += normal->matrix[i][j] * step[j];
        }
        change += row * step[i];
    }
    return change;
}

static void set_jacobian(const struct plan_stage *stage, const struct plan_truth *truth,
                         const struct plan_view *view, struct plan_room *room, struct normal *normal) {
    struct gap_parameter parameter[GAP_PARAMETERS_MAX];
    struct gap_model model = view->model;
    const size_t count = gap_model_parameters(&model, parameter);
    for (size_t p = 0; p < count; p++) {
        fill_column(stage, truth, view, &model, &parameter[p], p, room);
    }
    set_normal(stage, &model, room, count, normal);
}

/* The residuals that the first order promises of a step. */
static void foresee(const struct plan_stage *stage, const struct normal *normal, const double *step,
                    struct plan_room *room) {
    memcpy(room->moved, room->residual, stage->residuals * sizeof *room->moved);
    for (size_t p = 0; p < normal->size; p++) {
        const double *column = room->jacobian + p * stage->residuals;
        for (size_t k = 0; k < stage->residuals; k++) {
            room->moved[k] += step[p] * column[k];
        }
    }
}

/* The least cost that the first order promises from a view; leaves residuals and Jacobian in the room, and
 * the residuals that are promised in room->moved. */
static double look_at(const struct plan_stage *stage, const struct plan_truth *truth,
                      const struct plan_view *view, struct plan_room *room, struct normal *normal) {
    struct gap_parameter parameter[GAP_PARAMETERS_MAX];
    struct gap_model model = view->model;
    double step[GAP_PARAMETERS_MAX];
    bool is_free[GAP_PARAMETERS_MAX];
    (void)gap_model_parameters(&model, parameter);
    plan_stage_compare(stage, truth, &model, &view->trace, NULL, 0.0, room, room->residual);
    const double cost = cost_of(stage, &model, room->residual);
    set_jacobian(stage, truth, view, room, normal);
    free_all(normal, is_free);
    if (!find_step(normal, parameter, is_free, 0.0, step)) {
        memset(step, 0, sizeof step);
    }
    foresee(stage, normal, step, room);
    return fmax(cost + promised(normal, step), 0.0);
}

/* One step of Levenberg and Marquardt's from room->tried on. True: it went down, and room->tried,
 * room->residual and `cost` are the new ones. */
static bool take_step(const struct plan_stage *stage, const struct plan_truth *truth,
                      const struct normal *normal, double *damping, double *cost, struct plan_room *room) {
    for (int attempt = 0; attempt < ATTEMPTS; attempt++) {
        struct gap_model model = room->tried.model;
        struct gap_parameter parameter[GAP_PARAMETERS_MAX];
        double step[GAP_PARAMETERS_MAX];
        bool is_free[GAP_PARAMETERS_MAX];
        const size_t count = gap_model_parameters(&model, parameter);
        free_all(normal, is_free);
        if (find_step(normal, parameter, is_free, *damping, step)) {
            for (size_t p = 0; p < count; p++) {
                *parameter[p].value =
                    fmin(fmax(*parameter[p].value + step[p], parameter[p].least), parameter[p].most);
            }
            plan_stage_gas(stage, &room->tried, &model, &room->trial);
            plan_stage_compare(stage, truth, &model, &room->trial, NULL, 0.0, room, room->moved);
            const double trial = cost_of(stage, &model, room->moved);
            if (trial < *cost) {
                const struct plan_trace swap = room->tried.trace;
                room->tried.trace = room->trial;
                room->trial = swap;
                room->tried.model = model;
                memcpy(room->residual, room->moved, stage->residuals * sizeof *room->residual);
                *cost = trial;
                *damping *= 0.2;
                return true;
            }
        }
        *damping *= 10.0;
    }
    return false;
}

double plan_fit_look(const struct plan_stage *stage, const struct plan_truth *truth,
                     const struct plan_view *view, struct plan_room *room) {
    struct normal normal;
    return look_at(stage, truth, view, room, &normal);
}

double plan_fit_refine(const struct plan_stage *stage, const struct plan_truth *truth,
                       const struct plan_view *view, int rounds, struct plan_room *room) {
    struct normal normal;
    double damping = 1e-3;
    if (!plan_view_copy(view, &room->tried)) {
        return INFINITY;
    }
    (void)look_at(stage, truth, view, room, &normal);
    double cost = cost_of(stage, &view->model, room->residual);
    for (int round = 0; round < rounds; round++) {
        const double before = cost;
        const bool stepped = take_step(stage, truth, &normal, &damping, &cost, room);
        const double least = round >= 2 && cost > CLEAR * CLEAR ? SLOW * before : ENOUGH * before + ENOUGH;
        if (!stepped || before - cost < least) {
            break;
        }
        if (round + 1 < rounds && plan_stage_derive(stage, &room->tried)) {
            set_jacobian(stage, truth, &room->tried, room, &normal);
        }
    }
    return cost;
}
