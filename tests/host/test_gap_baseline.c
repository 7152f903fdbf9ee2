/* Diagnosis of another simulator's gap: what its sim_ columns may hold, which effects are found on top of it, and what is
 * said where it is wrong itself. */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "gap/baseline.h"
#include "gap/diagnosis.h"
#include "gap/report.h"
#include "log/mapping_import.h"
#include "log/run_log.h"
#include "program/table_file.h"
#include "support/scratch.h"

#define TABLE "tables/paper-semicircle.tbt"
#define ROW_S 0.01
#define ROWS 2000
#define SENSOR_AGE_S 0.01
#define READING_NOISE_PA 100.0
#define POSITION_NOISE_M 2e-5
#define TURN_NOISE 1e-4

static const char *const names[] = {"time_s",      "valve1",      "valve2",      "valve3",     "p1_pa",      "p2_pa",
                                    "p3_pa",       "tip_x_m",     "tip_y_m",     "tip_z_m",    "tip_qw",     "tip_qx",
                                    "tip_qy",      "tip_qz",      "sim_tip_x_m", "sim_tip_y_m", "sim_tip_z_m", "sim_tip_qw",
                                    "sim_tip_qx",  "sim_tip_qy",  "sim_tip_qz",  "sim_p1_pa",  "sim_p2_pa",  "sim_p3_pa"};
enum { TIME, DUTY, READING = 4, PLACE = 7, TURN = 10, SIM_PLACE = 14, SIM_TURN = 17, SIM_PRESSURE = 21, COLUMNS = 24 };

static struct table_file table;
static char directory[SCRATCH_BYTES];
static char log_path[SCRATCH_WITHIN_BYTES], json_path[SCRATCH_WITHIN_BYTES], source_path[SCRATCH_WITHIN_BYTES],
    mapping_path[SCRATCH_WITHIN_BYTES];
static double value[ROWS][COLUMNS];

static int set_up(void **state) {
    (void)state;
    if (table_file_open(&table, TABLE, NULL) != 0 || !scratch_folder(directory)) {
        return -1;
    }
    (void)snprintf(log_path, sizeof log_path, "%s/run.csv", directory);
    (void)snprintf(source_path, sizeof source_path, "%s/source.csv", directory);
    (void)snprintf(mapping_path, sizeof mapping_path, "%s/mapping.yaml", directory);
    (void)snprintf(json_path, sizeof json_path, "%s/gap.json", directory);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    (void)remove(log_path);
    (void)remove(json_path);
    (void)remove(source_path);
    (void)remove(mapping_path);
    table_file_close(&table);
    return rmdir(directory);
}

static double noise(uint64_t *seed) {
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        *seed = *seed * 6364136223846793005u + 1442695040888963407u;
        sum += (double)(*seed >> 11) / 9007199254740992.0;
    }
    return sum;
}

/* Ramps and holds of each chamber alone, then of two together. */
static void pressures_at(double time_s, double pressure_pa[3]) {
    static const double level_pa[12][3] = {{0, 0, 0},       {7000, 0, 0},    {3500, 0, 0},   {0, 6500, 0},
                                           {0, 3000, 0},    {0, 0, 7200},    {0, 0, 4000},   {5000, 5200, 0},
                                           {0, 5500, 4800}, {4600, 0, 5600}, {1500, 0, 6800}, {0, 0, 0}};
    const double length_s = ROWS * ROW_S / 12.0, at = time_s / length_s;
    const size_t now = at > 0.0 ? (size_t)fmin(at, 11.0) : 0, before = now > 0 ? now - 1 : 0;
    const double share = fmin((at - (double)now) * 3.0, 1.0);
    for (size_t c = 0; c < 3; c++) {
        pressure_pa[c] = level_pa[before][c] + share * (level_pa[now][c] - level_pa[before][c]);
    }
}

/* --- the other simulator: not our table, but an arc that bends by a polynomial of the pressures' vector sum --- */

struct arc {
    double bend_per_pa;    /* rad/Pa, along the vector sum */
    double growth_per_pa2; /* of the bend, rad/Pa^3 */
    double stretch_per_pa; /* of the sum */
};

struct push {
    double x_pa;
    double y_pa;
    double sum_pa;
};

/* A chamber pushes the tip away from its side. */
static struct push push_of(const double pressure_pa[3]) {
    struct push push = {0.0, 0.0, 0.0};
    for (size_t c = 0; c < 3; c++) {
        push.x_pa -= pressure_pa[c] * cos(2.0 * M_PI / 3.0 * (double)c);
        push.y_pa -= pressure_pa[c] * sin(2.0 * M_PI / 3.0 * (double)c);
        push.sum_pa += pressure_pa[c];
    }
    return push;
}

static void arc_pose(const struct arc *arc, const double pressure_pa[3], double *place, double *turn) {
    const struct push push = push_of(pressure_pa);
    const double across_pa = hypot(push.x_pa, push.y_pa), cap_m = 0.005;
    const double bend = across_pa * (arc->bend_per_pa + arc->growth_per_pa2 * across_pa * across_pa);
    const double length_m = 0.055 * (1.0 + arc->stretch_per_pa * push.sum_pa);
    const double x = across_pa > 1e-9 ? push.x_pa / across_pa : 1.0, y = across_pa > 1e-9 ? push.y_pa / across_pa : 0.0;
    const double off_m = bend > 1e-9 ? length_m * (1.0 - cos(bend)) / bend : 0.0;
    const double up_m = bend > 1e-9 ? length_m * sin(bend) / bend : length_m;
    place[0] = x * (off_m + cap_m * sin(bend));
    place[1] = y * (off_m + cap_m * sin(bend));
    place[2] = cap_m + up_m + cap_m * cos(bend);
    turn[0] = cos(0.5 * bend);
    turn[1] = -y * sin(0.5 * bend);
    turn[2] = x * sin(0.5 * bend);
    turn[3] = 0.0;
}

/* As near to a module of that stiffness as such an arc can be: least squares over the recording. */
static struct arc fitted_arc(double stiffness) {
    double a[3] = {0.0}, b[2] = {0.0}, stretch[2] = {0.0};
    for (size_t row = 0; row < ROWS; row += 10) {
        double pressure_pa[3], load_pa[3];
        struct body_shape shape;
        pressures_at(ROW_S * (double)row, pressure_pa);
        for (size_t c = 0; c < 3; c++) {
            load_pa[c] = pressure_pa[c] / stiffness;
        }
        body_shape_at(&table.table, load_pa, &shape);
        const struct push push = push_of(pressure_pa);
        const double across_pa = hypot(push.x_pa, push.y_pa), cube = across_pa * across_pa * across_pa;
        const double bend = hypot(shape.bend_x_rad, shape.bend_y_rad);
        a[0] += across_pa * across_pa;
        a[1] += across_pa * cube;
        a[2] += cube * cube;
        b[0] += across_pa * bend;
        b[1] += cube * bend;
        stretch[0] += push.sum_pa * push.sum_pa;
        stretch[1] += push.sum_pa * (shape.stretch - 1.0);
    }
    const double det = a[0] * a[2] - a[1] * a[1];
    return (struct arc){(b[0] * a[2] - b[1] * a[1]) / det, (b[1] * a[0] - b[0] * a[1]) / det, stretch[1] / stretch[0]};
}

/* --- recordings --- */

struct recording {
    const char *effect;      /* "NAME:parameter=..", or NULL */
    double stiffness;        /* of the real module */
    const struct arc *arc;   /* NULL: the simulator is a twin of the real module, without the effect */
    bool as_shown;           /* the simulator's poses are as old as the sensor's */
    bool driven_by_readings; /* the simulator's input was what the pressure sensors show */
};

static void put_pose(const struct tip_pose *pose, double noise_share, uint64_t *seed, double *place, double *turn) {
    for (size_t k = 0; k < 3; k++) {
        place[k] = pose->position_m[k] + noise_share * POSITION_NOISE_M * noise(seed);
    }
    for (size_t k = 0; k < 4; k++) {
        turn[k] = pose->quaternion[k] + noise_share * TURN_NOISE * noise(seed);
    }
}

/* Gas is left out: the pressures are what they are. */
static void record(const struct recording *of) {
    static struct plant real, twin;
    struct plant_parameters parameters;
    struct effect effect;
    char error[256];
    uint64_t seed = 11;
    plant_default_parameters(&parameters);
    parameters.gas.stiffness_scale = of->stiffness;
    plant_init(&real, &table.table, &parameters);
    plant_init(&twin, &table.table, &parameters);
    if (of->effect != NULL) {
        assert_true(effect_parse(of->effect, &effect, error, sizeof error));
        assert_true(plant_add_effect(&real, &effect));
    }
    for (size_t row = 0; row < ROWS; row++) {
        double pressure_pa[3], shown_pa[3], input_pa[3];
        const double time_s = ROW_S * (double)row, pose_s = time_s - SENSOR_AGE_S;
        struct effect_signals signals = {.time_s = time_s,
                                         .step_s = ROW_S,
                                         .temperature_k = NAN,
                                         .table = &table.table,
                                         .stiffness_scale = of->stiffness,
                                         .pressure_pa = pressure_pa,
                                         .reading_pa = shown_pa};
        value[row][TIME] = time_s;
        pressures_at(pose_s, pressure_pa);
        plant_sample_tip(&real, pressure_pa, pose_s, ROW_S, 1.0);
        put_pose(&real.pose, 1.0, &seed, &value[row][PLACE], &value[row][TURN]);
        pressures_at(time_s, pressure_pa);
        memcpy(shown_pa, pressure_pa, sizeof shown_pa);
        effects_run(real.effect, real.effect_count, EFFECT_HOOK_READING, &signals);
        pressures_at(of->as_shown ? pose_s : time_s, input_pa);
        for (size_t c = 0; c < 3; c++) {
            value[row][DUTY + c] = 0.2;
            value[row][READING + c] = fmax(shown_pa[c] + READING_NOISE_PA * noise(&seed), 0.0);
            value[row][SIM_PRESSURE + c] = pressure_pa[c];
            input_pa[c] += of->driven_by_readings ? shown_pa[c] - pressure_pa[c] : 0.0;
        }
        plant_sample_tip(&twin, input_pa, time_s, ROW_S, 1.0);
        put_pose(&twin.pose, 0.0, &seed, &value[row][SIM_PLACE], &value[row][SIM_TURN]);
        if (of->arc != NULL) {
            arc_pose(of->arc, input_pa, &value[row][SIM_PLACE], &value[row][SIM_TURN]);
        }
    }
}

static void leave_empty(size_t first, size_t count, size_t from_row, size_t to_row) {
    for (size_t row = from_row; row < to_row; row++) {
        for (size_t k = 0; k < count; k++) {
            value[row][first + k] = NAN;
        }
    }
}

static void write_log(const char *path) {
    const struct run_log_pair metadata[] = {{"module", table.table.module.name}};
    char error[256];
    assert_true(run_log_write_columns(path, names, &value[0][0], ROWS, COLUMNS, metadata, 1, error, sizeof error));
}

/* --- diagnoses --- */

static struct gap_data data;
static struct search search;
static struct diagnosis diagnosis;

static void diagnose(void) {
    const char *paths[] = {log_path};
    struct plant_parameters nominal;
    const struct search_options options = {.threads = 2};
    char error[512] = "";
    write_log(log_path);
    if (!gap_data_read(&data, paths, 1, error, sizeof error) || !gap_baseline_present(&data) ||
        !gap_baseline_use(&data, error, sizeof error)) {
        fail_msg("%s", error);
    }
    plant_default_parameters(&nominal);
    assert_true(search_run(&search, &data, &table.table, &nominal, &options));
    assert_true(diagnosis_conclude(&diagnosis, &search));
    for (size_t t = 0; t < search.trials; t++) { /* whatever is tried, nothing that acts on gas is */
        for (size_t e = 0; e < search.trial[t].fit.model.count; e++) {
            const struct effect_kind *kind = search.trial[t].fit.model.effect[e].kind;
            assert_false(effect_has(kind, EFFECT_HOOK_COMMAND) || effect_has(kind, EFFECT_HOOK_GAS));
        }
    }
}

static void forget(void) {
    search_close(&search);
    gap_data_free(&data);
}

static void assert_verdict(enum gap_verdict verdict) {
    if (diagnosis.verdict != verdict) {
        gap_report_text(&diagnosis, &data, stdout);
        fail_msg("the verdict is %s, not %s", gap_verdict_name(diagnosis.verdict), gap_verdict_name(verdict));
    }
}

static void assert_found(const char *name) {
    assert_verdict(GAP_EFFECT);
    assert_int_equal(diagnosis.effects, 1);
    assert_string_equal(diagnosis.effect[0].kind->name, name);
}

static void assert_parameter(size_t index, double truth, double share) {
    assert_close(diagnosis.effect[0].parameter[index].value, truth, share * fabs(truth));
}

static bool is_noted(const char *words) {
    for (size_t i = 0; i < diagnosis.warnings; i++) {
        if (strstr(diagnosis.warning[i], words) != NULL) {
            return true;
        }
    }
    return false;
}

static void a_body_effect_is_found_on_another_simulator(void **state) {
    (void)state;
    record(&(struct recording){.effect = "creep:amplitude=0.08,time_constant=1.5", .stiffness = 1.25});
    diagnose();
    assert_found("creep");
    assert_parameter(0, 0.08, 0.05);
    assert_parameter(1, 1.5, 0.05);
    assert_close(search.replay.elsewhere.stiffness_scale, 1.25, 0.01);
    assert_close(diagnosis.stiffness_scale.value, 1.0, 0.01);
    assert_true(diagnosis.gap[0].measured && diagnosis.gap[2].after_effect < 0.1 * diagnosis.gap[2].before);
    forget();
}

static void the_report_says_what_was_not_tried(void **state) {
    (void)state;
    char text[20000], error[256];
    record(&(struct recording){.stiffness = 1.25});
    diagnose();
    assert_verdict(GAP_NONE);
    assert_true(is_noted("another simulator's output (sim_tip_x_m .. and sim_p1_pa ..)"));
    assert_true(is_noted("not tried: chamber_leak, cross_coupling, line_resistance, line_volume, supply_droop, valve_dead_band, "
                         "valve_dead_time, valve_sluggish; it acts on the gas"));
    assert_true(gap_report_json(&diagnosis, &data, json_path, error, sizeof error));
    FILE *file = fopen(json_path, "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    assert_int_equal(fclose(file), 0);
    assert_non_null(strstr(text, "\"baseline\": \"simulator\""));
    assert_non_null(strstr(text, "\"name\": \"valve_dead_time\""));
    forget();
}

static void a_tip_sensor_effect_is_found_where_only_the_tip_was_simulated(void **state) {
    (void)state;
    record(&(struct recording){.effect = "tip_misalignment:x=0.08,y=-0.05,z=0.03", .stiffness = 1.25, .as_shown = true});
    leave_empty(SIM_PRESSURE, 3, 0, ROWS);
    diagnose();
    assert_found("tip_misalignment");
    assert_parameter(0, 0.08, 0.03);
    assert_parameter(1, -0.05, 0.03);
    assert_true(data.run[0].sim_as_shown); /* else the sensor's age would be a latency */
    assert_false(diagnosis.gap[0].measured);
    assert_true(diagnosis.gap[1].measured);
    assert_true(is_noted("gives no pressures"));
    forget();
}

static void a_pressure_sensor_shows_in_the_tip_of_a_simulator_that_it_drove(void **state) {
    (void)state;
    record(&(struct recording){
        .effect = "pressure_offset:offset=900,chamber=2", .stiffness = 1.0, .driven_by_readings = true});
    leave_empty(SIM_PRESSURE, 3, 0, ROWS);
    diagnose();
    assert_found("pressure_offset");
    assert_int_equal(diagnosis.effect[0].chamber, 2);
    assert_parameter(0, 900.0, 0.1);
    forget();
}

static void a_pressure_sensor_is_found_although_the_simulator_errs(void **state) {
    (void)state;
    const struct arc arc = fitted_arc(1.25);
    record(&(struct recording){.effect = "pressure_offset:offset=1800,chamber=2", .stiffness = 1.25, .arc = &arc});
    diagnose();
    assert_found("pressure_offset");
    assert_int_equal(diagnosis.effect[0].chamber, 2);
    assert_parameter(0, 1800.0, 0.05);
    assert_string_equal(diagnosis.stage, "pressure sensor");
    assert_true(diagnosis.chamber[1] && !diagnosis.chamber[0]);
    assert_true(is_noted("the tip is left with"));
    forget();
}

static void only_pressures_are_compared_where_only_they_were_simulated(void **state) {
    (void)state;
    record(&(struct recording){.effect = "pressure_offset:offset=900,chamber=2", .stiffness = 1.25});
    leave_empty(SIM_PLACE, 7, 0, ROWS);
    diagnose();
    assert_found("pressure_offset");
    assert_parameter(0, 900.0, 0.05);
    assert_true(diagnosis.gap[0].measured);
    assert_false(diagnosis.gap[1].measured || diagnosis.gap[2].measured);
    assert_true(is_noted("only pressures are compared"));
    assert_true(is_noted("creep"));
    forget();
}

/* An arc that misses the module by a degree or so, and one that is wrong by far. */
static void errors_of_the_simulator_are_no_effect(void **state) {
    (void)state;
    const struct arc arcs[2] = {fitted_arc(1.25), {0.9 * M_PI / 180.0 / 100.0, 0.0, 0.0}};
    for (size_t i = 0; i < 2; i++) {
        record(&(struct recording){.stiffness = i == 0 ? 1.25 : 1.0, .arc = &arcs[i]});
        diagnose();
        if (diagnosis.verdict != GAP_UNKNOWN && diagnosis.verdict != GAP_RECALIBRATE) {
            assert_verdict(GAP_UNKNOWN);
        }
        assert_true(is_noted("rough"));
        forget();
    }
}

static void rows_without_simulation_and_orientation_are_left_out(void **state) {
    (void)state;
    record(&(struct recording){.effect = "creep:amplitude=0.08,time_constant=1.5", .stiffness = 1.25});
    leave_empty(SIM_TURN, 4, 0, ROWS);
    leave_empty(SIM_PLACE, 10, 300, 400);
    leave_empty(SIM_PLACE, 3, 1000, 1005); /* too short to be a hole */
    diagnose();
    assert_found("creep");
    assert_parameter(0, 0.08, 0.1);
    assert_int_equal(data.run[0].rows_without_sim, 100);
    assert_in_range(data.run[0].tips_without_sim, 99, 102);
    assert_true(diagnosis.gap[1].measured);
    assert_false(diagnosis.gap[2].measured);
    assert_true(is_noted("100 rows with pressures"));
    assert_true(is_noted("position alone"));
    forget();
}

/* --- the columns --- */

static void refuse(const char *words) {
    const char *paths[] = {log_path};
    char error[512] = "";
    write_log(log_path);
    if (gap_data_read(&data, paths, 1, error, sizeof error)) {
        assert_false(gap_baseline_use(&data, error, sizeof error));
        gap_data_free(&data);
    }
    if (strstr(error, words) == NULL) {
        fail_msg("'%s' does not say '%s'", error, words);
    }
}

static void incomplete_columns_are_refused(void **state) {
    (void)state;
    record(&(struct recording){.stiffness = 1.0});
    leave_empty(SIM_PRESSURE + 1, 1, 0, ROWS);
    refuse("run.csv: column sim_p2_pa is missing or empty");
    record(&(struct recording){.stiffness = 1.0});
    leave_empty(SIM_PLACE + 2, 1, 0, ROWS);
    refuse("run.csv: column sim_tip_z_m is missing or empty");
    record(&(struct recording){.stiffness = 1.0});
    value[5][SIM_TURN] = 45.0;
    refuse("run.csv:9: columns sim_tip_qw to sim_tip_qz: their length is 45, not 1"); /* two lines of preamble and the header */
    record(&(struct recording){.stiffness = 1.0});
    leave_empty(SIM_PLACE, 7, 0, ROWS);
    leave_empty(READING, 3, 0, ROWS);
    refuse("nothing that was measured can be held against the sim_ columns");
}

static void readings_written_down_as_simulated_do_not_count(void **state) {
    (void)state;
    const char *paths[] = {log_path};
    char error[512];
    record(&(struct recording){.stiffness = 1.0});
    for (size_t row = 0; row < ROWS; row++) {
        memcpy(&value[row][SIM_PRESSURE], &value[row][READING], 3 * sizeof(double));
    }
    write_log(log_path);
    assert_true(gap_data_read(&data, paths, 1, error, sizeof error));
    assert_true(gap_baseline_use(&data, error, sizeof error));
    assert_true(data.run[0].sim_is_copy);
    assert_null(data.run[0].sim_pa);
    gap_data_free(&data);
}

static void a_mapping_fills_the_columns(void **state) {
    (void)state;
    struct description_error why;
    struct run_log log;
    char error[1024] = "";
    FILE *file = fopen(source_path, "w");
    assert_non_null(file);
    fputs("t,x,y,z,w,i,j,k,a,b,c\n0,1,2,60,1,0,0,0,10,20,30\n20,1.5,2.5,61,1,0,0,0,11,21,31\n", file);
    assert_int_equal(fclose(file), 0);
    file = fopen(mapping_path, "w");
    assert_non_null(file);
    fputs("name: sofa\nsource: a test\nmodule: paper-semicircle\ncolumns:\n"
          "  - {to: time_s, column: t, unit: ms}\n  - {to: sim_tip_x_m, column: x, unit: mm}\n"
          "  - {to: sim_tip_y_m, column: y, unit: mm}\n  - {to: sim_tip_z_m, column: z, unit: mm}\n"
          "  - {to: sim_tip_qw, column: w, unit: '1'}\n  - {to: sim_tip_qx, column: i, unit: '1'}\n"
          "  - {to: sim_tip_qy, column: j, unit: '1'}\n  - {to: sim_tip_qz, column: k, unit: '1'}\n"
          "  - {to: sim_p1_pa, column: a, unit: mbar}\n  - {to: sim_p2_pa, column: b, unit: mbar}\n"
          "  - {to: sim_p3_pa, column: c, unit: mbar}\n",
          file);
    assert_int_equal(fclose(file), 0);
    struct mapping *mapping = mapping_read(mapping_path, &why);
    if (mapping == NULL) {
        fail_msg("%s", why.text);
    }
    assert_true(mapping_import(mapping, source_path, NULL, 0, &log, error, sizeof error));
    const double *row = log.value + log.columns;
    assert_close(row[run_log_column(&log, "sim_tip_z_m")], 0.061, 1e-12);
    assert_close(row[run_log_column(&log, "sim_tip_qw")], 1.0, 1e-12);
    assert_close(row[run_log_column(&log, "sim_p3_pa")], 3100.0, 1e-9);
    run_log_free(&log);
    mapping_free(mapping);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_body_effect_is_found_on_another_simulator),
        cmocka_unit_test(the_report_says_what_was_not_tried),
        cmocka_unit_test(a_tip_sensor_effect_is_found_where_only_the_tip_was_simulated),
        cmocka_unit_test(a_pressure_sensor_shows_in_the_tip_of_a_simulator_that_it_drove),
        cmocka_unit_test(a_pressure_sensor_is_found_although_the_simulator_errs),
        cmocka_unit_test(only_pressures_are_compared_where_only_they_were_simulated),
        cmocka_unit_test(errors_of_the_simulator_are_no_effect),
        cmocka_unit_test(rows_without_simulation_and_orientation_are_left_out),
        cmocka_unit_test(incomplete_columns_are_refused),
        cmocka_unit_test(readings_written_down_as_simulated_do_not_count),
        cmocka_unit_test(a_mapping_fills_the_columns)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
