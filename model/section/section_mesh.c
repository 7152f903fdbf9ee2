/* From gmsh's triangles to a section: a three-fold, mirror-symmetric module is meshed over one half-wedge of 60 degrees,
 * which is mirrored and turned: the three chambers then have the same mesh and the bend of one chamber does not drift
 * sideways with the mesh. */
#include "section/section_mesh.h"

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "section/section_sketch.h"

#define PI 3.14159265358979323846
#define DEFAULT_SIZE_M 0.75e-3
#define MERGE_TOLERANCE 1e-7    /* of the outer radius: nodes nearer than this are one */
#define ON_CIRCLE 1e-3          /* of the outer radius: mid-side nodes nearer to a circle lie on it */

static void set_error(struct description_error *error, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(error->text, sizeof error->text, format, arguments);
    va_end(arguments);
}

struct section_mesh *section_mesh_new(size_t nodes, size_t triangles) {
    struct section_mesh *mesh = nodes == 0 || triangles == 0 ? NULL : calloc(1, sizeof *mesh);
    if (mesh == NULL) {
        return NULL;
    }
    mesh->position_m = calloc(2 * nodes, sizeof *mesh->position_m);
    mesh->triangle = calloc(triangles, sizeof *mesh->triangle);
    mesh->region = calloc(triangles, sizeof *mesh->region);
    if (mesh->position_m == NULL || mesh->triangle == NULL || mesh->region == NULL) {
        section_mesh_free(mesh);
        return NULL;
    }
    mesh->triangle_count = triangles;
    return mesh;
}

static double triangle_area_m2(const struct section_mesh *mesh, size_t t) {
    const double *a = &mesh->position_m[2 * mesh->triangle[t][0]];
    const double *b = &mesh->position_m[2 * mesh->triangle[t][1]];
    const double *c = &mesh->position_m[2 * mesh->triangle[t][2]];
    return 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
}

static void turn_counter_clockwise(struct section_mesh *mesh) {
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        if (triangle_area_m2(mesh, t) < 0.0) {
            size_t *n = mesh->triangle[t];
            const size_t flipped[6] = {n[0], n[2], n[1], n[5], n[4], n[3]};
            memcpy(n, flipped, sizeof flipped);
        }
    }
}

/* --- six copies of the half-wedge --- */

static size_t find_or_add(struct section_mesh *mesh, const double position_m[2], double tolerance_m) {
    for (size_t i = 0; i < mesh->node_count; i++) {
        if (fabs(mesh->position_m[2 * i] - position_m[0]) < tolerance_m &&
            fabs(mesh->position_m[2 * i + 1] - position_m[1]) < tolerance_m) {
            return i;
        }
    }
    memcpy(&mesh->position_m[2 * mesh->node_count], position_m, 2 * sizeof(double));
    return mesh->node_count++;
}

static void add_copy(struct section_mesh *whole, const struct section_mesh *wedge, double angle, double mirror,
                     size_t *image, double tolerance_m) {
    for (size_t i = 0; i < wedge->node_count; i++) {
        const double x = wedge->position_m[2 * i], y = mirror * wedge->position_m[2 * i + 1];
        const double turned[2] = {x * cos(angle) - y * sin(angle), x * sin(angle) + y * cos(angle)};
        image[i] = find_or_add(whole, turned, tolerance_m);
    }
    for (size_t t = 0; t < wedge->triangle_count; t++) {
        for (size_t k = 0; k < 6; k++) {
            whole->triangle[whole->triangle_count][k] = image[wedge->triangle[t][k]];
        }
        whole->triangle_count++;
    }
}

static struct section_mesh *unfold_wedge(const struct section_mesh *wedge, double outer_m) {
    struct section_mesh *whole = section_mesh_new(6 * wedge->node_count, 6 * wedge->triangle_count);
    size_t *image = malloc((wedge->node_count + 1) * sizeof *image);
    if (image == NULL) {
        section_mesh_free(whole);
        whole = NULL;
    }
    if (whole != NULL) {
        whole->triangle_count = 0;
        for (int third = 0; third < 3; third++) {
            add_copy(whole, wedge, third * 2.0 * PI / 3.0, 1.0, image, MERGE_TOLERANCE * outer_m);
            add_copy(whole, wedge, third * 2.0 * PI / 3.0, -1.0, image, MERGE_TOLERANCE * outer_m);
        }
    }
    free(image);
    return whole;
}

/* --- boundary edges --- */

struct side {
    size_t low, high, triangle, side;
};

static int compare_sides(const void *a, const void *b) {
    const struct side *p = a, *q = b;
    if (p->low != q->low) {
        return p->low < q->low ? -1 : 1;
    }
    return p->high < q->high ? -1 : p->high > q->high;
}

static struct side *sorted_sides(const struct section_mesh *mesh) {
    struct side *side = malloc(3 * mesh->triangle_count * sizeof *side);
    if (side == NULL) {
        return NULL;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (size_t k = 0; k < 3; k++) {
            const size_t a = mesh->triangle[t][k], b = mesh->triangle[t][(k + 1) % 3];
            side[3 * t + k] = (struct side){a < b ? a : b, a < b ? b : a, t, k};
        }
    }
    qsort(side, 3 * mesh->triangle_count, sizeof *side, compare_sides);
    return side;
}

/* The triangle walks its edge with the material to the left; a cavity's contour wants the cavity there. */
static struct section_edge make_edge(const struct section_mesh *mesh, const struct side *side,
                                     const struct section_plan *plan) {
    const size_t *n = mesh->triangle[side->triangle];
    const size_t from = n[side->side], to = n[(side->side + 1) % 3], mid = n[3 + side->side];
    const double *position_m = &mesh->position_m[2 * mid];
    const double radius_m = hypot(position_m[0], position_m[1]), near_m = ON_CIRCLE * plan->outer_radius_m;
    if (radius_m > plan->outer_radius_m - near_m) {
        return (struct section_edge){{from, to, mid}, SECTION_OUTLINE, 0.0};
    }
    if (radius_m < plan->bore_radius_m + near_m && plan->bore_radius_m > 0.0) {
        return (struct section_edge){{from, to, mid}, SECTION_BORE, 0.0};
    }
    size_t nearest = 0;
    double least_m = INFINITY;
    for (size_t i = 0; i < plan->cavity_count; i++) {
        const double distance_m = cavity_outline_distance(&plan->cavity[i], position_m);
        if (distance_m < least_m) {
            least_m = distance_m;
            nearest = i;
        }
    }
    return (struct section_edge){{to, from, mid}, plan->chamber[nearest], plan->cavity[nearest].hoop_stiffness_npm};
}

static bool find_edges(struct section_mesh *mesh, const struct section_plan *plan) {
    struct side *side = sorted_sides(mesh);
    mesh->edge = calloc(3 * mesh->triangle_count, sizeof *mesh->edge);
    if (side == NULL || mesh->edge == NULL) {
        free(side);
        return false;
    }
    const size_t sides = 3 * mesh->triangle_count;
    for (size_t i = 0; i < sides; i++) {
        const bool like_last = i > 0 && compare_sides(&side[i], &side[i - 1]) == 0;
        const bool like_next = i + 1 < sides && compare_sides(&side[i], &side[i + 1]) == 0;
        if (!like_last && !like_next) {
            mesh->edge[mesh->edge_count++] = make_edge(mesh, &side[i], plan);
        }
    }
    free(side);
    return true;
}

static void find_centre(struct section_mesh *mesh) {
    double least_m = INFINITY;
    for (size_t i = 0; i < mesh->node_count; i++) {
        const double distance_m = hypot(mesh->position_m[2 * i], mesh->position_m[2 * i + 1]);
        if (distance_m < least_m) {
            least_m = distance_m;
            mesh->centre_node = i;
        }
    }
}

/* Region 0 is the module's own material, region l + 1 layer l. */
static void find_regions(struct section_mesh *mesh, const struct section_plan *plan) {
    mesh->region_count = 1 + plan->layer_count;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        double centre_m[2] = {0.0, 0.0};
        for (size_t k = 0; k < 6; k++) {
            centre_m[0] += mesh->position_m[2 * mesh->triangle[t][k]] / 6.0;
            centre_m[1] += mesh->position_m[2 * mesh->triangle[t][k] + 1] / 6.0;
        }
        const double radius_m = hypot(centre_m[0], centre_m[1]);
        for (size_t l = 0; l < plan->layer_count; l++) {
            if (radius_m > plan->layer_inner_m[l] && radius_m < plan->layer_outer_m[l]) {
                mesh->region[t] = l + 1;
            }
        }
    }
}

static void find_azimuths(struct section_mesh *mesh, const struct section_plan *plan) {
    double x[MODULE_CHAMBERS] = {0.0}, y[MODULE_CHAMBERS] = {0.0};
    for (size_t i = 0; i < plan->cavity_count; i++) {
        x[plan->chamber[i]] += cos(cavity_azimuth(&plan->cavity[i]));
        y[plan->chamber[i]] += sin(cavity_azimuth(&plan->cavity[i]));
    }
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        mesh->chamber_azimuth_rad[c] = atan2(y[c], x[c]);
    }
}

static struct section_mesh *finish(struct section_mesh *mesh, const struct section_plan *plan,
                                   struct description_error *error) {
    if (mesh == NULL) {
        set_error(error, "gmsh could not mesh the section; check that chambers, walls and outline leave room for elements "
                         "of %g mm, or try another element size",
                  1e3 * plan->size_m);
        return NULL;
    }
    mesh->outer_radius_m = plan->outer_radius_m;
    mesh->bored = plan->bore_radius_m > 0.0;
    turn_counter_clockwise(mesh);
    find_centre(mesh);
    find_regions(mesh, plan);
    find_azimuths(mesh, plan);
    if (!find_edges(mesh, plan)) {
        set_error(error, "out of memory while meshing");
        section_mesh_free(mesh);
        return NULL;
    }
    return mesh;
}

struct section_mesh *section_mesh_create_disc(double outer_radius_m, const struct cavity *cavity, const int *chamber,
                                              size_t cavity_count, double size_m, struct description_error *error) {
    struct section_plan plan = {.outer_radius_m = outer_radius_m,
                                .cavity_count = cavity_count,
                                .size_m = size_m > 0.0 ? size_m : DEFAULT_SIZE_M};
    for (size_t i = 0; i < cavity_count; i++) {
        plan.cavity[i] = cavity[i];
        plan.chamber[i] = chamber[i];
    }
    return finish(section_sketch_mesh(&plan, false), &plan, error);
}

bool section_is_symmetric(const struct module_description *module) {
    const struct chamber *first = &module->chamber[0];
    for (size_t k = 0; k < first->cavity_count; k++) {
        bool paired = cavity_symmetric(&first->cavity[k]);
        for (size_t l = 0; l < first->cavity_count && !paired; l++) {
            struct cavity image;
            cavity_mirror(&first->cavity[k], &image);
            const struct cavity *other = &first->cavity[l];
            const double gap_m = hypot(image.centre_m[0] - other->centre_m[0], image.centre_m[1] - other->centre_m[1]) +
                                 fabs(image.radius_m - other->radius_m) +
                                 fabs(image.inner_radius_m - other->inner_radius_m);
            const double turn = image.shape == CAVITY_CIRCLE ? 0.0 : image.orientation_rad - other->orientation_rad;
            paired = image.shape == other->shape && gap_m < 1e-9 && fabs(sin(0.5 * turn)) < 1e-9 &&
                     fabs(image.opening_rad - other->opening_rad) < 1e-9 &&
                     image.hoop_stiffness_npm == other->hoop_stiffness_npm;
        }
        if (!paired) {
            return false;
        }
    }
    return module->three_fold;
}

struct section_mesh *section_mesh_create(const struct module_description *module,
                                         const struct section_mesh_options *options, struct description_error *error) {
    struct section_plan plan = {.outer_radius_m = 0.5 * module->outer_diameter_m,
                                .bore_radius_m = 0.5 * module->bore_diameter_m,
                                .layer_count = module->layer_count};
    for (int c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            plan.cavity[plan.cavity_count] = module->chamber[c].cavity[k];
            plan.chamber[plan.cavity_count++] = c;
        }
    }
    for (size_t l = 0; l < module->layer_count; l++) {
        plan.layer_inner_m[l] = module->layer[l].inner_radius_m;
        plan.layer_outer_m[l] = module->layer[l].outer_radius_m;
    }
    plan.size_m = options != NULL && options->size_m > 0.0 ? options->size_m : DEFAULT_SIZE_M;
    if (!section_is_symmetric(module)) {
        return finish(section_sketch_mesh(&plan, false), &plan, error);
    }
    struct section_mesh *wedge = section_sketch_mesh(&plan, true);
    struct section_mesh *whole = wedge == NULL ? NULL : unfold_wedge(wedge, plan.outer_radius_m);
    section_mesh_free(wedge);
    return finish(whole, &plan, error);
}

void section_mesh_free(struct section_mesh *mesh) {
    if (mesh == NULL) {
        return;
    }
    free(mesh->position_m);
    free(mesh->triangle);
    free(mesh->region);
    free(mesh->edge);
    free(mesh);
}
