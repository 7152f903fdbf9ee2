/* Logs of other programs as run logs: mappings, LCM event logs, candump; and what a run log itself refuses.
 */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "log/can_layout.h"
#include "log/candump.h"
#include "log/lcm_log.h"
#include "log/lcm_type.h"
#include "log/mapping_import.h"
#include "log/rotation.h"
#include "log/run_columns.h"
#include "log/run_log.h"
#include "support/scratch.h"

#define DEGREES (180.0 / M_PI)
#define ERROR_BYTES 1024

static char directory[SCRATCH_BYTES];
static char source_path[SCRATCH_WITHIN_BYTES], mapping_path[SCRATCH_WITHIN_BYTES], run_path[SCRATCH_WITHIN_BYTES];

static int set_up(void **state) {
    (void)state;
    if (!scratch_folder(directory)) {
        return -1;
    }
    (void)snprintf(source_path, sizeof source_path, "%s/source", directory);
    (void)snprintf(mapping_path, sizeof mapping_path, "%s/mapping.yaml", directory);
    (void)snprintf(run_path, sizeof run_path, "%s/run.csv", directory);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    (void)remove(source_path);
    (void)remove(mapping_path);
    (void)remove(run_path);
    return rmdir(directory);
}

static void write_bytes(const char *path, const void *bytes, size_t count) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    assert_int_equal(fclose(file), 0);
}

static void write_text(const char *path, const char *text) {
    write_bytes(path, text, strlen(text));
}

static double field(const struct run_log *log, size_t row, const char *name) {
    const int column = run_log_column(log, name);
    if (column < 0) {
        fail_msg("there is no column %s", name);
    }
    return log->value[row * log->columns + (size_t)column];
}

static void assert_names(const char *error, const char *words) {
    if (strstr(error, words) == NULL) {
        fail_msg("'%s' does not say '%s'", error, words);
    }
}

/* --- run logs --- */

static void metadata_lines_are_kept(void **state) {
    (void)state;
    struct run_log log;
    char error[ERROR_BYTES];
    write_text(
        run_path,
        "# tribend-run 1\n# module: m\n# note: two words: and more\n# a remark\n# empty:\ntime_s\n0\n1\n");
    assert_true(run_log_read(run_path, &log, error, sizeof error));
    assert_string_equal(log.module, "m");
    assert_string_equal(run_log_metadata(&log, "module"), "m");
    assert_string_equal(run_log_metadata(&log, "note"), "two words: and more");
    assert_string_equal(run_log_metadata(&log, "empty"), "");
    assert_null(run_log_metadata(&log, "colour"));
    assert_int_equal(log.metadata_count, 3);
    assert_true(run_log_set_metadata(&log, "module", "other"));
    assert_string_equal(log.module, "other");
    assert_int_equal(log.metadata_count, 3);
    run_log_free(&log);
}

static void unknown_columns_are_kept_and_reported(void **state) {
    (void)state;
    struct run_log log;
    char error[ERROR_BYTES], names[64], short_of_room[4];
    write_text(run_path, "# tribend-run 1\ntime_s,colour,sim_tip_x_m,sim_p2_pa,mood\n0,1,2,3,4\n1,5,6,7,8\n");
    assert_true(run_log_read(run_path, &log, error, sizeof error));
    assert_int_equal(run_log_unknown_columns(&log, names, sizeof names), 2);
    assert_string_equal(names, "colour, mood");
    assert_int_equal(run_log_unknown_columns(&log, short_of_room, sizeof short_of_room), 2);
    assert_close(field(&log, 1, "mood"), 8.0, 0.0);
    run_log_free(&log);
}

static void each_bad_run_log_names_line_and_column(void **state) {
    (void)state;
    const struct {
        const char *rows;
        const char *line;
        const char *words;
    } bad[] = {
        {"time_s,p1_pa\n0,1\n1,nan\n", ":4:", "column p1_pa"},
        {"time_s,p1_pa\n0,1\n1,inf\n", ":4:", "no finite number"},
        {"time_s,p1_pa\n0,1\n1,-1e999\n", ":4:", "column p1_pa"},
        {"time_s,p1_pa\n0,1\n1,two\n", ":4:", "'two'"},
        {"time_s,p1_pa\n0,1\n0.5,1\n0.4,1\n", ":5:", "column time_s: time runs backwards from 0.5 to 0.4"},
        {"time_s,p1_pa\n0,1\n,1\n", ":4:", "column time_s"},
        {"time_s,p1_pa,p2_pa,p3_pa\n0,1,2,3\n1,1\n", ":4:", "column p2_pa is missing"},
        {"time_s,p1_pa\n0,1\n1,2,3\n", ":4:", "after column p1_pa"},
        {"time_s,p1_pa\n0,1\n", ":3:", "one row only"},
        {"time_s,p1_pa\n", ":2:", "no rows"},
        {"\n0,1\n", ":2:", "header is empty"},
        {"time_s,,p1_pa\n0,1,2\n", ":2:", "column 2"},
        {"time_s,p1_pa,p1_pa\n0,1,2\n", ":2:", "p1_pa appears twice"},
        {"time_s,state\n0,SAFE\n1,DANCING\n", ":4:", "'DANCING'"}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct run_log log;
        char error[ERROR_BYTES] = "", text[256];
        (void)snprintf(text, sizeof text, "# tribend-run 1\n%s", bad[i].rows);
        write_text(run_path, text);
        if (run_log_read(run_path, &log, error, sizeof error)) {
            fail_msg("case %d was accepted", (int)i);
        }
        assert_names(error, run_path);
        assert_names(error, bad[i].line);
        assert_names(error, bad[i].words);
    }
}

static void any_columns_are_written_and_read_back(void **state) {
    (void)state;
    const char *const names[] = {"time_s", "sim_tip_z_m", "state"};
    const double value[] = {0.0, 0.0651234567, SUPERVISOR_HOLD, 0.5, NAN, NAN};
    const struct run_log_pair pairs[] = {{"module", "m"}, {"note", "one\nline"}};
    struct run_log log;
    char error[ERROR_BYTES];
    assert_true(run_log_write_columns(run_path, names, value, 2, 3, pairs, 2, error, sizeof error));
    assert_true(run_log_read(run_path, &log, error, sizeof error));
    assert_string_equal(run_log_metadata(&log, "note"), "one line");
    assert_close(field(&log, 0, "sim_tip_z_m"), value[1], 1e-10);
    assert_close(field(&log, 0, "state"), SUPERVISOR_HOLD, 0.0);
    assert_true(isnan(field(&log, 1, "sim_tip_z_m")) && isnan(field(&log, 1, "state")));
    assert_true(run_log_write(run_path, &log, error, sizeof error));
    run_log_free(&log);
    assert_false(
        run_log_write_columns("/nowhere/at/all.csv", names, value, 2, 3, pairs, 2, error, sizeof error));
    assert_names(error, "/nowhere/at/all.csv");
}

/* --- mappings --- */

static bool import_with(const char *mapping_text, const char *source_text,
                        const struct mapping_setting *settings, size_t count, struct run_log *log,
                        char error[ERROR_BYTES]) {
    struct description_error why;
    write_text(mapping_path, mapping_text);
    write_text(source_path, source_text);
    struct mapping *mapping = mapping_read(mapping_path, &why);
    if (mapping == NULL) {
        (void)snprintf(error, ERROR_BYTES, "%s", why.text);
        return false;
    }
    const bool sound = mapping_import(mapping, source_path, settings, count, log, error, ERROR_BYTES);
    mapping_free(mapping);
    return sound;
}

static void import_good(const char *mapping_text, const char *source_text, struct run_log *log) {
    char error[ERROR_BYTES];
    if (!import_with(mapping_text, source_text, NULL, 0, log, error)) {
        fail_msg("%s", error);
    }
}

static void units_signs_offsets_and_scales_become_si(void **state) {
    (void)state;
    struct run_log log;
    import_good(
        "name: m\nsource: s\nmodule: paper-semicircle\ndelimiter: ';'\nheader_lines: 2\ncomment: '%'\n"
        "columns:\n"
        "  - {to: time_s, column: t, unit: ms}\n"
        "  - {to: p1_pa, column: p, unit: bar, offset: 1.0}\n"
        "  - {to: p2_pa, column: p, unit: mbar, scale: 1000, sign: -1, offset: 2.0}\n"
        "  - {to: p3_pa, column: 4, unit: psi}\n"
        "  - {to: temperature_k, column: T, unit: degC}\n"
        "  - {to: valve1, column: duty, unit: '%'}\n"
        "  - {to: bend_cmd_rad, column: b, unit: deg}\n",
        "some program\n\"t\"; p ;T;q;duty;b;text\n% remark\n1000;1.5;20;1;50;180;x\n\n1500;;21;1;25;90;y\n",
        &log);
    assert_int_equal(log.rows, 2);
    assert_string_equal(log.module, "paper-semicircle");
    assert_close(field(&log, 0, "time_s"), 0.0, 0.0);
    assert_close(field(&log, 1, "time_s"), 0.5, 1e-12);
    assert_names(run_log_metadata(&log, "time_zero"), "1.000000 s");
    assert_close(field(&log, 0, "p1_pa"), 50000.0, 1e-9);
    assert_close(field(&log, 0, "p2_pa"), 50000.0, 1e-9); /* -1000 (1.5 - 2.0) mbar */
    assert_close(field(&log, 0, "p3_pa"), 6894.757, 1e-3);
    assert_close(field(&log, 0, "temperature_k"), 293.15, 1e-9);
    assert_close(field(&log, 0, "valve1"), 0.5, 1e-12);
    assert_close(field(&log, 1, "bend_cmd_rad"), M_PI / 2.0, 1e-12);
    assert_true(isnan(field(&log, 1, "p1_pa")));
    run_log_free(&log);
}

static void a_file_without_header_is_read_by_number(void **state) {
    (void)state;
    struct run_log log;
    import_good("name: m\nsource: s\ndelimiter: space\nheader_lines: 0\ncolumns:\n"
                "  - {to: time_s, column: 1, unit: s}\n  - {to: p1_pa, column: 3, unit: kPa}\n",
                "  0   7\t 1\n 0.1 8   2 \n", &log);
    assert_close(field(&log, 1, "p1_pa"), 2000.0, 1e-9);
    run_log_free(&log);
}

static void the_mean_at_rest_is_taken_off(void **state) {
    (void)state;
    struct run_log log;
    import_good("name: m\nsource: s\nrest: {from_s: 0.1, until_s: 0.3}\ncolumns:\n"
                "  - {to: time_s, column: t, unit: s}\n"
                "  - {to: p1_pa, column: p, unit: Pa, subtract_rest: true}\n",
                "t,p\n0,900\n0.1,1000\n0.2,1002\n0.3,5000\n", &log);
    assert_close(field(&log, 3, "p1_pa"), 5000.0 - 1001.0, 1e-9);
    assert_names(run_log_metadata(&log, "rest_p1_pa"), "1001 taken off, the mean of 2 rows");
    run_log_free(&log);
}

/* A pose sample of a sensor beside the axis, in a tracker's frame: what a mapping must undo. */
static void tracker_row(char *text, size_t bytes, double time_s, const double tip_m[3],
                        const double tip_turn[4], const double mount[4], const double arm_m[3],
                        const double base_m[3], const double to_base[4]) {
    double back[4], at_m[3], arm[3], turn[4];
    rotation_inverse(to_base, back);
    rotation_apply(tip_turn, arm_m, arm);
    for (size_t k = 0; k < 3; k++) {
        at_m[k] = tip_m[k] + arm[k];
    }
    rotation_apply(back, at_m, at_m);
    rotation_multiply(back, tip_turn, turn);
    rotation_multiply(turn, mount, turn);
    (void)snprintf(text, bytes, "%g,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n", time_s,
                   1e3 * (at_m[0] + base_m[0]), 1e3 * (at_m[1] + base_m[1]), 1e3 * (at_m[2] + base_m[2]),
                   turn[1], turn[2], turn[3], turn[0], 1e3 * base_m[0], 1e3 * base_m[1], 1e3 * base_m[2]);
}

static void a_sensor_beside_the_axis_gives_the_pose_of_the_tip(void **state) {
    (void)state;
    const double tips_m[3][3] = {{0.0, 0.0, 0.065}, {0.0, 0.0, 0.065}, {-0.030, 0.010, 0.050}};
    const double half = 0.5 * 1.2; /* a bend of 1.2 rad about an axis in the x-y plane */
    const double turns[3][4] = {{1.0, 0.0, 0.0, 0.0},
                                {1.0, 0.0, 0.0, 0.0},
                                {cos(half), -0.3 * sin(half), -sqrt(1.0 - 0.09) * sin(half), 0.0}};
    const double mount[4] = {0.5, 0.5, -0.5, 0.5}, arm_m[3] = {0.002, -0.015, 0.006};
    const double bases_m[3][3] = {{0.1, 0.2, 0.3}, {0.1, 0.2, 0.3}, {0.101, 0.198, 0.302}};
    const double axes[3][3] = {{0.0, 1.0, 0.0}, {-1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}}; /* x: +y, y: -x, z: +z */
    double to_base[4];
    char text[1024] = "t,x,y,z,qx,qy,qz,qw,bx,by,bz\n";
    struct run_log log;
    rotation_from_rows(axes, to_base);
    for (size_t i = 0; i < 3; i++) {
        const size_t used = strlen(text);
        tracker_row(text + used, sizeof text - used, 0.1 * (double)i, tips_m[i], turns[i], mount, arm_m,
                    bases_m[i], to_base);
    }
    import_good(
        "name: m\nsource: s\nrest: {until_s: 0.15}\ncolumns:\n  - {to: time_s, column: t, unit: s}\n"
        "tip:\n  unit: mm\n  position: [x, y, z]\n  quaternion: [qx, qy, qz, qw]\n  quaternion_order: xyzw\n"
        "  lever_arm_m: [0.002, -0.015, 0.006]\n"
        "frame:\n  subtract_base:\n    - {x: bx, y: by, z: bz}\n  axes: {x: +y, y: -x, z: +z}\n"
        "  rest_is_straight: true\n  rest_tip_m: [0, 0, 0.065]\n",
        text, &log);
    const char *const position[] = {"tip_x_m", "tip_y_m", "tip_z_m"};
    const char *const rotation[] = {"tip_qw", "tip_qx", "tip_qy", "tip_qz"};
    for (size_t row = 0; row < 3; row++) {
        for (size_t k = 0; k < 3; k++) {
            assert_close(field(&log, row, position[k]), tips_m[row][k], 1e-8);
        }
        for (size_t k = 0; k < 4; k++) {
            assert_close(field(&log, row, rotation[k]), turns[row][k], 1e-8);
        }
    }
    run_log_free(&log);
}

static void markers_give_position_and_orientation(void **state) {
    (void)state;
    const double corners[4][3] = {{0.02, 0.0, 0.0}, {-0.01, 0.02, 0.0}, {-0.01, -0.02, 0.0}, {0.0, 0.0, 0.0}};
    const double turn[4] = {cos(0.3), 0.0, sin(0.3), 0.0}, moved_m[3] = {0.03, 0.01, -0.004};
    char text[2048] = "t,ax,ay,az,bx,by,bz,cx,cy,cz,dx,dy,dz\n";
    struct run_log log;
    for (int row = 0; row < 3; row++) {
        size_t used = strlen(text);
        used += (size_t)snprintf(text + used, sizeof text - used, "%g", 0.1 * row);
        for (size_t m = 0; m < 4; m++) {
            double at_m[3] = {corners[m][0], corners[m][1], corners[m][2]};
            if (row == 2) {
                rotation_apply(turn, at_m, at_m);
            }
            for (size_t k = 0; k < 3; k++) {
                used += (size_t)snprintf(text + used, sizeof text - used, ",%.9f",
                                         at_m[k] + (row == 2 ? moved_m[k] : 0.0));
            }
        }
        (void)snprintf(text + used, sizeof text - used, "\n");
    }
    (void)strcat(text, "0.3,,,,1,1,1,1,1,1,1,1,1\n"); /* a marker is hidden */
    import_good(
        "name: m\nsource: s\nrest: {until_s: 0.15}\ncolumns:\n  - {to: time_s, column: t, unit: s}\n"
        "tip:\n  unit: m\n  tip_from_markers:\n    - {x: ax, y: ay, z: az}\n    - {x: bx, y: by, z: bz}\n"
        "    - {x: cx, y: cy, z: cz}\n    - {x: dx, y: dy, z: dz}\n",
        text, &log);
    assert_close(field(&log, 0, "tip_qw"), 1.0, 1e-12);
    assert_close(field(&log, 2, "tip_x_m") - field(&log, 0, "tip_x_m"), moved_m[0], 1e-8);
    assert_close(field(&log, 2, "tip_z_m") - field(&log, 0, "tip_z_m"), moved_m[2], 1e-8);
    assert_close(field(&log, 2, "tip_qw"), turn[0], 1e-7);
    assert_close(field(&log, 2, "tip_qy"), turn[2], 1e-7);
    assert_true(isnan(field(&log, 3, "tip_x_m")) && isnan(field(&log, 3, "tip_qw")));
    run_log_free(&log);
}

#define STEPPED_MAPPING                                                                                      \
    "name: m\nsource: s\nrest: {until_s: 0.25}\ncolumns:\n  - {to: time_s, column: t, unit: s}\n"            \
    "constants:\n  - {to: p1_cmd_pa, while_moved_m: 0.0005}\n  - {to: p2_cmd_pa, unit: mbar, value: 3}\n"    \
    "  - to: p3_cmd_pa\n    unit: mbar\n    steps: [[0, 0], [0.4, 10], [0.6, 20]]\n"                         \
    "tip: {unit: mm, position: [x, y, z]}\ngaps: {cut_after_s: 0.5}\n"
#define STEPPED_SOURCE                                                                                       \
    "t,x,y,z\n0,0,0,65\n0.1,0.1,0,65\n0.2,0,0,65\n0.3,2,0,65\n0.4,9,0,64\n0.5,11,0,64\n0.6,10,0,64\n0.7,10." \
    "5,0,64\n"                                                                                               \
    "0.8,6,0,64\n0.9,1,0,65\n2.0,0.6,0,65\n"

static void the_step_is_found_where_the_tip_moves(void **state) {
    (void)state;
    const struct mapping_setting settings[] = {{"p1_cmd_pa", 30000.0}, {"supply_pa", 150000.0}};
    struct run_log log;
    char error[ERROR_BYTES];
    assert_true(import_with(STEPPED_MAPPING, STEPPED_SOURCE, settings, 2, &log, error));
    const double wanted_pa[] = {0.0, 0.0, 0.0, 30000.0, 30000.0, 30000.0, 30000.0, 30000.0, 0.0, 0.0, 0.0};
    for (size_t row = 0; row < log.rows; row++) {
        assert_close(field(&log, row, "p1_cmd_pa"), wanted_pa[row], 0.0);
    }
    assert_close(field(&log, 7, "p2_cmd_pa"), 300.0, 1e-9);
    assert_close(field(&log, 3, "p3_cmd_pa"), 0.0, 0.0);
    assert_close(field(&log, 4, "p3_cmd_pa"), 1000.0, 1e-9);
    assert_close(field(&log, 10, "p3_cmd_pa"), 2000.0, 1e-9);
    assert_close(field(&log, 10, "supply_pa"), 150000.0, 0.0);
    assert_int_equal(run_log_column(&log, "tip_qw"), -1);
    assert_names(run_log_metadata(&log, "step_p1_cmd_pa"), "30000 from 0.300 to 0.700 s");
    assert_string_equal(run_log_metadata(&log, "segments"), "0.000 2.000");
    run_log_free(&log);
}

static void what_the_file_lacks_must_be_given(void **state) {
    (void)state;
    const struct mapping_setting twice[] = {{"p1_cmd_pa", 1.0}, {"p2_cmd_pa", 1.0}};
    struct run_log log;
    char error[ERROR_BYTES];
    double value = 0.0;
    assert_false(import_with(STEPPED_MAPPING, STEPPED_SOURCE, NULL, 0, &log, error));
    assert_names(error, "--set p1_cmd_pa=");
    assert_names(error, "pressure");
    assert_false(import_with(STEPPED_MAPPING, STEPPED_SOURCE, twice, 2, &log, error));
    assert_names(error, "p2_cmd_pa cannot be set");
    assert_false(import_with(STEPPED_MAPPING, "t,x,y,z\n0,0,0,65\n1,0,0,65\n", twice, 1, &log, error));
    assert_names(error, "never moves");
    assert_true(run_column_parse("p1_cmd_pa", "300mbar", &value, error, sizeof error));
    assert_close(value, 30000.0, 1e-9);
    assert_true(run_column_parse("valve1", "0.5", &value, error, sizeof error));
    assert_close(value, 0.5, 0.0);
    const char *const bad[] = {"300", "300mm", "mbar", "nanPa", "300 mbar", ""};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_false(run_column_parse("p1_cmd_pa", bad[i], &value, error, sizeof error));
        assert_names(error, "mbar");
    }
    assert_false(run_column_parse("colour", "1", &value, error, sizeof error));
    assert_names(error, "p1_cmd_pa");
}

static void pressure_jumps_and_gaps_start_segments(void **state) {
    (void)state;
    struct run_log log;
    import_good("name: m\nsource: s\ngaps: {cut_after_s: 0.2, pressure_jump_pa: 3000}\ncolumns:\n"
                "  - {to: time_s, column: t, unit: s}\n  - {to: p2_pa, column: p, unit: kPa}\n",
                "t,p\n0,0\n0.1,2\n0.2,9\n0.3,10\n0.6,10\n", &log);
    assert_string_equal(run_log_metadata(&log, "segments"), "0.000 0.200 0.600");
    run_log_free(&log);
}

#define HEAD "name: m\nsource: s\n"
#define TIME "columns:\n  - {to: time_s, column: t, unit: s}\n"
#define PLAIN_SOURCE "t,p,x,y,z,qa,qb,qc,qd\n0,1,0,0,65,1,0,0,0\n1,2,0,0,65,1,0,0,0\n"

static void each_bad_mapping_names_line_and_key(void **state) {
    (void)state;
    const struct {
        const char *text;
        const char *line;
        const char *words;
    } bad[] = {
        {HEAD TIME "  - {to: p1_pa, column: p, unit: furlong}\n", ":5:", "'furlong' is no unit"},
        {HEAD TIME "  - to: p1_pa\n    column: p\n    unit: mm\n", ":7:", "unit: p1_pa is a pressure"},
        {HEAD TIME "  - {to: p1_pascal, column: p, unit: Pa}\n", ":5:", "no column 'p1_pascal'"},
        {HEAD TIME "  - {to: p1_pa, column: p}\n", ":", "unit"},
        {HEAD TIME "  - {to: p1_pa, column: p, unit: Pa, colour: red}\n", ":5:", "colour"},
        {HEAD TIME "  - {to: p1_pa, column: p, unit: Pa, sign: 2}\n", ":5:", "must be 1 or -1"},
        {HEAD TIME "  - {to: p1_pa, column: p, unit: Pa, scale: 0}\n", ":5:", "scale"},
        {HEAD TIME "  - {to: p1_pa, column: p, unit: Pa}\n  - {to: p1_pa, column: t, unit: Pa}\n", ":",
         "given 2 times"},
        {HEAD "columns:\n  - {to: p1_pa, column: p, unit: Pa}\n", ":3:", "time_s"},
        {HEAD TIME "delimiter: ';;'\n", ":5:", "delimiter"},
        {HEAD TIME "header_lines: -1\n", ":5:", "header_lines"},
        {HEAD TIME "  - {to: p1_pa, column: p, unit: Pa, subtract_rest: true}\n", ":", "until_s"},
        {HEAD TIME "rest: {from_s: 2, until_s: 1}\n", ":", "until_s"},
        {HEAD TIME "tip: {unit: Pa, position: [x, y, z]}\n", ":5:", "length"},
        {HEAD TIME "tip: {unit: mm}\n", ":5:", "position or tip_from_markers"},
        {HEAD TIME "tip: {unit: mm, position: [x, y]}\n", ":5:", "2 of 3"},
        {HEAD TIME "tip: {unit: mm, position: [x, y, z], lever_arm_m: [0, 0, 0]}\n", ":", "orientation"},
        {HEAD TIME
         "tip: {unit: mm, position: [x, y, z], quaternion: [qa, qb, qc, qd], quaternion_order: zyxw}\n",
         ":5:", "quaternion_order"},
        {HEAD TIME "frame: {axes: {x: +x, y: +y, z: +z}}\n", ":5:", "without 'tip:'"},
        {HEAD TIME "tip: {unit: mm, position: [x, y, z]}\nframe:\n  axes: {x: +x, y: +y, z: -z}\n",
         ":7:", "right-handed"},
        {HEAD TIME "tip: {unit: mm, position: [x, y, z]}\nframe:\n  axes: {x: up, y: +y, z: +z}\n",
         ":7:", "right-handed"},
        {HEAD TIME "tip: {unit: mm, position: [x, y, z]}\nframe: {quaternion: [1, 1, 0, 0]}\n",
         ":6:", "length"},
        {HEAD TIME "  - {to: tip_x_m, column: x, unit: mm}\ntip: {unit: mm, position: [x, y, z]}\n",
         ":5:", "either"},
        {HEAD TIME "constants:\n  - {to: p1_cmd_pa, value: 3}\n", ":6:", "without a unit"},
        {HEAD TIME "constants:\n  - {to: p1_cmd_pa, unit: mbar, steps: [[1, 0], [1, 2]]}\n", ":6:", "later"},
        {HEAD TIME "constants:\n  - {to: p1_cmd_pa, unit: mbar, value: 1, while_moved_m: 1}\n", ":6:", "tip"},
        {"source: s\n" TIME, ":", "name"},
        {HEAD "columns: [\n", ":", "mapping.yaml"}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct run_log log;
        char error[ERROR_BYTES] = "";
        if (import_with(bad[i].text, PLAIN_SOURCE, NULL, 0, &log, error)) {
            fail_msg("case %d was accepted", (int)i);
        }
        assert_names(error, mapping_path);
        assert_names(error, bad[i].line);
        assert_names(error, bad[i].words);
    }
}

static void each_bad_source_names_line_and_column(void **state) {
    (void)state;
    const char *const pressure = HEAD TIME "  - {to: p1_pa, column: p, unit: Pa}\n";
    const char *const posed =
        HEAD TIME "tip: {unit: mm, position: [x, y, z], quaternion: [qa, qb, qc, qd]}\n";
    const char *const marked =
        HEAD TIME "rest: {until_s: 1}\ntip:\n  unit: mm\n  tip_from_markers:\n"
                  "    - {x: x, y: y, z: z}\n    - {x: x, y: y, z: qa}\n    - {x: x, y: y, z: qb}\n";
    const struct {
        const char *mapping;
        const char *source;
        const char *line;
        const char *words;
    } bad[] = {{pressure, "t,q\n0,1\n1,2\n", ":1:", "no column 'p'; the file has: t, q"},
               {pressure, "t,p\n0,1\n1,abc\n", ":3:", "column 'p': 'abc'"},
               {pressure, "t,p\n0,1\n1,inf\n", ":3:", "column 'p'"},
               {pressure, "t,p\n0,1\n1\n", ":3:", "too few fields: 1, and column 'p' is number 2"},
               {pressure, "t,p\n0,1\n-1,1\n", ":3:", "backwards"},
               {pressure, "t,p\n0,1\n,1\n", ":3:", "time is missing"},
               {pressure, "t,p\n", ":1:", "no rows"},
               {pressure, "t,p\n0,1\n", ":2:", "one row only"},
               {pressure, "", ":0:", "header lines"},
               {posed, "t,x,y,z,qa,qb,qc,qd\n0,0,0,65,1,0,0,0\n1,0,0,65,1,1,0,0\n", ":3:", "length 1.414"},
               {marked, PLAIN_SOURCE, ":", "one line"},
               {marked, "t,x,y,z,qa,qb\n5,,0,0,0,0\n6,1,1,1,1,1\n", ":", "no row at rest"}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct run_log log;
        char error[ERROR_BYTES] = "";
        if (import_with(bad[i].mapping, bad[i].source, NULL, 0, &log, error)) {
            fail_msg("case %d was accepted", (int)i);
        }
        assert_names(error, source_path);
        assert_names(error, bad[i].line);
        assert_names(error, bad[i].words);
    }
}

/* --- measured data of others --- */

static bool find_data(const char *name, char path[256]) {
    const char *root = getenv("TRIBEND_DATA");
    (void)snprintf(path, 256, "%s/%s", root != NULL && *root != '\0' ? root : "../shared/data", name);
    if (access(path, R_OK) == 0) {
        return true;
    }
    print_message("           skipped: %s is not there; set TRIBEND_DATA to the folder that holds %s\n", path,
                  name);
    return false;
}

static void import_real(const char *mapping_name, const char *path, const struct mapping_setting *settings,
                        size_t count, struct run_log *log) {
    struct description_error why;
    char error[ERROR_BYTES];
    struct mapping *mapping = mapping_read(mapping_name, &why);
    if (mapping == NULL) {
        fail_msg("%s", why.text);
    }
    if (!mapping_import(mapping, path, settings, count, log, error, sizeof error)) {
        fail_msg("%s", error);
    }
    mapping_free(mapping);
}

/* Means over the rows between two times, of the pose's third axis and position. */
struct plateau {
    double pressure_pa[3];
    double bend_deg;
    double direction_deg; /* 0 to 360: where the tip's axis leans */
    double moved_m[3];    /* against where the tip is at rest */
};

static struct plateau average(const struct run_log *log, double from_s, double until_s,
                              const double rest_m[3]) {
    static const char *const pressure[] = {"p1_pa", "p2_pa", "p3_pa"}, *const position[] = {
                                                                           "tip_x_m", "tip_y_m", "tip_z_m"};
    struct plateau mean = {.bend_deg = 0.0};
    double axis[3] = {0.0}, rows = 0.0;
    for (size_t row = 0; row < log->rows; row++) {
        const double time_s = field(log, row, "time_s");
        if (time_s < from_s || time_s >= until_s) {
            continue;
        }
        const double turn[4] = {field(log, row, "tip_qw"), field(log, row, "tip_qx"),
                                field(log, row, "tip_qy"), field(log, row, "tip_qz")};
        double along[3] = {0.0, 0.0, 1.0};
        rotation_apply(turn, along, along);
        rows += 1.0;
        for (size_t k = 0; k < 3; k++) {
            axis[k] += along[k];
            mean.moved_m[k] += field(log, row, position[k]) - rest_m[k];
            mean.pressure_pa[k] += run_log_column(log, pressure[k]) >= 0 ? field(log, row, pressure[k]) : 0.0;
        }
    }
    assert_true(rows > 0.0);
    for (size_t k = 0; k < 3; k++) {
        mean.moved_m[k] /= rows;
        mean.pressure_pa[k] /= rows;
    }
    mean.bend_deg = atan2(hypot(axis[0], axis[1]), axis[2]) * DEGREES;
    mean.direction_deg = fmod(atan2(axis[1], axis[0]) * DEGREES + 360.0, 360.0);
    return mean;
}

static void the_stiff_flop_recording_bends_as_its_notes_say(void **state) {
    (void)state;
    /* Second halves of the loaded plateaus; bends to which the recording's notes come: 13, 19, 41 to 48, 73
     * to 77 deg. */
    const struct {
        double from_s;
        double until_s;
        int chamber;
        double pressure_bar;
        double least_deg;
        double most_deg;
    } plateaus[] = {{21.9, 23.3, 3, 0.27, 13.0, 13.0}, {9.6, 11.0, 1, 0.36, 19.0, 19.0},
                    {16.0, 17.9, 2, 0.36, 19.0, 19.0}, {27.0, 28.0, 1, 0.73, 41.0, 48.0},
                    {30.6, 31.4, 2, 0.73, 41.0, 48.0}, {35.0, 36.3, 3, 0.69, 41.0, 48.0},
                    {39.6, 41.3, 1, 1.07, 73.0, 77.0}, {44.3, 45.1, 2, 1.11, 73.0, 77.0},
                    {51.2, 52.5, 3, 1.10, 73.0, 77.0}};
    const double directions_deg[] = {180.0, 300.0, 60.0}, rest_m[3] = {0.0, 0.0, 0.044};
    char path[256];
    struct run_log log;
    if (!find_data("kcl_stiff_flop/NoLoad.csv", path)) {
        skip();
    }
    import_real("tables/mappings/kcl_stiff_flop.yaml", path, NULL, 0, &log);
    assert_string_equal(log.module, "stiff-flop");
    const struct plateau rest = average(&log, 0.0, 6.0, rest_m);
    assert_under(rest.bend_deg, 0.1);
    assert_under(hypot(hypot(rest.moved_m[0], rest.moved_m[1]), rest.moved_m[2]), 1e-6);
    for (size_t i = 0; i < sizeof plateaus / sizeof plateaus[0]; i++) {
        const size_t c = (size_t)plateaus[i].chamber - 1;
        const struct plateau at = average(&log, plateaus[i].from_s, plateaus[i].until_s, rest_m);
        print_message("           chamber %zu at %.2f bar: %.1f deg toward %.1f deg, tip %.1f %.1f %.1f mm\n",
                      c + 1, 1e-5 * at.pressure_pa[c], at.bend_deg, at.direction_deg, 1e3 * at.moved_m[0],
                      1e3 * at.moved_m[1], 1e3 * at.moved_m[2]);
        assert_close(1e-5 * at.pressure_pa[c], plateaus[i].pressure_bar, 0.02);
        assert_under(fabs(at.pressure_pa[(c + 1) % 3]) + fabs(at.pressure_pa[(c + 2) % 3]), 500.0);
        assert_true(at.bend_deg > plateaus[i].least_deg - 3.0 && at.bend_deg < plateaus[i].most_deg + 3.0);
        assert_close(at.direction_deg, directions_deg[c], 5.0);
        /* the position leans the same way, as that of a tip on the axis must */
        const double moved_deg = fmod(atan2(at.moved_m[1], at.moved_m[0]) * DEGREES + 360.0, 360.0);
        assert_close(moved_deg, directions_deg[c], 5.0);
    }
    const char *segments = run_log_metadata(&log, "segments");
    assert_non_null(segments);
    assert_names(segments, " 8.050 ");
    run_log_free(&log);
}

static void the_sopra_steps_move_the_tip_as_their_notes_say(void **state) {
    (void)state;
    const struct {
        const char *name;
        const char *mapping;
        double pressure_pa;
        double from_s; /* of the plateau's later part */
        double until_s;
        double moved_mm;
    } steps[] = {{"eth_sopra_steps/100mbar_V3.csv", "eth_sopra_steps", 10000.0, 1.5, 3.5, 2.8},
                 {"eth_sopra_steps/300mbar_V3.csv", "eth_sopra_steps", 30000.0, 3.0, 4.5, 15.3},
                 {"eth_sopra_steps/400mbar_V3.csv", "eth_sopra_steps", 40000.0, 2.0, 4.0, 33.7},
                 {"eth_sopra_steps/blackframe_300mbar.csv", "eth_sopra_blackframe", 30000.0, 0.8, 1.5, 15.3}};
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; i++) {
        const struct mapping_setting setting = {"p1_cmd_pa", steps[i].pressure_pa};
        char path[256], mapping[128];
        struct run_log log;
        if (!find_data(steps[i].name, path)) {
            skip();
        }
        (void)snprintf(mapping, sizeof mapping, "tables/mappings/%s.yaml", steps[i].mapping);
        import_real(mapping, path, &setting, 1, &log);
        const double rest_m[3] = {field(&log, 0, "tip_x_m"), field(&log, 0, "tip_y_m"),
                                  field(&log, 0, "tip_z_m")};
        const struct plateau at = average(&log, steps[i].from_s, steps[i].until_s, rest_m);
        const double moved_mm = 1e3 * hypot(hypot(at.moved_m[0], at.moved_m[1]), at.moved_m[2]);
        print_message("           %s: tip %.1f mm, bend %.1f deg toward %.1f deg; step %s\n", steps[i].name,
                      moved_mm, at.bend_deg, at.direction_deg, run_log_metadata(&log, "step_p1_cmd_pa"));
        assert_relative(moved_mm, steps[i].moved_mm, 0.1);
        assert_close(at.direction_deg, 180.0, 7.0);
        assert_true(at.moved_m[0] < 0.0);
        assert_close(field(&log, 0, "p1_cmd_pa"), 0.0, 0.0);
        assert_names(run_log_metadata(&log, "step_p1_cmd_pa"), "from");
        run_log_free(&log);
    }
}

/* --- LCM --- */

static void fingerprints_are_those_of_lcm_gen(void **state) {
    (void)state;
    /* Types that others published with the hash that lcm-gen gave them, before the rotation by one. */
    const struct lcm_type robot = {.fields = 13,
                                   .field = {{.type = "int8_t", .name = "mode"},
                                             {.type = "int8_t", .name = "gait_id"},
                                             {.type = "int8_t", .name = "contact"},
                                             {.type = "int8_t", .name = "life_count"},
                                             {.type = "float", .name = "vel_des", .count = 3},
                                             {.type = "float", .name = "rpy_des", .count = 3},
                                             {.type = "float", .name = "pos_des", .count = 3},
                                             {.type = "float", .name = "acc_des", .count = 6},
                                             {.type = "float", .name = "ctrl_point", .count = 3},
                                             {.type = "float", .name = "foot_pose", .count = 6},
                                             {.type = "float", .name = "step_height", .count = 2},
                                             {.type = "int32_t", .name = "value"},
                                             {.type = "int32_t", .name = "duration"}}};
    const struct lcm_type group = {.fields = 1, .field = {{.type = "string", .name = "desired_group"}}};
    assert_true(lcm_type_fingerprint(&robot) == 0x476b61e296af96f5u << 1);
    assert_true(lcm_type_fingerprint(&group) == (0xe21c68d2e41b458du << 1) + 1u);
}

/* host/lcm/tribend_NAME.lcm holds the fields of the table, in order. */
static void the_lcm_files_and_the_table_agree(void **state) {
    (void)state;
    for (size_t t = 0; t < lcm_type_count; t++) {
        char path[128], line[256], type[32], name[64];
        size_t found = 0;
        (void)snprintf(path, sizeof path, "host/lcm/tribend_%s.lcm", lcm_types[t].name);
        FILE *file = fopen(path, "r");
        assert_non_null(file);
        while (fgets(line, sizeof line, file) != NULL) {
            const size_t length = strcspn(line, ";");
            if (line[length] == '\0' || strncmp(line, "    int", 7) != 0) {
                continue;
            }
            line[length] = '\0';
            assert_int_equal(sscanf(line, " %31s %63s", type, name), 2);
            char *bracket = strchr(name, '[');
            const size_t count = bracket == NULL ? 0 : (size_t)strtol(bracket + 1, NULL, 10);
            name[strcspn(name, "[")] = '\0';
            assert_true(found < lcm_types[t].fields);
            assert_string_equal(type, lcm_types[t].field[found].type);
            assert_string_equal(name, lcm_types[t].field[found].name);
            assert_int_equal(count, lcm_types[t].field[found].count);
            found++;
        }
        (void)fclose(file);
        assert_int_equal(found, lcm_types[t].fields);
        assert_string_equal(lcm_types[t].field[0].name, "utime");
    }
}

struct lcm_file {
    uint8_t bytes[4096];
    size_t size;
    size_t events;
};

static void put(struct lcm_file *file, uint64_t value, size_t bytes) {
    for (size_t b = bytes; b-- > 0;) {
        file->bytes[file->size++] = (uint8_t)(value >> (8u * b));
    }
}

/* An event with a message of `type`: utime, then `numbers` for the other elements, in order. */
static void put_event(struct lcm_file *file, const struct lcm_type *type, const char *channel,
                      int64_t utime_us, const int64_t *numbers) {
    put(file, 0xEDA1DA01u, 4);
    put(file, file->events++, 8);
    put(file, (uint64_t)(utime_us + 1700000000000000), 8);
    put(file, strlen(channel), 4);
    put(file, lcm_type_bytes(type), 4);
    memcpy(file->bytes + file->size, channel, strlen(channel));
    file->size += strlen(channel);
    put(file, lcm_type_fingerprint(type), 8);
    for (size_t f = 0; f < type->fields; f++) {
        const size_t count = type->field[f].count > 0 ? type->field[f].count : 1;
        const size_t bytes = strtoul(type->field[f].type + 3, NULL, 10) / 8;
        for (size_t e = 0; e < count; e++) {
            put(file, (uint64_t)(f == 0 ? utime_us : *numbers++), bytes);
        }
    }
}

static const int64_t status_numbers[] = {
    1234, -56, 40000, 2000, 0, 100, 40500, 250000, 0, 1000000, SUPERVISOR_ACTIVE, 0, 0, 1047000, 1000, 1};
static const int64_t tip_numbers[] = {4990000, -12345, 500, 64000, 990000000, -100000000, 0, 5, 97, 3};
static const int64_t bend_numbers[] = {COMMAND_BEND, 1, 2, 3, 1047198, -523599, 0};

/* Status, tip and command, and one of another program. */
static void fill_lcm(struct lcm_file *file) {
    memset(file, 0, sizeof *file);
    put_event(file, &lcm_types[0], "TRIBEND_STATUS", 5000000, status_numbers);
    put_event(file, &lcm_types[1], "TRIBEND_TIP", 5000000, tip_numbers);
    put_event(file, &lcm_types[0], "CAMERA", 5000500, status_numbers);
    put_event(file, &lcm_types[2], "TRIBEND_COMMAND", 5002000, bend_numbers);
    put_event(file, &lcm_types[0], "TRIBEND_STATUS", 5001000, status_numbers); /* came late */
}

static void an_lcm_log_becomes_a_run_log(void **state) {
    (void)state;
    static struct lcm_file file;
    struct lcm_log_counts counts;
    struct run_log log;
    char error[ERROR_BYTES];
    fill_lcm(&file);
    write_bytes(source_path, file.bytes, file.size);
    assert_true(lcm_log_read(source_path, &log, &counts, error, sizeof error));
    assert_int_equal(counts.events, 5);
    assert_int_equal(counts.decoded, 4);
    assert_int_equal(counts.other_channel, 1);
    assert_int_equal(counts.skipped_bytes + counts.cut_off_bytes, 0);
    assert_int_equal(log.rows, 3);
    assert_close(field(&log, 1, "time_s"), 0.001, 1e-9);
    assert_close(field(&log, 0, "p2_pa"), -56.0, 0.0);
    assert_close(field(&log, 0, "p3_cmd_pa"), 100.0, 0.0);
    assert_close(field(&log, 0, "valve1"), 0.25, 1e-12);
    assert_close(field(&log, 0, "state"), SUPERVISOR_ACTIVE, 0.0);
    assert_close(field(&log, 0, "tip_x_m"), -0.012345, 1e-12); /* the same step, the same row */
    assert_close(field(&log, 0, "tip_qx"), -0.1, 1e-12);
    assert_close(field(&log, 0, "tip_quality"), 97.0, 0.0);
    assert_true(isnan(field(&log, 1, "tip_x_m")));
    assert_close(field(&log, 2, "bend_cmd_rad"), 1.047198, 1e-9);
    assert_true(isnan(field(&log, 2, "p1_cmd_pa"))); /* a bend command has no pressures */
    assert_int_equal(run_log_column(&log, "temperature_k"), -1);
    assert_names(run_log_metadata(&log, "time_zero"), "5000000 us");
    assert_true(run_log_write(run_path, &log, error, sizeof error));
    run_log_free(&log);
    assert_true(run_log_read(run_path, &log, error, sizeof error));
    run_log_free(&log);
}

static void a_damaged_lcm_log_keeps_its_whole_events(void **state) {
    (void)state;
    static struct lcm_file file;
    struct lcm_log_counts counts;
    struct run_log log;
    char error[ERROR_BYTES];
    fill_lcm(&file);
    for (size_t cut = 1; cut < 60; cut += 7) { /* anywhere in the last event */
        write_bytes(source_path, file.bytes, file.size - cut);
        assert_true(lcm_log_read(source_path, &log, &counts, error, sizeof error));
        assert_int_equal(counts.events, 4);
        assert_true(counts.cut_off_bytes > 0);
        assert_names(run_log_metadata(&log, "imported"), "cut off");
        run_log_free(&log);
    }
    const size_t second = 28 + strlen("TRIBEND_STATUS") + lcm_type_bytes(&lcm_types[0]);
    file.bytes[second] ^= 0xFFu; /* the second event's sync word */
    write_bytes(source_path, file.bytes, file.size);
    assert_true(lcm_log_read(source_path, &log, &counts, error, sizeof error));
    assert_int_equal(counts.events, 4);
    assert_int_equal(counts.skipped_bytes, 28 + strlen("TRIBEND_TIP") + lcm_type_bytes(&lcm_types[1]));
    run_log_free(&log);
    fill_lcm(&file);
    file.bytes[28 + strlen("TRIBEND_STATUS")] ^= 1u; /* the first event's fingerprint */
    write_bytes(source_path, file.bytes, file.size);
    assert_true(lcm_log_read(source_path, &log, &counts, error, sizeof error));
    assert_int_equal(counts.other_version, 1);
    run_log_free(&log);
    fill_lcm(&file);
    file.bytes[28 + strlen("TRIBEND_STATUS") + 8] ^= 0x80u; /* the first event's time is negative */
    write_bytes(source_path, file.bytes, file.size);
    assert_true(lcm_log_read(source_path, &log, &counts, error, sizeof error));
    assert_int_equal(counts.wrong_time, 1);
    assert_close(field(&log, 0, "time_s"), 0.0, 0.0);
    run_log_free(&log);
}

static void what_is_no_lcm_log_of_ours_is_refused(void **state) {
    (void)state;
    static struct lcm_file file;
    struct lcm_log_counts counts;
    struct run_log log;
    char error[ERROR_BYTES];
    write_text(source_path, "time_s,p1_pa\n0,1\n");
    assert_false(lcm_log_read(source_path, &log, &counts, error, sizeof error));
    assert_names(error, "not one whole LCM event");
    memset(&file, 0, sizeof file);
    put_event(&file, &lcm_types[0], "CAMERA", 1, status_numbers);
    write_bytes(source_path, file.bytes, file.size);
    assert_false(lcm_log_read(source_path, &log, &counts, error, sizeof error));
    assert_names(error, "'CAMERA'");
    assert_names(error, "TRIBEND_STATUS");
    write_text(source_path, "");
    assert_false(lcm_log_read(source_path, &log, &counts, error, sizeof error));
    assert_false(lcm_log_read("/nowhere/at/all", &log, &counts, error, sizeof error));
    assert_names(error, "/nowhere/at/all");
}

/* --- candump --- */

static void a_candump_becomes_a_run_log(void **state) {
    (void)state;
    struct candump_counts counts;
    struct run_log log;
    char error[ERROR_BYTES];
    /* node 3: 1000 Pa = 500 = F401 in little-endian; -100 Pa = -50 = CEFF; no reading is 0080 */
    write_text(source_path, "(1700000000.000100) can0 113#F401CEFF00800000\n"
                            "(1700000000.000400) can0 123#D007000000000000\n"
                            "(1700000000.000700) can0 143#8813000071823801\n"
                            "(1700000000.000900) can0 103#1300000000000000\n"
                            "(1700000000.001000) can0 153#F0D8000018190000\n"
                            "(1700000000.001300) can0 163#FF7F000000000180 T\n"
                            "(1700000000.001400) can0 114#0000000000000000\n"
                            "(1700000000.001500) can0 18FF0001#00\n"
                            "(1700000000.001600) can0 113#R\n"
                            "(1700000000.001700) can0 113#FA00\n"
                            "\n"
                            "(1700000000.001800) can0 113#0000000000000000\n");
    assert_true(candump_read(source_path, CANDUMP_FIRST_NODE, &log, &counts, error, sizeof error));
    assert_int_equal(counts.frames, 11);
    assert_int_equal(counts.decoded, 7);
    assert_int_equal(counts.other_node, 1);
    assert_int_equal(counts.other_message, 2);
    assert_int_equal(counts.short_frames, 1);
    assert_int_equal(counts.malformed, 0);
    assert_int_equal(log.rows, 2); /* one step's messages share a row until one comes again */
    assert_close(field(&log, 0, "p1_pa"), 1000.0, 0.0);
    assert_close(field(&log, 0, "p2_pa"), -100.0, 0.0);
    assert_true(isnan(field(&log, 0, "p3_pa")));
    assert_close(field(&log, 0, "supply_pa"), 40000.0, 0.0);
    assert_close(field(&log, 0, "p1_cmd_pa"), 2000.0, 0.0);
    assert_close(field(&log, 0, "valve1"), 0.5, 1e-12);
    assert_close(field(&log, 0, "valve3"), 1.0, 1e-12);
    assert_close(field(&log, 0, "state"), SUPERVISOR_ACTIVE, 0.0);
    assert_close(field(&log, 0, "tip_x_m"), -0.1, 1e-12); /* 0xD8F0 = -10000 */
    assert_close(field(&log, 0, "tip_z_m"), 0.06424, 1e-9);
    assert_close(field(&log, 0, "tip_qw"), 1.0, 1e-7);
    assert_close(field(&log, 0, "tip_qz"), -1.0, 1e-7);
    assert_close(field(&log, 1, "time_s"), 0.0017, 1e-9);
    assert_true(isnan(field(&log, 1, "tip_qw")));
    run_log_free(&log);
    assert_false(candump_read(source_path, 4, &log, &counts, error, sizeof error)); /* it spoke once */
    assert_int_equal(counts.other_node, 8);
    assert_names(error, "8 of other nodes");
}

static void malformed_candump_lines_are_counted_and_the_first_is_named(void **state) {
    (void)state;
    const char *const bad[] = {"1700000000.0 can0 103#00",
                               "(1700000000.12) can0 103#00",
                               "(1700000000.000001) can0",
                               "(1700000000.000001) can0 10#00",
                               "(1700000000.000001) can0 103:00",
                               "(1700000000.000001) can0 FFF#00",
                               "(1700000000.000001) can0 103#0",
                               "(1700000000.000001) can0 103#000000000000000000",
                               "(1700000000.000001) can0 103#0G",
                               "(1700000000.000001) can0 103##",
                               "(",
                               "(1700000000.000001)"};
    struct candump_counts counts;
    struct run_log log;
    char error[ERROR_BYTES], text[256];
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        (void)snprintf(text, sizeof text,
                       "(1.000000) can0 111#0000000000000000\n%s\n(1.100000) can0 111#0000000000000000\n",
                       bad[i]);
        write_text(source_path, text);
        assert_true(candump_read(source_path, CANDUMP_FIRST_NODE, &log, &counts, error, sizeof error));
        if (counts.malformed != 1 || counts.first_malformed_line != 2) {
            fail_msg("'%s' passed", bad[i]);
        }
        assert_names(run_log_metadata(&log, "malformed"), "the first is line 2");
        run_log_free(&log);
        write_text(source_path, bad[i]);
        assert_false(candump_read(source_path, CANDUMP_FIRST_NODE, &log, &counts, error, sizeof error));
        assert_names(error, ":1: no line of candump");
    }
}

/* FD telemetry says the last tip sample again until there is a new one: only that is a sample. */
static void fd_telemetry_becomes_rows_with_each_tip_sample_once(void **state) {
    (void)state;
    struct candump_counts counts;
    struct run_log log;
    char error[ERROR_BYTES], text[2048] = "";
    for (int i = 0; i < 6; i++) {
        const struct message_telemetry telemetry = {.pressure_1 = 100.0f * (float)i,
                                                    .pressure_2 = NAN,
                                                    .duty_2 = 0.25f,
                                                    .tip_x = 0.01f,
                                                    .tip_qw = 1.0f,
                                                    .tip_measured = (uint16_t)(i / 2 * 156),
                                                    .state = SUPERVISOR_ACTIVE};
        struct message_trouble trouble = {0};
        struct hal_can_frame frame;
        message_frame(MESSAGE_TELEMETRY, 2u, &telemetry, &frame, &trouble);
        size_t at = strlen(text);
        (void)snprintf(text + at, sizeof text - at, "(1700000000.%06d) can0 %03X##1", 5000 * i, frame.id);
        for (size_t b = 0; b < 64; b++) {
            at = strlen(text);
            (void)snprintf(text + at, sizeof text - at, "%02X%s", frame.data[b], b == 63 ? "\n" : "");
        }
    }
    write_text(source_path, text);
    assert_true(candump_read(source_path, CANDUMP_FIRST_NODE, &log, &counts, error, sizeof error));
    assert_int_equal(log.rows, 6);
    for (size_t row = 0; row < 6; row++) {
        assert_close(field(&log, row, "p1_pa"), 100.0 * (double)row, 0.0);
        assert_close(field(&log, row, "valve2"), 0.25, 1e-9);
        assert_close(field(&log, row, "time_s"), 0.005 * (double)row, 1e-9);
        assert_int_equal(isnan(field(&log, row, "tip_x_m")), row % 2 == 1);
        assert_int_equal(isnan(field(&log, row, "tip_qw")), row % 2 == 1);
    }
    run_log_free(&log);
}

/* Each column that a message carries is one of a run log's, and each row of the layout names a field. */
static void every_can_column_is_a_column_of_a_run_log(void **state) {
    (void)state;
    size_t columns = 0;
    for (uint32_t number = 0; number < 128u; number++) {
        enum message_id id;
        unsigned node = 0;
        if (!can_layout_find(number * 16u + 5u, &id, &node)) {
            continue;
        }
        union message message;
        struct event_value values[CAN_COLUMNS_MAX];
        memset(&message, 0, sizeof message);
        assert_int_equal(node, 5);
        const size_t count = can_layout_columns(id, &message, true, values);
        for (size_t v = 0; v < count; v++) {
            enum run_dimension dimension;
            assert_true(run_column_find(values[v].column, &dimension));
        }
        columns += count;
    }
    assert_int_equal(columns, 37); /* the rows of can_layout.c */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(metadata_lines_are_kept),
        cmocka_unit_test(unknown_columns_are_kept_and_reported),
        cmocka_unit_test(each_bad_run_log_names_line_and_column),
        cmocka_unit_test(any_columns_are_written_and_read_back),
        cmocka_unit_test(units_signs_offsets_and_scales_become_si),
        cmocka_unit_test(a_file_without_header_is_read_by_number),
        cmocka_unit_test(the_mean_at_rest_is_taken_off),
        cmocka_unit_test(a_sensor_beside_the_axis_gives_the_pose_of_the_tip),
        cmocka_unit_test(markers_give_position_and_orientation),
        cmocka_unit_test(the_step_is_found_where_the_tip_moves),
        cmocka_unit_test(what_the_file_lacks_must_be_given),
        cmocka_unit_test(pressure_jumps_and_gaps_start_segments),
        cmocka_unit_test(each_bad_mapping_names_line_and_key),
        cmocka_unit_test(each_bad_source_names_line_and_column),
        cmocka_unit_test(the_stiff_flop_recording_bends_as_its_notes_say),
        cmocka_unit_test(the_sopra_steps_move_the_tip_as_their_notes_say),
        cmocka_unit_test(fingerprints_are_those_of_lcm_gen),
        cmocka_unit_test(the_lcm_files_and_the_table_agree),
        cmocka_unit_test(an_lcm_log_becomes_a_run_log),
        cmocka_unit_test(a_damaged_lcm_log_keeps_its_whole_events),
        cmocka_unit_test(what_is_no_lcm_log_of_ours_is_refused),
        cmocka_unit_test(a_candump_becomes_a_run_log),
        cmocka_unit_test(malformed_candump_lines_are_counted_and_the_first_is_named),
        cmocka_unit_test(fd_telemetry_becomes_rows_with_each_tip_sample_once),
        cmocka_unit_test(every_can_column_is_a_column_of_a_run_log),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
