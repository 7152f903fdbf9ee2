#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "log/run_log.h"
#include "report/run_summary.h"
#include "support/scratch.h"
#include "units/units.h"

static char directory[SCRATCH_BYTES];
static char path[SCRATCH_WITHIN_BYTES], aside[SCRATCH_WITHIN_BYTES + 8];

static int set_up(void **state) {
    (void)state;
    if (!scratch_folder(directory)) {
        return -1;
    }
    (void)snprintf(path, sizeof path, "%s/run.csv", directory);
    (void)snprintf(aside, sizeof aside, "%s.part", path);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    (void)remove(path);
    return rmdir(directory);
}

static void write_text(const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static struct link_report sample_report(int64_t time_us, bool tip) {
    struct link_report report;
    memset(&report, 0, sizeof report);
    report.time_us = time_us;
    report.status.state = SUPERVISOR_ACTIVE;
    for (size_t c = 0; c < 3; c++) {
        report.duty[c] = 0.25f * (float)(c + 1);
        report.pressure_pa[c] = 1234.5f * (float)(c + 1);
        report.status.pressure_target_pa[c] = 1000.0f * (float)(c + 1);
        report.tip_position_m[c] = 0.0123f * (float)(c + 1);
    }
    report.supply_pa = 40000.0f;
    report.tip_new = tip;
    report.tip_quaternion[0] = 0.8f;
    report.tip_quaternion[1] = 0.6f;
    report.tip_quality = 97;
    return report;
}

static double field(const struct run_log *log, size_t row, const char *name) {
    const int column = run_log_column(log, name);
    assert_true(column >= 0);
    return log->value[row * log->columns + (size_t)column];
}

static void what_is_written_is_read_back(void **state) {
    (void)state;
    struct run_log_writer writer;
    struct run_log log;
    char error[256];
    const struct run_log_metadata metadata = {
        .module = "paper-semicircle", .table_hash = 7, .rate_hz = 1000.0, .note = "test"};
    const struct controller_command bend = {.kind = COMMAND_BEND, .bend_rad = 1.25f, .direction_rad = -0.5f};
    const struct controller_command vent = {.kind = COMMAND_VENT};
    assert_true(run_log_create(&writer, path, &metadata, error, sizeof error));
    const struct link_report with_tip = sample_report(1000, true), without = sample_report(2000, false);
    run_log_append(&writer, &with_tip, &bend);
    run_log_append(&writer, &without, &vent);
    assert_int_not_equal(access(path, F_OK), 0); /* only beside its place until it is whole */
    assert_true(run_log_finish(&writer, error, sizeof error));
    assert_int_equal(access(path, F_OK), 0);
    assert_int_not_equal(access(aside, F_OK), 0);
    assert_true(run_log_read(path, &log, error, sizeof error));
    assert_int_equal(log.rows, 2);
    assert_string_equal(log.module, "paper-semicircle");
    assert_close(field(&log, 0, "time_s"), 0.001, 1e-12);
    assert_close(field(&log, 0, "valve3"), 0.75, 1e-6);
    assert_close(field(&log, 1, "p2_pa"), 2469.0, 1e-3);
    assert_close(field(&log, 1, "p3_cmd_pa"), 3000.0, 1e-3);
    assert_close(field(&log, 0, "tip_z_m"), 0.0369, 1e-7);
    assert_close(field(&log, 0, "tip_qx"), 0.6, 1e-7);
    assert_close(field(&log, 0, "bend_cmd_rad"), 1.25, 1e-7);
    assert_close(field(&log, 0, "state"), (double)SUPERVISOR_ACTIVE, 0.0);
    assert_true(isnan(field(&log, 1, "tip_z_m")));
    assert_true(isnan(field(&log, 1, "bend_cmd_rad")));
    run_log_free(&log);
}

static void a_discarded_log_leaves_nothing_and_keeps_the_old(void **state) {
    (void)state;
    struct run_log_writer writer;
    char error[256];
    const struct run_log_metadata metadata = {.module = "m", .rate_hz = 1000.0, .note = ""};
    write_text("old");
    assert_true(run_log_create(&writer, path, &metadata, error, sizeof error));
    run_log_discard(&writer);
    assert_int_not_equal(access(aside, F_OK), 0);
    assert_int_equal(access(path, F_OK), 0);
    assert_false(run_log_create(&writer, "/nowhere/at/all.csv", &metadata, error, sizeof error));
    assert_non_null(strstr(error, "/nowhere/at/all.csv"));
}

static void unknown_columns_and_missing_ones_are_fine(void **state) {
    (void)state;
    struct run_log log;
    char error[256];
    write_text("# tribend-run 1\n# module: m\n# colour: blue\ntime_s,p1_pa,temperature_k\n0,1,2\n0.1,,4\r\n");
    assert_true(run_log_read(path, &log, error, sizeof error));
    assert_int_equal(log.rows, 2);
    assert_true(isnan(field(&log, 1, "p1_pa")));
    assert_close(field(&log, 1, "temperature_k"), 4.0, 0.0);
    assert_int_equal(run_log_column(&log, "p2_pa"), -1);
    run_log_free(&log);
}

static void each_malformed_log_names_its_line(void **state) {
    (void)state;
    const struct {
        const char *text;
        const char *names;
    } bad[] = {{"", ":"},
               {"time_s,p1_pa\n0,1\n", ":1:"},
               {"# tribend-run 2\ntime_s\n0\n", ":1:"},
               {"# tribend-run 1\n# module: m\n", ":"},
               {"# tribend-run 1\np1_pa,p2_pa\n0,1\n", "time_s"},
               {"# tribend-run 1\ntime_s,p1_pa,p1_pa\n0,1,2\n", ":2:"},
               {"# tribend-run 1\ntime_s,p1_pa\n0,1\n0.1\n", ":4:"},
               {"# tribend-run 1\ntime_s,p1_pa\n0,1\n0.1,2,3\n", ":4:"},
               {"# tribend-run 1\ntime_s,p1_pa\n0,1\n0.1,one\n", ":4:"},
               {"# tribend-run 1\ntime_s,p1_pa\n0,inf\n", ":3:"},
               {"# tribend-run 1\ntime_s,p1_pa\n0,1\n-1,1\n", ":4:"},
               {"# tribend-run 1\ntime_s,p1_pa\n", ":"},
               {"# tribend-run 1\ntime_s,state\n0,DANCING\n", ":3:"}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct run_log log;
        char error[512] = "";
        write_text(bad[i].text);
        if (run_log_read(path, &log, error, sizeof error)) {
            fail_msg("case %d was accepted", (int)i);
        }
        if (strstr(error, path) == NULL || strstr(error, bad[i].names) == NULL) {
            fail_msg("case %d: '%s' does not name %s", (int)i, error, bad[i].names);
        }
    }
}

/* --- run summary --- */

static void a_settling_bend_is_timed(void **state) {
    (void)state;
    struct run_summary summary;
    const struct controller_command command = {.kind = COMMAND_BEND, .bend_rad = 1.0f, .direction_rad = 3.1f};
    run_summary_start(&summary, &command, 0, 3000000);
    for (int ms = 0; ms <= 3000; ms += 10) {
        struct link_report report = sample_report(1000 * ms, true);
        report.status.bend_rad = ms < 700 ? 0.5f : 1.002f;
        report.status.direction_rad = -3.183185307f; /* 3.1 rad, a turn less */
        run_summary_add(&summary, &report);
    }
    const double settling_s = run_summary_settling_s(&summary);
    assert_true(settling_s > 0.69 && settling_s < 0.95); /* the smoothing's few time constants later */
    assert_close(summary.bend_sum_rad / summary.samples, 1.002, 1e-6);
    assert_close(sqrt(summary.direction_square_rad2 / summary.samples), 0.0, 1e-6);
}

static void a_bend_that_never_arrives_has_not_settled(void **state) {
    (void)state;
    struct run_summary summary;
    const struct controller_command command = {.kind = COMMAND_BEND, .bend_rad = 1.0f};
    run_summary_start(&summary, &command, 0, 1000000);
    for (int ms = 0; ms <= 1000; ms += 10) {
        struct link_report report = sample_report(1000 * ms, true);
        report.status.bend_rad = 0.9f;
        run_summary_add(&summary, &report);
    }
    assert_true(run_summary_settling_s(&summary) < 0.0);
}

/* --- units --- */

static void quantities_carry_their_units(void **state) {
    (void)state;
    const struct {
        enum units_kind kind;
        const char *text;
        double value;
    } good[] = {{UNITS_PRESSURE, "40mbar", 4000.0},   {UNITS_PRESSURE, "0.08bar", 8000.0},
                {UNITS_PRESSURE, "8kPa", 8000.0},     {UNITS_PRESSURE, "-3Pa", -3.0},
                {UNITS_ANGLE, "180deg", M_PI},        {UNITS_ANGLE, "1e-1rad", 0.1},
                {UNITS_TIME, "250ms", 0.25},          {UNITS_TIME, "2min", 120.0},
                {UNITS_LENGTH, "12mm", 0.012},        {UNITS_LENGTH, "750um", 0.00075}};
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        double value = 0.0;
        enum units_kind kind;
        char error[256];
        assert_true(units_parse(good[i].kind, good[i].text, &value, error, sizeof error));
        assert_close(value, good[i].value, 1e-12 * fabs(good[i].value));
        assert_true(units_kind_of(good[i].text, &kind));
        assert_int_equal(kind, good[i].kind);
    }
    const char *const bad[] = {"60", "", "deg", "60 deg", "60degrees", "60mbar", "nandeg", "infdeg", "1e999deg", "6odeg"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        double value = -7.0;
        char error[256] = "";
        assert_false(units_parse(UNITS_ANGLE, bad[i], &value, error, sizeof error));
        assert_close(value, -7.0, 0.0);
        assert_non_null(strstr(error, "60deg")); /* what would have been right */
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_written_is_read_back),
        cmocka_unit_test(a_discarded_log_leaves_nothing_and_keeps_the_old),
        cmocka_unit_test(unknown_columns_and_missing_ones_are_fine),
        cmocka_unit_test(each_malformed_log_names_its_line),
        cmocka_unit_test(a_settling_bend_is_timed),
        cmocka_unit_test(a_bend_that_never_arrives_has_not_settled),
        cmocka_unit_test(quantities_carry_their_units),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
