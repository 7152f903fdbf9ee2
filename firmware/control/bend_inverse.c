/* Two chambers next to the wanted direction do the bending, the third holds the co-contraction.
 *
 * The two are nearly independent: each bends towards its own side by a steep function of its own pressure. So the cell
 * of the table is found chamber by chamber, by bisection over nodes; a linear guess inside it and Newton on the
 * interpolant give the answer, as a rule at the second look. Where limits are in the way, the answer lies where the
 * curve of points that bend in the wanted direction leaves what is allowed: that curve is followed inwards from the
 * limits, cell by cell, until the table holds, and met with the cell's edge. Signs at nodes alone lead the walk. Alone,
 * chamber k moves the tip towards 180 + 120 k degrees. */
#include "control/bend_inverse.h"

#include "control/real_math.h"

#define RESIDUAL_WANTED_RAD 1e-4f /* half the noise of a tip sensor */
#define RESIDUAL_ACCEPTED_RAD 3e-4f
#define SEARCH_EVALUATIONS 20u
#define EDGE_EVALUATIONS 8u
#define WALK_CELLS 8u /* in one step */
#define NO_BEND_RAD 1e-6f
#define INSIDE 0.999999f /* of an edge's pressure: on this side of it */

/* Where each chamber alone moves the tip. */
static const float push[3][2] = {{-1.0f, 0.0f}, {0.5f, -0.866025404f}, {0.5f, 0.866025404f}};

static float cross(const float a[2], const float b[2]) {
    return a[0] * b[1] - a[1] * b[0];
}

/* --- the cell --- */

/* Once a pressure was as high as it may be, the answer may lie anywhere on the edge of what is allowed. */
static void note_ceiling(struct bend_inverse *inverse) {
    inverse->capped = inverse->capped || inverse->pressure_pa[0] >= inverse->ceiling_pa ||
                      inverse->pressure_pa[1] >= inverse->ceiling_pa;
}

/* How far the lead pushes at a node: its share of the bend, but for a factor. */
static inline float lead_push_at(const struct bend_inverse *inverse, uint32_t lead, uint32_t follow) {
    float curvature[2];
    bend_plane_node(&inverse->plane, lead, follow, curvature);
    return cross(curvature, push[inverse->plane.chamber[BEND_PLANE_FOLLOW]]);
}

static inline float follow_push_at(const struct bend_inverse *inverse, uint32_t lead, uint32_t follow) {
    float curvature[2];
    bend_plane_node(&inverse->plane, lead, follow, curvature);
    return cross(push[inverse->plane.chamber[BEND_PLANE_LEAD]], curvature);
}

/* The last node of the lead that pushes no more than wanted, the follower at the floor. */
static uint32_t bisect_lead(const struct bend_inverse *inverse, float wanted) {
    uint32_t low = 0u, high = bend_plane_nodes(&inverse->plane, BEND_PLANE_LEAD);
    while (high - low > 1u) {
        const uint32_t middle = (low + high) / 2u;
        if (lead_push_at(inverse, middle, 0u) <= wanted) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

static uint32_t bisect_follow(const struct bend_inverse *inverse, uint32_t lead, float wanted) {
    uint32_t low = 0u, high = bend_plane_nodes(&inverse->plane, BEND_PLANE_FOLLOW);
    while (high - low > 1u) {
        const uint32_t middle = (low + high) / 2u;
        if (follow_push_at(inverse, lead, middle) <= wanted) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

/* The follower takes a little off the lead's push, or adds to it. */
static uint32_t correct_lead(const struct bend_inverse *inverse, uint32_t lead, uint32_t follow, float wanted) {
    if (lead + 1u < bend_plane_nodes(&inverse->plane, BEND_PLANE_LEAD) &&
        lead_push_at(inverse, lead + 1u, follow) <= wanted) {
        return lead + 1u;
    }
    return lead > 0u && lead_push_at(inverse, lead, follow) > wanted ? lead - 1u : lead;
}

static float between(const struct bend_inverse *inverse, enum bend_plane_role role, uint32_t node, float share) {
    const float low_pa = bend_plane_pressure(&inverse->plane, role, node);
    const float high_pa = bend_plane_pressure(&inverse->plane, role, node + 1u);
    return real_clamp(low_pa + share * (high_pa - low_pa), inverse->plane.floor_pa, inverse->ceiling_pa);
}

/* The pressure is in its cell, but for what the other chamber does to it. */
static void bracket(struct bend_inverse *inverse, enum bend_plane_role role, uint32_t node) {
    const uint32_t nodes = bend_plane_nodes(&inverse->plane, role);
    const float low_pa = bend_plane_pressure(&inverse->plane, role, node > 0u ? node - 1u : 0u);
    const float high_pa = bend_plane_pressure(&inverse->plane, role, node + 2u < nodes ? node + 2u : nodes);
    inverse->low_pa[role] = low_pa;
    inverse->high_pa[role] = real_min(high_pa, inverse->ceiling_pa);
    inverse->slack_pa[role] = 0.1f * (high_pa - low_pa);
}

/* Start: the cell, and in it where planes through three of its corners meet what is wanted. */
static void find_start(struct bend_inverse *inverse) {
    const float target[2] = {inverse->wanted * inverse->toward[0], inverse->wanted * inverse->toward[1]};
    const uint32_t *chamber = inverse->plane.chamber;
    const float lead_push = cross(target, push[chamber[BEND_PLANE_FOLLOW]]);
    const float follow_push = cross(push[chamber[BEND_PLANE_LEAD]], target);
    const uint32_t alone = bisect_lead(inverse, lead_push);
    const uint32_t j = bisect_follow(inverse, alone, follow_push);
    const uint32_t i = correct_lead(inverse, alone, j, lead_push);
    float corner[2], by_lead[2], by_follow[2];
    bend_plane_node(&inverse->plane, i, j, corner);
    bend_plane_node(&inverse->plane, i + 1u, j, by_lead);
    bend_plane_node(&inverse->plane, i, j + 1u, by_follow);
    const float gap[2] = {target[0] - corner[0], target[1] - corner[1]};
    for (uint32_t k = 0; k < 2u; k++) {
        by_lead[k] -= corner[k];
        by_follow[k] -= corner[k];
    }
    const float determinant = cross(by_lead, by_follow);
    const bool flat = !(real_abs(determinant) > 0.0f);
    const float lead = flat ? 0.5f : cross(gap, by_follow) / determinant;
    const float follow = flat ? 0.5f : cross(by_lead, gap) / determinant;
    bend_plane_expect(&inverse->plane, i, j);
    bracket(inverse, BEND_PLANE_LEAD, i);
    bracket(inverse, BEND_PLANE_FOLLOW, j);
    inverse->pressure_pa[0] = between(inverse, BEND_PLANE_LEAD, i, real_clamp(lead, -1.0f, 2.0f));
    inverse->pressure_pa[1] = between(inverse, BEND_PLANE_FOLLOW, j, real_clamp(follow, -1.0f, 2.0f));
    note_ceiling(inverse);
}

/* --- the request --- */

static float ceiling_of(const struct bend_table *table) {
    float ceiling_pa = table->module.working_pressure_pa;
    for (uint32_t a = 0; a < 3u; a++) {
        ceiling_pa = real_min(ceiling_pa, table->axis_pa[a][table->nodes[a] - 1u]);
    }
    return ceiling_pa;
}

/* The chamber whose push lies clockwise of the direction or in it, the next one's being counter-clockwise of it. */
static uint32_t lead_of(const float toward[2]) {
    if (cross(push[0], toward) >= 0.0f && cross(toward, push[1]) > 0.0f) {
        return 0u;
    }
    return cross(push[1], toward) >= 0.0f && cross(toward, push[2]) > 0.0f ? 1u : 2u;
}

static void rest(struct bend_inverse *inverse) {
    inverse->pressure_pa[0] = inverse->plane.floor_pa;
    inverse->pressure_pa[1] = inverse->plane.floor_pa;
    inverse->stage = BEND_INVERSE_REST;
}

void bend_inverse_begin(struct bend_inverse *inverse, const struct bend_table *table, const float bend_rad[2],
                        float co_contraction_pa) {
    const float size_rad = real_hypot(bend_rad[0], bend_rad[1]), limit_rad = table->module.bend_limit_rad;
    const bool finite = real_is_finite(bend_rad[0]) && real_is_finite(bend_rad[1]) && real_is_finite(co_contraction_pa);
    const bool bends = finite && size_rad >= NO_BEND_RAD;
    const float floor_pa = finite ? real_max(co_contraction_pa, 0.0f) : 0.0f;
    inverse->ceiling_pa = ceiling_of(table);
    inverse->flags = finite ? 0u : (uint32_t)BEND_INVERSE_NOT_FINITE;
    inverse->flags |= finite && size_rad > limit_rad ? (uint32_t)BEND_INVERSE_LIMITED_BEND : 0u;
    inverse->flags |= floor_pa > inverse->ceiling_pa ? (uint32_t)BEND_INVERSE_LIMITED_CO_CONTRACTION : 0u;
    inverse->evaluations = 0u;
    inverse->edge_evaluations = 0u;
    inverse->steps = 0u;
    inverse->turned = false;
    inverse->cornered = false;
    inverse->capped = false;
    inverse->found = false;
    inverse->length_m = table->module.active_length_m;
    inverse->wanted = bends ? real_min(size_rad, limit_rad) / inverse->length_m : 0.0f;
    inverse->toward[0] = bends ? bend_rad[0] / size_rad : 1.0f;
    inverse->toward[1] = bends ? bend_rad[1] / size_rad : 0.0f;
    inverse->lead = lead_of(inverse->toward);
    inverse->plane.table = table;
    inverse->plane.floor_pa = real_min(floor_pa, inverse->ceiling_pa);
    inverse->stage = BEND_INVERSE_START;
}

static void start(struct bend_inverse *inverse) {
    bend_plane_open(&inverse->plane, inverse->plane.table, inverse->lead, inverse->plane.floor_pa);
    if (inverse->wanted > 0.0f) {
        inverse->stage = BEND_INVERSE_SEARCH;
        find_start(inverse);
    } else {
        rest(inverse);
    }
}

/* --- looking at the table --- */

/* Where the pressures stand now, and what is missing there; returns the residual in rad. */
static float look(struct bend_inverse *inverse, struct bend_plane_point *point, float gap[2]) {
    const float *pressure_pa = inverse->pressure_pa;
    bend_plane_evaluate(&inverse->plane, pressure_pa[0], pressure_pa[1], point);
    gap[0] = inverse->wanted * inverse->toward[0] - point->curvature[0];
    gap[1] = inverse->wanted * inverse->toward[1] - point->curvature[1];
    inverse->evaluations++;
    return inverse->length_m * real_hypot(gap[0], gap[1]);
}

static void keep(struct bend_inverse *inverse, const struct bend_plane_point *point, float residual_rad) {
    const uint32_t *chamber = inverse->plane.chamber;
    inverse->found = true;
    inverse->found_pa[chamber[BEND_PLANE_LEAD]] = inverse->pressure_pa[0];
    inverse->found_pa[chamber[BEND_PLANE_FOLLOW]] = inverse->pressure_pa[1];
    inverse->found_pa[chamber[BEND_PLANE_REST]] = inverse->plane.floor_pa;
    inverse->found_curvature[0] = point->curvature[0];
    inverse->found_curvature[1] = point->curvature[1];
    inverse->found_residual_rad = residual_rad;
}

/* --- the edge of what is allowed --- */

/* On which side of the wanted direction a node bends: positive counter-clockwise, the follower's side. */
static float side_of(const struct bend_inverse *inverse, uint32_t lead, uint32_t follow) {
    float curvature[2];
    bend_plane_node(&inverse->plane, lead, follow, curvature);
    return cross(inverse->toward, curvature);
}

/* Where the curve of the wanted direction leaves the square of allowed pressures: the cell, and the edge. */
static void find_exit(struct bend_inverse *inverse) {
    const uint32_t last[2] = {bend_plane_cell(&inverse->plane, BEND_PLANE_LEAD, inverse->ceiling_pa),
                              bend_plane_cell(&inverse->plane, BEND_PLANE_FOLLOW, inverse->ceiling_pa)};
    const bool leads = side_of(inverse, last[0] + 1u, last[1] + 1u) > 0.0f;
    const uint32_t free = leads ? 1u : 0u;
    uint32_t low = 0u, high = last[free] + 1u;
    while (high - low > 1u) {
        const uint32_t middle = (low + high) / 2u;
        const float side = leads ? side_of(inverse, last[0] + 1u, middle) : -side_of(inverse, middle, last[1] + 1u);
        if (side <= 0.0f) {
            low = middle;
        } else {
            high = middle;
        }
    }
    inverse->edge = leads ? BEND_PLANE_LEAD : BEND_PLANE_FOLLOW;
    inverse->cell[0] = leads ? last[0] : low;
    inverse->cell[1] = leads ? low : last[1];
    inverse->stage = BEND_INVERSE_WALK;
}

/* On the cell's far edge, where the signs say that the curve passes. */
static void stand_on_edge(struct bend_inverse *inverse) {
    const uint32_t kept = (uint32_t)inverse->edge, free = 1u - kept, *cell = inverse->cell;
    const uint32_t lead = cell[0] + 1u - kept, follow = cell[1] + kept; /* the edge's first node */
    const float low = side_of(inverse, lead, follow), high = side_of(inverse, lead + kept, follow + free);
    const float share = real_abs(high - low) > 0.0f ? real_clamp(low / (low - high), 0.0f, INSIDE) : 0.5f;
    const float edge_pa = bend_plane_pressure(&inverse->plane, inverse->edge, cell[kept] + 1u);
    inverse->pressure_pa[kept] =
        edge_pa <= inverse->ceiling_pa ? real_max(INSIDE * edge_pa, inverse->plane.floor_pa) : inverse->ceiling_pa;
    inverse->pressure_pa[free] = between(inverse, (enum bend_plane_role)free, cell[free], share);
    inverse->stage = BEND_INVERSE_EDGE;
}

static void walk(struct bend_inverse *inverse) {
    uint32_t *cell = inverse->cell;
    for (uint32_t i = 0; i < WALK_CELLS; i++) {
        if (bend_plane_cell_is_valid(&inverse->plane, cell[0], cell[1])) {
            stand_on_edge(inverse);
            return;
        }
        if (cell[0] == 0u && cell[1] == 0u) {
            rest(inverse);
            return;
        }
        /* the curve comes in through the lead's edge where the near corner lies on the lead's side of it */
        const bool leads = cell[1] == 0u || (cell[0] > 0u && side_of(inverse, cell[0], cell[1]) <= 0.0f);
        inverse->edge = leads ? BEND_PLANE_LEAD : BEND_PLANE_FOLLOW;
        cell[inverse->edge]--;
    }
}

/* Newton for the wanted direction. */
static void follow_edge(struct bend_inverse *inverse) {
    const uint32_t kept = (uint32_t)inverse->edge, free = 1u - kept;
    struct bend_plane_point point;
    float gap[2];
    const float residual_rad = look(inverse, &point, gap);
    const float side = cross(inverse->toward, point.curvature);
    const float by_free[2] = {point.slope[0][free], point.slope[1][free]};
    const float slope = cross(inverse->toward, by_free);
    const float along = inverse->toward[0] * point.curvature[0] + inverse->toward[1] * point.curvature[1];
    /* the first is valid, in the cell where the walk ended; one that bends too far shows a search that failed, and is
     * no better than what that found */
    if (point.valid && (along <= inverse->wanted || !inverse->found)) {
        keep(inverse, &point, residual_rad);
    }
    if (!point.valid || inverse->length_m * real_abs(side) <= RESIDUAL_WANTED_RAD ||
        ++inverse->edge_evaluations >= EDGE_EVALUATIONS || !(real_abs(slope) > 0.0f)) {
        inverse->stage = BEND_INVERSE_DONE;
        return;
    }
    const float present_pa = inverse->pressure_pa[free], next_pa = present_pa - side / slope;
    inverse->pressure_pa[free] = real_clamp(next_pa, inverse->plane.floor_pa, inverse->ceiling_pa);
    if (next_pa > inverse->ceiling_pa && present_pa >= inverse->ceiling_pa && !inverse->cornered) {
        inverse->cornered = true;
        inverse->edge = (enum bend_plane_role)free; /* round the corner */
    }
}

/* --- Newton on both pressures --- */

/* A chamber alone does not push quite where its place says: the direction is the neighbouring pair's. */
static void turn(struct bend_inverse *inverse, bool follower_is_too_much) {
    inverse->lead = inverse->plane.chamber[follower_is_too_much ? BEND_PLANE_REST : BEND_PLANE_FOLLOW];
    inverse->turned = true;
    inverse->stage = BEND_INVERSE_START;
}

/* Newton's step for one of the pressures, or the middle of its bracket where that is far outside. */
static float step_within(const struct bend_inverse *inverse, uint32_t k, float step_pa) {
    const float next_pa = inverse->pressure_pa[k] + step_pa, slack_pa = inverse->slack_pa[k];
    const float low_pa = inverse->low_pa[k], high_pa = inverse->high_pa[k];
    const bool within = next_pa >= low_pa - slack_pa && next_pa <= high_pa + slack_pa;
    return real_clamp(within ? next_pa : 0.5f * (low_pa + high_pa), inverse->plane.floor_pa, inverse->ceiling_pa);
}

/* How the present pressures stand to limits and wishes. */
struct standing {
    bool over;     /* one is at the ceiling, and more is wanted of it */
    bool under[2]; /* it is at the floor, and less is wanted of it */
};

/* Narrows the brackets. `missing`: push that is wanted beyond the present one; `step_pa`: Newton's. */
static struct standing narrow(struct bend_inverse *inverse, const float missing[2], const float step_pa[2]) {
    struct standing standing = {false, {false, false}};
    for (uint32_t k = 0; k < 2u; k++) {
        const float present_pa = inverse->pressure_pa[k];
        const bool more = missing[k] > 0.0f;
        inverse->low_pa[k] = more ? present_pa : real_min(inverse->low_pa[k], present_pa);
        inverse->high_pa[k] = more ? real_max(inverse->high_pa[k], present_pa) : present_pa;
        standing.over = standing.over || (present_pa >= inverse->ceiling_pa && more && step_pa[k] >= 0.0f);
        standing.under[k] = present_pa <= inverse->plane.floor_pa && missing[k] < 0.0f && step_pa[k] <= 0.0f;
    }
    return standing;
}

static void improve(struct bend_inverse *inverse, const struct bend_plane_point *point, const float gap[2],
                    float residual_rad) {
    const uint32_t *chamber = inverse->plane.chamber;
    const float by_lead[2] = {point->slope[0][0], point->slope[1][0]};
    const float by_follow[2] = {point->slope[0][1], point->slope[1][1]};
    const float determinant = cross(by_lead, by_follow);
    const float share = real_abs(determinant) > 0.0f ? 1.0f / determinant : 0.0f;
    const float step_pa[2] = {cross(gap, by_follow) * share, cross(by_lead, gap) * share};
    const float missing[2] = {cross(gap, push[chamber[BEND_PLANE_FOLLOW]]), cross(push[chamber[BEND_PLANE_LEAD]], gap)};
    const struct standing standing = narrow(inverse, missing, step_pa);
    const bool far = residual_rad > RESIDUAL_ACCEPTED_RAD, under = standing.under[0] || standing.under[1];
    inverse->pressure_pa[0] = step_within(inverse, 0u, step_pa[0]);
    inverse->pressure_pa[1] = step_within(inverse, 1u, step_pa[1]);
    note_ceiling(inverse);
    if (far && standing.over) {
        inverse->stage = BEND_INVERSE_LEAVE;
    } else if (far && under && !inverse->turned) {
        turn(inverse, standing.under[1]);
    } else if (!far && point->valid && (standing.over || under)) {
        inverse->stage = BEND_INVERSE_DONE;
    } else if (inverse->evaluations >= SEARCH_EVALUATIONS) {
        inverse->stage = inverse->found ? BEND_INVERSE_DONE : BEND_INVERSE_LEAVE;
    }
}

static void search(struct bend_inverse *inverse) {
    struct bend_plane_point point;
    float gap[2];
    const float residual_rad = look(inverse, &point, gap);
    const bool better = !inverse->found || residual_rad < inverse->found_residual_rad;
    if (point.valid && better) {
        keep(inverse, &point, residual_rad);
    }
    if (residual_rad <= RESIDUAL_WANTED_RAD || (residual_rad <= RESIDUAL_ACCEPTED_RAD && !better)) {
        inverse->stage = point.valid ? BEND_INVERSE_DONE : BEND_INVERSE_LEAVE;
        return;
    }
    improve(inverse, &point, gap, residual_rad);
}

bool bend_inverse_step(struct bend_inverse *inverse) {
    struct bend_plane_point point;
    float gap[2];
    if (++inverse->steps >= BEND_INVERSE_STEPS_MOST && inverse->stage != BEND_INVERSE_DONE) {
        rest(inverse);
    }
    switch (inverse->stage) {
    case BEND_INVERSE_SEARCH:
        search(inverse);
        break;
    case BEND_INVERSE_START:
        start(inverse);
        break;
    case BEND_INVERSE_LEAVE:
        find_exit(inverse);
        break;
    case BEND_INVERSE_WALK:
        walk(inverse);
        break;
    case BEND_INVERSE_EDGE:
        follow_edge(inverse);
        break;
    case BEND_INVERSE_REST:
        keep(inverse, &point, look(inverse, &point, gap));
        inverse->stage = BEND_INVERSE_DONE;
        break;
    case BEND_INVERSE_DONE:
    default:
        break;
    }
    return inverse->stage == BEND_INVERSE_DONE;
}

/* --- answers --- */

bool bend_inverse_preview(const struct bend_inverse *inverse, float pressure_pa[3]) {
    const struct bend_plane *plane = &inverse->plane;
    if (inverse->stage == BEND_INVERSE_DONE) {
        for (uint32_t c = 0; c < 3u; c++) {
            pressure_pa[c] = inverse->found_pa[c];
        }
        return true;
    }
    if (inverse->stage == BEND_INVERSE_SEARCH && !inverse->capped &&
        bend_plane_cell_is_valid(plane, bend_plane_cell(plane, BEND_PLANE_LEAD, inverse->pressure_pa[0]),
                                 bend_plane_cell(plane, BEND_PLANE_FOLLOW, inverse->pressure_pa[1]))) {
        pressure_pa[plane->chamber[BEND_PLANE_LEAD]] = inverse->pressure_pa[0];
        pressure_pa[plane->chamber[BEND_PLANE_FOLLOW]] = inverse->pressure_pa[1];
        pressure_pa[plane->chamber[BEND_PLANE_REST]] = plane->floor_pa;
        return true;
    }
    return false;
}

void bend_inverse_finish(const struct bend_inverse *inverse, struct bend_inverse_result *result) {
    const float *curvature = inverse->found_curvature;
    for (uint32_t c = 0; c < 3u; c++) {
        result->pressure_pa[c] = inverse->found_pa[c];
    }
    result->bend_rad = inverse->length_m * real_hypot(curvature[0], curvature[1]);
    result->direction_rad = real_atan2(curvature[1], curvature[0]);
    result->residual_rad = inverse->found_residual_rad;
    result->flags = inverse->flags;
    result->evaluations = inverse->evaluations;
    if (inverse->found_residual_rad > RESIDUAL_ACCEPTED_RAD) {
        result->flags |= BEND_INVERSE_LIMITED_PRESSURE;
    }
}

void bend_inverse_solve(const struct bend_table *table, const struct bend_inverse_request *request,
                        struct bend_inverse_result *result) {
    const float direction_rad = request->direction_rad;
    /* NaN where either is not finite, else zero */
    const float doubt = (request->bend_rad - request->bend_rad) + (direction_rad - direction_rad);
    const float size_rad = real_clamp(request->bend_rad, 0.0f, 2.0f * table->module.bend_limit_rad);
    const float bend_rad[2] = {size_rad * real_cos(direction_rad) + doubt, size_rad * real_sin(direction_rad) + doubt};
    struct bend_inverse inverse;
    bend_inverse_begin(&inverse, table, bend_rad, request->co_contraction_pa);
    for (uint32_t i = 0; i < BEND_INVERSE_STEPS_MOST && !bend_inverse_step(&inverse); i++) {
    }
    bend_inverse_finish(&inverse, result);
}
