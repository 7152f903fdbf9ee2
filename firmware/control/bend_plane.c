#include "control/bend_plane.h"

#define STENCIL 4u

static const enum bend_table_channel curvatures[2] = {BEND_TABLE_CURVATURE_X, BEND_TABLE_CURVATURE_Y};

void bend_plane_expect(struct bend_plane *plane, uint32_t lead, uint32_t follow) {
    plane->stencil.cell[plane->chamber[BEND_PLANE_LEAD]] = plane->floor_cell[BEND_PLANE_LEAD] + lead;
    plane->stencil.cell[plane->chamber[BEND_PLANE_FOLLOW]] = plane->floor_cell[BEND_PLANE_FOLLOW] + follow;
}

static uint32_t floor_cell(const struct bend_plane *plane, uint32_t role, float floor_pa) {
    const bool known = role > 0u && plane->table->axes_alike;
    return known ? plane->floor_cell[0] : bend_table_cell(plane->table, plane->chamber[role], floor_pa);
}

void bend_plane_open(struct bend_plane *plane, const struct bend_table *table, uint32_t lead, float floor_pa) {
    const uint32_t stride[3] = {table->nodes[2] * table->nodes[1], table->nodes[2], 1u};
    uint32_t first = 0u;
    plane->table = table;
    plane->floor_pa = floor_pa;
    for (uint32_t role = 0; role < 3u; role++) {
        const uint32_t chamber = lead + role < 3u ? lead + role : lead + role - 3u;
        plane->chamber[role] = chamber;
        plane->stride[role] = stride[chamber];
        plane->floor_cell[role] = floor_pa > 0.0f ? floor_cell(plane, role, floor_pa) : 0u;
        first += stride[chamber] * plane->floor_cell[role];
    }
    const uint32_t rest = plane->chamber[BEND_PLANE_REST];
    const float *axis = table->axis_pa[rest] + plane->floor_cell[BEND_PLANE_REST];
    plane->floor_share = (floor_pa - axis[0]) / (axis[1] - axis[0]);
    plane->stencil.cell[rest] = plane->floor_cell[BEND_PLANE_REST];
    bend_plane_expect(plane, 0u, 0u);
    if (plane->floor_share > 0.0f) {
        bend_table_locate_in_cell(table, rest, plane->floor_cell[BEND_PLANE_REST], floor_pa, &plane->stencil);
    }
    for (uint32_t i = 0; i < 2u; i++) {
        plane->node[i] = table->channel[curvatures[i]] + first;
    }
}

/* --- exactly --- */

struct line {
    float value;
    float slope; /* by the follower's pressure */
};

/* Four nodes across the resting chamber's axis. */
static inline float across(const float *node, uint32_t stride, const float weight[STENCIL]) {
    return weight[0] * node[0] + weight[1] * node[stride] + weight[2] * node[2u * stride] +
           weight[3] * node[3u * stride];
}

/* Four nodes along the follower's axis, weighed for value and slope. Written out: a loop's turn costs as much as a
 * node. */
static inline struct line weigh(const float w[STENCIL], const float d[STENCIL], float a, float b, float c, float e) {
    return (struct line){w[0] * a + w[1] * b + w[2] * c + w[3] * e, d[0] * a + d[1] * b + d[2] * c + d[3] * e};
}

/* One curvature: value, and slopes by lead and follower. `rest` NULL: the third axis is at a node. */
static inline float contract(const struct bend_plane *plane, const float *node, const float *rest, float slope[2]) {
    const struct bend_table_stencil *stencil = &plane->stencil;
    const uint32_t leader = plane->chamber[BEND_PLANE_LEAD], follower = plane->chamber[BEND_PLANE_FOLLOW];
    const uint32_t next = plane->stride[BEND_PLANE_FOLLOW], deep = plane->stride[BEND_PLANE_REST];
    const float *w = stencil->weight[follower], *d = stencil->derivative[follower];
    float value = 0.0f, by_lead = 0.0f, by_follow = 0.0f;
    for (uint32_t i = 0; i < STENCIL; i++) {
        const struct line line =
            rest == NULL ? weigh(w, d, node[0], node[next], node[2u * next], node[3u * next])
                         : weigh(w, d, across(node, deep, rest), across(node + next, deep, rest),
                                 across(node + 2u * next, deep, rest), across(node + 3u * next, deep, rest));
        value += stencil->weight[leader][i] * line.value;
        by_lead += stencil->derivative[leader][i] * line.value;
        by_follow += stencil->weight[leader][i] * line.slope;
        node += plane->stride[BEND_PLANE_LEAD];
    }
    slope[0] = by_lead;
    slope[1] = by_follow;
    return value;
}

/* Most looks are next to the one before: in its cell, or a neighbour of it. */
static uint32_t cell_of(const struct bend_plane *plane, uint32_t chamber, float pressure_pa) {
    const float *axis = plane->table->axis_pa[chamber];
    uint32_t cell = plane->stencil.cell[chamber];
    if (pressure_pa < axis[cell]) {
        cell -= cell > 0u ? 1u : 0u;
    } else if (pressure_pa >= axis[cell + 1u]) {
        cell += cell + 2u < plane->table->nodes[chamber] ? 1u : 0u;
    }
    const bool there = axis[cell] <= pressure_pa && pressure_pa < axis[cell + 1u];
    return there ? cell : bend_table_cell(plane->table, chamber, pressure_pa);
}

static inline void locate(struct bend_plane *plane, uint32_t chamber, float pressure_pa) {
    const uint32_t cell = cell_of(plane, chamber, pressure_pa);
    bend_table_locate_in_cell(plane->table, chamber, cell, pressure_pa, &plane->stencil);
}

void bend_plane_evaluate(struct bend_plane *plane, float lead_pa, float follow_pa, struct bend_plane_point *point) {
    const struct bend_table *table = plane->table;
    struct bend_table_stencil *stencil = &plane->stencil;
    const uint32_t leader = plane->chamber[BEND_PLANE_LEAD], follower = plane->chamber[BEND_PLANE_FOLLOW];
    const uint32_t rest = plane->chamber[BEND_PLANE_REST];
    locate(plane, leader, lead_pa);
    locate(plane, follower, follow_pa);
    const uint32_t first = plane->stride[BEND_PLANE_LEAD] * stencil->first[leader] +
                           plane->stride[BEND_PLANE_FOLLOW] * stencil->first[follower];
    if (plane->floor_share > 0.0f) {
        const uint32_t at = first + plane->stride[BEND_PLANE_REST] * stencil->first[rest];
        for (uint32_t i = 0; i < 2u; i++) {
            point->curvature[i] =
                contract(plane, table->channel[curvatures[i]] + at, stencil->weight[rest], point->slope[i]);
        }
    } else {
        const uint32_t at = first + plane->stride[BEND_PLANE_REST] * stencil->cell[rest];
        for (uint32_t i = 0; i < 2u; i++) {
            point->curvature[i] = contract(plane, table->channel[curvatures[i]] + at, NULL, point->slope[i]);
        }
    }
    point->valid = bend_table_cell_is_valid(table, stencil->cell);
}

/* --- at nodes --- */

uint32_t bend_plane_nodes(const struct bend_plane *plane, enum bend_plane_role role) {
    return plane->table->nodes[plane->chamber[role]] - 1u - plane->floor_cell[role];
}

float bend_plane_pressure(const struct bend_plane *plane, enum bend_plane_role role, uint32_t node) {
    const float *axis = plane->table->axis_pa[plane->chamber[role]] + plane->floor_cell[role];
    return node == 0u ? plane->floor_pa : axis[node];
}

uint32_t bend_plane_cell(const struct bend_plane *plane, enum bend_plane_role role, float pressure_pa) {
    return cell_of(plane, plane->chamber[role], pressure_pa) - plane->floor_cell[role];
}

bool bend_plane_cell_is_valid(const struct bend_plane *plane, uint32_t lead, uint32_t follow) {
    uint32_t cell[3];
    cell[plane->chamber[BEND_PLANE_LEAD]] = plane->floor_cell[BEND_PLANE_LEAD] + lead;
    cell[plane->chamber[BEND_PLANE_FOLLOW]] = plane->floor_cell[BEND_PLANE_FOLLOW] + follow;
    cell[plane->chamber[BEND_PLANE_REST]] = plane->floor_cell[BEND_PLANE_REST];
    return bend_table_cell_is_valid(plane->table, cell);
}
