/* Recordings that are not what they seem: chambers exchanged, frames turned, tips out of reach. Of blind cases, whatever is
 * wrong with their modules, none is taken for one. */
#include "support/test.h"

#include <glob.h>
#include <stdlib.h>
#include <unistd.h>

#include "gap/log_check.h"
#include "log/run_log.h"
#include "program/table_file.h"
#include "support/scratch.h"

#define TABLE "tables/paper-semicircle.tbt"
#define COMMAND_BYTES 512

static struct table_file table;
static struct plant_parameters nominal;
static char directory[SCRATCH_BYTES];
static char log_path[SCRATCH_WITHIN_BYTES];
static glob_t logs; /* two a case, of healthy columns */

static void generate(const char *corpus, int count) {
    char command[COMMAND_BYTES];
    const char *build = getenv("TRIBEND_BUILD");
    (void)snprintf(command, sizeof command,
                   "%s/tests/gap/blind/blind_generate --corpus %s --count %d --seed 5 --seconds 20 --table " TABLE
                   " --out %s/%s >/dev/null",
                   build != NULL ? build : "build", corpus, count, directory, corpus);
    assert_int_equal(system(command), 0); // NOLINT(cert-env33-c): a program of this build
}

static int set_up(void **state) {
    char pattern[COMMAND_BYTES];
    (void)state;
    if (table_file_open(&table, TABLE, NULL) != 0 || !scratch_folder(directory)) {
        return -1;
    }
    plant_default_parameters(&nominal);
    (void)snprintf(log_path, sizeof log_path, "%s/changed.csv", directory);
    generate("single", 10);
    generate("unknown", 6);
    (void)snprintf(pattern, sizeof pattern, "%s/*/logs/*", directory);
    return glob(pattern, 0, NULL, &logs);
}

static int tear_down(void **state) {
    char command[COMMAND_BYTES];
    (void)state;
    globfree(&logs);
    table_file_close(&table);
    (void)snprintf(command, sizeof command, "rm -r %s", directory);
    return system(command); // NOLINT(cert-env33-c): a folder of this test
}

/* True: nothing was found. */
static bool fits(const char *path, char *error, size_t error_bytes) {
    static struct gap_data data;
    const char *paths[] = {path};
    if (!gap_data_read(&data, paths, 1, error, error_bytes)) {
        fail_msg("%s", error);
    }
    const bool fit = log_check(&data, &table.table, &nominal, error, error_bytes);
    gap_data_free(&data);
    return fit;
}

static void blind_cases_fit(void **state) {
    (void)state;
    char error[1024] = "";
    assert_true(logs.gl_pathc >= 32);
    for (size_t i = 0; i < logs.gl_pathc; i++) {
        if (!fits(logs.gl_pathv[i], error, sizeof error)) {
            fail_msg("%s", error);
        }
    }
}

/* --- exchanged --- */

static double *cell(const struct run_log *log, size_t row, const char *format, size_t chamber) {
    char name[RUN_LOG_NAME_BYTES];
    (void)snprintf(name, sizeof name, format, chamber + 1); // NOLINT(clang-diagnostic-format-nonliteral)
    const int column = run_log_column(log, name);
    return column < 0 ? NULL : &log->value[row * log->columns + (size_t)column];
}

/* Column c gets what column order[c] has. */
static void reorder(struct run_log *log, const char *format, const size_t order[3]) {
    for (size_t row = 0; row < log->rows; row++) {
        double was[3];
        for (size_t c = 0; c < 3; c++) {
            const double *from = cell(log, row, format, order[c]);
            was[c] = from != NULL ? *from : NAN;
        }
        for (size_t c = 0; c < 3; c++) {
            double *to = cell(log, row, format, c);
            if (to != NULL) {
                *to = was[c];
            }
        }
    }
}

static void read_log(size_t index, struct run_log *log) {
    char error[512];
    if (!run_log_read(logs.gl_pathv[index], log, error, sizeof error)) {
        fail_msg("%s", error);
    }
}

static void write_log(const struct run_log *log) {
    char error[512];
    if (!run_log_write(log_path, log, error, sizeof error)) {
        fail_msg("%s", error);
    }
}

static void assert_says(const char *words) {
    char error[1024] = "";
    if (fits(log_path, error, sizeof error)) {
        fail_msg("nothing was found, not '%s'", words);
    }
    if (strstr(error, words) == NULL) {
        fail_msg("'%s' does not say '%s'", error, words);
    }
}

static const size_t swap[3] = {0, 2, 1}, turn[3] = {1, 2, 0};

static void exchanged_readings_are_named(void **state) {
    (void)state;
    for (size_t i = 0; i < logs.gl_pathc; i += 5) {
        struct run_log log;
        read_log(i, &log);
        reorder(&log, "p%zu_pa", swap);
        write_log(&log);
        assert_says("the log's chambers look exchanged: p2 and p3 do not follow their own valves");
        assert_says("swap columns p2_pa and p3_pa and repeat");
        reorder(&log, "p%zu_pa", swap); /* the remedy */
        reorder(&log, "p%zu_pa", turn);
        write_log(&log);
        assert_says("rename columns p1_pa to p2_pa, p2_pa to p3_pa, p3_pa to p1_pa and repeat");
        run_log_free(&log);
    }
}

static void exchanged_valves_are_named(void **state) {
    (void)state;
    struct run_log log;
    read_log(0, &log);
    reorder(&log, "valve%zu", swap);
    write_log(&log);
    assert_says("swap columns valve2 and valve3 and repeat");
    reorder(&log, "valve%zu", swap);
    reorder(&log, "valve%zu", turn);
    write_log(&log);
    assert_says("rename columns valve1 to valve2, valve2 to valve3, valve3 to valve1 and repeat");
    run_log_free(&log);
}

static void chambers_that_do_not_stand_where_the_tip_says_are_named(void **state) {
    (void)state;
    for (size_t i = 0; i < logs.gl_pathc; i += 5) {
        struct run_log log;
        read_log(i, &log);
        reorder(&log, "p%zu_pa", turn);
        reorder(&log, "valve%zu", turn);
        write_log(&log);
        assert_says("do not bend the tip to where these chambers stand");
        assert_says("or the tip's frame is turned by a third");
        assert_says("rename columns p1_pa to p2_pa, p2_pa to p3_pa, p3_pa to p1_pa and repeat");
        assert_says("that goes for the valves as well");
        for (size_t row = 0; row < log.rows; row++) { /* the tip alone tells it as well */
            for (size_t c = 0; c < 3; c++) {
                *cell(&log, row, "valve%zu", c) = NAN;
            }
        }
        write_log(&log);
        assert_says("rename columns p1_pa to p2_pa, p2_pa to p3_pa, p3_pa to p1_pa and repeat");
        run_log_free(&log);
    }
}

/* --- frames --- */

static void move_tip(struct run_log *log, double turned_rad, double scale, double up_m) {
    for (size_t row = 0; row < log->rows; row++) {
        double *at[3] = {cell(log, row, "tip_x_m", 0), cell(log, row, "tip_y_m", 0), cell(log, row, "tip_z_m", 0)};
        const double x = *at[0], y = *at[1];
        *at[0] = scale * (x * cos(turned_rad) - y * sin(turned_rad));
        *at[1] = scale * (x * sin(turned_rad) + y * cos(turned_rad));
        *at[2] = scale * *at[2] + up_m;
    }
}

static void a_turned_frame_is_named(void **state) {
    (void)state;
    struct run_log log;
    read_log(0, &log);
    move_tip(&log, 0.5 * M_PI, 1.0, 0.0);
    write_log(&log);
    char error[1024] = "";
    assert_false(fits(log_path, error, sizeof error));
    const char *turned = strstr(error, "turned by ");
    assert_non_null(turned);
    assert_close(strtod(turned + strlen("turned by "), NULL), 90.0, 5.0);
    run_log_free(&log);
}

static void a_tip_out_of_reach_is_named(void **state) {
    (void)state;
    struct run_log log;
    read_log(0, &log);
    move_tip(&log, 0.0, 3.0, 0.0);
    write_log(&log);
    assert_says("mm from the base, but module paper-semicircle is 65 mm long");
    run_log_free(&log);
    read_log(0, &log);
    move_tip(&log, 0.0, 1.0, -0.05); /* such as an origin at the tip's rest */
    write_log(&log);
    assert_says("without pressure the tip is at (");
    run_log_free(&log);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(blind_cases_fit),
                                       cmocka_unit_test(exchanged_readings_are_named),
                                       cmocka_unit_test(exchanged_valves_are_named),
                                       cmocka_unit_test(chambers_that_do_not_stand_where_the_tip_says_are_named),
                                       cmocka_unit_test(a_turned_frame_is_named),
                                       cmocka_unit_test(a_tip_out_of_reach_is_named)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
