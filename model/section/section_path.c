/* Pseudo-arc-length continuation (Riks 1979; bordering as Keller 1977). The arc is measured in displacements (root mean
 * square over the nodes, in radii), stretch, curvature times radius and pressure over shear modulus. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "section/section_internal.h"

#define ARC_ITERATIONS_MAX 10
#define ARC_ITERATIONS_WANTED 5
#define ARC_TOLERANCE 1e-6
#define ARC_FIRST 0.02
#define ARC_LEAST 1e-5
#define ARC_MOST 0.08
#define PATH_POINTS_MAX 2000
#define GOAL_TOLERANCE 1e-8
#define GOAL_ITERATIONS_MAX 40

struct path {
    struct section_solver *solver;
    double direction[MODULE_CHAMBERS]; /* over the shear modulus, greatest component one */
    double factor;
    double *start;   /* unknowns of the last converged point */
    double start_factor;
    double *tangent; /* unit along the path */
    double tangent_factor;
    enum section_goal goal;
    int iterations;
};

static double arc_product(const struct section_solver *solver, const double *a, const double *b) {
    double sum = 0.0;
    for (size_t i = 0; i < 2 * solver->mesh->node_count; i++) {
        const size_t equation = solver->displacement_equation[i];
        if (equation != NO_EQUATION) {
            sum += a[equation] * b[equation];
        }
    }
    sum /= (double)solver->mesh->node_count;
    for (size_t m = 0; m < GLOBALS; m++) {
        sum += a[solver->sparse_count + m] * b[solver->sparse_count + m];
    }
    return sum;
}

static void set_pressures(const struct path *path) {
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        path->solver->pressure[c] = path->factor * path->direction[c];
    }
}

static bool correct(struct path *path, double arc) {
    struct section_solver *solver = path->solver;
    const size_t count = section_solver_equations(solver);
    for (path->iterations = 1; path->iterations <= ARC_ITERATIONS_MAX; path->iterations++) {
        set_pressures(path);
        if (!section_linearise(solver, path->direction)) {
            return false;
        }
        for (size_t i = 0; i < count; i++) {
            solver->saved[i] = solver->unknown[i] - path->start[i];
        }
        const double gap = arc_product(solver, path->tangent, solver->saved) +
                           path->tangent_factor * (path->factor - path->start_factor) - arc;
        const double slope = path->tangent_factor + arc_product(solver, path->tangent, solver->tangent_step);
        const double change = -(gap + arc_product(solver, path->tangent, solver->increment)) / slope;
        double most = fabs(change);
        for (size_t i = 0; i < count; i++) {
            solver->increment[i] += change * solver->tangent_step[i];
            solver->unknown[i] += solver->increment[i];
        }
        most = fmax(most, section_largest_change(solver, solver->increment));
        path->factor += change;
        if (!(most < 1.0)) {
            return false;
        }
        if (most < ARC_TOLERANCE) {
            set_pressures(path);
            return true;
        }
    }
    return false;
}

static bool step_along(struct path *path, double arc) {
    struct section_solver *solver = path->solver;
    for (size_t i = 0; i < section_solver_equations(solver); i++) {
        solver->unknown[i] = path->start[i] + arc * path->tangent[i];
    }
    path->factor = path->start_factor + arc * path->tangent_factor;
    return correct(path, arc);
}

/* The converged point becomes the start of the next step; the tangent keeps its sense. */
static void accept(struct path *path) {
    struct section_solver *solver = path->solver;
    const size_t count = section_solver_equations(solver);
    const double sense = path->tangent_factor + arc_product(solver, path->tangent, solver->tangent_step);
    const double length = sqrt(1.0 + arc_product(solver, solver->tangent_step, solver->tangent_step));
    path->tangent_factor = copysign(1.0 / length, sense);
    for (size_t i = 0; i < count; i++) {
        path->tangent[i] = path->tangent_factor * solver->tangent_step[i];
    }
    memcpy(path->start, solver->unknown, count * sizeof(double));
    path->start_factor = path->factor;
}

static double measure(const struct path *path) {
    const double *border = &path->solver->unknown[path->solver->sparse_count];
    if (path->goal == SECTION_GOAL_CURVATURE) {
        return hypot(border[1], border[2]) / path->solver->radius_m;
    }
    return path->factor * path->solver->modulus_pa;
}

/* The arc length within (0, arc] at which the measure equals the goal, by the Illinois variant of regula falsi
 * (Dowell and Jarratt 1971). */
static bool land_on_goal(struct path *path, double low_value, double arc, double high_value, double goal) {
    double low = 0.0, high = arc, low_gap = low_value - goal, high_gap = high_value - goal;
    for (int i = 0; i < GOAL_ITERATIONS_MAX; i++) {
        const double middle = (low * high_gap - high * low_gap) / (high_gap - low_gap);
        if (!step_along(path, middle)) {
            return false;
        }
        const double gap = measure(path) - goal;
        if (fabs(gap) <= GOAL_TOLERANCE * goal) {
            return true;
        }
        if (gap * high_gap < 0.0) {
            low = high;
            low_gap = high_gap;
        } else {
            low_gap *= 0.5;
        }
        high = middle;
        high_gap = gap;
    }
    return false;
}

static bool follow(struct path *path, double goal_value, section_path_callback callback, void *context,
                   struct description_error *error) {
    struct section_solver *solver = path->solver;
    double arc = ARC_FIRST, last = 0.0, greatest_factor = 0.0;
    struct section_state state;
    for (int point = 0; point < PATH_POINTS_MAX; point++) {
        while (!step_along(path, arc)) {
            arc *= 0.5;
            if (arc < ARC_LEAST) {
                (void)snprintf(error->text, sizeof error->text,
                               "the path breaks down at %.0f Pa and %.2f 1/m: no further equilibrium was found. Ask "
                               "`tribend-tables material %s` whether its law is stable that far, or stop before",
                               path->start_factor * solver->modulus_pa,
                               hypot(path->start[solver->sparse_count + 1], path->start[solver->sparse_count + 2]) /
                                   solver->radius_m,
                               solver->law[0].material.name);
                return false;
            }
        }
        const double value = measure(path);
        const bool arrived = value >= goal_value;
        if (arrived && !land_on_goal(path, last, arc, value, goal_value)) {
            (void)snprintf(error->text, sizeof error->text, "the path could not be landed on its goal at %.0f Pa",
                           path->factor * solver->modulus_pa);
            return false;
        }
        solver->iterations = path->iterations;
        section_solver_state(solver, &state);
        if (callback != NULL && !callback(context, &state)) {
            (void)snprintf(error->text, sizeof error->text, "the path was stopped at %.0f Pa", state.pressure_pa[0]);
            return false;
        }
        if (arrived) {
            return true;
        }
        last = value;
        accept(path);
        greatest_factor = fmax(greatest_factor, path->factor);
        if (path->factor < 0.0) {
            (void)snprintf(error->text, sizeof error->text,
                           "the pressure turns back at a limit point of %.0f Pa and falls to zero: beyond it there is no "
                           "equilibrium. Ask `tribend-tables material %s` how far its law is stable",
                           greatest_factor * solver->modulus_pa, solver->law[0].material.name);
            return false;
        }
        arc = fmin(ARC_MOST, arc * (path->iterations < ARC_ITERATIONS_WANTED ? 1.4 : 0.8));
    }
    (void)snprintf(error->text, sizeof error->text, "the goal was not reached in %d path points", PATH_POINTS_MAX);
    return false;
}

bool section_solver_path(struct section_solver *solver, const double direction_pa[3], enum section_goal goal,
                         double goal_value, section_path_callback callback, void *context,
                         struct description_error *error) {
    const size_t count = section_solver_equations(solver);
    struct path path = {.solver = solver, .goal = goal};
    const double greatest = fmax(direction_pa[0], fmax(direction_pa[1], direction_pa[2]));
    if (!(greatest > 0.0) || !(goal_value > 0.0)) {
        (void)snprintf(error->text, sizeof error->text, "a path needs a chamber under pressure and a goal above zero");
        return false;
    }
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        path.direction[c] = direction_pa[c] / greatest;
    }
    path.start = calloc(count, sizeof(double));
    path.tangent = calloc(count, sizeof(double));
    bool reached = false;
    if (path.start != NULL && path.tangent != NULL) {
        section_solver_reset(solver);
        path.tangent_factor = 1.0;
        struct section_state state;
        section_solver_state(solver, &state);
        if (callback != NULL) {
            (void)callback(context, &state);
        }
        if (section_linearise(solver, path.direction)) {
            accept(&path);
            reached = follow(&path, goal_value, callback, context, error);
        } else {
            (void)snprintf(error->text, sizeof error->text, "the undeformed section cannot be factorised");
        }
    } else {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the path");
    }
    free(path.start);
    free(path.tangent);
    return reached;
}
