/* Mesh of a module's cross-section: curved six-node triangles, cavity contours and outline. Internal to model/section.
 * Lengths in m. Node pairs [x, y]; triangles as gmsh orders them: three corners, then mid-sides 01, 12, 20. */
#ifndef TRIBEND_SECTION_MESH_H
#define TRIBEND_SECTION_MESH_H

#include <stddef.h>

#include "section/section_solver.h"

#define SECTION_OUTLINE (-1)
#define SECTION_BORE (-2)

/* A curved boundary edge, from node[0] over mid node[2] to node[1]. */
struct section_edge {
    size_t node[3];
    int chamber; /* 0..2, traversed so that the chamber lies to its left; SECTION_OUTLINE or SECTION_BORE */
    double hoop_stiffness_npm; /* of the fibres wound round the cavity */
};

struct section_mesh {
    size_t node_count;
    double *position_m;   /* [2 * node_count] */
    size_t triangle_count;
    size_t (*triangle)[6];
    size_t *region;       /* of each triangle: 0 the module's material, l + 1 layer l */
    size_t region_count;
    size_t edge_count;
    struct section_edge *edge;
    size_t centre_node;   /* at the section's centre, or the node nearest to it where the centre is hollow */
    double outer_radius_m;
    bool bored;
    double chamber_azimuth_rad[MODULE_CHAMBERS];
};

/* Room for a mesh, empty. */
struct section_mesh *section_mesh_new(size_t nodes, size_t triangles);

/* A disc with `cavity_count` cavities, cavity i belonging to chamber `chamber[i]`: for closed-form checks (a tube, a solid
 * disc), where a module with three chambers does not fit. */
struct section_mesh *section_mesh_create_disc(double outer_radius_m, const struct cavity *cavity, const int *chamber,
                                              size_t cavity_count, double size_m, struct description_error *error);

#endif
