/* The bend over the pressures of two chambers while the third one stands still: what the inverse looks at.
 *
 * Twofold: exactly, as bend_table.h interpolates, with slopes by the two pressures; and at the table's own nodes, where
 * the third chamber's pressure is taken linearly, which costs a twentieth and is good enough to find the cell. Nodes
 * are counted from the cell of the floor: node 0 is the floor itself. Units: curvature in 1/m, Pa. */
#ifndef TRIBEND_BEND_PLANE_H
#define TRIBEND_BEND_PLANE_H

#include "control/bend_table.h"

enum bend_plane_role { BEND_PLANE_LEAD = 0, BEND_PLANE_FOLLOW, BEND_PLANE_REST };

struct bend_plane {
    const struct bend_table *table;
    uint32_t chamber[3]; /* 0..2, by role: lead and follower vary, the third rests at the floor */
    uint32_t stride[3];  /* between nodes along it */
    float floor_pa;
    uint32_t floor_cell[3];
    float floor_share;    /* of the resting chamber's cell below the floor: 0 at a node */
    const float *node[2]; /* node (0, 0) of either curvature */
    struct bend_table_stencil stencil;
};

struct bend_plane_point {
    float curvature[2];
    float slope[2][2]; /* of x, y by the lead's and the follower's pressure, 1/(m Pa) */
    bool valid;        /* the table holds there */
};

/* `lead` 0..2; the follower is the next chamber. `floor_pa` and all pressures that follow lie within the axes. */
void bend_plane_open(struct bend_plane *plane, const struct bend_table *table, uint32_t lead, float floor_pa);
/* The next look is likely to be in this cell. */
void bend_plane_expect(struct bend_plane *plane, uint32_t lead, uint32_t follow);
void bend_plane_evaluate(struct bend_plane *plane, float lead_pa, float follow_pa, struct bend_plane_point *point);
/* Nodes of `role` above the floor. */
uint32_t bend_plane_nodes(const struct bend_plane *plane, enum bend_plane_role role);
/* Pressure of `role` at a node. */
float bend_plane_pressure(const struct bend_plane *plane, enum bend_plane_role role, uint32_t node);
/* Node at or below a pressure that is at least the floor; there is always one above it. */
uint32_t bend_plane_cell(const struct bend_plane *plane, enum bend_plane_role role, float pressure_pa);
bool bend_plane_cell_is_valid(const struct bend_plane *plane, uint32_t lead, uint32_t follow);

/* Curvature at node (lead, follow), about. Over a floor between two nodes it is the mean of the planes at either, each
 * with its own floor, so that chambers at the floor go along. Here for the compiler to unfold: a search asks for a
 * dozen. */
static inline void bend_plane_node(const struct bend_plane *plane, uint32_t lead, uint32_t follow, float curvature[2]) {
    const uint32_t at = plane->stride[BEND_PLANE_LEAD] * lead + plane->stride[BEND_PLANE_FOLLOW] * follow;
    curvature[0] = plane->node[0][at];
    curvature[1] = plane->node[1][at];
    if (plane->floor_share > 0.0f) {
        const uint32_t above = at + plane->stride[BEND_PLANE_REST] +
                               (lead == 0u ? plane->stride[BEND_PLANE_LEAD] : 0u) +
                               (follow == 0u ? plane->stride[BEND_PLANE_FOLLOW] : 0u);
        curvature[0] += plane->floor_share * (plane->node[0][above] - curvature[0]);
        curvature[1] += plane->floor_share * (plane->node[1][above] - curvature[1]);
    }
}

#endif
