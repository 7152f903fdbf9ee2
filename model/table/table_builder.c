#include "table/table_builder.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "control/bend_table.h"
#include "control/bend_table_format.h"
#include "program/output_file.h"
#include "section/section_bend.h"
#include "section/section_solver.h"
#include "sweep/sweep.h"
#include "table/snap.h"

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the image is written in the host's byte order");

/* The axis reaches past the working pressure, so that control and simulation never leave it in normal use. */
#define AXIS_MARGIN 1.1
/* p_i = p_max (i / (n - 1))^exponent: closer nodes at high pressure, where bend rises fastest. */
#define AXIS_EXPONENT 0.8
/* Where chamber 1 alone snaps, the axis ends at this share of the pressure at which it does. */
#define SNAP_AXIS_SHARE 0.95
/* A ballooned module that bends further than this meets itself. */
#define BEND_MOST_RAD M_PI

struct node {
    float value[BEND_TABLE_CHANNEL_COUNT];
    uint8_t tag; /* 0: not solved (no equilibrium) */
};

struct build {
    const struct module_description *module;
    const struct table_build_options *options;
    const struct section_mesh *mesh;
    size_t n;
    double axis_pa[BEND_TABLE_AXIS_NODES_MAX];
    struct node *node; /* [n * n * n], filled where i1 >= i2 >= i3 */
    struct snap snap;
    struct node *ballooned; /* [SNAP_VOLUMES * SNAP_OTHERS^2], filled where i2 >= i3 */
    double *base;      /* [n * unknowns] states with chamber 1 alone, then [SNAP_VOLUMES * unknowns] ballooned */
    size_t base_count; /* of the first with an equilibrium */
    size_t ballooned_count; /* of the others */
    size_t unknowns;
    size_t total;
    size_t done;       /* for the progress */
};

/* A slab of the table, chamber 1 at node i: this head, then the nodes (j, k) with i >= j >= k, row by row. Of the ballooned
 * grid, chamber 1 at volume v: the head, what is known of the snap, and the nodes where there is a grid. */
struct slab_head {
    uint64_t solved;
    uint64_t no_equilibrium;
    uint64_t newton_iterations;
};

/* One worker of the sweep. */
struct worker {
    struct section_solver *solver;
    double *row;
};

static struct node *node_at(const struct build *build, size_t i, size_t j, size_t k) {
    return &build->node[k + build->n * (j + build->n * i)];
}

static struct node *ballooned_at(const struct build *build, size_t v, size_t j, size_t k) {
    return &build->ballooned[k + SNAP_OTHERS * (j + SNAP_OTHERS * v)];
}

static bool has_ballooned(const struct build *build) {
    return build->snap.volume_m2[0] > 0.0;
}

static size_t slab_nodes(size_t i) {
    return (i + 1) * (i + 2) / 2;
}

/* To where the module works and some more, or to just before chamber 1 alone snaps. */
static void place_axis(struct build *build) {
    double end_pa = AXIS_MARGIN * build->module->working_pressure_pa;
    if (build->snap.jump_up_pa > 0.0) {
        end_pa = fmin(end_pa, SNAP_AXIS_SHARE * build->snap.jump_up_pa);
    }
    for (size_t i = 0; i < build->n; i++) {
        build->axis_pa[i] = end_pa * pow((double)i / (double)(build->n - 1), AXIS_EXPONENT);
    }
}

static bool stopped(const struct build *build) {
    return build->options->stop != NULL && *build->options->stop != 0;
}

static void tick(struct build *build, size_t count) {
#pragma omp critical(table_progress)
    {
        build->done += count;
        if (build->options->progress != NULL) {
            build->options->progress(build->options->context, build->done, build->total);
        }
    }
}

static void grow_total(struct build *build, size_t count) {
#pragma omp critical(table_progress)
    build->total += count;
}

/* The table's curvature is the tip's bend over the chamber's length, ends included. */
static void record(const struct build *build, struct node *node, const struct section_state *state) {
    const double length_m = build->module->chamber_length_m;
    double bend_rad[2];
    section_tip_bend(build->module, state, bend_rad);
    const double values[BEND_TABLE_CHANNEL_COUNT] = {
        bend_rad[0] / length_m, bend_rad[1] / length_m, state->stretch,     state->volume_m2[0], state->volume_m2[1],
        state->volume_m2[2],    state->von_mises_apex_pa, state->stretch_max, state->width_max_m};
    for (size_t c = 0; c < BEND_TABLE_CHANNEL_COUNT; c++) {
        node->value[c] = (float)values[c];
    }
    unsigned tag = BEND_TABLE_TAG_VALID | (state->stable ? BEND_TABLE_TAG_STABLE : 0u);
    tag |= state->beyond_strain ? BEND_TABLE_TAG_BEYOND_STRAIN : 0u;
    if (state->contact) {
        tag = (tag | BEND_TABLE_TAG_CONTACT) & ~(unsigned)BEND_TABLE_TAG_VALID;
    }
    node->tag = (uint8_t)tag;
}

/* Record the state that the solver found at a node, if it did; `by_volume`: of the ballooned grid. */
static bool take_node(struct build *build, struct section_solver *solver, bool found, bool by_volume, struct node *node,
                      struct slab_head *head) {
    struct section_state state;
    section_solver_state(solver, &state);
    if (found) {
        record(build, node, &state);
    }
    if (found && by_volume) {
        node->value[BEND_TABLE_PRESSURE_1] = (float)state.pressure_pa[0];
    }
    head->solved++;
    head->no_equilibrium += !found;
    head->newton_iterations += (uint64_t)state.newton_iterations;
    tick(build, 1);
    return found;
}

/* Chamber 1 alone, from nothing to the end of the axis: where each slab starts. */
static void solve_base(struct build *build, struct section_solver *solver) {
    section_solver_reset(solver);
    build->base_count = 0;
    for (size_t i = 0; i < build->n && !stopped(build); i++) {
        const double pressure_pa[3] = {build->axis_pa[i], 0.0, 0.0};
        if (!section_solver_move_to(solver, pressure_pa)) {
            return;
        }
        section_solver_save(solver, build->base + i * build->unknowns);
        build->base_count = i + 1;
    }
}

/* Chamber 1 alone at each volume of the ballooned grid. */
static void solve_ballooned_base(struct build *build, struct section_solver *solver) {
    section_solver_reset(solver);
    for (size_t v = 0; v < SNAP_VOLUMES && !stopped(build); v++) {
        if (!section_solver_move_to_volume(solver, build->snap.volume_m2[v], 0.0, 0.0)) {
            return;
        }
        section_solver_save(solver, build->base + (build->n + v) * build->unknowns);
        build->ballooned_count = v + 1;
    }
}

/* What all slabs start from. Every worker would find the same. */
static void prepare(struct build *build, struct section_solver *solver) {
    solve_base(build, solver);
    if (build->base_count == build->n || stopped(build)) {
        return;
    }
    snap_find(solver, build->axis_pa[build->n - 1], BEND_MOST_RAD / build->module->chamber_length_m, &build->snap);
    if (build->snap.jump_up_pa > 0.0) {
        place_axis(build);
        solve_base(build, solver);
    }
    if (has_ballooned(build)) {
        solve_ballooned_base(build, solver);
    }
}

static void close_worker(void *pointer) {
    struct worker *worker = pointer;
    section_solver_free(worker->solver);
    free(worker->row);
    free(worker);
}

static void *open_worker(void *context, char *error, size_t error_bytes) {
    struct build *build = context;
    struct description_error why = {"out of memory for the table"};
    struct worker *worker = calloc(1, sizeof *worker);
    if (worker != NULL) {
        worker->solver = section_solver_create(build->mesh, build->module, &why);
    }
    if (worker != NULL && worker->solver != NULL) {
#pragma omp critical(table_base)
        {
            if (build->base == NULL) {
                build->unknowns = section_solver_unknowns(worker->solver);
                build->base = malloc((build->n + SNAP_VOLUMES) * build->unknowns * sizeof(double));
                if (build->base != NULL) {
                    prepare(build, worker->solver);
                }
            }
        }
        worker->row = malloc(build->unknowns * sizeof(double));
    }
    if (worker != NULL && (worker->row == NULL || build->base == NULL)) {
        (void)snprintf(error, error_bytes, "%.200s", why.text);
        close_worker(worker);
        return NULL;
    }
    return worker;
}

/* Chamber 1 at node i, chamber 2 rising, and from each of its states chamber 3 rising up to chamber 2. */
static bool solve_slab(struct build *build, struct worker *worker, size_t i, struct sweep_result *result) {
    result->size = sizeof(struct slab_head) + slab_nodes(i) * sizeof(struct node);
    result->bytes = calloc(1, result->size);
    if (result->bytes == NULL) {
        return false;
    }
    struct slab_head head = {0, 0, 0};
    struct node *node = (struct node *)(void *)(result->bytes + sizeof head);
    if (i < build->base_count) {
        memcpy(worker->row, build->base + i * build->unknowns, build->unknowns * sizeof(double));
    }
    for (size_t j = 0; j <= i && i < build->base_count && !stopped(build); j++) {
        bool found = true;
        section_solver_restore(worker->solver, worker->row);
        for (size_t k = 0; k <= j && found && !stopped(build); k++) {
            const double pressure_pa[3] = {build->axis_pa[i], build->axis_pa[j], build->axis_pa[k]};
            found = take_node(build, worker->solver, section_solver_move_to(worker->solver, pressure_pa), false,
                              &node[j * (j + 1) / 2 + k], &head);
            if (k == 0 && found) {
                section_solver_save(worker->solver, worker->row);
            } else if (k == 0) {
                j = i; /* no equilibrium with two chambers: none further out */
            }
        }
    }
    memcpy(result->bytes, &head, sizeof head);
    return true;
}

/* The same for chamber 1 at the v-th volume of the ballooned grid. */
static bool solve_ballooned_slab(struct build *build, struct worker *worker, size_t v, struct sweep_result *result) {
    const size_t count = has_ballooned(build) ? slab_nodes(SNAP_OTHERS - 1) : 0;
    result->size = sizeof(struct slab_head) + sizeof build->snap + count * sizeof(struct node);
    result->bytes = calloc(1, result->size);
    if (result->bytes == NULL) {
        return false;
    }
    struct slab_head head = {0, 0, 0};
    struct node *node = (struct node *)(void *)(result->bytes + sizeof head + sizeof build->snap);
    grow_total(build, count);
    if (v < build->ballooned_count) {
        memcpy(worker->row, build->base + (build->n + v) * build->unknowns, build->unknowns * sizeof(double));
    }
    for (size_t j = 0; j < SNAP_OTHERS && v < build->ballooned_count && !stopped(build); j++) {
        bool found = true;
        section_solver_restore(worker->solver, worker->row);
        for (size_t k = 0; k <= j && found && !stopped(build); k++) {
            found = section_solver_move_to_volume(worker->solver, build->snap.volume_m2[v], build->snap.others_pa[j],
                                                  build->snap.others_pa[k]);
            found = take_node(build, worker->solver, found, true, &node[j * (j + 1) / 2 + k], &head);
            if (k == 0 && found) {
                section_solver_save(worker->solver, worker->row);
            } else if (k == 0) {
                j = SNAP_OTHERS; /* none further out */
            }
        }
    }
    memcpy(result->bytes, &head, sizeof head);
    memcpy(result->bytes + sizeof head, &build->snap, sizeof build->snap);
    return true;
}

/* Tasks: the slabs, the largest first, then those of the ballooned grid. */
static bool solve_task(void *context, void *pointer, size_t task, struct sweep_result *result) {
    struct build *build = context;
    const bool solved = task < build->n ? solve_slab(build, pointer, build->n - 1 - task, result)
                                        : solve_ballooned_slab(build, pointer, task - build->n, result);
    if (solved && stopped(build)) { /* cut short */
        free(result->bytes);
        *result = (struct sweep_result){NULL, 0};
    }
    return solved && !stopped(build);
}

static void count_arrival(void *context, size_t task) {
    struct build *build = context;
    if (task < build->n) {
        tick(build, slab_nodes(build->n - 1 - task));
    }
}

/* Rows (j, k) with j >= k of a slab's `nodes`, to where (j, 0) lies in a grid. */
static void take_rows(const unsigned char *nodes, size_t rows, struct node *first, size_t stride) {
    for (size_t j = 0; j < rows; j++) {
        memcpy(first + j * stride, nodes + j * (j + 1) / 2 * sizeof(struct node), (j + 1) * sizeof(struct node));
    }
}

static void take_results(struct build *build, const struct sweep_result *results, struct table_image *image) {
    struct slab_head head;
    for (size_t task = 0; task < build->n + SNAP_VOLUMES; task++) {
        const unsigned char *bytes = results[task].bytes;
        memcpy(&head, bytes, sizeof head);
        image->solved += head.solved;
        image->no_equilibrium += head.no_equilibrium;
        image->newton_iterations += head.newton_iterations;
        if (task < build->n) {
            const size_t i = build->n - 1 - task;
            take_rows(bytes + sizeof head, i + 1, node_at(build, i, 0, 0), build->n);
        } else {
            memcpy(&build->snap, bytes + sizeof head, sizeof build->snap);
            take_rows(bytes + sizeof head + sizeof build->snap, has_ballooned(build) ? SNAP_OTHERS : 0,
                      ballooned_at(build, task - build->n, 0, 0), SNAP_OTHERS);
        }
    }
    place_axis(build);
}

/* --- from one sixth to the whole --- */

/* order[k]: the chamber with the k-th greatest index; ties keep their order. */
static void sort_chambers(const size_t index[3], size_t order[3]) {
    for (size_t c = 0; c < 3; c++) {
        size_t rank = 0;
        for (size_t d = 0; d < 3; d++) {
            rank += index[d] > index[c] || (d < c && index[d] == index[c]);
        }
        order[rank] = c;
    }
}

/* The solved node, moved so that the chamber with the k-th greatest pressure is order[k]: a turn by order[0] thirds,
 * after a mirror at the x axis (chambers 2 and 3 change places) where the order runs backwards. */
static void turn_node(const struct node *solved, const size_t order[3], struct node *turned) {
    const bool mirrored = (order[1] + 3 - order[0]) % 3 == 2;
    const double angle = (double)order[0] * 2.0 * M_PI / 3.0;
    const double x = (double)solved->value[BEND_TABLE_CURVATURE_X];
    const double y = (mirrored ? -1.0 : 1.0) * (double)solved->value[BEND_TABLE_CURVATURE_Y];
    *turned = *solved;
    turned->value[BEND_TABLE_CURVATURE_X] = (float)(x * cos(angle) - y * sin(angle));
    turned->value[BEND_TABLE_CURVATURE_Y] = (float)(x * sin(angle) + y * cos(angle));
    for (size_t k = 0; k < 3; k++) {
        turned->value[BEND_TABLE_VOLUME_1 + order[k]] = solved->value[BEND_TABLE_VOLUME_1 + k];
    }
    if (mirrored || order[0] != 0) {
        turned->tag = (uint8_t)(turned->tag | BEND_TABLE_TAG_MIRRORED);
    }
}

static void grow_volumes(const struct build *build, size_t i, size_t j, size_t k, struct node *node) {
    const struct node *below = node_at(build, i, j, k);
    for (size_t c = 0; c < 3; c++) {
        node->value[BEND_TABLE_VOLUME_1 + c] = fmaxf(node->value[BEND_TABLE_VOLUME_1 + c], below->value[BEND_TABLE_VOLUME_1 + c]);
    }
}

/* A node without an equilibrium takes the values of the nearest one below it along the diagonal, which has its symmetry;
 * its volumes are no less than those of any node below it, so that a chamber never shrinks as its pressure rises. */
static void fill_node(const struct build *build, size_t i, size_t j, size_t k) {
    struct node filled = *node_at(build, i - 1, j - (j > 0), k - (k > 0));
    float *volume = &filled.value[BEND_TABLE_VOLUME_1];
    filled.tag = BEND_TABLE_TAG_EXTRAPOLATED;
    if (i > j) {
        grow_volumes(build, i - 1, j, k, &filled);
    }
    if (j > k) {
        grow_volumes(build, i, j - 1, k, &filled);
    }
    if (k > 0) {
        grow_volumes(build, i, j, k - 1, &filled);
    }
    if (i == j) { /* chambers under the same pressure are alike */
        volume[0] = volume[1] = fmaxf(volume[0], volume[1]);
    }
    if (j == k) {
        volume[1] = volume[2] = fmaxf(volume[1], volume[2]);
    }
    *node_at(build, i, j, k) = filled;
}

static void fill_nodes(const struct build *build) {
    for (size_t i = 1; i < build->n; i++) {
        for (size_t j = 0; j <= i; j++) {
            for (size_t k = 0; k <= j; k++) {
                if (node_at(build, i, j, k)->tag == 0) {
                    fill_node(build, i, j, k);
                }
            }
        }
    }
}

static void put(unsigned char *image, size_t offset, const void *bytes, size_t size) {
    memcpy(image + offset, bytes, size);
}

static void put_u16(unsigned char *image, size_t offset, unsigned value) {
    const uint16_t word = (uint16_t)value;
    put(image, offset, &word, sizeof word);
}

static void put_u32(unsigned char *image, size_t offset, size_t value) {
    const uint32_t word = (uint32_t)value;
    put(image, offset, &word, sizeof word);
}

static void put_header(const struct build *build, struct table_image *image) {
    const struct module_description *module = build->module;
    const uint64_t hash = module_description_hash(module);
    const float geometry[] = {(float)module->outer_diameter_m,
                              (float)module->chamber_length_m,
                              (float)module->chamber_length_m, /* bend = curvature x this */
                              (float)module->cap_proximal_m,
                              (float)module->cap_distal_m,
                              (float)module->working_pressure_pa,
                              (float)module->burst_pressure_pa,
                              (float)module->bend_limit_rad};
    put(image->bytes, 0, BEND_TABLE_MAGIC, 4);
    put_u16(image->bytes, BEND_TABLE_OFFSET_VERSION, BEND_TABLE_VERSION);
    put_u16(image->bytes, BEND_TABLE_OFFSET_HEADER_BYTES, BEND_TABLE_HEADER_BYTES);
    put_u32(image->bytes, BEND_TABLE_OFFSET_IMAGE_BYTES, image->size);
    put(image->bytes, BEND_TABLE_OFFSET_NAME, module->name, strlen(module->name));
    put(image->bytes, BEND_TABLE_OFFSET_HASH, &hash, sizeof hash);
    for (size_t a = 0; a < 3; a++) {
        put_u32(image->bytes, BEND_TABLE_OFFSET_NODES + 4 * a, build->n);
    }
    put_u32(image->bytes, BEND_TABLE_OFFSET_CHANNELS, BEND_TABLE_CHANNEL_COUNT);
    put(image->bytes, BEND_TABLE_OFFSET_GEOMETRY, geometry, sizeof geometry);
    put(image->bytes, BEND_TABLE_OFFSET_CHANNEL_TEXT, BEND_TABLE_CHANNEL_TEXT, strlen(BEND_TABLE_CHANNEL_TEXT));
}

/* A grid's place in the image. */
struct grid_image {
    unsigned char *axes;
    unsigned char *channels;
    unsigned char *tags;
    size_t count; /* of nodes */
};

static size_t grid_bytes(size_t axis_nodes, size_t count) {
    return (sizeof(float) * (axis_nodes + BEND_TABLE_CHANNEL_COUNT * count) + count + 3) / 4 * 4;
}

static struct grid_image grid_at(unsigned char *start, size_t axis_nodes, size_t count) {
    unsigned char *channels = start + axis_nodes * sizeof(float);
    return (struct grid_image){start, channels, channels + BEND_TABLE_CHANNEL_COUNT * count * sizeof(float), count};
}

static void put_axis(const struct grid_image *grid, size_t first, const double *values, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const float value = (float)values[i];
        put(grid->axes, (first + i) * sizeof(float), &value, sizeof value);
    }
}

static void put_node(const struct grid_image *grid, size_t at, const struct node *node) {
    for (size_t c = 0; c < BEND_TABLE_CHANNEL_COUNT; c++) {
        put(grid->channels, (c * grid->count + at) * sizeof(float), &node->value[c], sizeof(float));
    }
    grid->tags[at] = node->tag;
}

static void put_nodes(const struct build *build, const struct grid_image *grid) {
    const size_t n = build->n;
    for (size_t a = 0; a < 3; a++) {
        put_axis(grid, a * n, build->axis_pa, n);
    }
    for (size_t at = 0; at < grid->count && n > 0; at++) {
        const size_t index[3] = {at / (n * n), at / n % n, at % n};
        size_t order[3];
        sort_chambers(index, order);
        struct node turned;
        turn_node(node_at(build, index[order[0]], index[order[1]], index[order[2]]), order, &turned);
        put_node(grid, at, &turned);
    }
}

/* A ballooned node without an equilibrium takes the values of the one with less pressure in the other chambers. */
static void fill_ballooned(const struct build *build) {
    for (size_t at = 0; at < SNAP_VOLUMES * SNAP_OTHERS * SNAP_OTHERS; at++) {
        const size_t v = at / (SNAP_OTHERS * SNAP_OTHERS), j = at / SNAP_OTHERS % SNAP_OTHERS, k = at % SNAP_OTHERS;
        struct node *node = ballooned_at(build, v, j, k);
        if (k > j || node->tag != 0) {
            continue;
        }
        if (j > 0) {
            *node = *ballooned_at(build, v, j - 1, k - (k == j));
        } else {
            *node = *ballooned_at(build, v - (v > 0), 0, 0);
        }
        node->tag = BEND_TABLE_TAG_EXTRAPOLATED;
    }
}

/* Chambers 2 and 3 change places at the x axis. */
static void put_ballooned(const struct build *build, const struct grid_image *grid) {
    put_axis(grid, 0, build->snap.volume_m2, SNAP_VOLUMES);
    put_axis(grid, SNAP_VOLUMES, build->snap.others_pa, SNAP_OTHERS);
    put_axis(grid, SNAP_VOLUMES + SNAP_OTHERS, build->snap.others_pa, SNAP_OTHERS);
    for (size_t at = 0; at < grid->count; at++) {
        static const size_t straight[3] = {0, 1, 2}, mirrored[3] = {0, 2, 1};
        const size_t v = at / (SNAP_OTHERS * SNAP_OTHERS), j = at / SNAP_OTHERS % SNAP_OTHERS, k = at % SNAP_OTHERS;
        struct node turned;
        turn_node(ballooned_at(build, v, j > k ? j : k, j > k ? k : j), k > j ? mirrored : straight, &turned);
        put_node(grid, at, &turned);
    }
}

static void put_snap(const struct build *build, struct table_image *image) {
    const float jumps[2] = {(float)build->snap.jump_up_pa, (float)build->snap.jump_down_pa};
    put(image->bytes, BEND_TABLE_OFFSET_JUMPS, jumps, sizeof jumps);
    for (size_t a = 0; a < 3 && has_ballooned(build); a++) {
        put_u32(image->bytes, BEND_TABLE_OFFSET_BALLOONED + 4 * a, a == 0 ? SNAP_VOLUMES : SNAP_OTHERS);
    }
}

static bool make_image(const struct build *build, struct table_image *image) {
    const size_t axes = 3 * build->n, count = build->n * build->n * build->n;
    const size_t axes_beyond = SNAP_VOLUMES + 2 * SNAP_OTHERS, beyond = SNAP_VOLUMES * SNAP_OTHERS * SNAP_OTHERS;
    const size_t end = BEND_TABLE_HEADER_BYTES + grid_bytes(axes, count);
    image->size = end + (has_ballooned(build) ? grid_bytes(axes_beyond, beyond) : 0);
    image->nodes = count + (has_ballooned(build) ? beyond : 0);
    image->bytes = calloc(image->size, 1);
    if (image->bytes == NULL) {
        return false;
    }
    const struct grid_image grid = grid_at(image->bytes + BEND_TABLE_HEADER_BYTES, axes, count);
    fill_nodes(build);
    put_header(build, image);
    put_nodes(build, &grid);
    put_snap(build, image);
    if (has_ballooned(build)) {
        const struct grid_image ballooned = grid_at(image->bytes + end, axes_beyond, beyond);
        fill_ballooned(build);
        put_ballooned(build, &ballooned);
    }
    const size_t covered = BEND_TABLE_OFFSET_CRC + 4;
    put_u32(image->bytes, BEND_TABLE_OFFSET_CRC, crc32(0, image->bytes + covered, (uInt)(image->size - covered)));
    return true;
}

/* The first slab without an equilibrium of chamber 1 alone. */
static size_t first_empty_slab(const struct build *build) {
    size_t i = 0;
    while (i < build->n && node_at(build, i, 0, 0)->tag != 0) {
        i++;
    }
    return i;
}

static enum sweep_outcome finish(struct build *build, enum sweep_outcome outcome, const struct sweep_result *results,
                                 struct table_image *image, struct description_error *error) {
    if (outcome == SWEEP_STOPPED) {
        (void)snprintf(error->text, sizeof error->text, "interrupted after %zu of %zu equilibria; %s", build->done,
                       build->total,
                       build->options->keep_path == NULL ? "nothing was written"
                                                         : "the finished slabs are kept: the same command goes on");
    }
    if (outcome != SWEEP_DONE) {
        return outcome;
    }
    take_results(build, results, image);
    const size_t reached = first_empty_slab(build);
    if (reached < 3) {
        (void)snprintf(error->text, sizeof error->text,
                       "material %s has no stable equilibrium above %.0f Pa: no table can be made of it; see "
                       "`tribend-tables material %s`",
                       build->module->material.name, build->axis_pa[reached == 0 ? 0 : reached - 1],
                       build->module->material.name);
        return SWEEP_FAILED;
    }
    if (!make_image(build, image)) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the table's image");
        return SWEEP_FAILED;
    }
    return SWEEP_DONE;
}

static enum sweep_outcome run(struct build *build, struct table_image *image, struct description_error *error) {
    const struct section_mesh_options mesh_options = {.size_m = build->options->size_m};
    struct section_mesh *mesh = section_mesh_create(build->module, &mesh_options, error);
    const size_t tasks = build->n + SNAP_VOLUMES;
    struct sweep_result *results = calloc(tasks, sizeof *results);
    enum sweep_outcome outcome = SWEEP_FAILED;
    if (mesh != NULL && results != NULL) {
        const struct sweep_job job = {.count = tasks,
                                      .context = build,
                                      .open = open_worker,
                                      .close = close_worker,
                                      .work = solve_task,
                                      .arrived = count_arrival,
                                      .keep_path = build->options->keep_path,
                                      .key = module_description_hash(build->module) ^ (build->n << 32) ^
                                             (uint64_t)(1e9 * build->options->size_m) ^ (uint64_t)BEND_TABLE_VERSION << 56,
                                      .stop = build->options->stop};
        build->mesh = mesh;
        outcome = finish(build, sweep_run(&job, results, error->text, sizeof error->text), results, image, error);
    }
    for (size_t i = 0; i < tasks && results != NULL; i++) {
        free(results[i].bytes);
    }
    free(results);
    section_mesh_free(mesh);
    return outcome;
}

enum sweep_outcome table_build(const struct module_description *module, const struct table_build_options *options,
                 struct table_image *image, struct description_error *error) {
    struct build build = {.module = module, .options = options};
    memset(image, 0, sizeof *image);
    build.n = options->nodes == 0 ? TABLE_NODES_DEFAULT : options->nodes;
    if (build.n < TABLE_NODES_LEAST || build.n > BEND_TABLE_AXIS_NODES_MAX) {
        (void)snprintf(error->text, sizeof error->text, "a table takes %d to %u nodes on each axis, not %zu",
                       TABLE_NODES_LEAST, BEND_TABLE_AXIS_NODES_MAX, build.n);
        return SWEEP_FAILED;
    }
    if (!section_is_symmetric(module)) {
        (void)snprintf(error->text, sizeof error->text,
                       "module %s: tables are built for three equal chambers that are symmetric about their axis; "
                       "describe one such chamber",
                       module->name);
        return SWEEP_FAILED;
    }
    build.total = build.n * (build.n + 1) * (build.n + 2) / 6;
    place_axis(&build);
    build.node = calloc(build.n * build.n * build.n, sizeof *build.node);
    build.ballooned = calloc(SNAP_VOLUMES * SNAP_OTHERS * SNAP_OTHERS, sizeof *build.ballooned);
    enum sweep_outcome outcome = SWEEP_FAILED;
    if (build.node == NULL || build.ballooned == NULL) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for the table's nodes");
    } else {
        outcome = run(&build, image, error);
    }
    free(build.node);
    free(build.ballooned);
    free(build.base);
    return outcome;
}

void table_image_free(struct table_image *image) {
    free(image->bytes);
    memset(image, 0, sizeof *image);
}

bool table_image_write(const struct table_image *image, const char *path, char *error, size_t error_bytes) {
    struct output_file file;
    if (!output_file_open(&file, path, error, error_bytes)) {
        return false;
    }
    (void)fwrite(image->bytes, 1, image->size, file.stream); /* commit looks at the stream's error flag */
    return output_file_commit(&file, error, error_bytes);
}
