/* What one Gauss point of the section and one edge of a cavity contribute: energy, residual and tangent in closed form.
 * Internal to model/section. Everything is without dimension: lengths over the outer radius, stresses over the initial
 * shear modulus. The five components of a deformation gradient are ordered F11, F12, F21, F22, F33. */
#ifndef TRIBEND_SECTION_ELEMENT_H
#define TRIBEND_SECTION_ELEMENT_H

#include <stdbool.h>
#include <stddef.h>

#include "material/material.h"

#define ELEMENT_NODES 6
#define ELEMENT_CORNERS 3
#define ELEMENT_GAUSS_POINTS 6
#define ELEMENT_DISPLACEMENTS (2 * ELEMENT_NODES)
#define ELEMENT_LOCAL (ELEMENT_DISPLACEMENTS + ELEMENT_CORNERS)
#define GLOBALS 3 /* stretch, curvature x, curvature y */
#define EDGE_NODES 3
#define EDGE_LOCAL (2 * EDGE_NODES)

/* Stretch and curvature of the section. */
struct section_globals {
    double stretch;
    double curvature[2];
};

/* Geometry of one Gauss point, kept from the undeformed mesh. */
struct gauss_point {
    double gradient[ELEMENT_NODES][2]; /* of the six shape functions */
    double weight;
    double hoop[2]; /* unit vector round the section's centre */
};

/* What a region of the section is made of. */
struct element_law {
    struct material material;
    double bulk;                 /* bulk modulus over the solver's shear modulus */
    double corrugation_fraction; /* of the volume; 0: plain */
    struct material corrugation; /* carries hoop stretch only */
};

/* Stress and stiffness of the isochoric law and the pressure constraint at one deformation gradient. */
struct point_response {
    double jacobian;
    double energy;
    double stress[5];       /* derivative of W + q (J - 1) by the deformation gradient */
    double stiffness[5][5];
    double dj[5];           /* derivative of J */
};

struct element_matrix {
    double residual[ELEMENT_LOCAL];
    double tangent[ELEMENT_LOCAL][ELEMENT_LOCAL];
    double global_residual[GLOBALS];
    double global_column[GLOBALS][ELEMENT_LOCAL];
    double global_tangent[GLOBALS][GLOBALS];
};

/* Volume (per reference length) below one edge of a cavity's contour, with its derivatives. */
struct edge_matrix {
    double volume;
    double gradient[EDGE_LOCAL]; /* x and y of the three nodes, in turn */
    double hessian[EDGE_LOCAL][EDGE_LOCAL];
    double global_gradient[GLOBALS];
    double global_column[GLOBALS][EDGE_LOCAL];
};

extern const double element_gauss_shape[ELEMENT_GAUSS_POINTS][ELEMENT_NODES];
extern const double element_gauss_corner[ELEMENT_GAUSS_POINTS][ELEMENT_CORNERS];

/* Shape function gradients and weights of a curved triangle; false where it is folded. */
bool element_geometry(double position[ELEMENT_NODES][2], struct gauss_point point[ELEMENT_GAUSS_POINTS]);
/* `position` is the deformed one. */
void element_deformation(const struct gauss_point *point, size_t index, double position[ELEMENT_NODES][2],
                         const struct section_globals *globals, double gradient[5]);
/* Stress and stiffness at a Gauss point, corrugation included. Stresses over `modulus_pa`. */
void point_response(const struct gauss_point *point, const double gradient[5], double pressure,
                    const struct element_law *law, double modulus_pa, struct point_response *response);
/* False where some Gauss point is turned inside out. */
bool element_assemble(const struct gauss_point point[ELEMENT_GAUSS_POINTS], double position[ELEMENT_NODES][2],
                      const double pressure[ELEMENT_CORNERS], const struct section_globals *globals,
                      const struct element_law *law, double modulus_pa, struct element_matrix *matrix);
void edge_assemble(double position[EDGE_NODES][2], const struct section_globals *globals,
                   struct edge_matrix *matrix);
/* Fibres along an edge, slack under compression: energy stiffness / 2 (stretch - 1)^2 a reference length while the
 * stretch is above one. `stiffness` over shear modulus and outer radius. */
struct fibre_matrix {
    double gradient[EDGE_LOCAL];
    double hessian[EDGE_LOCAL][EDGE_LOCAL];
};
void fibre_assemble(double rest[EDGE_NODES][2], double position[EDGE_NODES][2], double stiffness,
                    struct fibre_matrix *matrix);

#endif
