/* The cross-section solver: generalised plane strain in a bent frame, mixed P2-P1 (Taylor-Hood) elements, neo-Hookean
 * and reduced-polynomial laws, follower pressure in three chambers.
 *
 *   F = [grad y 0; 0 F33],  F33 = stretch + kappa_x y_2 - kappa_y y_1
 *   Pi = int W(F) dA - sum_i p_i V_i,   V_i = int over chamber i of F33 da
 *
 * Curvature and stretch are those of the line through the material point at the section's centre, with zero mean
 * rotation of the section. See docs in section_solver.c for discretisation. */
#ifndef TRIBEND_SECTION_SOLVER_H
#define TRIBEND_SECTION_SOLVER_H

#include <stdbool.h>
#include <stddef.h>

#include "description/module_description.h"

struct section_mesh;
struct section_solver;

struct section_mesh_options {
    double size_m; /* element edge at chamber walls; grows towards the core. 0: the default */
};

/* What one equilibrium says. Curvature components are those of the bend: the vector points where the tip moves. */
struct section_state {
    double pressure_pa[3];
    double curvature_x_1pm;
    double curvature_y_1pm;
    double stretch;
    double volume_m2[3];         /* deformed volume per reference length, int F33 da */
    double width_bend_plane_m;   /* extent of the deformed outline along the bending direction (balloon included) */
    double width_across_m;
    double width_max_m;
    double von_mises_apex_pa;    /* mean through the wall at the apex of the chamber with the highest pressure */
    double stretch_max;          /* greatest principal stretch */
    bool stable;
    bool beyond_strain;          /* stretch over the fitted range of the material there */
    bool elliptic;               /* the law is, at every Gauss point (material_ellipticity_margin) */
    bool contact;                /* walls of a cavity, of the bore or of the outside cross or touch */
    int newton_iterations;
};

struct section_mesh *section_mesh_create(const struct module_description *module,
                                         const struct section_mesh_options *options, struct description_error *error);
/* Are the three chambers alike and each its own mirror image? Then one sixth of a table makes the whole. */
bool section_is_symmetric(const struct module_description *module);
void section_mesh_free(struct section_mesh *mesh);

/* Solver for one thread; the mesh may be shared. NULL with a message when memory or factorisation set-up fails. */
struct section_solver *section_solver_create(const struct section_mesh *mesh, const struct module_description *module,
                                             struct description_error *error);
void section_solver_free(struct section_solver *solver);

/* Natural continuation from the present state to these pressures, steps cut as needed. False: no equilibrium was
 * reached (a fold, or loss of convergence); the solver is then back at its last converged state. */
bool section_solver_move_to(struct section_solver *solver, const double pressure_pa[3]);
/* Forces on the section from beyond its ends, as a rod passes them on. `moment_nm` is conjugate to the reported curvature:
 * its vector points where it would move the tip. */
struct section_load {
    double axial_n;
    double moment_nm[2];
};
/* The same with a load, which then stays until the next move or reset. */
bool section_solver_move_to_loaded(struct section_solver *solver, const double pressure_pa[3],
                                   const struct section_load *load);
/* With the volume of chamber 1 given instead of its pressure: this passes the limit point of an inflating chamber, where
 * no state at given pressures is stable. Volume per reference length, as in struct section_state; no load. */
bool section_solver_move_to_volume(struct section_solver *solver, double volume_1_m2, double pressure_2_pa,
                                   double pressure_3_pa);
void section_solver_state(struct section_solver *solver, struct section_state *state);
/* Undeformed again. */
void section_solver_reset(struct section_solver *solver);
/* Save and restore the unknowns; `values` has section_solver_unknowns() doubles. */
size_t section_solver_unknowns(const struct section_solver *solver);
void section_solver_save(const struct section_solver *solver, double *values);
void section_solver_restore(struct section_solver *solver, const double *values);
/* Undeformed chamber area, m2. */
double section_solver_chamber_area_m2(const struct section_solver *solver, size_t chamber);
/* Deformed position of each mesh node, [2 * node_count], m, and greatest principal stretch of each triangle. */
void section_solver_field(const struct section_solver *solver, double *position_m, double *triangle_stretch);

enum section_goal { SECTION_GOAL_PRESSURE, SECTION_GOAL_CURVATURE };
/* Called after each converged point of a path; false stops it. */
typedef bool (*section_path_callback)(void *context, const struct section_state *state);
/* Pseudo-arc-length path in the factor of `direction_pa` (pressures = factor * direction), through limit points, from
 * the undeformed state to where the greatest pressure (Pa) or the curvature (1/m) first equals `goal_value`, on which
 * the last point lies. False: the path broke down before, or the callback stopped it; `error` says where. */
bool section_solver_path(struct section_solver *solver, const double direction_pa[3], enum section_goal goal,
                         double goal_value, section_path_callback callback, void *context,
                         struct description_error *error);

/* For the check of the tangent against differences of the residual, at the solver's state. `vector`, `product` and
 * `residual` have section_solver_equations() entries, without dimension; displace() adds to the unknowns. */
size_t section_solver_equations(const struct section_solver *solver);
bool section_solver_residual(struct section_solver *solver, double *residual);
bool section_solver_tangent_product(struct section_solver *solver, const double *vector, double *product);
void section_solver_displace(struct section_solver *solver, double factor, const double *vector);

#endif
