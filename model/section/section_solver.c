/* Assembly, bordered factorisation, Newton and arc length.
 *
 * The tangent is sparse but for its border: stretch and the two curvatures touch every element, and so does the
 * multiplier that holds the mean rotation. The sparse block alone is singular (the section may turn about its pinned
 * centre), so one diagonal is raised by one while factorising; a fifth border column takes it back exactly:
 *
 *   [A + e e'  B  e] [x]   [r]
 *   [B'        C  0] [y] = [s]     equals A x + B y = r, B' x + C y = s
 *   [e'        0  1] [z]   [0]
 *
 * A is quasi-definite near the solution (displacements +, pressures -1/K), so an LDL' factorisation without pivoting
 * exists for a symmetric permutation (Vanderbei 1995) and its signs, with those of the 5 x 5 Schur complement, give the
 * inertia: at a stable equilibrium one negative for each pressure equation and one for the rotation. */
#include <gsl/gsl_eigen.h>
#include <gsl/gsl_linalg.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "section/section_internal.h"

#define SCHUR (BORDERED + 1)
#define COLUMN_RESIDUAL SCHUR
#define COLUMN_LOAD (SCHUR + 1)
#define COLUMNS (SCHUR + 2)
#define NEWTON_ITERATIONS_MAX 12
#define NEWTON_TOLERANCE 1e-6    /* of the last update; quadratic convergence leaves about its square */
#define DISPLACEMENT_STEP_MAX 0.5 /* radii: a longer jump may have landed on another branch */
#define SUBSTEP_LEAST (1.0 / 64.0)

static void set_error(struct description_error *error, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(error->text, sizeof error->text, format, arguments);
    va_end(arguments);
}

/* --- set-up --- */

static size_t *pressure_equation_of(const struct section_solver *solver, size_t triangle, size_t corner) {
    const struct section_mesh *mesh = solver->mesh;
    return &solver->pressure_equation[mesh->triangle[triangle][corner] * mesh->region_count + mesh->region[triangle]];
}

double section_corner_pressure(const struct section_solver *solver, size_t triangle, size_t corner) {
    return solver->unknown[*pressure_equation_of(solver, triangle, corner)];
}

static void number_equations(struct section_solver *solver) {
    const struct section_mesh *mesh = solver->mesh;
    size_t next = 0;
    for (size_t i = 0; i < mesh->node_count * mesh->region_count; i++) {
        solver->pressure_equation[i] = NO_EQUATION;
    }
    for (size_t i = 0; i < mesh->node_count; i++) {
        for (size_t d = 0; d < 2; d++) {
            solver->displacement_equation[2 * i + d] = i == mesh->centre_node ? NO_EQUATION : next++;
        }
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
            size_t *equation = pressure_equation_of(solver, t, c);
            if (*equation == NO_EQUATION) {
                *equation = next++;
                solver->pressure_count++;
            }
        }
    }
    solver->sparse_count = next;
}

static void displacement_equations(const struct section_solver *solver, const size_t *nodes, size_t node_count,
                                   size_t *equation) {
    for (size_t a = 0; a < node_count; a++) {
        equation[2 * a] = solver->displacement_equation[2 * nodes[a]];
        equation[2 * a + 1] = solver->displacement_equation[2 * nodes[a] + 1];
    }
}

static void triangle_equations(const struct section_solver *solver, size_t triangle, size_t equation[ELEMENT_LOCAL]) {
    displacement_equations(solver, solver->mesh->triangle[triangle], ELEMENT_NODES, equation);
    for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
        equation[ELEMENT_DISPLACEMENTS + c] = *pressure_equation_of(solver, triangle, c);
    }
}

static bool make_pattern(struct section_solver *solver) {
    const struct section_mesh *mesh = solver->mesh;
    cholmod_triplet *triplet = cholmod_allocate_triplet(
        solver->sparse_count, solver->sparse_count, mesh->triangle_count * ELEMENT_LOCAL * (ELEMENT_LOCAL + 1) / 2, -1,
        CHOLMOD_REAL, &solver->common);
    if (triplet == NULL) {
        return false;
    }
    int *row = triplet->i, *column = triplet->j;
    double *value = triplet->x;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        size_t equation[ELEMENT_LOCAL];
        triangle_equations(solver, t, equation);
        for (size_t k = 0; k < ELEMENT_LOCAL; k++) {
            for (size_t l = 0; l <= k; l++) {
                if (equation[k] != NO_EQUATION && equation[l] != NO_EQUATION) {
                    row[triplet->nnz] = (int)(equation[k] > equation[l] ? equation[k] : equation[l]);
                    column[triplet->nnz] = (int)(equation[k] > equation[l] ? equation[l] : equation[k]);
                    value[triplet->nnz++] = 1.0;
                }
            }
        }
    }
    solver->matrix = cholmod_triplet_to_sparse(triplet, 0, &solver->common);
    cholmod_free_triplet(&triplet, &solver->common);
    return solver->matrix != NULL;
}

static size_t find_slot(const cholmod_sparse *matrix, size_t p, size_t q) {
    if (p == NO_EQUATION || q == NO_EQUATION) {
        return NO_EQUATION;
    }
    const int row = (int)(p > q ? p : q), column = (int)(p > q ? q : p);
    const int *start = matrix->p, *rows = matrix->i;
    int low = start[column], high = start[column + 1] - 1;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (rows[middle] < row) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return (size_t)low;
}

static void make_slots(struct section_solver *solver) {
    const struct section_mesh *mesh = solver->mesh;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        size_t equation[ELEMENT_LOCAL];
        triangle_equations(solver, t, equation);
        for (size_t k = 0; k < ELEMENT_LOCAL; k++) {
            for (size_t l = 0; l <= k; l++) {
                solver->triangle_slot[(t * ELEMENT_LOCAL + k) * ELEMENT_LOCAL + l] =
                    find_slot(solver->matrix, equation[k], equation[l]);
            }
        }
    }
    for (size_t e = 0; e < mesh->edge_count; e++) {
        size_t equation[EDGE_LOCAL];
        displacement_equations(solver, mesh->edge[e].node, EDGE_NODES, equation);
        for (size_t k = 0; k < EDGE_LOCAL; k++) {
            for (size_t l = 0; l <= k; l++) {
                solver->edge_slot[(e * EDGE_LOCAL + k) * EDGE_LOCAL + l] =
                    find_slot(solver->matrix, equation[k], equation[l]);
            }
        }
    }
}

/* Undeformed geometry: Gauss points, mean rotation vector, chamber areas. False where a triangle is folded. */
static bool measure_rest(struct section_solver *solver) {
    const struct section_mesh *mesh = solver->mesh;
    for (size_t i = 0; i < 2 * mesh->node_count; i++) {
        solver->rest[i] = mesh->position_m[i] / solver->radius_m;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        double position[ELEMENT_NODES][2];
        section_deformed_triangle(solver, t, position);
        if (!element_geometry(position, solver->gauss[t])) {
            return false;
        }
        size_t equation[ELEMENT_LOCAL];
        triangle_equations(solver, t, equation);
        for (size_t g = 0; g < ELEMENT_GAUSS_POINTS; g++) {
            double x[2] = {0.0, 0.0};
            for (size_t a = 0; a < ELEMENT_NODES; a++) {
                x[0] += element_gauss_shape[g][a] * position[a][0];
                x[1] += element_gauss_shape[g][a] * position[a][1];
            }
            const double radius = hypot(x[0], x[1]);
            solver->gauss[t][g].hoop[0] = -x[1] / radius;
            solver->gauss[t][g].hoop[1] = x[0] / radius;
            for (size_t a = 0; a < ELEMENT_NODES; a++) {
                if (equation[2 * a] != NO_EQUATION) {
                    const double share = solver->gauss[t][g].weight * element_gauss_shape[g][a];
                    solver->rotation[equation[2 * a]] -= share * x[1];
                    solver->rotation[equation[2 * a + 1]] += share * x[0];
                }
            }
        }
    }
    const struct section_globals none = {1.0, {0.0, 0.0}};
    double rightmost = -INFINITY;
    for (size_t e = 0; e < mesh->edge_count; e++) {
        const size_t *n = mesh->edge[e].node;
        double position[EDGE_NODES][2];
        for (size_t a = 0; a < EDGE_NODES; a++) {
            memcpy(position[a], &solver->rest[2 * n[a]], sizeof position[a]);
        }
        if (mesh->edge[e].chamber >= 0) {
            struct edge_matrix matrix;
            edge_assemble(position, &none, &matrix);
            solver->chamber_area[mesh->edge[e].chamber] += matrix.volume;
        } else if (mesh->edge[e].chamber == SECTION_OUTLINE && position[0][0] > rightmost && solver->displacement_equation[2 * n[0]] != NO_EQUATION) {
            rightmost = position[0][0];
            solver->stabiliser = solver->displacement_equation[2 * n[0] + 1];
        }
    }
    return true;
}

static bool allocate(struct section_solver *solver) {
    const size_t nodes = solver->mesh->node_count, triangles = solver->mesh->triangle_count;
    solver->displacement_equation = calloc(2 * nodes, sizeof(size_t));
    solver->pressure_equation = calloc(nodes * solver->mesh->region_count, sizeof(size_t));
    solver->rest = calloc(2 * nodes, sizeof(double));
    solver->gauss = calloc(triangles, sizeof *solver->gauss);
    solver->triangle_slot = calloc(triangles * ELEMENT_LOCAL * ELEMENT_LOCAL, sizeof(size_t));
    solver->edge_slot = calloc(solver->mesh->edge_count * EDGE_LOCAL * EDGE_LOCAL, sizeof(size_t));
    if (solver->displacement_equation == NULL || solver->pressure_equation == NULL || solver->rest == NULL ||
        solver->gauss == NULL || solver->triangle_slot == NULL || solver->edge_slot == NULL) {
        return false;
    }
    number_equations(solver);
    const size_t all = solver->sparse_count + BORDERED;
    double **arrays[] = {&solver->rotation, &solver->unknown,   &solver->residual,     &solver->load,
                         &solver->saved,    &solver->increment, &solver->tangent_step, &solver->column[0],
                         &solver->column[1], &solver->column[2]};
    for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++) {
        *arrays[i] = calloc(all, sizeof(double));
        if (*arrays[i] == NULL) {
            return false;
        }
    }
    return true;
}

static void start_sparse(struct section_solver *solver) {
    cholmod_start(&solver->common);
    solver->common.print = 0;
    solver->common.supernodal = CHOLMOD_SIMPLICIAL; /* the only kind that does LDL' */
    solver->common.final_ll = 0;
}

struct section_solver *section_solver_create(const struct section_mesh *mesh, const struct module_description *module,
                                             struct description_error *error) {
    struct section_solver *solver = calloc(1, sizeof *solver);
    if (solver == NULL) {
        set_error(error, "out of memory for the section solver");
        return NULL;
    }
    start_sparse(solver);
    solver->mesh = mesh;
    solver->modulus_pa = material_shear_modulus(&module->material);
    solver->law[0] = (struct element_law){.material = module->material,
                                          .bulk = module->material.bulk_modulus_pa / solver->modulus_pa};
    for (size_t l = 0; l < module->layer_count; l++) {
        const struct module_layer *layer = &module->layer[l];
        solver->law[l + 1] = (struct element_law){.material = layer->material,
                                                  .bulk = layer->material.bulk_modulus_pa / solver->modulus_pa,
                                                  .corrugation_fraction = layer->corrugation_fraction,
                                                  .corrugation = layer->corrugation};
    }
    solver->radius_m = mesh->outer_radius_m;
    if (!allocate(solver) || !make_pattern(solver)) {
        set_error(error, "out of memory for a section of %zu triangles", mesh->triangle_count);
        section_solver_free(solver);
        return NULL;
    }
    make_slots(solver);
    solver->right = cholmod_zeros(solver->sparse_count, COLUMNS, CHOLMOD_REAL, &solver->common);
    solver->factor = cholmod_analyze(solver->matrix, &solver->common);
    if (!measure_rest(solver) || solver->right == NULL || solver->factor == NULL) {
        set_error(error, "the section's mesh cannot be factorised; try another element size");
        section_solver_free(solver);
        return NULL;
    }
    section_solver_reset(solver);
    return solver;
}

void section_solver_free(struct section_solver *solver) {
    if (solver == NULL) {
        return;
    }
    cholmod_free_sparse(&solver->matrix, &solver->common);
    cholmod_free_factor(&solver->factor, &solver->common);
    cholmod_free_dense(&solver->right, &solver->common);
    cholmod_free_dense(&solver->solution, &solver->common);
    cholmod_free_dense(&solver->work_y, &solver->common);
    cholmod_free_dense(&solver->work_e, &solver->common);
    cholmod_finish(&solver->common);
    void *arrays[] = {solver->displacement_equation, solver->pressure_equation, solver->rest,      solver->gauss,
                      solver->triangle_slot,         solver->edge_slot,         solver->rotation,  solver->unknown,
                      solver->residual,              solver->load,              solver->saved,     solver->increment,
                      solver->tangent_step,          solver->column[0],         solver->column[1], solver->column[2]};
    for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++) {
        free(arrays[i]);
    }
    free(solver);
}

/* --- state --- */

static size_t equations(const struct section_solver *solver) {
    return solver->sparse_count + BORDERED;
}

void section_globals_of(const struct section_solver *solver, struct section_globals *globals) {
    const double *border = &solver->unknown[solver->sparse_count];
    *globals = (struct section_globals){border[0], {border[1], border[2]}};
}

void section_deformed_triangle(const struct section_solver *solver, size_t triangle,
                               double position[ELEMENT_NODES][2]) {
    const size_t *node = solver->mesh->triangle[triangle];
    for (size_t a = 0; a < ELEMENT_NODES; a++) {
        for (size_t d = 0; d < 2; d++) {
            const size_t equation = solver->displacement_equation[2 * node[a] + d];
            position[a][d] =
                solver->rest[2 * node[a] + d] + (equation == NO_EQUATION ? 0.0 : solver->unknown[equation]);
        }
    }
}

void section_solver_reset(struct section_solver *solver) {
    memset(solver->unknown, 0, equations(solver) * sizeof(double));
    memset(solver->pressure, 0, sizeof solver->pressure);
    memset(solver->force, 0, sizeof solver->force);
    solver->unknown[solver->sparse_count] = 1.0;
    solver->stable = true;
    solver->iterations = 0;
}

size_t section_solver_unknowns(const struct section_solver *solver) {
    return equations(solver) + MODULE_CHAMBERS + GLOBALS;
}

void section_solver_save(const struct section_solver *solver, double *values) {
    memcpy(values, solver->unknown, equations(solver) * sizeof(double));
    memcpy(values + equations(solver), solver->pressure, sizeof solver->pressure);
    memcpy(values + equations(solver) + MODULE_CHAMBERS, solver->force, sizeof solver->force);
}

void section_solver_restore(struct section_solver *solver, const double *values) {
    memcpy(solver->unknown, values, equations(solver) * sizeof(double));
    memcpy(solver->pressure, values + equations(solver), sizeof solver->pressure);
    memcpy(solver->force, values + equations(solver) + MODULE_CHAMBERS, sizeof solver->force);
}

double section_solver_chamber_area_m2(const struct section_solver *solver, size_t chamber) {
    return solver->chamber_area[chamber] * solver->radius_m * solver->radius_m;
}

/* --- assembly --- */

static void scatter_triangle(struct section_solver *solver, size_t triangle, const struct element_matrix *matrix) {
    size_t equation[ELEMENT_LOCAL];
    double *value = solver->matrix->x;
    triangle_equations(solver, triangle, equation);
    for (size_t k = 0; k < ELEMENT_LOCAL; k++) {
        if (equation[k] == NO_EQUATION) {
            continue;
        }
        const size_t *slot = &solver->triangle_slot[(triangle * ELEMENT_LOCAL + k) * ELEMENT_LOCAL];
        solver->residual[equation[k]] += matrix->residual[k];
        for (size_t m = 0; m < GLOBALS; m++) {
            solver->column[m][equation[k]] += matrix->global_column[m][k];
        }
        for (size_t l = 0; l <= k; l++) {
            if (slot[l] != NO_EQUATION) {
                value[slot[l]] += matrix->tangent[k][l];
            }
        }
    }
    for (size_t m = 0; m < GLOBALS; m++) {
        solver->residual[solver->sparse_count + m] += matrix->global_residual[m];
        for (size_t l = 0; l <= m; l++) {
            solver->corner[m][l] += matrix->global_tangent[m][l];
        }
    }
}

static void scatter_edge(struct section_solver *solver, size_t edge, const double direction[MODULE_CHAMBERS],
                         const struct edge_matrix *matrix) {
    const int chamber = solver->mesh->edge[edge].chamber;
    const double pressure = solver->pressure[chamber];
    size_t equation[EDGE_LOCAL];
    double *value = solver->matrix->x;
    displacement_equations(solver, solver->mesh->edge[edge].node, EDGE_NODES, equation);
    solver->volume[chamber] += matrix->volume;
    for (size_t k = 0; k < EDGE_LOCAL; k++) {
        if (equation[k] == NO_EQUATION) {
            continue;
        }
        const size_t *slot = &solver->edge_slot[(edge * EDGE_LOCAL + k) * EDGE_LOCAL];
        solver->residual[equation[k]] -= pressure * matrix->gradient[k];
        solver->load[equation[k]] += direction[chamber] * matrix->gradient[k];
        for (size_t m = 0; m < GLOBALS; m++) {
            solver->column[m][equation[k]] -= pressure * matrix->global_column[m][k];
        }
        for (size_t l = 0; l <= k; l++) {
            if (slot[l] != NO_EQUATION) {
                value[slot[l]] -= pressure * matrix->hessian[k][l];
            }
        }
    }
    for (size_t m = 0; m < GLOBALS; m++) {
        solver->residual[solver->sparse_count + m] -= pressure * matrix->global_gradient[m];
        solver->load[solver->sparse_count + m] += direction[chamber] * matrix->global_gradient[m];
    }
}

static void scatter_fibres(struct section_solver *solver, size_t edge, double position[EDGE_NODES][2]) {
    const struct section_edge *at = &solver->mesh->edge[edge];
    const double stiffness = at->hoop_stiffness_npm / (solver->modulus_pa * solver->radius_m);
    struct fibre_matrix matrix;
    size_t equation[EDGE_LOCAL];
    double rest[EDGE_NODES][2], *value = solver->matrix->x;
    for (size_t a = 0; a < EDGE_NODES; a++) {
        memcpy(rest[a], &solver->rest[2 * at->node[a]], sizeof rest[a]);
    }
    fibre_assemble(rest, position, stiffness, &matrix);
    displacement_equations(solver, at->node, EDGE_NODES, equation);
    for (size_t k = 0; k < EDGE_LOCAL; k++) {
        const size_t *slot = &solver->edge_slot[(edge * EDGE_LOCAL + k) * EDGE_LOCAL];
        if (equation[k] != NO_EQUATION) {
            solver->residual[equation[k]] += matrix.gradient[k];
        }
        for (size_t l = 0; l <= k; l++) {
            if (slot[l] != NO_EQUATION) {
                value[slot[l]] += matrix.hessian[k][l];
            }
        }
    }
}

static void clear_sums(struct section_solver *solver) {
    const size_t bytes = equations(solver) * sizeof(double);
    memset(solver->matrix->x, 0, solver->matrix->nzmax * sizeof(double));
    memset(solver->residual, 0, bytes);
    memset(solver->load, 0, bytes);
    memset(solver->corner, 0, sizeof solver->corner);
    memset(solver->volume, 0, sizeof solver->volume);
    for (size_t m = 0; m < GLOBALS; m++) {
        memset(solver->column[m], 0, bytes);
    }
}

/* Residual, tangent and load vector at the present unknowns and pressures; false where the section is inside out. */
static bool assemble(struct section_solver *solver, const double direction[MODULE_CHAMBERS]) {
    const struct section_mesh *mesh = solver->mesh;
    struct section_globals globals;
    section_globals_of(solver, &globals);
    clear_sums(solver);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        double position[ELEMENT_NODES][2], pressure[ELEMENT_CORNERS];
        struct element_matrix matrix;
        section_deformed_triangle(solver, t, position);
        for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
            pressure[c] = section_corner_pressure(solver, t, c);
        }
        if (!element_assemble(solver->gauss[t], position, pressure, &globals, &solver->law[mesh->region[t]],
                              solver->modulus_pa, &matrix)) {
            return false;
        }
        scatter_triangle(solver, t, &matrix);
    }
    for (size_t e = 0; e < mesh->edge_count; e++) {
        if (mesh->edge[e].chamber < 0) {
            continue;
        }
        double position[EDGE_NODES][2];
        for (size_t a = 0; a < EDGE_NODES; a++) {
            for (size_t d = 0; d < 2; d++) {
                const size_t equation = solver->displacement_equation[2 * mesh->edge[e].node[a] + d];
                position[a][d] = solver->rest[2 * mesh->edge[e].node[a] + d] +
                                 (equation == NO_EQUATION ? 0.0 : solver->unknown[equation]);
            }
        }
        struct edge_matrix matrix;
        edge_assemble(position, &globals, &matrix);
        scatter_edge(solver, e, direction, &matrix);
        if (mesh->edge[e].hoop_stiffness_npm > 0.0) {
            scatter_fibres(solver, e, position);
        }
    }
    for (size_t m = 0; m < GLOBALS; m++) {
        solver->residual[solver->sparse_count + m] -= solver->force[m];
    }
    const double multiplier = solver->unknown[solver->sparse_count + GLOBALS];
    for (size_t i = 0; i < solver->sparse_count; i++) {
        solver->residual[i] += multiplier * solver->rotation[i];
        solver->residual[solver->sparse_count + GLOBALS] += solver->rotation[i] * solver->unknown[i];
    }
    return true;
}

/* --- the bordered system --- */

static double dot(const double *a, const double *b, size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

static size_t negative_eigenvalues(double schur[SCHUR][SCHUR]) {
    double copy[SCHUR * SCHUR], values[SCHUR];
    memcpy(copy, schur, sizeof copy);
    gsl_matrix_view matrix = gsl_matrix_view_array(copy, SCHUR, SCHUR);
    gsl_vector_view eigenvalues = gsl_vector_view_array(values, SCHUR);
    gsl_eigen_symm_workspace *workspace = gsl_eigen_symm_alloc(SCHUR);
    gsl_eigen_symm(&matrix.matrix, &eigenvalues.vector, workspace);
    gsl_eigen_symm_free(workspace);
    size_t count = 0;
    for (size_t i = 0; i < SCHUR; i++) {
        count += values[i] < 0.0;
    }
    return count;
}

static size_t negative_pivots(const cholmod_factor *factor) {
    const int *start = factor->p;
    const double *value = factor->x;
    size_t count = 0;
    for (size_t j = 0; j < factor->n; j++) {
        count += value[start[j]] < 0.0;
    }
    return count;
}

static void fill_right(struct section_solver *solver) {
    const size_t n = solver->sparse_count;
    double *right = solver->right->x;
    for (size_t m = 0; m < GLOBALS; m++) {
        memcpy(right + m * n, solver->column[m], n * sizeof(double));
    }
    memcpy(right + GLOBALS * n, solver->rotation, n * sizeof(double));
    memset(right + BORDERED * n, 0, n * sizeof(double));
    right[BORDERED * n + solver->stabiliser] = 1.0;
    memcpy(right + COLUMN_RESIDUAL * n, solver->residual, n * sizeof(double));
    memcpy(right + COLUMN_LOAD * n, solver->load, n * sizeof(double));
}

/* From the sparse solution of one right-hand side (column `which`) to that of the whole bordered system. */
static void finish_column(const struct section_solver *solver, const gsl_matrix *lu, const gsl_permutation *order,
                          size_t which, const double *border, double sign, double *answer) {
    const size_t n = solver->sparse_count;
    const double *right = solver->right->x, *solution = solver->solution->x;
    double rest[SCHUR], y[SCHUR];
    for (size_t m = 0; m < SCHUR; m++) {
        rest[m] = (m < BORDERED ? border[m] : 0.0) - dot(right + m * n, solution + which * n, n);
    }
    gsl_vector_view rest_view = gsl_vector_view_array(rest, SCHUR), y_view = gsl_vector_view_array(y, SCHUR);
    gsl_linalg_LU_solve(lu, order, &rest_view.vector, &y_view.vector);
    for (size_t i = 0; i < n; i++) {
        double value = solution[which * n + i];
        for (size_t m = 0; m < SCHUR; m++) {
            value -= solution[m * n + i] * y[m];
        }
        answer[i] = sign * value;
    }
    for (size_t m = 0; m < BORDERED; m++) {
        answer[n + m] = sign * y[m];
    }
}

/* increment = -K^-1 residual, tangent_step = K^-1 load, and the inertia. */
static bool solve_bordered(struct section_solver *solver) {
    const size_t n = solver->sparse_count;
    double *value = solver->matrix->x;
    const size_t diagonal = find_slot(solver->matrix, solver->stabiliser, solver->stabiliser);
    value[diagonal] += 1.0;
    const int factorised = cholmod_factorize(solver->matrix, solver->factor, &solver->common);
    value[diagonal] -= 1.0;
    if (!factorised || solver->common.status != CHOLMOD_OK) {
        return false;
    }
    fill_right(solver);
    if (!cholmod_solve2(CHOLMOD_A, solver->factor, solver->right, NULL, &solver->solution, NULL, &solver->work_y,
                        &solver->work_e, &solver->common)) {
        return false;
    }
    const double *right = solver->right->x, *solution = solver->solution->x;
    double schur[SCHUR][SCHUR];
    for (size_t m = 0; m < SCHUR; m++) {
        for (size_t l = 0; l <= m; l++) {
            const double corner = m < GLOBALS ? solver->corner[m][l] : (m == BORDERED && l == BORDERED ? 1.0 : 0.0);
            schur[m][l] = corner - dot(right + m * n, solution + l * n, n);
            schur[l][m] = schur[m][l];
        }
    }
    solver->stable = negative_pivots(solver->factor) + negative_eigenvalues(schur) == solver->pressure_count + 1;
    double copy[SCHUR * SCHUR];
    memcpy(copy, schur, sizeof copy);
    size_t order_data[SCHUR];
    gsl_permutation order = {SCHUR, order_data};
    gsl_matrix_view lu = gsl_matrix_view_array(copy, SCHUR, SCHUR);
    int sign = 0;
    gsl_linalg_LU_decomp(&lu.matrix, &order, &sign);
    for (size_t m = 0; m < SCHUR; m++) {
        if (copy[m * SCHUR + m] == 0.0 || !isfinite(copy[m * SCHUR + m])) {
            return false;
        }
    }
    finish_column(solver, &lu.matrix, &order, COLUMN_RESIDUAL, solver->residual + n, -1.0, solver->increment);
    finish_column(solver, &lu.matrix, &order, COLUMN_LOAD, solver->load + n, 1.0, solver->tangent_step);
    return true;
}

double section_largest_change(const struct section_solver *solver, const double *step) {
    double most = 0.0;
    for (size_t i = 0; i < 2 * solver->mesh->node_count; i++) {
        const size_t equation = solver->displacement_equation[i];
        if (equation != NO_EQUATION) {
            most = fmax(most, fabs(step[equation]));
        }
    }
    for (size_t m = 0; m < GLOBALS; m++) {
        most = fmax(most, fabs(step[solver->sparse_count + m]));
    }
    return most;
}

static void add_scaled(double *to, double factor, const double *from, size_t count) {
    for (size_t i = 0; i < count; i++) {
        to[i] += factor * from[i];
    }
}

static const double no_direction[MODULE_CHAMBERS] = {0.0, 0.0, 0.0};

/* With the volume of chamber 1 given, its pressure becomes an unknown: the step that meets the volume to first order. */
static void meet_volume(struct section_solver *solver, double volume) {
    const double gap = volume - solver->volume[0] - dot(solver->load, solver->increment, equations(solver));
    const double change = gap / dot(solver->load, solver->tangent_step, equations(solver));
    add_scaled(solver->increment, change, solver->tangent_step, equations(solver));
    solver->pressure[0] += change;
}

/* `volume` of chamber 1 (over radius^2), or NAN: its pressure is given. */
static bool newton(struct section_solver *solver, double volume) {
    static const double first_chamber[MODULE_CHAMBERS] = {1.0, 0.0, 0.0};
    for (int i = 0; i < NEWTON_ITERATIONS_MAX; i++) {
        if (!assemble(solver, isnan(volume) ? no_direction : first_chamber) || !solve_bordered(solver)) {
            return false;
        }
        if (!isnan(volume)) {
            meet_volume(solver, volume);
        }
        const double change = section_largest_change(solver, solver->increment);
        solver->iterations++;
        if (!(change < 2.0)) {
            return false;
        }
        add_scaled(solver->unknown, 1.0, solver->increment, equations(solver));
        if (change < NEWTON_TOLERANCE) {
            return true;
        }
    }
    return false;
}

static bool landed_near(struct section_solver *solver, const double *start) {
    for (size_t i = 0; i < equations(solver); i++) {
        solver->tangent_step[i] = solver->unknown[i] - start[i];
    }
    return section_largest_change(solver, solver->tangent_step) < DISPLACEMENT_STEP_MAX;
}

/* Where a move goes, without dimension. */
struct destination {
    double pressure[MODULE_CHAMBERS];
    double force[GLOBALS];
    double volume; /* of chamber 1, whose pressure is then an unknown; NAN: none given */
};

/* Straight to the destination, or in as many steps as it takes; at given pressures over stable states only. */
static bool move(struct section_solver *solver, const struct destination *to) {
    const size_t bytes = section_solver_unknowns(solver) * sizeof(double);
    double *origin = malloc(bytes), *start = malloc(bytes);
    bool reached = false;
    solver->iterations = 0;
    if (origin != NULL && start != NULL) {
        section_solver_save(solver, origin);
        double done = 0.0, step = 1.0;
        const double *from = origin + equations(solver), *force_from = from + MODULE_CHAMBERS;
        const bool by_volume = !isnan(to->volume);
        const double volume_from = by_volume && assemble(solver, no_direction) ? solver->volume[0] : NAN;
        while (done < 1.0 && step >= SUBSTEP_LEAST) {
            const double share = done + step;
            section_solver_save(solver, start);
            for (size_t c = by_volume ? 1 : 0; c < MODULE_CHAMBERS; c++) {
                solver->pressure[c] = from[c] + share * (to->pressure[c] - from[c]);
            }
            for (size_t m = 0; m < GLOBALS; m++) {
                solver->force[m] = force_from[m] + share * (to->force[m] - force_from[m]);
            }
            const double volume = volume_from + share * (to->volume - volume_from);
            if (newton(solver, volume) && (by_volume || solver->stable) && landed_near(solver, start)) {
                done += step;
                step = fmin(2.0 * step, 1.0 - done);
            } else {
                section_solver_restore(solver, start);
                step *= 0.5;
            }
        }
        reached = done >= 1.0;
        if (!reached) {
            section_solver_restore(solver, origin);
        }
    }
    free(origin);
    free(start);
    return reached;
}

bool section_solver_move_to(struct section_solver *solver, const double pressure_pa[3]) {
    static const struct section_load none = {0.0, {0.0, 0.0}};
    return section_solver_move_to_loaded(solver, pressure_pa, &none);
}

bool section_solver_move_to_loaded(struct section_solver *solver, const double pressure_pa[3],
                                   const struct section_load *load) {
    const double force_unit = solver->modulus_pa * solver->radius_m * solver->radius_m;
    const double moment_unit = force_unit * solver->radius_m;
    struct destination to = {.volume = NAN};
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        to.pressure[c] = pressure_pa[c] / solver->modulus_pa;
    }
    /* the reported curvature is (ky, -kx) of the section's globals */
    to.force[0] = load->axial_n / force_unit;
    to.force[1] = -load->moment_nm[1] / moment_unit;
    to.force[2] = load->moment_nm[0] / moment_unit;
    return move(solver, &to);
}

bool section_solver_move_to_volume(struct section_solver *solver, double volume_1_m2, double pressure_2_pa,
                                   double pressure_3_pa) {
    const struct destination to = {.pressure = {0.0, pressure_2_pa / solver->modulus_pa, pressure_3_pa / solver->modulus_pa},
                                   .volume = volume_1_m2 / (solver->radius_m * solver->radius_m)};
    return move(solver, &to);
}

/* --- for the path and the checks --- */

bool section_linearise(struct section_solver *solver, const double direction[MODULE_CHAMBERS]) {
    return assemble(solver, direction) && solve_bordered(solver);
}

size_t section_solver_equations(const struct section_solver *solver) {
    return equations(solver);
}

bool section_solver_residual(struct section_solver *solver, double *residual) {
    const bool sound = assemble(solver, no_direction);
    memcpy(residual, solver->residual, equations(solver) * sizeof(double));
    return sound;
}

bool section_solver_tangent_product(struct section_solver *solver, const double *vector, double *product) {
    const size_t n = solver->sparse_count;
    if (!assemble(solver, no_direction)) {
        return false;
    }
    const int *start = solver->matrix->p, *row = solver->matrix->i;
    const double *value = solver->matrix->x;
    memset(product, 0, equations(solver) * sizeof(double));
    for (size_t j = 0; j < n; j++) {
        for (int k = start[j]; k < start[j + 1]; k++) {
            const size_t i = (size_t)row[k];
            product[i] += value[k] * vector[j];
            product[j] += i == j ? 0.0 : value[k] * vector[i];
        }
    }
    for (size_t m = 0; m < BORDERED; m++) {
        const double *column = m < GLOBALS ? solver->column[m] : solver->rotation;
        add_scaled(product, vector[n + m], column, n);
        product[n + m] += dot(column, vector, n);
        for (size_t l = 0; l < GLOBALS && m < GLOBALS; l++) {
            product[n + m] += solver->corner[l < m ? m : l][l < m ? l : m] * vector[n + l];
        }
    }
    return true;
}

void section_solver_displace(struct section_solver *solver, double factor, const double *vector) {
    add_scaled(solver->unknown, factor, vector, equations(solver));
}
