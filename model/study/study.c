#include "study/study.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SECTOR_OPENING_RAD (M_PI / 3.0)
#define RING_OPENING_RAD (M_PI / 3.0)
#define MODULE_AREA_M2 (M_PI * PAPER_RADIUS_M * PAPER_RADIUS_M)
#define SEMICIRCLE_AREA_M2 (0.5 * M_PI * PAPER_CAVITY_RADIUS_M * PAPER_CAVITY_RADIUS_M)

const char *const cavity_shape_name[STUDY_SHAPES] = {"circle", "semicircle", "sector", "ring-sector"};

const struct study study_of[STUDY_KINDS] = {
    {"wall", "wall distance / module diameter", "falls linearly as the wall thins", "the balloon is almost constant"},
    {"length", "chamber length / module length", "falls linearly as the ratio grows",
     "the balloon falls from 0.6 to 0.8 and then stays"},
    {"area", "chamber area / module area", "falls about linearly for all four shapes",
     "the balloon grows with the ratio for circle, semicircle and sector, and falls to a plateau for the ring sector"},
    {"shape", "chamber area / module area", "the ring sector needs least, 0.065 bar at a ratio of 0.032",
     "the semicircle at 0.04 balloons least, the ring sector most"}};

void study_module(enum cavity_shape shape, double area_m2, double wall_m, const struct material *material,
                  struct module_description *module) {
    const double reach_m = PAPER_RADIUS_M - wall_m;
    struct cavity cavity = {.shape = shape};
    switch (shape) {
    case CAVITY_CIRCLE:
        cavity.radius_m = sqrt(area_m2 / M_PI);
        cavity.centre_m[0] = reach_m - cavity.radius_m;
        break;
    case CAVITY_SEMICIRCLE:
        cavity.radius_m = sqrt(2.0 * area_m2 / M_PI);
        cavity.centre_m[0] = reach_m - cavity.radius_m;
        break;
    case CAVITY_SECTOR:
        cavity.opening_rad = SECTOR_OPENING_RAD;
        cavity.radius_m = sqrt(2.0 * area_m2 / SECTOR_OPENING_RAD);
        cavity.centre_m[0] = reach_m - cavity.radius_m;
        break;
    default:
        cavity.opening_rad = RING_OPENING_RAD;
        cavity.radius_m = reach_m;
        cavity.inner_radius_m = sqrt(reach_m * reach_m - 2.0 * area_m2 / RING_OPENING_RAD);
        break;
    }
    memset(module, 0, sizeof *module);
    (void)snprintf(module->name, sizeof module->name, "%s", cavity_shape_name[shape]);
    module->outer_diameter_m = 2.0 * PAPER_RADIUS_M;
    module->length_m = PAPER_LENGTH_M;
    module->three_fold = true;
    module->material = *material;
    for (size_t c = 0; c < MODULE_CHAMBERS; c++) {
        module->chamber[c].cavity_count = 1;
        cavity_turn(&cavity, (double)c * 2.0 * M_PI / 3.0, &module->chamber[c].cavity[0]);
    }
}

static void add(struct study_point *points, size_t *count, enum cavity_shape shape, double area_m2, double wall_m,
                double chamber_length_m, double bend_rad, double x, const struct material *material) {
    struct study_point *point = &points[(*count)++];
    memset(point, 0, sizeof *point);
    study_module(shape, area_m2, wall_m, material, &point->module);
    point->goal = SECTION_GOAL_CURVATURE;
    point->value = bend_rad / chamber_length_m;
    point->chamber_length_m = chamber_length_m;
    point->x = x;
}

size_t study_points(enum study_kind kind, const struct material *material, double bend_rad, struct study_point *points) {
    static const double walls[] = {0.03, 0.04, 0.05, 0.06, 0.07, 0.08};
    static const double lengths[] = {0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95};
    static const double areas[] = {0.025, 0.032, 0.04, 0.05, 0.065};
    static const double shape_areas[] = {0.032, 0.04};
    size_t count = 0;
    if (kind == STUDY_WALL) {
        for (size_t i = 0; i < sizeof walls / sizeof walls[0]; i++) {
            add(points, &count, CAVITY_SEMICIRCLE, SEMICIRCLE_AREA_M2, walls[i] * 2.0 * PAPER_RADIUS_M,
                PAPER_CHAMBER_LENGTH_M, bend_rad, walls[i], material);
        }
    } else if (kind == STUDY_LENGTH) {
        for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
            add(points, &count, CAVITY_SEMICIRCLE, SEMICIRCLE_AREA_M2, PAPER_WALL_M, lengths[i] * PAPER_LENGTH_M, bend_rad,
                lengths[i], material);
        }
    } else {
        const double *ratios = kind == STUDY_AREA ? areas : shape_areas;
        const size_t ratio_count = kind == STUDY_AREA ? sizeof areas / sizeof areas[0] : 2;
        for (int shape = 0; shape < STUDY_SHAPES; shape++) {
            for (size_t i = 0; i < ratio_count; i++) {
                add(points, &count, (enum cavity_shape)shape, ratios[i] * MODULE_AREA_M2, PAPER_WALL_M,
                    PAPER_CHAMBER_LENGTH_M, bend_rad, ratios[i], material);
            }
        }
    }
    return count;
}

/* --- solving --- */

struct job {
    const struct study_point *points;
    const struct study_options *options;
    size_t count;
    size_t done;
};

struct greatest {
    struct section_state state;
    const volatile sig_atomic_t *stop;
};

static bool keep_greatest(void *context, const struct section_state *state) {
    struct greatest *greatest = context;
    if (state->pressure_pa[0] >= greatest->state.pressure_pa[0]) {
        greatest->state = *state;
    }
    return greatest->stop == NULL || *greatest->stop == 0;
}

static void solve_point(const struct study_point *point, const volatile sig_atomic_t *stop, struct study_answer *answer) {
    static const double direction_pa[3] = {1.0, 0.0, 0.0};
    struct description_error error = {""};
    struct greatest greatest = {.stop = stop};
    struct section_mesh *mesh;
    memset(answer, 0, sizeof *answer);
#pragma omp critical(study_mesh) /* gmsh holds one model for the whole program */
    mesh = section_mesh_create(&point->module, NULL, &error);
    struct section_solver *solver = mesh == NULL ? NULL : section_solver_create(mesh, &point->module, &error);
    if (solver != NULL) {
        answer->found = section_solver_path(solver, direction_pa, point->goal, point->value, keep_greatest, &greatest, &error);
        answer->state = greatest.state;
        if (answer->found) {
            section_solver_state(solver, &answer->state);
        }
    }
    (void)snprintf(answer->why, sizeof answer->why, "%.250s", answer->found ? "" : error.text);
    section_solver_free(solver);
    section_mesh_free(mesh);
}

static void tick(void *context, size_t task) {
    struct job *job = context;
    (void)task;
#pragma omp critical(study_progress)
    {
        job->done++;
        if (job->options->progress != NULL) {
            job->options->progress(job->options->context, job->done, job->count);
        }
    }
}

static void *open_worker(void *context, char *error, size_t error_bytes) {
    (void)error;
    (void)error_bytes;
    return context; /* each point has a mesh and a solver of its own */
}

static void close_worker(void *worker) {
    (void)worker;
}

static bool work(void *context, void *worker, size_t task, struct sweep_result *result) {
    struct job *job = context;
    struct study_answer *answer = calloc(1, sizeof *answer);
    (void)worker;
    if (answer == NULL) {
        return false;
    }
    solve_point(&job->points[task], job->options->stop, answer);
    *result = (struct sweep_result){(unsigned char *)answer, sizeof *answer};
    const bool stopped = job->options->stop != NULL && *job->options->stop != 0;
    if (stopped) {
        free(answer);
        *result = (struct sweep_result){NULL, 0};
    } else {
        tick(context, task);
    }
    return !stopped;
}

static uint64_t key_of(const struct study_point *points, size_t count) {
    uint64_t key = count;
    for (size_t i = 0; i < count; i++) {
        uint64_t value = 0;
        memcpy(&value, &points[i].value, sizeof value);
        key = key * 1099511628211ULL ^ module_description_hash(&points[i].module) ^ value ^ (uint64_t)points[i].goal;
    }
    return key;
}

enum sweep_outcome study_solve(const struct study_point *points, size_t count, const struct study_options *options,
                               struct study_answer *answers, struct description_error *error) {
    struct job job = {points, options, count, 0};
    struct sweep_result *results = calloc(count + 1, sizeof *results);
    if (results == NULL) {
        (void)snprintf(error->text, sizeof error->text, "out of memory for %zu points", count);
        return SWEEP_FAILED;
    }
    const struct sweep_job sweep = {.count = count,
                                    .context = &job,
                                    .open = open_worker,
                                    .close = close_worker,
                                    .work = work,
                                    .arrived = tick,
                                    .keep_path = options->keep_path,
                                    .key = key_of(points, count),
                                    .stop = options->stop};
    const enum sweep_outcome outcome = sweep_run(&sweep, results, error->text, sizeof error->text);
    for (size_t i = 0; i < count; i++) {
        if (outcome == SWEEP_DONE) {
            memcpy(&answers[i], results[i].bytes, sizeof answers[i]);
        }
        free(results[i].bytes);
    }
    free(results);
    if (outcome == SWEEP_STOPPED) {
        (void)snprintf(error->text, sizeof error->text, "interrupted after %zu of %zu points%s", job.done, count,
                       options->keep_path != NULL ? "; they are kept: the same command goes on" : "");
    }
    return outcome;
}

/* --- reading --- */

double study_bend_rad(const struct study_point *point, const struct study_answer *answer) {
    return hypot(answer->state.curvature_x_1pm, answer->state.curvature_y_1pm) * point->chamber_length_m;
}

double study_balloon_area_m2(const struct study_point *point, const struct study_answer *answer) {
    return (answer->state.width_bend_plane_m - point->module.outer_diameter_m) * point->chamber_length_m *
           answer->state.stretch;
}

double study_correlation(const double *x, const double *y, size_t count) {
    double mx = 0.0, my = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    for (size_t i = 0; i < count; i++) {
        mx += x[i] / (double)count;
        my += y[i] / (double)count;
    }
    for (size_t i = 0; i < count; i++) {
        xx += (x[i] - mx) * (x[i] - mx);
        yy += (y[i] - my) * (y[i] - my);
        xy += (x[i] - mx) * (y[i] - my);
    }
    return xy / sqrt(xx * yy);
}
