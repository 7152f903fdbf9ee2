#include "section/section_sketch.h"

#include <gmshc.h>
#include <math.h>
#include <omp.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define GROWTH 0.35           /* of the element size with the distance from the nearest cavity */
#define CORE_COARSENING 3.0   /* greatest element size over that at the walls */
#define WALL_ELEMENTS 2.0     /* at least, through any wall */
#define CORNER_SIZE 0.3       /* at a cavity's corners, where the stress is singular, over that at its walls */
#define CORNER_GROWTH 0.4
#define SIZE_LEAST 0.1        /* of the size at the walls */
#define GMSH_TRIANGLE_6 9

static int add_point(struct section_sketch *sketch, const double point_m[2]) {
    int error = 0;
    const int tag = gmshModelOccAddPoint(point_m[0], point_m[1], 0.0, 0.0, -1, &error);
    sketch->failed |= error;
    return tag;
}

static int add_line(struct section_sketch *sketch, int from, int to) {
    int error = 0;
    const int tag = gmshModelOccAddLine(from, to, -1, &error);
    sketch->failed |= error;
    return tag;
}

static int add_arc(struct section_sketch *sketch, int from, int centre, int to) {
    int error = 0;
    const int tag = gmshModelOccAddCircleArc(from, centre, to, -1, &error);
    sketch->failed |= error;
    return tag;
}

static int add_surface(struct section_sketch *sketch, int *curves, size_t count) {
    int error = 0;
    int loop = gmshModelOccAddCurveLoop(curves, count, -1, &error);
    sketch->failed |= error;
    const int tag = gmshModelOccAddPlaneSurface(&loop, 1, -1, &error);
    sketch->failed |= error;
    return tag;
}

static int add_disc(struct section_sketch *sketch, double radius_m) {
    int error = 0;
    const int tag = gmshModelOccAddDisk(0.0, 0.0, 0.0, radius_m, radius_m, -1, &error);
    sketch->failed |= error;
    return tag;
}

static int add_half_wedge(struct section_sketch *sketch, double radius_m) {
    const double centre_m[2] = {0.0, 0.0}, start_m[2] = {radius_m, 0.0};
    const double end_m[2] = {radius_m * cos(PI / 3.0), radius_m * sin(PI / 3.0)};
    const int centre = add_point(sketch, centre_m), start = add_point(sketch, start_m), end = add_point(sketch, end_m);
    int curves[3] = {add_line(sketch, centre, start), add_arc(sketch, start, centre, end), add_line(sketch, end, centre)};
    return add_surface(sketch, curves, 3);
}

/* Arcs are drawn as two halves: an arc of 180 degrees would leave its side open. */
int section_sketch_cavity(struct section_sketch *sketch, const struct cavity *cavity) {
    struct cavity_piece piece[CAVITY_PIECES_MAX];
    const size_t count = cavity_outline(cavity, piece);
    int curves[2 * CAVITY_PIECES_MAX], first = add_point(sketch, piece[0].from_m), from = first;
    size_t curve = 0;
    for (size_t i = 0; i < count; i++) {
        const int to = i + 1 == count ? first : add_point(sketch, piece[i].to_m);
        if (piece[i].arc) {
            double middle_m[2];
            cavity_piece_point(&piece[i], 0.5, middle_m);
            const int centre = add_point(sketch, piece[i].centre_m), middle = add_point(sketch, middle_m);
            curves[curve++] = add_arc(sketch, from, centre, middle);
            curves[curve++] = add_arc(sketch, middle, centre, to);
        } else {
            curves[curve++] = add_line(sketch, from, to);
        }
        from = to;
    }
    return add_surface(sketch, curves, curve);
}

static void cut(struct section_sketch *sketch, int *surface, int *tools, size_t count) {
    int error = 0, *out = NULL, **map = NULL;
    size_t outs = 0, *map_sizes = NULL, maps = 0;
    gmshModelOccCut(surface, 2, tools, 2 * count, &out, &outs, &map, &map_sizes, &maps, -1, 1, 1, &error);
    sketch->failed |= error != 0 || outs < 2;
    if (sketch->failed == 0) {
        surface[1] = out[1];
    }
    gmshFree(out);
    for (size_t i = 0; i < maps; i++) {
        gmshFree(map[i]);
    }
    gmshFree(map);
    gmshFree(map_sizes);
}

/* Splits the surface along curves and at points, which then lie on element sides and corners. */
static void split(struct section_sketch *sketch, int *surface, int *tools, size_t count) {
    int error = 0, *out = NULL, **map = NULL;
    size_t outs = 0, *map_sizes = NULL, maps = 0;
    gmshModelOccFragment(surface, 2, tools, 2 * count, &out, &outs, &map, &map_sizes, &maps, -1, 1, 1, &error);
    sketch->failed |= error;
    gmshFree(out);
    for (size_t i = 0; i < maps; i++) {
        gmshFree(map[i]);
    }
    gmshFree(map);
    gmshFree(map_sizes);
}

static bool centre_is_solid(const struct section_plan *plan) {
    const double centre_m[2] = {0.0, 0.0};
    for (size_t i = 0; i < plan->cavity_count; i++) {
        if (cavity_holds(&plan->cavity[i], centre_m)) {
            return false;
        }
    }
    return plan->bore_radius_m == 0.0;
}

static void draw(struct section_sketch *sketch, const struct section_plan *plan, bool half_wedge) {
    int surface[2] = {2, half_wedge ? add_half_wedge(sketch, plan->outer_radius_m)
                                    : add_disc(sketch, plan->outer_radius_m)};
    int tools[2 * (SECTION_CAVITIES_MAX + 1)], count = 0;
    for (size_t i = 0; i < plan->cavity_count; i++) {
        if (!half_wedge || plan->chamber[i] == 0) {
            tools[2 * count] = 2;
            tools[2 * count++ + 1] = section_sketch_cavity(sketch, &plan->cavity[i]);
        }
    }
    if (plan->bore_radius_m > 0.0) {
        tools[2 * count] = 2;
        tools[2 * count++ + 1] = add_disc(sketch, plan->bore_radius_m);
    }
    if (count > 0) {
        cut(sketch, surface, tools, (size_t)count);
    }
    int inner[2 * (2 * MODULE_LAYERS_MAX + 1)], inners = 0;
    for (size_t l = 0; l < plan->layer_count; l++) {
        const double edges_m[2] = {plan->layer_inner_m[l], plan->layer_outer_m[l]};
        for (size_t e = 0; e < 2; e++) {
            int error = 0;
            if (edges_m[e] < plan->outer_radius_m * (1.0 - 1e-9)) {
                inner[2 * inners] = 1;
                inner[2 * inners++ + 1] = gmshModelOccAddCircle(0.0, 0.0, 0.0, edges_m[e], -1, 0.0, 2.0 * PI, &error);
                sketch->failed |= error;
            }
        }
    }
    if (!half_wedge && centre_is_solid(plan)) {
        const double centre_m[2] = {0.0, 0.0};
        inner[2 * inners] = 0;
        inner[2 * inners++ + 1] = add_point(sketch, centre_m);
    }
    if (inners > 0 && sketch->failed == 0) {
        split(sketch, surface, inner, (size_t)inners);
    }
}

static double corner_distance(const struct cavity *cavity, const double point_m[2]) {
    struct cavity_piece piece[CAVITY_PIECES_MAX];
    const size_t count = cavity->shape == CAVITY_CIRCLE ? 0 : cavity_outline(cavity, piece);
    double least = INFINITY;
    for (size_t i = 0; i < count; i++) {
        least = fmin(least, hypot(point_m[0] - piece[i].from_m[0], point_m[1] - piece[i].from_m[1]));
    }
    return least;
}

/* Element size at a point: fine at the cavities and finer at their corners, coarser away from them, two elements through
 * any wall. */
double section_sketch_size(int dimension, int tag, double x, double y, double z, void *context) {
    const struct section_plan *plan = context;
    const double point_m[2] = {x, y}, radius_m = hypot(x, y);
    double nearest_m = fmax(0.0, plan->outer_radius_m - radius_m), second_m = INFINITY, cavity_m = INFINITY;
    double corner_m = INFINITY;
    (void)dimension;
    (void)tag;
    (void)z;
    for (size_t i = 0; i <= plan->cavity_count; i++) {
        if (i == plan->cavity_count && plan->bore_radius_m == 0.0) {
            break;
        }
        const double distance_m = i < plan->cavity_count ? cavity_outline_distance(&plan->cavity[i], point_m)
                                                         : fmax(0.0, radius_m - plan->bore_radius_m);
        cavity_m = fmin(cavity_m, distance_m);
        corner_m = i < plan->cavity_count && !plan->plain_corners ? fmin(corner_m, corner_distance(&plan->cavity[i], point_m)) : corner_m;
        second_m = fmin(second_m, fmax(nearest_m, distance_m));
        nearest_m = fmin(nearest_m, distance_m);
    }
    const double coarse_m = plan->cavity_count == 0 ? plan->size_m
                                                    : fmin(plan->size_m + GROWTH * cavity_m, CORE_COARSENING * plan->size_m);
    const double wall_m = (nearest_m + second_m) / WALL_ELEMENTS;
    return fmax(SIZE_LEAST * plan->size_m,
                fmin(fmin(coarse_m, wall_m), CORNER_SIZE * plan->size_m + CORNER_GROWTH * corner_m));
}

/* --- from gmsh to our arrays --- */

static size_t greatest(const size_t *values, size_t count) {
    size_t most = 0;
    for (size_t i = 0; i < count; i++) {
        most = values[i] > most ? values[i] : most;
    }
    return most;
}

/* Nodes that no triangle uses (arc centres) are left out; the others are numbered by first use. */
static struct section_mesh *take_arrays(const size_t *tag, size_t tags, const double *coordinate, const size_t *corner,
                                        size_t corners) {
    const size_t highest = greatest(tag, tags);
    size_t *by_tag = malloc((highest + 1) * sizeof *by_tag);
    size_t *number = malloc((highest + 1) * sizeof *number);
    struct section_mesh *mesh = section_mesh_new(tags, corners / 6);
    if (by_tag != NULL && number != NULL && mesh != NULL) {
        for (size_t i = 0; i < tags; i++) {
            by_tag[tag[i]] = i;
            number[tag[i]] = SIZE_MAX;
        }
        for (size_t k = 0; k < corners; k++) {
            if (number[corner[k]] == SIZE_MAX) {
                number[corner[k]] = mesh->node_count;
                memcpy(&mesh->position_m[2 * mesh->node_count], &coordinate[3 * by_tag[corner[k]]], 2 * sizeof(double));
                mesh->node_count++;
            }
            mesh->triangle[k / 6][k % 6] = number[corner[k]];
        }
    }
    free(by_tag);
    free(number);
    return mesh;
}

static struct section_mesh *generate(struct section_sketch *sketch, struct section_plan *plan) {
    int error = sketch->failed;
    size_t *tag = NULL, *element = NULL, *corner = NULL, tags = 0, elements = 0, corners = 0, coordinates = 0, none = 0;
    double *coordinate = NULL, *parametric = NULL;
    struct section_mesh *mesh = NULL;
    if (error == 0) {
        gmshModelOccSynchronize(&error);
    }
    if (error == 0) {
        gmshModelMeshSetSizeCallback(section_sketch_size, plan, &error);
    }
    if (error == 0) {
        gmshModelMeshGenerate(2, &error);
    }
    if (error == 0) {
        gmshModelMeshSetOrder(2, &error);
    }
    if (error == 0) {
        gmshModelMeshGetNodes(&tag, &tags, &coordinate, &coordinates, &parametric, &none, -1, -1, 0, 0, &error);
    }
    if (error == 0) {
        gmshModelMeshGetElementsByType(GMSH_TRIANGLE_6, &element, &elements, &corner, &corners, -1, 0, 1, &error);
    }
    if (error == 0 && corners > 0) {
        mesh = take_arrays(tag, tags, coordinate, corner, corners);
    }
    gmshFree(tag);
    gmshFree(element);
    gmshFree(corner);
    gmshFree(coordinate);
    gmshFree(parametric);
    return mesh;
}

void section_sketch_begin(struct section_sketch *sketch) {
    int error = 0;
    sketch->failed = 0;
    sketch->threads = omp_get_max_threads();
    gmshInitialize(0, NULL, 0, &error);
    sketch->failed |= error;
    gmshOptionSetNumber("General.Terminal", 0.0, &error);
    gmshOptionSetNumber("General.NumThreads", 1.0, &error); /* the same mesh on every machine */
    gmshOptionSetNumber("Mesh.MeshSizeExtendFromBoundary", 0.0, &error);
    gmshOptionSetNumber("Mesh.MeshSizeFromPoints", 0.0, &error);
    gmshModelAdd("section", &error);
    sketch->failed |= error;
}

void section_sketch_end(const struct section_sketch *sketch) {
    int error = 0;
    gmshFinalize(&error);
    omp_set_num_threads(sketch->threads);
}

struct section_mesh *section_sketch_mesh(const struct section_plan *plan, bool half_wedge) {
    struct section_plan copy = *plan;
    struct section_sketch sketch;
    section_sketch_begin(&sketch);
    draw(&sketch, plan, half_wedge);
    struct section_mesh *mesh = generate(&sketch, &copy);
    section_sketch_end(&sketch);
    return mesh;
}
