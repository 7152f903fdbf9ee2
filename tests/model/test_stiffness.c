/* Plateaus of a run, and the stiffness that is fitted to them. */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "calibration/stiffness_fit.h"
#include "section/section_solver.h"
#include "support/scratch.h"

static char path[SCRATCH_BYTES];
static const struct plateau_options how = {.jump_pa = 3000.0, .rows_least = 20, .loaded_pa = 5000.0};

static int make_file(void **state) {
    (void)state;
    const int file = scratch_file(path);
    return file >= 0 && close(file) == 0 ? 0 : -1;
}

static int remove_file(void **state) {
    (void)state;
    return remove(path);
}

static void write_rows(FILE *stream, double time_s, int rows, const double pressure_pa[3], double bend_rad, double sign) {
    for (int i = 0; i < rows; i++) { /* a turn about y by the bend; either sign of the quaternion is the same pose */
        const double flip = i % 3 == 0 ? sign : 1.0;
        assert_true(fprintf(stream, "%.2f,%.3f,%.3f,%.3f,%.9f,0,%.9f,0\n", time_s + 0.05 * i,
                            pressure_pa[0] + (i % 2) * 100.0, pressure_pa[1], pressure_pa[2], flip * cos(0.5 * bend_rad),
                            flip * sin(0.5 * bend_rad)) > 0);
    }
}

/* A run of a module whose rubber is 1.3 times as stiff as its file says. */
static void the_stiffness_that_made_a_run_is_found(void **state) {
    (void)state;
    enum { LOADS = 7 };
    static const double loads_pa[LOADS] = {30e3, 50e3, 65e3, 80e3, 95e3, 40e3, 75e3};
    struct module_description module, stiffer;
    struct description_error error;
    assert_true(module_description_read("tables/modules/stiff-flop.yaml", NULL, &module, &error));
    stiffer = module;
    stiffer.material.coefficient_pa[0] *= 1.3;
    struct section_mesh *mesh = section_mesh_create(&stiffer, NULL, &error);
    struct section_solver *solver = section_solver_create(mesh, &stiffer, &error);
    assert_non_null(solver);
    FILE *stream = fopen(path, "w");
    assert_non_null(stream);
    assert_true(fputs("# tribend-run 1\ntime_s,p1_pa,p2_pa,p3_pa,tip_qw,tip_qx,tip_qy,tip_qz\n", stream) >= 0);
    const double rest_pa[3] = {50.0, 50.0, 50.0};
    write_rows(stream, 0.0, 40, rest_pa, 0.0, -1.0);
    for (int k = 0; k < LOADS; k++) {
        const double only_pa[3] = {loads_pa[k], 0.0, 0.0}, read_pa[3] = {loads_pa[k] + 50.0, 50.0, 50.0};
        struct section_state there;
        section_solver_reset(solver);
        assert_true(section_solver_move_to(solver, only_pa));
        section_solver_state(solver, &there);
        const double bend_rad = hypot(there.curvature_x_1pm, there.curvature_y_1pm) * stiffer.chamber_length_m;
        write_rows(stream, 10.0 * (k + 1), 50, read_pa, bend_rad, -1.0);
        write_rows(stream, 10.0 * (k + 1) + 5.0, 5, rest_pa, 0.0, 1.0); /* too short to count */
    }
    assert_int_equal(fclose(stream), 0);
    section_solver_free(solver);
    section_mesh_free(mesh);

    static struct plateau plateaus[PLATEAUS_MAX];
    static struct stiffness_fit fit;
    char message[256] = "";
    assert_int_equal(plateaus_read(path, &how, plateaus, message, sizeof message), LOADS);
    assert_close(plateaus[0].pressure_pa[0], 30e3, 100.0);
    assert_int_equal(plateaus[0].first_row, 40);
    assert_int_equal(plateaus[0].rows, 50);
    assert_true(stiffness_fit(&module, plateaus, LOADS, &fit, &error));
    print_message("           stiffness x %.4f, held out %.3f deg, line %.3f deg\n", fit.factor,
                  fit.rms_held_out_rad * 180.0 / M_PI, fit.rms_line_rad * 180.0 / M_PI);
    assert_relative(fit.factor, 1.3, 1e-2); /* the fibres, which do stretch a little, stay as they are */
    assert_int_equal(fit.fitted, 4);
    assert_int_equal(fit.held_out, 3);
    assert_under(fit.rms_held_out_rad, 0.2 * M_PI / 180.0);
    assert_true(fit.rms_line_rad > 5.0 * fit.rms_held_out_rad);
    assert_true(fit.rms_proportion_rad > fit.rms_line_rad);
}

static void runs_of_no_use_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *text;
        const char *words;
    } cases[] = {{"time_s,p1_pa,p2_pa\n0,1,2\n", "p3_pa"},
                 {"p1_pa,p2_pa,p3_pa,tip_qw,tip_qx,tip_qy,tip_qz\n0,0,0,1,0,0,zero\n", ":2: column 7"},
                 {"p1_pa,p2_pa,p3_pa,tip_qw,tip_qx,tip_qy,tip_qz\n0,0,0,1,0,0\n", ":2: column 7"},
                 {"p1_pa,p2_pa,p3_pa,tip_qw,tip_qx,tip_qy,tip_qz\n0,0,0,1,0,0,0\n", "no plateau"},
                 {"", "no plateau"}};
    static struct plateau plateaus[PLATEAUS_MAX];
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char message[256] = "";
        FILE *stream = fopen(path, "w");
        assert_non_null(stream);
        assert_true(fputs(cases[i].text, stream) >= 0);
        assert_int_equal(fclose(stream), 0);
        assert_int_equal(plateaus_read(path, &how, plateaus, message, sizeof message), 0);
        if (strstr(message, cases[i].words) == NULL) {
            fail_msg("'%s' does not say '%s'", message, cases[i].words);
        }
    }
}

static void plateaus_must_load_one_chamber_and_be_enough(void **state) {
    (void)state;
    struct module_description module;
    struct description_error error;
    static struct stiffness_fit fit;
    struct plateau plateaus[4] = {{{3e4, 0, 0}, 0.3, 0, 50}, {{4e4, 3e4, 0}, 0.3, 50, 50}, {{5e4, 0, 0}, 0.5, 100, 50},
                                  {{6e4, 0, 0}, 0.6, 150, 50}};
    assert_true(module_description_read("tables/modules/stiff-flop.yaml", NULL, &module, &error));
    assert_false(stiffness_fit(&module, plateaus, 4, &fit, &error));
    assert_non_null(strstr(error.text, "row 50"));
    assert_false(stiffness_fit(&module, plateaus, 3, &fit, &error));
    assert_non_null(strstr(error.text, "too few"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_stiffness_that_made_a_run_is_found),
        cmocka_unit_test(runs_of_no_use_are_refused),
        cmocka_unit_test(plateaus_must_load_one_chamber_and_be_enough),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
