#include "model/ccx/solid_model.h"

#include <gmshc.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "section/section_sketch.h"

#define MM 1e3
#define MPA 1e-6
#define QUAD_8 16
#define ON_PLANE_MM 1e-6
#define NONE SIZE_MAX

/* Half of the section, y >= 0, cavities filled, in eight-node quadrangles. */
struct plane_mesh {
    size_t nodes;
    double (*position_mm)[2];
    size_t quads;
    size_t (*quad)[8]; /* corners, then mid-sides 01, 12, 23, 30 */
    int *chamber;      /* of each quadrangle; -1: rubber */
};

struct solid {
    const struct module_description *module;
    const struct solid_options *options;
    struct plane_mesh plane;
    size_t levels;      /* of nodes along z: corners at even ones */
    double *z_mm;       /* [levels] */
    size_t bricks;      /* layers, cap included */
    size_t chamber_bricks;
    size_t *number;     /* [levels * nodes] from 1; 0: not used */
    size_t count;       /* of nodes */
    double (*rest_mm)[3];
    double (*moved_mm)[3];
};

/* --- the plane mesh --- */

static void draw_half(struct section_sketch *sketch, const struct section_plan *plan) {
    const double r = plan->outer_radius_m;
    int error = 0, half[2] = {2, 0}, box[2] = {2, 0}, *out = NULL, **map = NULL;
    size_t outs = 0, *sizes = NULL, maps = 0;
    half[1] = gmshModelOccAddDisk(0.0, 0.0, 0.0, r, r, -1, &error);
    box[1] = gmshModelOccAddRectangle(-2.0 * r, -2.0 * r, 0.0, 4.0 * r, 2.0 * r, -1, 0.0, &error);
    gmshModelOccCut(half, 2, box, 2, &out, &outs, &map, &sizes, &maps, -1, 1, 1, &error);
    sketch->failed |= error != 0 || outs != 2;
    if (sketch->failed != 0) {
        return;
    }
    int parts[2 * (SECTION_CAVITIES_MAX + 1)], count = 0;
    for (size_t i = 0; i < plan->cavity_count; i++) {
        if (plan->chamber[i] == 2) {
            continue; /* below the half */
        }
        int tool[2] = {2, section_sketch_cavity(sketch, &plan->cavity[i])}, *kept = NULL;
        size_t kept_count = 0;
        gmshModelOccIntersect(tool, 2, out, 2, &kept, &kept_count, &map, &sizes, &maps, -1, 1, 0, &error);
        sketch->failed |= error != 0 || kept_count != 2;
        if (sketch->failed != 0) {
            return;
        }
        parts[2 * count] = 2;
        parts[2 * count++ + 1] = kept[1];
        gmshFree(kept);
    }
    const double centre_mm = 0.0;
    parts[2 * count] = 0;
    parts[2 * count++ + 1] = gmshModelOccAddPoint(centre_mm, 0.0, 0.0, 0.0, -1, &error);
    int *fragments = NULL;
    gmshModelOccFragment(out, 2, parts, 2 * (size_t)count, &fragments, &outs, &map, &sizes, &maps, -1, 1, 1, &error);
    sketch->failed |= error;
    gmshFree(fragments);
    gmshFree(out);
}

static int chamber_at(const struct section_plan *plan, const double point_m[2]) {
    for (size_t i = 0; i < plan->cavity_count; i++) {
        if (cavity_holds(&plan->cavity[i], point_m)) {
            return plan->chamber[i];
        }
    }
    return -1;
}

static bool take_plane(const struct section_plan *plan, struct plane_mesh *plane) {
    int error = 0;
    size_t *tag = NULL, *element = NULL, *corner = NULL, tags = 0, elements = 0, corners = 0, coordinates = 0, none = 0;
    double *coordinate = NULL, *parametric = NULL;
    gmshModelMeshGetNodes(&tag, &tags, &coordinate, &coordinates, &parametric, &none, -1, -1, 0, 0, &error);
    gmshModelMeshGetElementsByType(QUAD_8, &element, &elements, &corner, &corners, -1, 0, 1, &error);
    if (error != 0 || corners == 0) {
        return false;
    }
    size_t highest = 0;
    for (size_t i = 0; i < tags; i++) {
        highest = tag[i] > highest ? tag[i] : highest;
    }
    size_t *number = malloc((highest + 1) * sizeof *number), *at = malloc((highest + 1) * sizeof *at);
    plane->position_mm = calloc(tags, sizeof *plane->position_mm);
    plane->quad = calloc(corners / 8, sizeof *plane->quad);
    plane->chamber = calloc(corners / 8, sizeof *plane->chamber);
    if (number == NULL || at == NULL || plane->position_mm == NULL || plane->quad == NULL || plane->chamber == NULL) {
        return false;
    }
    for (size_t i = 0; i < tags; i++) {
        number[tag[i]] = NONE;
        at[tag[i]] = i;
    }
    for (size_t k = 0; k < corners; k++) {
        if (number[corner[k]] == NONE) {
            number[corner[k]] = plane->nodes;
            plane->position_mm[plane->nodes][0] = MM * coordinate[3 * at[corner[k]]];
            plane->position_mm[plane->nodes++][1] = MM * coordinate[3 * at[corner[k]] + 1];
        }
        plane->quad[k / 8][k % 8] = number[corner[k]];
    }
    plane->quads = corners / 8;
    for (size_t q = 0; q < plane->quads; q++) {
        double area = 0.0, middle_m[2] = {0.0, 0.0};
        for (size_t k = 0; k < 4; k++) {
            const double *a = plane->position_mm[plane->quad[q][k]], *b = plane->position_mm[plane->quad[q][(k + 1) % 4]];
            area += a[0] * b[1] - a[1] * b[0];
            middle_m[0] += 0.25 * a[0] / MM;
            middle_m[1] += 0.25 * a[1] / MM;
        }
        if (area < 0.0) {
            size_t *n = plane->quad[q];
            const size_t turned[8] = {n[0], n[3], n[2], n[1], n[7], n[6], n[5], n[4]};
            memcpy(n, turned, sizeof turned);
        }
        plane->chamber[q] = chamber_at(plan, middle_m);
    }
    free(number);
    free(at);
    gmshFree(tag);
    gmshFree(element);
    gmshFree(corner);
    gmshFree(coordinate);
    gmshFree(parametric);
    return true;
}

/* Twice as coarse as asked for: gmsh then cuts every element in four quadrangles. */
static double coarse_size(int dimension, int tag, double x, double y, double z, void *plan) {
    return 2.0 * section_sketch_size(dimension, tag, x, y, z, plan);
}

static bool mesh_plane(const struct module_description *module, double size_m, struct plane_mesh *plane) {
    struct section_plan plan = {.outer_radius_m = 0.5 * module->outer_diameter_m, .size_m = size_m, .plain_corners = true};
    for (int c = 0; c < MODULE_CHAMBERS; c++) {
        for (size_t k = 0; k < module->chamber[c].cavity_count; k++) {
            plan.cavity[plan.cavity_count] = module->chamber[c].cavity[k];
            plan.chamber[plan.cavity_count++] = c;
        }
    }
    struct section_sketch sketch;
    int error = 0;
    section_sketch_begin(&sketch);
    draw_half(&sketch, &plan);
    gmshOptionSetNumber("Mesh.Algorithm", 6.0, &error);
    gmshOptionSetNumber("Mesh.RecombineAll", 1.0, &error);
    gmshOptionSetNumber("Mesh.SubdivisionAlgorithm", 1.0, &error); /* every triangle and quadrangle into quadrangles */
    gmshOptionSetNumber("Mesh.SecondOrderIncomplete", 1.0, &error);
    bool sound = sketch.failed == 0;
    if (sound) {
        gmshModelOccSynchronize(&error);
        gmshModelMeshSetSizeCallback(coarse_size, &plan, &error);
        gmshModelMeshGenerate(2, &error);
        sound = error == 0;
    }
    if (sound) {
        gmshModelMeshSetOrder(2, &error);
        sound = error == 0 && take_plane(&plan, plane);
    }
    section_sketch_end(&sketch);
    return sound;
}

/* --- bricks --- */

static bool is_open(const struct solid *solid, size_t quad, size_t brick) {
    return solid->plane.chamber[quad] >= 0 && brick < solid->chamber_bricks;
}

/* The brick's twenty nodes as ccx orders them: bottom corners, top corners, bottom, top and upright mid-sides. */
static void brick_nodes(const struct solid *solid, size_t quad, size_t brick, size_t node[20]) {
    const size_t *n = solid->plane.quad[quad], nodes = solid->plane.nodes;
    const size_t low = 2 * brick * nodes, middle = low + nodes, high = middle + nodes;
    for (size_t k = 0; k < 4; k++) {
        node[k] = low + n[k];
        node[4 + k] = high + n[k];
        node[8 + k] = low + n[4 + k];
        node[12 + k] = high + n[4 + k];
        node[16 + k] = middle + n[k];
    }
}

static bool number_nodes(struct solid *solid) {
    const struct solid_options *options = solid->options;
    const size_t nodes = solid->plane.nodes;
    solid->chamber_bricks = options->layers;
    solid->bricks = options->layers + options->cap_layers;
    solid->levels = 2 * solid->bricks + 1;
    solid->z_mm = calloc(solid->levels, sizeof *solid->z_mm);
    solid->number = calloc(solid->levels * nodes, sizeof *solid->number);
    solid->rest_mm = calloc(solid->levels * nodes + 1, sizeof *solid->rest_mm);
    solid->moved_mm = calloc(solid->levels * nodes + 1, sizeof *solid->moved_mm);
    if (solid->z_mm == NULL || solid->number == NULL || solid->rest_mm == NULL || solid->moved_mm == NULL) {
        return false;
    }
    const double half_mm = 0.5 * MM * solid->module->chamber_length_m, cap_mm = MM * solid->module->cap_distal_m;
    for (size_t l = 0; l < solid->levels; l++) {
        const double brick = 0.5 * (double)l, chamber = (double)solid->chamber_bricks;
        if (brick <= chamber) { /* shorter towards the cap, where the balloon ends */
            const double share = brick / chamber;
            solid->z_mm[l] = half_mm * share * (1.6 - 0.6 * share);
        } else {
            solid->z_mm[l] = half_mm + cap_mm * (brick - chamber) / (double)options->cap_layers;
        }
    }
    for (size_t l = 1; l < solid->levels; l += 2) { /* mid-sides in the middle */
        solid->z_mm[l] = 0.5 * (solid->z_mm[l - 1] + solid->z_mm[l + 1]);
    }
    for (size_t b = 0; b < solid->bricks; b++) {
        for (size_t q = 0; q < solid->plane.quads; q++) {
            size_t node[20];
            brick_nodes(solid, q, b, node);
            for (size_t k = 0; k < 20 && !is_open(solid, q, b); k++) {
                if (solid->number[node[k]] == 0) {
                    solid->number[node[k]] = ++solid->count;
                    const double *plane_mm = solid->plane.position_mm[node[k] % nodes];
                    const double rest_mm[3] = {plane_mm[0], plane_mm[1], solid->z_mm[node[k] / nodes]};
                    memcpy(solid->rest_mm[solid->count], rest_mm, sizeof rest_mm);
                }
            }
        }
    }
    return true;
}

static const size_t side_faces[4] = {3, 4, 5, 6}; /* ccx's face over the plane's side 01, 12, 23, 30 */

/* Calls for each face of rubber on chamber 1: the element's number and the face's. */
typedef void (*face_call)(const struct solid *solid, size_t quad, size_t brick, size_t face, void *context);

static size_t neighbour_over(const struct plane_mesh *plane, size_t quad, size_t side) {
    const size_t middle = plane->quad[quad][4 + side];
    for (size_t q = 0; q < plane->quads; q++) {
        for (size_t k = 0; k < 4 && q != quad; k++) {
            if (plane->quad[q][4 + k] == middle) {
                return q;
            }
        }
    }
    return NONE;
}

static void each_wet_face(const struct solid *solid, face_call call, void *context) {
    const struct plane_mesh *plane = &solid->plane;
    for (size_t q = 0; q < plane->quads; q++) {
        if (plane->chamber[q] == 0) { /* the cap's underside closes the chamber */
            call(solid, q, solid->chamber_bricks, 1, context);
        }
        for (size_t side = 0; side < 4 && plane->chamber[q] < 0; side++) {
            const size_t other = neighbour_over(plane, q, side);
            for (size_t b = 0; b < solid->chamber_bricks && other != NONE && plane->chamber[other] == 0; b++) {
                call(solid, q, b, side_faces[side], context);
            }
        }
    }
}

static size_t element_number(const struct solid *solid, size_t quad, size_t brick) {
    return 1 + brick * solid->plane.quads + quad;
}

struct load {
    FILE *stream;
    double pressure_mpa;
};

static void write_load(const struct solid *solid, size_t quad, size_t brick, size_t face, void *context) {
    const struct load *load = context;
    fprintf(load->stream, "%zu, P%zu, %.10g\n", element_number(solid, quad, brick), face, load->pressure_mpa);
}

static void write_material(FILE *stream, const struct material *material) {
    const double *c = material->coefficient_pa, d = 2.0 / (material->bulk_modulus_pa * MPA);
    if (material->law == MATERIAL_OGDEN) {
        fprintf(stream, "*HYPERELASTIC, OGDEN, N=%zu\n", material->terms);
        for (size_t k = 0; k < material->terms; k++) {
            fprintf(stream, "%.10g, %.10g, ", c[k] * MPA, material->exponent[k]);
        }
        for (size_t k = 0; k < material->terms; k++) {
            fprintf(stream, "%.10g%s", k == 0 ? d : 0.0, k + 1 < material->terms ? ", " : "\n");
        }
        return;
    }
    /* a reduced polynomial is Yeoh's with zeros */
    fprintf(stream, "*HYPERELASTIC, YEOH\n%.10g, %.10g, %.10g, %.10g, 0., 0.\n", c[0] * MPA,
            material->terms > 1 ? c[1] * MPA : 0.0, material->terms > 2 ? c[2] * MPA : 0.0, d);
}

static void write_boundary(const struct solid *solid, FILE *stream) {
    fputs("*BOUNDARY\n", stream);
    bool held = false;
    for (size_t n = 1; n <= solid->count; n++) {
        const double *at_mm = solid->rest_mm[n];
        if (fabs(at_mm[1]) < ON_PLANE_MM) {
            fprintf(stream, "%zu, 2, 2\n", n);
        }
        if (fabs(at_mm[2]) < ON_PLANE_MM) {
            fprintf(stream, "%zu, 3, 3\n", n);
            if (!held && hypot(at_mm[0], at_mm[1]) < ON_PLANE_MM) {
                fprintf(stream, "%zu, 1, 1\n", n);
                held = true;
            }
        }
    }
}

static bool write_input(const struct solid *solid, const char *path) {
    FILE *stream = fopen(path, "w");
    if (stream == NULL) {
        return false;
    }
    fputs("*NODE, NSET=ALL\n", stream);
    for (size_t n = 1; n <= solid->count; n++) {
        fprintf(stream, "%zu, %.12g, %.12g, %.12g\n", n, solid->rest_mm[n][0], solid->rest_mm[n][1], solid->rest_mm[n][2]);
    }
    fputs("*ELEMENT, TYPE=C3D20R, ELSET=RUBBER\n", stream);
    for (size_t b = 0; b < solid->bricks; b++) {
        for (size_t q = 0; q < solid->plane.quads; q++) {
            if (is_open(solid, q, b)) {
                continue;
            }
            size_t node[20];
            brick_nodes(solid, q, b, node);
            fprintf(stream, "%zu", element_number(solid, q, b));
            for (size_t k = 0; k < 20; k++) {
                fprintf(stream, ",%s%zu", k == 12 ? "\n" : " ", solid->number[node[k]]);
            }
            fputc('\n', stream);
        }
    }
    fputs("*MATERIAL, NAME=RUBBER\n", stream);
    write_material(stream, &solid->module->material);
    fputs("*SOLID SECTION, ELSET=RUBBER, MATERIAL=RUBBER\n", stream);
    write_boundary(solid, stream);
    for (size_t s = 0; s < solid->options->steps; s++) {
        struct load load = {stream, solid->options->pressure_pa[s] * MPA};
        fprintf(stream, "*STEP, NLGEOM, INC=200\n*STATIC\n%.3g, 1., 1e-4, 0.5\n*DLOAD, OP=NEW\n", s == 0 ? 0.25 : 0.5);
        each_wet_face(solid, write_load, &load);
        fputs("*NODE PRINT, NSET=ALL, FREQUENCY=999\nU\n*END STEP\n", stream);
    }
    return fclose(stream) == 0;
}

/* --- running and reading --- */

static double children_s(void) {
    struct rusage usage;
    (void)getrusage(RUSAGE_CHILDREN, &usage);
    return (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

static bool run_ccx(const char *folder, double *cpu_s) {
    const double before_s = children_s();
    const pid_t child = fork();
    if (child == 0) {
        if (chdir(folder) != 0 || freopen("ccx.log", "w", stdout) == NULL) {
            _exit(1);
        }
        (void)setenv("OMP_NUM_THREADS", "2", 0);
        (void)execlp("ccx", "ccx", "-i", "solid", (char *)NULL);
        _exit(127);
    }
    int status = 0;
    (void)waitpid(child, &status, 0);
    *cpu_s = children_s() - before_s;
    return WIFEXITED(status) && WEXITSTATUS(status) != 127;
}

/* Displacements of the next step in ccx's table of results; false where there is none. */
static bool read_step(struct solid *solid, FILE *stream) {
    char line[256];
    size_t found = 0;
    while (found < solid->count && fgets(line, sizeof line, stream) != NULL) {
        char *end = NULL;
        const unsigned long node = strtoul(line, &end, 10);
        if (end == line || node == 0 || node > solid->count) {
            continue;
        }
        for (size_t d = 0; d < 3; d++) {
            solid->moved_mm[node][d] = solid->rest_mm[node][d] + strtod(end, &end);
        }
        found++;
    }
    return found == solid->count;
}

/* Rotation in the x-z plane that best turns the tip face's rest positions into the present ones. */
static double tip_rotation(const struct solid *solid) {
    const double top_mm = solid->z_mm[solid->levels - 1];
    double rest[2] = {0.0, 0.0}, moved[2] = {0.0, 0.0}, count = 0.0, cross = 0.0, dot = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t n = 1; n <= solid->count; n++) {
            if (fabs(solid->rest_mm[n][2] - top_mm) > ON_PLANE_MM) {
                continue;
            }
            if (pass == 0) {
                rest[0] += solid->rest_mm[n][0];
                moved[0] += solid->moved_mm[n][0];
                moved[1] += solid->moved_mm[n][2];
                count += 1.0;
            } else {
                const double x = solid->rest_mm[n][0] - rest[0] / count;
                const double mx = solid->moved_mm[n][0] - moved[0] / count, mz = solid->moved_mm[n][2] - moved[1] / count;
                dot += x * mx;
                cross += x * mz;
            }
        }
    }
    return atan2(cross, dot);
}

static double middle_width_m(const struct solid *solid) {
    double least = INFINITY, most = -INFINITY;
    for (size_t n = 1; n <= solid->count; n++) {
        if (fabs(solid->rest_mm[n][2]) < ON_PLANE_MM) {
            least = fmin(least, solid->moved_mm[n][0]);
            most = fmax(most, solid->moved_mm[n][0]);
        }
    }
    return (most - least) / MM;
}

struct volume {
    double (*position_mm)[3];
    double sum_mm3;
};

/* One third of the flux of the position through the face, by its eight corner triangles (mid-sides as corners). */
static void add_volume(const struct solid *solid, size_t quad, size_t brick, size_t face, void *context) {
    static const size_t rim[7][8] = {{0},
                                     {0, 8, 1, 9, 2, 10, 3, 11},
                                     {0},
                                     {0, 16, 4, 12, 5, 17, 1, 8},
                                     {1, 17, 5, 13, 6, 18, 2, 9},
                                     {2, 18, 6, 14, 7, 19, 3, 10},
                                     {3, 19, 7, 15, 4, 16, 0, 11}};
    struct volume *volume = context;
    size_t node[20];
    double p[8][3], centre[3] = {0.0, 0.0, 0.0};
    brick_nodes(solid, quad, brick, node);
    for (size_t k = 0; k < 8; k++) {
        memcpy(p[k], volume->position_mm[solid->number[node[rim[face][k]]]], sizeof p[k]);
        for (size_t d = 0; d < 3; d++) { /* eight-node interpolation at the middle: -1/4 corners + 1/2 mid-sides */
            centre[d] += (k % 2 == 0 ? -0.25 : 0.5) * p[k][d];
        }
    }
    for (size_t k = 0; k < 8; k++) {
        const double *a = centre, *b = p[k], *c = p[(k + 1) % 8];
        volume->sum_mm3 += (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                            a[2] * (b[0] * c[1] - b[1] * c[0])) /
                           6.0;
    }
}

static double chamber_volume_mm3(const struct solid *solid, double (*position_mm)[3]) {
    struct volume volume = {position_mm, 0.0};
    each_wet_face(solid, add_volume, &volume);
    return fabs(volume.sum_mm3);
}

static void free_solid(struct solid *solid) {
    free(solid->plane.position_mm);
    free(solid->plane.quad);
    free(solid->plane.chamber);
    free(solid->z_mm);
    free(solid->number);
    free(solid->rest_mm);
    free(solid->moved_mm);
}

int solid_model_run(const struct module_description *module, const struct solid_options *options, const char *folder,
                    struct solid_answer *answers, size_t *equations, double *cpu_s, char *error, size_t error_bytes) {
    struct solid solid = {.module = module, .options = options};
    char path[512];
    int reached = -1;
    FILE *results = NULL;
    if (!mesh_plane(module, options->size_m, &solid.plane) || !number_nodes(&solid)) {
        (void)snprintf(error, error_bytes, "the solid could not be meshed");
        free_solid(&solid);
        return -1;
    }
    *equations = 3 * solid.count;
    (void)snprintf(path, sizeof path, "%s/solid.inp", folder);
    if (!write_input(&solid, path)) {
        (void)snprintf(error, error_bytes, "%s could not be written", path);
    } else if (!run_ccx(folder, cpu_s)) {
        (void)snprintf(error, error_bytes, "ccx could not be run: is the package calculix-ccx there?");
    } else {
        (void)snprintf(path, sizeof path, "%s/solid.dat", folder);
        results = fopen(path, "r");
        reached = 0;
    }
    const double rest_mm3 = chamber_volume_mm3(&solid, solid.rest_mm);
    while (results != NULL && (size_t)reached < options->steps && read_step(&solid, results)) {
        answers[reached++] = (struct solid_answer){2.0 * fabs(tip_rotation(&solid)), middle_width_m(&solid),
                                                   chamber_volume_mm3(&solid, solid.moved_mm) / rest_mm3};
    }
    if (results != NULL) {
        (void)fclose(results);
    }
    free_solid(&solid);
    return reached;
}
