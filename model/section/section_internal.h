/* The solver's state, shared by assembly and solution (section_solver.c) and by what is read off an equilibrium
 * (section_output.c). Internal to model/section. */
#ifndef TRIBEND_SECTION_INTERNAL_H
#define TRIBEND_SECTION_INTERNAL_H

#include <stdint.h>
#include <suitesparse/cholmod.h>

#include "section/section_element.h"
#include "section/section_mesh.h"
#include "section/section_solver.h"

#define BORDERED (GLOBALS + 1) /* stretch, two curvatures, multiplier of the mean rotation */
#define NO_EQUATION SIZE_MAX

struct section_solver {
    const struct section_mesh *mesh;
    struct element_law law[1 + MODULE_LAYERS_MAX]; /* by region */
    double modulus_pa;  /* shear modulus of region 0 */
    double radius_m;

    /* numbering: sparse equations first (displacements, pressures at corners), then the bordered ones */
    size_t sparse_count;
    size_t *displacement_equation; /* [2 * node_count], NO_EQUATION where pinned */
    /* [node_count * region_count], NO_EQUATION at mid-sides; a corner between regions has a pressure in each, since the
     * pressure jumps where the stiffness does */
    size_t *pressure_equation;
    size_t pressure_count;
    size_t stabiliser;             /* equation whose diagonal is raised while factorising */

    struct gauss_point (*gauss)[ELEMENT_GAUSS_POINTS];
    double *rest;        /* [2 * node_count] undeformed positions over the radius */
    double *rotation;    /* [sparse_count] mean rotation of the section is rotation . displacement */
    double chamber_area[MODULE_CHAMBERS];

    /* state */
    double *unknown;     /* [sparse_count + BORDERED] */
    double pressure[MODULE_CHAMBERS];
    double force[GLOBALS]; /* on stretch and curvatures, over modulus x radius^2 and ^3 */
    bool stable;
    int iterations;

    /* assembly */
    double *residual;    /* [sparse_count + BORDERED] */
    double *column[GLOBALS];
    double *load;        /* [sparse_count + BORDERED] derivative of sum_i direction_i V_i */
    double corner[GLOBALS][GLOBALS];
    double volume[MODULE_CHAMBERS];
    size_t *triangle_slot; /* [triangle_count * ELEMENT_LOCAL^2] where an entry goes in the matrix */
    size_t *edge_slot;     /* [edge_count * EDGE_LOCAL^2] */

    cholmod_common common;
    cholmod_sparse *matrix;
    cholmod_factor *factor;
    cholmod_dense *right;  /* columns: the border, the stabiliser, residual, load */
    cholmod_dense *solution;
    cholmod_dense *work_y;
    cholmod_dense *work_e;
    double *saved;
    double *increment;
    double *tangent_step;
};

void section_deformed_triangle(const struct section_solver *solver, size_t triangle, double position[ELEMENT_NODES][2]);
/* Tangent, residual and load vector (derivative of sum_i direction_i V_i) at the present state, and their solution:
 * solver->increment = -K^-1 residual, solver->tangent_step = K^-1 load, solver->stable. */
bool section_linearise(struct section_solver *solver, const double direction[MODULE_CHAMBERS]);
/* Greatest change of a displacement, the stretch or a curvature in `step`. */
double section_largest_change(const struct section_solver *solver, const double *step);
double section_corner_pressure(const struct section_solver *solver, size_t triangle, size_t corner);
void section_globals_of(const struct section_solver *solver, struct section_globals *globals);

#endif
