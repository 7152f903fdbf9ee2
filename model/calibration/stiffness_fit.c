#include "calibration/stiffness_fit.h"

#include <gsl/gsl_fit.h>
#include <gsl/gsl_min.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "section/section_bend.h"

#define CURVE_POINTS_MAX 2048
#define FACTOR_LEAST 0.1
#define FACTOR_MOST 10.0
#define SEARCH_STEPS 200
#define ITERATIONS_MAX 60
#define TOLERANCE 1e-7
#define SECOND_CHAMBER_SHARE 0.1 /* of the first's pressure that may stand in the others */
#define CURVE_BEND_MOST_RAD 2.5

/* Bend over the pressure of one chamber, up to the first limit point. */
struct curve {
    double pressure_pa[CURVE_POINTS_MAX];
    double bend_rad[CURVE_POINTS_MAX];
    size_t count;
    const struct module_description *module;
};

struct problem {
    const struct curve *curve;
    const struct plateau *plateaus;
    const bool *used;
    size_t count;
};

static bool take_point(void *context, const struct section_state *state) {
    struct curve *curve = context;
    double bend_rad[2];
    section_tip_bend(curve->module, state, bend_rad);
    const bool rises = curve->count == 0 || state->pressure_pa[0] > curve->pressure_pa[curve->count - 1];
    if (!rises || curve->count == CURVE_POINTS_MAX) {
        return false;
    }
    curve->pressure_pa[curve->count] = state->pressure_pa[0];
    curve->bend_rad[curve->count++] = hypot(bend_rad[0], bend_rad[1]);
    return true;
}

static bool make_curve(const struct module_description *module, struct curve *curve, struct description_error *error) {
    static const double direction_pa[3] = {1.0, 0.0, 0.0};
    struct section_mesh *mesh = section_mesh_create(module, NULL, error);
    struct section_solver *solver = mesh == NULL ? NULL : section_solver_create(mesh, module, error);
    curve->count = 0;
    curve->module = module;
    if (solver != NULL) {
        /* the curve ends where the path does: what matters is whether it reaches the plateaus */
        (void)section_solver_path(solver, direction_pa, SECTION_GOAL_CURVATURE, CURVE_BEND_MOST_RAD / module->chamber_length_m,
                                  take_point, curve, error);
    }
    const bool made = solver != NULL;
    section_solver_free(solver);
    section_mesh_free(mesh);
    return made;
}

/* Linear beyond the curve's end: only the search passes there. */
static double bend_at(const struct curve *curve, double pressure_pa) {
    size_t i = 1;
    while (i + 1 < curve->count && curve->pressure_pa[i] < pressure_pa) {
        i++;
    }
    const double slope = (curve->bend_rad[i] - curve->bend_rad[i - 1]) / (curve->pressure_pa[i] - curve->pressure_pa[i - 1]);
    return curve->bend_rad[i - 1] + slope * (pressure_pa - curve->pressure_pa[i - 1]);
}

static double greatest_pa(const struct plateau *plateau) {
    return fmax(plateau->pressure_pa[0], fmax(plateau->pressure_pa[1], plateau->pressure_pa[2]));
}

static double cost(double log_factor, void *context) {
    const struct problem *problem = context;
    double sum = 0.0;
    for (size_t i = 0; i < problem->count; i++) {
        if (problem->used[i]) {
            const double model = bend_at(problem->curve, greatest_pa(&problem->plateaus[i]) / exp(log_factor));
            sum += (model - problem->plateaus[i].bend_rad) * (model - problem->plateaus[i].bend_rad);
        }
    }
    return sum;
}

/* The best of a coarse search, refined by Brent's method. */
static double find_factor(struct problem *problem) {
    const double low = log(FACTOR_LEAST), step = (log(FACTOR_MOST) - low) / SEARCH_STEPS;
    double best = low;
    for (int i = 0; i <= SEARCH_STEPS; i++) {
        best = cost(low + i * step, problem) < cost(best, problem) ? low + i * step : best;
    }
    gsl_function function = {cost, problem};
    gsl_min_fminimizer *minimiser = gsl_min_fminimizer_alloc(gsl_min_fminimizer_brent);
    if (gsl_min_fminimizer_set(minimiser, &function, best, best - 1.5 * step, best + 1.5 * step) == 0) {
        for (int i = 0; i < ITERATIONS_MAX && gsl_min_fminimizer_iterate(minimiser) == 0; i++) {
            best = gsl_min_fminimizer_x_minimum(minimiser);
            if (gsl_min_fminimizer_x_upper(minimiser) - gsl_min_fminimizer_x_lower(minimiser) < TOLERANCE) {
                break;
            }
        }
    }
    gsl_min_fminimizer_free(minimiser);
    return exp(best);
}

static void judge(const struct problem *problem, struct stiffness_fit *fit) {
    double x[PLATEAUS_MAX], y[PLATEAUS_MAX], a = 0.0, b = 0.0, c00, c01, c11, squares, slope = 0.0, cov;
    size_t used = 0;
    for (size_t i = 0; i < problem->count; i++) {
        if (problem->used[i]) {
            x[used] = greatest_pa(&problem->plateaus[i]);
            y[used++] = problem->plateaus[i].bend_rad;
        }
    }
    (void)gsl_fit_linear(x, 1, y, 1, used, &a, &b, &c00, &c01, &c11, &squares);
    (void)gsl_fit_mul(x, 1, y, 1, used, &slope, &cov, &squares);
    for (size_t i = 0; i < problem->count; i++) {
        const double pressure_pa = greatest_pa(&problem->plateaus[i]), bend_rad = problem->plateaus[i].bend_rad;
        fit->model_rad[i] = bend_at(problem->curve, pressure_pa / fit->factor);
        const double gap = fit->model_rad[i] - bend_rad;
        if (problem->used[i]) {
            fit->fitted++;
            fit->rms_fitted_rad += gap * gap;
        } else {
            fit->held_out++;
            fit->rms_held_out_rad += gap * gap;
            fit->rms_line_rad += pow(a + b * pressure_pa - bend_rad, 2.0);
            fit->rms_proportion_rad += pow(slope * pressure_pa - bend_rad, 2.0);
        }
    }
    const double held_out = (double)fit->held_out;
    fit->rms_fitted_rad = sqrt(fit->rms_fitted_rad / (double)fit->fitted);
    fit->rms_held_out_rad = sqrt(fit->rms_held_out_rad / held_out);
    fit->rms_line_rad = sqrt(fit->rms_line_rad / held_out);
    fit->rms_proportion_rad = sqrt(fit->rms_proportion_rad / held_out);
}

bool stiffness_fit(const struct module_description *module, const struct plateau *plateaus, size_t count,
                   struct stiffness_fit *fit, struct description_error *error) {
    static struct curve curve;
    memset(fit, 0, sizeof *fit);
    if (count < 4) {
        (void)snprintf(error->text, sizeof error->text, "%zu loaded plateaus are too few: at least four, two of them to judge by",
                       count);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        double sum_pa = 0.0;
        for (size_t c = 0; c < 3; c++) {
            sum_pa += fmax(0.0, plateaus[i].pressure_pa[c]);
        }
        if (sum_pa > (1.0 + SECOND_CHAMBER_SHARE) * greatest_pa(&plateaus[i])) {
            (void)snprintf(error->text, sizeof error->text,
                           "the plateau from row %zu loads more than one chamber: leave it out of the file",
                           plateaus[i].first_row);
            return false;
        }
        fit->used[i] = i % 2 == 0;
    }
    if (!make_curve(module, &curve, error)) {
        return false;
    }
    struct problem problem = {&curve, plateaus, fit->used, count};
    fit->factor = find_factor(&problem);
    double most_pa = 0.0;
    for (size_t i = 0; i < count; i++) {
        most_pa = fmax(most_pa, greatest_pa(&plateaus[i]));
    }
    if (curve.count < 3 || most_pa / fit->factor > curve.pressure_pa[curve.count - 1]) {
        (void)snprintf(error->text, sizeof error->text,
                       "the module's path ends at %.0f Pa, before the plateau of %.0f Pa (stiffness x %.3f): %s",
                       curve.count > 0 ? curve.pressure_pa[curve.count - 1] : 0.0, most_pa, fit->factor,
                       "is the geometry the measured module's?");
        return false;
    }
    judge(&problem, fit);
    return true;
}
