/* A module under gravity and a tip load: a geometrically exact rod without shear (Antman 2005, chapter 8), whose stretch and
 * curvature at every station are those of the section's own equilibrium under the chamber pressures and the axial force and
 * moment there. End caps are rigid. SI units; base frame: z along the straight module, x through chamber 1. */
#ifndef TRIBEND_ROD_H
#define TRIBEND_ROD_H

#include "section/section_solver.h"

#define ROD_STATIONS_MAX 65

struct rod_load {
    double pressure_pa[3];
    double gravity_mps2[3];   /* in the base frame */
    double payload_kg;        /* at the middle of the tip face */
    double force_n[3];        /* there, too, and fixed in the base frame */
};

struct rod_state {
    size_t stations;                       /* along the chamber, both ends included */
    double position_m[ROD_STATIONS_MAX][3];
    double tip_position_m[3];              /* of the tip face's middle */
    double tip_axis[3];
    double bend_rad;                       /* between base and tip axis */
    double direction_rad;                  /* towards which the tip axis leans */
    double moment_most_nm;                 /* greatest bending moment */
    int iterations;
};

/* `stations` from 3 to ROD_STATIONS_MAX. False: no equilibrium was found; `error` says where. */
bool rod_solve(const struct module_description *module, struct section_solver *solver, const struct rod_load *load,
               size_t stations, struct rod_state *state, struct description_error *error);
/* Rubber's area of the undeformed section, m2. */
double rod_section_area_m2(const struct module_description *module);

#endif
