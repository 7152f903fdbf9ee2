/* What is read off an equilibrium: bend, volumes, widths, stress at the apex, greatest stretch, contact. */
#include <math.h>
#include <string.h>

#include "material/material_stability.h"
#include "section/section_internal.h"

#define WIDTH_DIRECTIONS 60    /* over 180 degrees */
#define APEX_HALF_WIDTH 0.5    /* of the wall: the strip through the apex wall that is averaged */

static void deformed_node(const struct section_solver *solver, size_t node, double position[2]) {
    for (size_t d = 0; d < 2; d++) {
        const size_t equation = solver->displacement_equation[2 * node + d];
        position[d] = solver->rest[2 * node + d] + (equation == NO_EQUATION ? 0.0 : solver->unknown[equation]);
    }
}

/* Extent of the outline along a direction: mid-side nodes included, so a curved edge is met on five points. */
static double width_along(const struct section_solver *solver, double x, double y) {
    double least = INFINITY, most = -INFINITY;
    for (size_t e = 0; e < solver->mesh->edge_count; e++) {
        const struct section_edge *edge = &solver->mesh->edge[e];
        for (size_t a = 0; a < EDGE_NODES && edge->chamber == SECTION_OUTLINE; a++) {
            double position[2];
            deformed_node(solver, edge->node[a], position);
            least = fmin(least, x * position[0] + y * position[1]);
            most = fmax(most, x * position[0] + y * position[1]);
        }
    }
    return (most - least) * solver->radius_m;
}

static double triangle_q(const struct section_solver *solver, size_t triangle, size_t gauss) {
    double q = 0.0;
    for (size_t c = 0; c < ELEMENT_CORNERS; c++) {
        q += element_gauss_corner[gauss][c] * section_corner_pressure(solver, triangle, c);
    }
    return q;
}

/* Von Mises of the Cauchy stress P F' / J, over the shear modulus. */
static double von_mises(const double g[5], const struct point_response *response) {
    const double *p = response->stress, j = response->jacobian;
    const double xx = (p[0] * g[0] + p[1] * g[1]) / j, xy = (p[0] * g[2] + p[1] * g[3]) / j;
    const double yy = (p[2] * g[2] + p[3] * g[3]) / j, zz = p[4] * g[4] / j;
    return sqrt(0.5 * ((xx - yy) * (xx - yy) + (yy - zz) * (yy - zz) + (zz - xx) * (zz - xx)) + 3.0 * xy * xy);
}

static void principal_stretches(const double g[5], double stretch[3]) {
    const double sum = g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + g[3] * g[3];
    const double area = g[0] * g[3] - g[1] * g[2];
    stretch[0] = sqrt(0.5 * (sum + sqrt(fmax(0.0, sum * sum - 4.0 * area * area))));
    stretch[1] = area / stretch[0];
    stretch[2] = g[4];
}

/* Is this undeformed point in the strip through the wall outside the apex of a chamber at `azimuth`? */
static bool in_apex_wall(const double rest[2], double azimuth, double apex) {
    const double along = rest[0] * cos(azimuth) + rest[1] * sin(azimuth);
    const double across = rest[1] * cos(azimuth) - rest[0] * sin(azimuth);
    return along > apex && fabs(across) < APEX_HALF_WIDTH * (1.0 - apex);
}

/* Outermost point of a cavity's contour on its chamber's azimuth. */
static double apex_radius(const struct section_solver *solver, int chamber) {
    const double azimuth = solver->mesh->chamber_azimuth_rad[chamber];
    double most = 0.0;
    for (size_t e = 0; e < solver->mesh->edge_count; e++) {
        for (size_t a = 0; a < EDGE_NODES && solver->mesh->edge[e].chamber == chamber; a++) {
            const double *rest = &solver->rest[2 * solver->mesh->edge[e].node[a]];
            most = fmax(most, rest[0] * cos(azimuth) + rest[1] * sin(azimuth));
        }
    }
    return most;
}

static void read_strains(const struct section_solver *solver, struct section_state *state) {
    int loaded = 0;
    for (int c = 1; c < MODULE_CHAMBERS; c++) {
        loaded = solver->pressure[c] > solver->pressure[loaded] ? c : loaded;
    }
    const double azimuth = solver->mesh->chamber_azimuth_rad[loaded], apex = apex_radius(solver, loaded);
    double stress = 0.0, weight = 0.0;
    struct section_globals globals;
    section_globals_of(solver, &globals);
    state->stretch_max = 1.0;
    state->elliptic = true;
    for (size_t t = 0; t < solver->mesh->triangle_count; t++) {
        const struct element_law *law = &solver->law[solver->mesh->region[t]];
        const bool doubtful = !material_always_elliptic(&law->material);
        double position[ELEMENT_NODES][2];
        section_deformed_triangle(solver, t, position);
        for (size_t p = 0; p < ELEMENT_GAUSS_POINTS; p++) {
            double g[5], rest[2] = {0.0, 0.0}, stretch[3];
            element_deformation(&solver->gauss[t][p], p, position, &globals, g);
            principal_stretches(g, stretch);
            const double most = fmax(stretch[0], stretch[2]);
            state->stretch_max = fmax(state->stretch_max, most);
            state->beyond_strain = state->beyond_strain || most > 1.0 + law->material.strain_max;
            state->elliptic = state->elliptic && !(doubtful && material_ellipticity_margin(&law->material, stretch) <= 0.0);
            for (size_t a = 0; a < ELEMENT_NODES; a++) {
                rest[0] += element_gauss_shape[p][a] * solver->rest[2 * solver->mesh->triangle[t][a]];
                rest[1] += element_gauss_shape[p][a] * solver->rest[2 * solver->mesh->triangle[t][a] + 1];
            }
            if (in_apex_wall(rest, azimuth, apex)) {
                struct point_response response;
                point_response(&solver->gauss[t][p], g, triangle_q(solver, t, p), law, solver->modulus_pa, &response);
                stress += solver->gauss[t][p].weight * von_mises(g, &response);
                weight += solver->gauss[t][p].weight;
            }
        }
    }
    state->von_mises_apex_pa = weight > 0.0 ? stress / weight * solver->modulus_pa : 0.0;
}

static double cross(const double a[2], const double b[2], const double c[2]) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Do two edges, taken as chords, cross? Edges that share a node do not count. */
static bool edges_cross(const struct section_solver *solver, const struct section_edge *one,
                        const struct section_edge *other) {
    if (one->node[0] == other->node[1] || one->node[1] == other->node[0] || one->node[0] == other->node[0] ||
        one->node[1] == other->node[1]) {
        return false;
    }
    double a[2], b[2], c[2], d[2];
    deformed_node(solver, one->node[0], a);
    deformed_node(solver, one->node[1], b);
    deformed_node(solver, other->node[0], c);
    deformed_node(solver, other->node[1], d);
    return cross(a, b, c) * cross(a, b, d) < 0.0 && cross(c, d, a) * cross(c, d, b) < 0.0;
}

static bool walls_cross(const struct section_solver *solver) {
    const struct section_mesh *mesh = solver->mesh;
    for (size_t e = 0; e < mesh->edge_count; e++) {
        for (size_t f = e + 1; f < mesh->edge_count; f++) {
            if (mesh->edge[e].chamber == mesh->edge[f].chamber && edges_cross(solver, &mesh->edge[e], &mesh->edge[f])) {
                return true;
            }
        }
    }
    return false;
}

static void read_volumes(const struct section_solver *solver, double volume_m2[MODULE_CHAMBERS]) {
    struct section_globals globals;
    section_globals_of(solver, &globals);
    memset(volume_m2, 0, MODULE_CHAMBERS * sizeof(double));
    for (size_t e = 0; e < solver->mesh->edge_count; e++) {
        const struct section_edge *edge = &solver->mesh->edge[e];
        if (edge->chamber >= 0) {
            double position[EDGE_NODES][2];
            struct edge_matrix matrix;
            for (size_t a = 0; a < EDGE_NODES; a++) {
                deformed_node(solver, edge->node[a], position[a]);
            }
            edge_assemble(position, &globals, &matrix);
            volume_m2[edge->chamber] += matrix.volume * solver->radius_m * solver->radius_m;
        }
    }
}

static void bore_middle(const struct section_solver *solver, double middle[2]) {
    double count = 0.0;
    middle[0] = 0.0;
    middle[1] = 0.0;
    for (size_t e = 0; e < solver->mesh->edge_count; e++) {
        if (solver->mesh->edge[e].chamber == SECTION_BORE) {
            double position[2];
            deformed_node(solver, solver->mesh->edge[e].node[2], position);
            middle[0] += position[0];
            middle[1] += position[1];
            count += 1.0;
        }
    }
    middle[0] /= count;
    middle[1] /= count;
}

/* Chamber 1 (+x) under pressure lengthens the fibres at +x (curvature[1] < 0) and moves the tip towards -x: the
 * reported vector points where the tip moves. */
void section_solver_state(struct section_solver *solver, struct section_state *state) {
    struct section_globals globals;
    section_globals_of(solver, &globals);
    memset(state, 0, sizeof *state);
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        state->pressure_pa[c] = solver->pressure[c] * solver->modulus_pa;
    }
    state->curvature_x_1pm = globals.curvature[1] / solver->radius_m;
    state->curvature_y_1pm = -globals.curvature[0] / solver->radius_m;
    state->stretch = globals.stretch;
    if (solver->mesh->bored) { /* the pinned node lies on the bore's wall: move to the deformed bore's middle */
        double middle[2];
        bore_middle(solver, middle);
        state->stretch += globals.curvature[0] * middle[1] - globals.curvature[1] * middle[0];
    }
    read_volumes(solver, state->volume_m2);
    const double curvature = hypot(state->curvature_x_1pm, state->curvature_y_1pm);
    const bool bent = curvature * solver->radius_m > 1e-9;
    const double x = bent ? state->curvature_x_1pm / curvature : 1.0, y = bent ? state->curvature_y_1pm / curvature : 0.0;
    state->width_bend_plane_m = width_along(solver, x, y);
    state->width_across_m = width_along(solver, -y, x);
    for (int i = 0; i < WIDTH_DIRECTIONS; i++) {
        const double angle = i * M_PI / WIDTH_DIRECTIONS;
        state->width_max_m = fmax(state->width_max_m, width_along(solver, cos(angle), sin(angle)));
    }
    read_strains(solver, state);
    state->stable = solver->stable;
    state->contact = walls_cross(solver);
    state->newton_iterations = solver->iterations;
}

void section_solver_field(const struct section_solver *solver, double *position_m, double *triangle_stretch) {
    struct section_globals globals;
    section_globals_of(solver, &globals);
    for (size_t i = 0; i < solver->mesh->node_count; i++) {
        deformed_node(solver, i, &position_m[2 * i]);
        position_m[2 * i] *= solver->radius_m;
        position_m[2 * i + 1] *= solver->radius_m;
    }
    for (size_t t = 0; t < solver->mesh->triangle_count; t++) {
        double position[ELEMENT_NODES][2];
        section_deformed_triangle(solver, t, position);
        triangle_stretch[t] = 1.0;
        for (size_t p = 0; p < ELEMENT_GAUSS_POINTS; p++) {
            double g[5], stretch[3];
            element_deformation(&solver->gauss[t][p], p, position, &globals, g);
            principal_stretches(g, stretch);
            triangle_stretch[t] = fmax(triangle_stretch[t], fmax(stretch[0], stretch[2]));
        }
    }
}
