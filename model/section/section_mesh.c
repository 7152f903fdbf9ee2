/* Meshing with gmsh. A three-fold module is meshed over one half-wedge of 60 degrees, which is mirrored and turned: the
 * three chambers then have the same mesh and the bend of one chamber does not drift sideways with the mesh. */
#include "section/section_mesh.h"

#include <gmshc.h>
#include <math.h>
#include <omp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define DEFAULT_SIZE_M 0.75e-3
#define CORE_COARSENING 3.0     /* element size at the centre over that at the chamber walls */
#define OUTLINE_COARSENING 1.6
#define MERGE_TOLERANCE 1e-7    /* of the outer radius: nodes nearer than this are one */
#define GMSH_TRIANGLE_6 9

static void set_error(struct description_error *error, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(error->text, sizeof error->text, format, arguments);
    va_end(arguments);
}

/* --- gmsh geometry: thin wrappers that collect failures in one flag --- */

struct sketch {
    int failed;
    int threads; /* OpenMP's setting, which gmsh overwrites for the whole program */
};

static int add_point(struct sketch *sketch, double x, double y, double size) {
    int error = 0;
    const int tag = gmshModelGeoAddPoint(x, y, 0.0, size, -1, &error);
    sketch->failed |= error;
    return tag;
}

static int add_line(struct sketch *sketch, int from, int to) {
    int error = 0;
    const int tag = gmshModelGeoAddLine(from, to, -1, &error);
    sketch->failed |= error;
    return tag;
}

static int add_arc(struct sketch *sketch, int from, int centre, int to) {
    int error = 0;
    const int tag = gmshModelGeoAddCircleArc(from, centre, to, -1, 0.0, 0.0, 0.0, &error);
    sketch->failed |= error;
    return tag;
}

static int add_loop(struct sketch *sketch, int *curves, size_t count) {
    int error = 0;
    const int tag = gmshModelGeoAddCurveLoop(curves, count, -1, 0, &error);
    sketch->failed |= error;
    return tag;
}

static int add_surface(struct sketch *sketch, int *loops, size_t count) {
    int error = 0;
    const int tag = gmshModelGeoAddPlaneSurface(loops, count, -1, &error);
    sketch->failed |= error;
    return tag;
}

static void begin_sketch(struct sketch *sketch) {
    int error = 0;
    sketch->failed = 0;
    sketch->threads = omp_get_max_threads();
    gmshInitialize(0, NULL, 0, &error);
    sketch->failed |= error;
    gmshOptionSetNumber("General.Terminal", 0.0, &error);
    gmshOptionSetNumber("General.NumThreads", 1.0, &error); /* the same mesh on every machine */
    gmshModelAdd("section", &error);
    sketch->failed |= error;
}

/* Half of one chamber's 120 degree wedge: from the chamber's axis (y = 0) up to 60 degrees. */
static void sketch_half_wedge(struct sketch *sketch, const struct cavity *cavity, double outer_m, double size_m) {
    const double c = cavity->centre_m[0], r = cavity->radius_m;
    const double wall_m = outer_m - c - r;
    const double wall_size_m = fmin(size_m, 0.5 * wall_m); /* at least two curved elements through the wall */
    const int centre = add_point(sketch, 0.0, 0.0, CORE_COARSENING * size_m);
    const int middle = add_point(sketch, c, 0.0, size_m);
    const int top = add_point(sketch, c, r, size_m);
    const int apex = add_point(sketch, c + r, 0.0, wall_size_m);
    const int outer = add_point(sketch, outer_m, 0.0, wall_size_m);
    const int seam = add_point(sketch, outer_m * cos(PI / 3.0), outer_m * sin(PI / 3.0), OUTLINE_COARSENING * size_m);
    const bool round = cavity->shape == CAVITY_CIRCLE;
    const int inner = round ? add_point(sketch, c - r, 0.0, size_m) : middle;
    int curves[7] = {
        add_line(sketch, centre, inner),
        round ? add_arc(sketch, inner, middle, top) : add_line(sketch, middle, top),
        add_arc(sketch, top, middle, apex),
        add_line(sketch, apex, outer),
        add_arc(sketch, outer, centre, seam),
        add_line(sketch, seam, centre),
    };
    int loop = add_loop(sketch, curves, 6);
    (void)add_surface(sketch, &loop, 1);
}

static int sketch_cavity(struct sketch *sketch, const struct cavity *cavity, double size_m) {
    const double turn = cavity->orientation_rad;
    const int centre = add_point(sketch, cavity->centre_m[0], cavity->centre_m[1], size_m);
    int rim[4];
    for (int i = 0; i < 4; i++) {
        const double angle = turn + (i - 1) * PI / 2.0;
        rim[i] = add_point(sketch, cavity->centre_m[0] + cavity->radius_m * cos(angle),
                           cavity->centre_m[1] + cavity->radius_m * sin(angle), size_m);
    }
    int curves[4] = {add_arc(sketch, rim[0], centre, rim[1]), add_arc(sketch, rim[1], centre, rim[2])};
    if (cavity->shape == CAVITY_SEMICIRCLE) {
        curves[2] = add_line(sketch, rim[2], rim[0]);
        return add_loop(sketch, curves, 3);
    }
    curves[2] = add_arc(sketch, rim[2], centre, rim[3]);
    curves[3] = add_arc(sketch, rim[3], centre, rim[0]);
    return add_loop(sketch, curves, 4);
}

static bool covers_centre(const struct cavity *cavity) {
    return hypot(cavity->centre_m[0], cavity->centre_m[1]) <= cavity->radius_m * (1.0 + 1e-9);
}

static void sketch_disc(struct sketch *sketch, double outer_m, const struct cavity *cavity, size_t count, double size_m) {
    int loops[1 + MODULE_CHAMBERS * MODULE_CAVITIES_MAX];
    bool hollow = false;
    for (size_t i = 0; i < count; i++) {
        loops[1 + i] = sketch_cavity(sketch, &cavity[i], size_m);
        hollow = hollow || covers_centre(&cavity[i]);
    }
    const double core_size_m = count == 0 ? size_m : CORE_COARSENING * size_m;
    int centre = add_point(sketch, 0.0, 0.0, hollow ? size_m : core_size_m);
    int rim[4], arcs[4];
    for (int i = 0; i < 4; i++) {
        rim[i] = add_point(sketch, outer_m * cos(i * PI / 2.0), outer_m * sin(i * PI / 2.0), size_m);
    }
    for (int i = 0; i < 4; i++) {
        arcs[i] = add_arc(sketch, rim[i], centre, rim[(i + 1) % 4]);
    }
    loops[0] = add_loop(sketch, arcs, 4);
    const int surface = add_surface(sketch, loops, count + 1);
    if (!hollow) {
        int error = 0;
        gmshModelGeoSynchronize(&error);
        gmshModelMeshEmbed(0, &centre, 1, 2, surface, &error);
        sketch->failed |= error;
    }
}

/* --- from gmsh to our arrays --- */

static struct section_mesh *new_mesh(size_t nodes, size_t triangles) {
    struct section_mesh *mesh = nodes == 0 || triangles == 0 ? NULL : calloc(1, sizeof *mesh);
    if (mesh == NULL) {
        return NULL;
    }
    mesh->position_m = calloc(2 * nodes, sizeof *mesh->position_m);
    mesh->triangle = calloc(triangles, sizeof *mesh->triangle);
    if (mesh->position_m == NULL || mesh->triangle == NULL) {
        section_mesh_free(mesh);
        return NULL;
    }
    mesh->triangle_count = triangles;
    return mesh;
}

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
    struct section_mesh *mesh = new_mesh(tags, corners / 6);
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

static struct section_mesh *generate(struct sketch *sketch) {
    int error = 0;
    size_t *tag = NULL, *element = NULL, *corner = NULL, tags = 0, elements = 0, corners = 0, coordinates = 0, none = 0;
    double *coordinate = NULL, *parametric = NULL;
    struct section_mesh *mesh = NULL;
    gmshModelGeoSynchronize(&error);
    if (sketch->failed == 0 && error == 0) {
        gmshModelMeshGenerate(2, &error);
    }
    if (sketch->failed == 0 && error == 0) {
        gmshModelMeshSetOrder(2, &error);
        gmshModelMeshGetNodes(&tag, &tags, &coordinate, &coordinates, &parametric, &none, -1, -1, 0, 0, &error);
        gmshModelMeshGetElementsByType(GMSH_TRIANGLE_6, &element, &elements, &corner, &corners, -1, 0, 1, &error);
        if (error == 0 && corners > 0) {
            mesh = take_arrays(tag, tags, coordinate, corner, corners);
        }
    }
    gmshFree(tag);
    gmshFree(element);
    gmshFree(corner);
    gmshFree(coordinate);
    gmshFree(parametric);
    gmshFinalize(&error);
    omp_set_num_threads(sketch->threads);
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
    struct section_mesh *whole = new_mesh(6 * wedge->node_count, 6 * wedge->triangle_count);
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

static int chamber_of(const double position_m[2], const struct cavity *cavity, const int *chamber, size_t count) {
    int nearest = 0;
    double least_m = INFINITY;
    for (size_t i = 0; i < count; i++) {
        const double distance_m = fabs(hypot(position_m[0] - cavity[i].centre_m[0],
                                             position_m[1] - cavity[i].centre_m[1]) - 0.5 * cavity[i].radius_m) /
                                  cavity[i].radius_m;
        if (distance_m < least_m) {
            least_m = distance_m;
            nearest = chamber[i];
        }
    }
    return nearest;
}

/* The triangle walks its edge with the material to the left; a cavity's contour wants the cavity there. */
static struct section_edge make_edge(const struct section_mesh *mesh, const struct side *side,
                                     const struct cavity *cavity, const int *chamber, size_t count) {
    const size_t *n = mesh->triangle[side->triangle];
    const size_t from = n[side->side], to = n[(side->side + 1) % 3], mid = n[3 + side->side];
    const double *position_m = &mesh->position_m[2 * mid];
    if (hypot(position_m[0], position_m[1]) > mesh->outer_radius_m * (1.0 - 1e-3)) {
        return (struct section_edge){{from, to, mid}, SECTION_OUTLINE};
    }
    return (struct section_edge){{to, from, mid}, chamber_of(position_m, cavity, chamber, count)};
}

static bool find_edges(struct section_mesh *mesh, const struct cavity *cavity, const int *chamber, size_t count) {
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
            mesh->edge[mesh->edge_count++] = make_edge(mesh, &side[i], cavity, chamber, count);
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

static struct section_mesh *finish(struct section_mesh *mesh, double outer_m, const struct cavity *cavity,
                                   const int *chamber, size_t count, struct description_error *error) {
    if (mesh == NULL) {
        set_error(error, "gmsh could not mesh the section; check that chambers, walls and outline leave room for elements");
        return NULL;
    }
    mesh->outer_radius_m = outer_m;
    turn_counter_clockwise(mesh);
    find_centre(mesh);
    if (!find_edges(mesh, cavity, chamber, count)) {
        set_error(error, "out of memory while meshing");
        section_mesh_free(mesh);
        return NULL;
    }
    for (size_t i = count; i-- > 0;) {
        mesh->chamber_azimuth_rad[chamber[i]] = atan2(cavity[i].centre_m[1], cavity[i].centre_m[0]);
    }
    return mesh;
}

struct section_mesh *section_mesh_create_disc(double outer_radius_m, const struct cavity *cavity, const int *chamber,
                                              size_t cavity_count, double size_m, struct description_error *error) {
    struct sketch sketch;
    begin_sketch(&sketch);
    sketch_disc(&sketch, outer_radius_m, cavity, cavity_count, size_m > 0.0 ? size_m : DEFAULT_SIZE_M);
    return finish(generate(&sketch), outer_radius_m, cavity, chamber, cavity_count, error);
}

static bool has_wedge_symmetry(const struct module_description *module) {
    const struct chamber *first = &module->chamber[0];
    return module->three_fold && first->cavity_count == 1 && first->cavity[0].centre_m[0] > first->cavity[0].radius_m &&
           fabs(first->cavity[0].centre_m[1]) < 1e-12 &&
           (first->cavity[0].shape == CAVITY_CIRCLE || fabs(first->cavity[0].orientation_rad) < 1e-12);
}

struct section_mesh *section_mesh_create(const struct module_description *module,
                                         const struct section_mesh_options *options, struct description_error *error) {
    struct cavity cavity[MODULE_CHAMBERS * MODULE_CAVITIES_MAX];
    int chamber[MODULE_CHAMBERS * MODULE_CAVITIES_MAX];
    size_t count = 0;
    for (int c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            cavity[count] = module->chamber[c].cavity[k];
            chamber[count++] = c;
        }
    }
    const double outer_m = 0.5 * module->outer_diameter_m;
    const double size_m = options != NULL && options->size_m > 0.0 ? options->size_m : DEFAULT_SIZE_M;
    if (!has_wedge_symmetry(module)) {
        return section_mesh_create_disc(outer_m, cavity, chamber, count, size_m, error);
    }
    struct sketch sketch;
    begin_sketch(&sketch);
    sketch_half_wedge(&sketch, &cavity[0], outer_m, size_m);
    struct section_mesh *wedge = generate(&sketch);
    struct section_mesh *whole = wedge == NULL ? NULL : unfold_wedge(wedge, outer_m);
    section_mesh_free(wedge);
    return finish(whole, outer_m, cavity, chamber, count, error);
}

void section_mesh_free(struct section_mesh *mesh) {
    if (mesh == NULL) {
        return;
    }
    free(mesh->position_m);
    free(mesh->triangle);
    free(mesh->edge);
    free(mesh);
}
