/* The table builder: what it writes is what the solver says, symmetric, and the same bytes on any number of threads. */
#include "support/test.h"

#include <omp.h>
#include <stdlib.h>

#include "control/bend_table.h"
#include "program/table_file.h"
#include "section/section_bend.h"
#include "table/table_builder.h"

#define NODES 5
#define SIZE_M 1.5e-3

static struct module_description module;

static int read_module(void **state) {
    (void)state;
    struct description_error error;
    return module_description_read("tables/modules/paper-semicircle.yaml", NULL, &module, &error) ? 0 : -1;
}

static void build(struct table_image *image, int threads) {
    const struct table_build_options options = {.nodes = NODES, .size_m = SIZE_M};
    struct description_error error;
    omp_set_num_threads(threads);
    if (table_build(&module, &options, image, &error) != SWEEP_DONE) {
        fail_msg("%s", error.text);
    }
}

static size_t node(size_t i, size_t j, size_t k) {
    return k + NODES * (j + NODES * i);
}

static void one_thread_or_three_write_the_same_bytes(void **state) {
    (void)state;
    struct table_image one, three;
    build(&one, 1);
    build(&three, 3);
    assert_int_equal(one.size, three.size);
    assert_memory_equal(one.bytes, three.bytes, one.size);
    assert_int_equal(one.nodes, NODES * NODES * NODES);
    assert_int_equal(one.solved, NODES * (NODES + 1) * (NODES + 2) / 6);
    table_image_free(&one);
    table_image_free(&three);
}

static void the_table_says_what_the_solver_says(void **state) {
    (void)state;
    struct table_image image;
    struct bend_table table;
    struct description_error error;
    build(&image, 2);
    assert_int_equal(bend_table_open(&table, image.bytes, image.size, "paper-semicircle"), BEND_TABLE_OK);
    const struct section_mesh_options options = {.size_m = SIZE_M};
    struct section_mesh *mesh = section_mesh_create(&module, &options, &error);
    struct section_solver *solver = section_solver_create(mesh, &module, &error);
    const size_t picks[][3] = {{0, 0, 0}, {2, 1, 0}, {1, 3, 2}, {0, 2, 3}, {3, 3, 1}, {2, 0, 3}};
    for (size_t n = 0; n < sizeof picks / sizeof picks[0]; n++) {
        const size_t *p = picks[n], at = node(p[0], p[1], p[2]);
        const double pressure_pa[3] = {(double)table.axis_pa[0][p[0]], (double)table.axis_pa[1][p[1]],
                                       (double)table.axis_pa[2][p[2]]};
        struct section_state solved;
        section_solver_reset(solver);
        assert_true(section_solver_move_to(solver, pressure_pa));
        section_solver_state(solver, &solved);
        double bend_rad[2];
        section_tip_bend(&module, &solved, bend_rad);
        assert_close((double)table.channel[BEND_TABLE_CURVATURE_X][at], bend_rad[0] / module.chamber_length_m, 1e-4);
        assert_close((double)table.channel[BEND_TABLE_CURVATURE_Y][at], bend_rad[1] / module.chamber_length_m, 1e-4);
        assert_relative((double)table.channel[BEND_TABLE_STRETCH][at], solved.stretch, 1e-6);
        for (size_t c = 0; c < 3; c++) {
            assert_relative((double)table.channel[(size_t)BEND_TABLE_VOLUME_1 + c][at], solved.volume_m2[c], 1e-5);
        }
        assert_relative((double)table.channel[BEND_TABLE_STRETCH_MAX][at], solved.stretch_max, 1e-3);
        assert_int_equal((table.tag[at] & BEND_TABLE_TAG_VALID) != 0, 1);
    }
    section_solver_free(solver);
    section_mesh_free(mesh);
    table_image_free(&image);
}

static void the_reference_table_is_threefold_symmetric_and_monotonic(void **state) {
    (void)state;
    struct table_file file;
    assert_int_equal(table_file_open(&file, "tables/paper-semicircle.tbt", "paper-semicircle"), 0);
    const struct bend_table *table = &file.table;
    const size_t n = table->nodes[0];
    const double c = cos(2.0 * M_PI / 3.0), s = sin(2.0 * M_PI / 3.0);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            for (size_t k = 0; k < n; k++) {
                const size_t at = k + n * (j + n * i), turned = j + n * (i + n * k); /* pressures (k, i, j) */
                const double x = (double)table->channel[BEND_TABLE_CURVATURE_X][at];
                const double y = (double)table->channel[BEND_TABLE_CURVATURE_Y][at];
                const double size = 1e-5 + 1e-6 * hypot(x, y);
                assert_close((double)table->channel[BEND_TABLE_CURVATURE_X][turned], c * x - s * y, size);
                assert_close((double)table->channel[BEND_TABLE_CURVATURE_Y][turned], s * x + c * y, size);
                assert_close((double)table->channel[BEND_TABLE_VOLUME_2][turned],
                             (double)table->channel[BEND_TABLE_VOLUME_1][at], 1e-12);
            }
        }
    }
    for (size_t i = 1; i < n; i++) { /* chamber 1 alone bends further with every node */
        const size_t at = n * n * i, before = n * n * (i - 1);
        assert_true(table->channel[BEND_TABLE_CURVATURE_X][at] < table->channel[BEND_TABLE_CURVATURE_X][before]);
        assert_true(table->channel[BEND_TABLE_VOLUME_1][at] > table->channel[BEND_TABLE_VOLUME_1][before]);
    }
    table_file_close(&file);
}

enum { POINTS = 500 };

struct point {
    double pressure_pa[3];
    double *unknowns; /* its equilibrium, for its neighbours to start from */
};

/* Start from the solved point nearest in pressure, or from rest. */
static void start_near(struct section_solver *solver, const struct point *points, size_t solved, const double pressure_pa[3]) {
    double least = pressure_pa[0] * pressure_pa[0] + pressure_pa[1] * pressure_pa[1] + pressure_pa[2] * pressure_pa[2];
    const struct point *nearest = NULL;
    for (size_t i = 0; i < solved; i++) {
        double square = 0.0;
        for (size_t c = 0; c < 3; c++) {
            square += pow(points[i].pressure_pa[c] - pressure_pa[c], 2.0);
        }
        if (square < least) {
            least = square;
            nearest = &points[i];
        }
    }
    section_solver_reset(solver);
    if (nearest != NULL) {
        section_solver_restore(solver, nearest->unknowns);
    }
}

/* What the table says between its nodes, against the solver at random pressures over the whole working range. */
static void the_reference_table_is_right_between_its_nodes(void **state) {
    (void)state;
    struct table_file file;
    struct description_error error;
    assert_int_equal(table_file_open(&file, "tables/paper-semicircle.tbt", "paper-semicircle"), 0);
    struct section_mesh *mesh = section_mesh_create(&module, NULL, &error);
    struct section_solver *solver = section_solver_create(mesh, &module, &error);
    struct point *points = calloc(POINTS, sizeof *points);
    assert_true(solver != NULL && points != NULL);
    double worst_bend_deg = 0.0, worst_direction_deg = 0.0, worst_volume = 0.0, most_bend_deg = 0.0;
    uint32_t random = 1;
    for (size_t i = 0; i < POINTS; i++) {
        float pressure_pa[3];
        for (size_t c = 0; c < 3; c++) {
            random = random * 1664525u + 1013904223u;
            pressure_pa[c] = (float)(module.working_pressure_pa * (double)(random >> 8) / 16777216.0);
            points[i].pressure_pa[c] = (double)pressure_pa[c];
        }
        struct bend_table_stencil stencil;
        struct section_state solved;
        double bend_rad[2];
        start_near(solver, points, i, points[i].pressure_pa);
        assert_true(section_solver_move_to(solver, points[i].pressure_pa));
        points[i].unknowns = malloc(section_solver_unknowns(solver) * sizeof(double));
        assert_non_null(points[i].unknowns);
        section_solver_save(solver, points[i].unknowns);
        section_solver_state(solver, &solved);
        section_tip_bend(&module, &solved, bend_rad);
        bend_table_locate(&file.table, pressure_pa, &stencil);
        const double length_m = (double)file.table.module.active_length_m;
        const double x = length_m * (double)bend_table_value(&file.table, &stencil, BEND_TABLE_CURVATURE_X);
        const double y = length_m * (double)bend_table_value(&file.table, &stencil, BEND_TABLE_CURVATURE_Y);
        const double bend_deg = hypot(bend_rad[0], bend_rad[1]) * 180.0 / M_PI;
        worst_bend_deg = fmax(worst_bend_deg, fabs(hypot(x, y) * 180.0 / M_PI - bend_deg));
        most_bend_deg = fmax(most_bend_deg, bend_deg);
        if (bend_deg > 1.0) {
            const double turn = remainder(atan2(y, x) - atan2(bend_rad[1], bend_rad[0]), 2.0 * M_PI);
            worst_direction_deg = fmax(worst_direction_deg, fabs(turn) * 180.0 / M_PI);
        }
        for (size_t c = 0; c < 3; c++) {
            const double volume = (double)bend_table_value(&file.table, &stencil, (enum bend_table_channel)(BEND_TABLE_VOLUME_1 + c));
            worst_volume = fmax(worst_volume, fabs(volume / solved.volume_m2[c] - 1.0));
        }
    }
    print_message("           worst of %d random pressures (bends up to %.0f deg): bend %.3f deg, direction %.3f deg, "
                  "volume %.3f %%\n",
                  POINTS, most_bend_deg, worst_bend_deg, worst_direction_deg, 100.0 * worst_volume);
    assert_under(worst_bend_deg, 0.5);
    assert_under(worst_direction_deg, 1.0);
    assert_under(worst_volume, 0.01);
    for (size_t i = 0; i < POINTS; i++) {
        free(points[i].unknowns);
    }
    free(points);
    section_solver_free(solver);
    section_mesh_free(mesh);
    table_file_close(&file);
}

/* The committed table was built from the committed module and material. */
static void the_reference_table_belongs_to_its_module(void **state) {
    (void)state;
    struct table_file file;
    struct description_error error;
    struct module_description read;
    assert_int_equal(table_file_open(&file, "tables/paper-semicircle.tbt", NULL), 0);
    assert_true(module_description_read("tables/modules/paper-semicircle.yaml", NULL, &read, &error));
    assert_relative((double)file.table.module.outer_diameter_m, read.outer_diameter_m, 1e-6);
    assert_relative((double)file.table.module.working_pressure_pa, read.working_pressure_pa, 1e-6);
    assert_relative((double)file.table.module.chamber_length_m, read.chamber_length_m, 1e-6);
    assert_string_equal(file.table.module.name, read.name);
    assert_true(file.table.module.inputs_hash == module_description_hash(&read));
    table_file_close(&file);
}

static int progress_calls;

static void stop_at_fifth(void *context, size_t done, size_t total) {
    assert_true(done <= total);
    if (++progress_calls == 5) {
        *(volatile sig_atomic_t *)context = 1;
    }
}

static void a_build_can_be_stopped(void **state) {
    (void)state;
    volatile sig_atomic_t stop = 0;
    struct table_image image;
    struct description_error error;
    const struct table_build_options options = {
        .nodes = NODES, .size_m = SIZE_M, .progress = stop_at_fifth, .context = (void *)&stop, .stop = &stop};
    omp_set_num_threads(1);
    assert_int_equal(table_build(&module, &options, &image, &error), SWEEP_STOPPED);
    assert_non_null(strstr(error.text, "interrupted"));
    assert_in_range(progress_calls, 5, 7);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_thread_or_three_write_the_same_bytes),
        cmocka_unit_test(the_table_says_what_the_solver_says),
        cmocka_unit_test(the_reference_table_is_threefold_symmetric_and_monotonic),
        cmocka_unit_test(the_reference_table_is_right_between_its_nodes),
        cmocka_unit_test(the_reference_table_belongs_to_its_module),
        cmocka_unit_test(a_build_can_be_stopped),
    };
    return cmocka_run_group_tests(tests, read_module, NULL);
}
