/* Calibrations: read back as they were written, refused where they make no sense, and of use: a controller that is told of
 * one follows commands better on the module that it was made of. */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "gap/close.h"
#include "gap/report.h"
#include "link/sim_link.h"
#include "program/input_file.h"
#include "program/table_file.h"
#include "support/scratch.h"
#include "support/synthetic_table.h"

#define TABLE "tables/paper-semicircle.tbt"
#define MODULE "paper-semicircle"
#define DEGREE (M_PI / 180.0)

static char directory[SCRATCH_BYTES];
static char path[SCRATCH_WITHIN_BYTES];
static struct table_file file;

static int set_up(void **state) {
    (void)state;
    if (!scratch_folder(directory)) {
        return -1;
    }
    (void)snprintf(path, sizeof path, "%s/found.yaml", directory);
    return table_file_open(&file, TABLE, MODULE);
}

static int tear_down(void **state) {
    (void)state;
    table_file_close(&file);
    (void)remove(path);
    return rmdir(directory);
}

static void write_text(const char *text) {
    FILE *stream = fopen(path, "w");
    assert_non_null(stream);
    assert_true(fputs(text, stream) >= 0);
    assert_int_equal(fclose(stream), 0);
}

static void read_calibration(const char *text, struct calibration *calibration) {
    char error[1024];
    write_text(text);
    if (!calibration_read(path, MODULE, calibration, error, sizeof error)) {
        fail_msg("%s", error);
    }
}

/* --- reading --- */

static struct diagnosis_interval around(double value) {
    return (struct diagnosis_interval){value, 0.9 * value, 1.1 * value};
}

static void what_a_diagnosis_writes_is_read_back(void **state) {
    (void)state;
    static struct diagnosis diagnosis;
    static struct gap_data data = {.runs = 1, .module = MODULE};
    static struct calibration calibration;
    char error[1024];
    diagnosis = (struct diagnosis){.verdict = GAP_EFFECTS,
                                   .effects = 2,
                                   .stiffness_scale = around(1.234567),
                                   .supply_scale = around(0.987654)};
    diagnosis.effect[0] = (struct diagnosis_effect){.kind = effect_kind_find("chamber_leak"),
                                                    .chamber = 3,
                                                    .onset_s = 4.25,
                                                    .parameter = {around(3.21e-11)}};
    diagnosis.effect[1] =
        (struct diagnosis_effect){.kind = effect_kind_find("creep"), .onset_s = 3.0, .latent = true, .parameter = {around(0.0765), around(1.25)}};
    (void)snprintf(data.run[0].path, sizeof data.run[0].path, "%s", "runs/first run.csv");
    assert_true(gap_report_calibration(&diagnosis, &data, path, error, sizeof error));
    if (!calibration_read(path, MODULE, &calibration, error, sizeof error)) {
        fail_msg("%s", error);
    }
    assert_string_equal(calibration.module, MODULE);
    assert_relative(calibration.stiffness_scale, 1.234567, 1e-7);
    assert_relative(calibration.supply_scale, 0.987654, 1e-7);
    assert_int_equal(calibration.effects, 2);
    assert_ptr_equal(calibration.effect[0].kind, effect_kind_find("chamber_leak"));
    assert_int_equal(calibration.effect[0].chamber, 3);
    assert_relative(calibration.effect[0].onset_s, 4.25, 1e-6);
    assert_relative(calibration.effect[0].parameter[0], 3.21e-11, 1e-7);
    assert_int_equal(calibration.effect[1].chamber, 0);
    assert_true(calibration.effect[1].latent && !calibration.effect[0].latent);
    assert_relative(calibration.effect[1].parameter[0], 0.0765, 1e-7);
    assert_relative(calibration.effect[1].parameter[1], 1.25, 1e-7);
    assert_relative(calibration_onset_s(&calibration), 4.25, 1e-6);
}

static const char two_effects[] = "module: paper-semicircle\n"                                     /* line 1 */
                                  "stiffness_scale: { value: 1.1 }\n"                              /* 2 */
                                  "supply_scale: { value: 0.95, unit: \"1\" }\n"                   /* 3 */
                                  "effects:\n"                                                     /* 4 */
                                  "  - name: creep\n"                                              /* 5 */
                                  "    form: 1\n"                                                  /* 6 */
                                  "    parameters:\n"                                              /* 7 */
                                  "      - { name: amplitude, value: 0.1, unit: \"1\" }\n"         /* 8 */
                                  "      - { name: time_constant, value: 2, unit: \"s\" }\n"       /* 9 */
                                  "  - name: valve_sluggish\n"                                     /* 10 */
                                  "    chamber: 2\n"                                               /* 11 */
                                  "    parameters:\n"                                              /* 12 */
                                  "      - { name: flow_scale, value: 0.5, low: 0.4, high: 0.6 }\n"; /* 13 */

static void what_is_optional_may_be_left_out(void **state) {
    (void)state;
    static struct calibration calibration;
    read_calibration(two_effects, &calibration);
    assert_int_equal(calibration.effects, 2);
    assert_int_equal(calibration.effect[0].form, 1);
    assert_int_equal(calibration.effect[0].chamber, 0);
    assert_close(calibration.effect[0].onset_s, 0.0, 0.0);
    assert_int_equal(calibration.effect[1].chamber, 2);
    read_calibration("module: paper-semicircle\nstiffness_scale: {value: 1}\nsupply_scale: {value: 1}\neffects: []\n",
                     &calibration);
    assert_int_equal(calibration.effects, 0);
}

/* `two_effects` with one text replaced by another. */
static void write_changed(const char *from, const char *to) {
    char text[2048];
    const char *at = strstr(two_effects, from);
    assert_non_null(at);
    (void)snprintf(text, sizeof text, "%.*s%s%s", (int)(at - two_effects), two_effects, to, at + strlen(from));
    write_text(text);
}

static void bad_files_are_refused_with_line_and_key(void **state) {
    (void)state;
    static const struct {
        const char *from, *to, *message; /* after "PATH:" */
    } cases[] = {
        {"module: paper-semicircle", "module: paper-circle", "1: module: this is a calibration of paper-circle, not of"},
        {"module: paper-semicircle", "module:", "1: module: names no module"},
        {"module: paper-semicircle\n", "", "Missing required mapping field: module"},
        {"stiffness_scale: { value: 1.1 }\n", "", "Missing required mapping field: stiffness_scale"},
        {"stiffness_scale: { value: 1.1 }", "stiffness_scale: { value: 7 }", "2: stiffness_scale: value 7 is not between"},
        {"supply_scale: { value: 0.95", "supply_scale: { value: nan", "3: value: 'nan' is no finite number"},
        {"0.95, unit: \"1\"", "0.95, unit: kPa", "3: supply_scale: is a ratio"},
        {"supply_scale", "supply", "3: Unexpected key: supply"},
        {"name: creep", "name: crepe", "5: name: there is no effect 'crepe'; there are: chamber_asymmetry"},
        {"form: 1", "form: 9", "5: form: creep has the forms 0 to"},
        {"form: 1", "form: 1.5", "5: form: '1.5' is no whole number"},
        {"form: 1", "form: -1", "5: form: '-1' is no whole number"},
        {"form: 1", "chamber: 1", "5: chamber: creep takes no chamber (0), not 1"},
        {"form: 1", "onset_s: -2", "5: onset_s: -2 s is before"},
        {"form: 1", "latent: 2", "5: latent: creep takes 0 or 1, not 2"},
        {"    chamber: 2\n", "    chamber: 2\n    latent: 1\n", "10: latent: valve_sluggish remembers nothing"},
        {"value: 0.1", "value: 0.9", "8: value: amplitude of creep takes 0 to 0.5, not 0.9"},
        {"value: 2,", "value: .inf,", "9: value: '.inf' is no finite number"},
        {"value: 2,", "value: 2ms,", "9: value: '2ms' is no finite number (in SI units, without its unit)"},
        {"low: 0.4", "low: few", "13: low: 'few' is no finite number"},
        {"unit: \"s\"", "unit: \"ms\"", "9: unit: time_constant of creep is in \"s\", not \"ms\""},
        {"name: time_constant", "name: time", "9: name: creep has no parameter 'time'"},
        {"name: time_constant", "name: amplitude", "9: amplitude: this parameter of creep is given twice"},
        {"      - { name: time_constant, value: 2, unit: \"s\" }\n", "", "5: parameters: creep has a parameter time_constant"},
        {"    chamber: 2\n", "", "10: chamber: valve_sluggish takes 1 to 3, not 0"},
        {"chamber: 2", "chamber: 4", "10: chamber: valve_sluggish takes 1 to 3, not 4"},
        {"chamber: 2", "form: 1", "10: form: valve_sluggish has one form only"},
        {"value: 0.5,", "value: 0,", "13: value: flow_scale of valve_sluggish takes 0.2 to 1.2, not 0"},
        {"value: 0.5,", "", "13: Missing required mapping field: value"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        static struct calibration calibration;
        char error[2048];
        write_changed(cases[i].from, cases[i].to);
        if (calibration_read(path, MODULE, &calibration, error, sizeof error)) {
            fail_msg("'%s' for '%s' is accepted", cases[i].to, cases[i].from);
        }
        if (strncmp(error, path, strlen(path)) != 0 || strstr(error, cases[i].message) == NULL) {
            fail_msg("'%s' for '%s': wanted '%s' in '%s'", cases[i].to, cases[i].from, cases[i].message, error);
        }
    }
}

static void a_file_that_is_not_there_is_said_to_be_missing(void **state) {
    (void)state;
    static struct calibration calibration;
    char error[1024];
    assert_false(calibration_read("no/such/found.yaml", MODULE, &calibration, error, sizeof error));
    assert_non_null(strstr(error, "no/such/found.yaml: No such file"));
}

static void every_effect_is_used_or_has_a_reason_and_is_in_the_documentation(void **state) {
    (void)state;
    char error[1024], name[64];
    size_t size = 0;
    char *page = (char *)input_file_read("docs/calibration.md", &size, error, sizeof error);
    assert_non_null(page);
    for (size_t i = 0; i < effect_kind_count(); i++) {
        const struct effect_kind *kind = effect_kind_at(i);
        const char *why_not = calibration_why_unused(kind);
        if (why_not != NULL && strstr(why_not, "nobody") != NULL) {
            fail_msg("calibration_use.c has no row for %s", kind->name);
        }
        (void)snprintf(name, sizeof name, "`%s`", kind->name);
        if (memmem(page, size, name, strlen(name)) == NULL) {
            fail_msg("docs/calibration.md does not name %s", kind->name);
        }
    }
    free(page);
}

/* --- the calibrated table --- */

static struct calibration plain(void) {
    static struct calibration calibration;
    memset(&calibration, 0, sizeof calibration);
    (void)snprintf(calibration.module, sizeof calibration.module, "%s", MODULE);
    calibration.stiffness_scale = 1.0;
    calibration.supply_scale = 1.0;
    return calibration;
}

static void add_effect(struct calibration *calibration, const char *text) {
    char error[256];
    assert_true(calibration->effects < CALIBRATION_EFFECTS_MAX);
    if (!effect_parse(text, &calibration->effect[calibration->effects++], error, sizeof error)) {
        fail_msg("%s", error);
    }
}

static void make_controller(struct calibrated_controller *controller, const struct calibration *calibration) {
    char error[256];
    if (!calibrated_controller_make(controller, calibration, &file.table, error, sizeof error)) {
        fail_msg("%s", error);
    }
}

/* Of a module that is so and a table that says so: the same bends. */
static void the_calibrated_table_bends_like_the_calibrated_module(void **state) {
    (void)state;
    static struct plant plant;
    static struct calibrated_controller controller;
    static struct calibration calibration;
    const double pressures_pa[][3] = {{0, 0, 0}, {6000, 0, 0}, {0, 7000, 0}, {2000, 6500, 1000}, {500, 4000, 6000}};
    struct plant_parameters parameters;
    calibration = plain();
    calibration.stiffness_scale = 1.15;
    add_effect(&calibration, "chamber_asymmetry:gain=1.1,azimuth=0.15,chamber=2");
    add_effect(&calibration, "end_restraint:fraction=0.9");
    make_controller(&controller, &calibration);
    assert_int_equal(controller.notes, 0);
    plant_default_parameters(&parameters);
    calibration_scale_plant(&calibration, &parameters);
    plant_init(&plant, &file.table, &parameters);
    for (size_t e = 0; e < calibration.effects; e++) {
        assert_true(plant_add_effect(&plant, &calibration.effect[e]));
    }
    for (size_t i = 0; i < sizeof pressures_pa / sizeof pressures_pa[0]; i++) {
        struct body_shape shape;
        plant_sample_tip(&plant, pressures_pa[i], 0.0, 0.01, 1.0);
        body_shape_at(&controller.table.table, pressures_pa[i], &shape);
        assert_close(shape.bend_x_rad, plant.shape.bend_x_rad, 1e-3);
        assert_close(shape.bend_y_rad, plant.shape.bend_y_rad, 1e-3);
    }
    calibrated_controller_free(&controller);
}

static void a_calibration_lowers_limits_and_never_raises_them(void **state) {
    (void)state;
    static struct calibrated_controller controller;
    static struct calibration calibration;
    const struct bend_table_module *nominal = &file.table.module;
    calibration = plain();
    calibration.stiffness_scale = 1.5;
    make_controller(&controller, &calibration);
    assert_close((double)controller.table.table.module.working_pressure_pa, (double)nominal->working_pressure_pa, 0.0);
    assert_close((double)controller.table.table.module.burst_pressure_pa, (double)nominal->burst_pressure_pa, 0.0);
    assert_relative((double)controller.table.table.axis_pa[0][controller.table.table.nodes[0] - 1],
                    1.5 * (double)file.table.axis_pa[0][file.table.nodes[0] - 1], 1e-6);
    assert_true(controller.table.table.module.inputs_hash != nominal->inputs_hash);
    calibrated_controller_free(&controller);
    calibration.stiffness_scale = 0.6;
    make_controller(&controller, &calibration);
    assert_relative((double)controller.table.table.module.working_pressure_pa, 0.6 * (double)nominal->working_pressure_pa,
                    1e-6);
    assert_relative((double)controller.parameters.limits.working_pressure_pa, 0.6 * (double)nominal->working_pressure_pa,
                    1e-6);
    assert_true(controller.parameters.limits.hard_pressure_pa < nominal->burst_pressure_pa);
    calibrated_controller_free(&controller);
}

/* Of a module that snaps: chamber 1 ballooned, at the pressure 3000 Pa + 1e6 Pa/m2 of its volume. */
static double snapping(enum bend_table_channel channel, const double pressure_pa[3]) {
    return channel == BEND_TABLE_PRESSURE_1 ? 3000.0 + 1e6 * pressure_pa[0] : synthetic_module(channel, pressure_pa);
}

static void a_snap_comes_at_so_many_times_the_pressure(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct table_scaled scaled;
    struct table_scales scales;
    struct bend_table before, after;
    char error[256];
    synthetic_table_create(&synthetic, 5, 8000.0, 1.0, synthetic_module);
    synthetic_table_add_ballooned(&synthetic, 5, 1e-4, 1e-3, 2000.0, 9000.0f, 4000.0f, snapping);
    table_scales_none(&scales);
    scales.stiffness = 1.25;
    if (!table_scaled(&scaled, &synthetic.table, &scales, error, sizeof error)) {
        fail_msg("%s", error);
    }
    assert_close((double)scaled.table.module.jump_up_pa, 1.25 * 9000.0, 1e-3);
    assert_close((double)scaled.table.module.jump_down_pa, 1.25 * 4000.0, 1e-3);
    assert_true(bend_table_ballooned(&synthetic.table, &before));
    assert_true(bend_table_ballooned(&scaled.table, &after));
    const size_t last = (size_t)before.nodes[0] * before.nodes[1] * before.nodes[2] - 1;
    assert_memory_equal(after.axis_pa[0], before.axis_pa[0], before.nodes[0] * sizeof(float));
    assert_relative((double)after.axis_pa[2][after.nodes[2] - 1], 1.25 * (double)before.axis_pa[2][before.nodes[2] - 1],
                    1e-6);
    assert_relative((double)after.channel[BEND_TABLE_PRESSURE_1][last],
                    1.25 * (double)before.channel[BEND_TABLE_PRESSURE_1][last], 1e-6);
    table_scaled_free(&scaled);
    synthetic_table_free(&synthetic);
}

/* --- the calibrated controller --- */

static void a_calibration_that_changes_nothing_keeps_every_bit(void **state) {
    (void)state;
    static struct calibrated_controller controller;
    static struct calibration calibration;
    static struct sim_link links[2];
    struct sim_link_setup setups[2];
    struct link interfaces[2];
    calibration = plain();
    add_effect(&calibration, "pressure_gain:gain=1");
    add_effect(&calibration, "line_resistance:conductance_scale=1");
    add_effect(&calibration, "creep:amplitude=0");
    add_effect(&calibration, "tip_lever_arm:x=0,y=0,z=0");
    make_controller(&controller, &calibration);
    assert_int_equal(controller.table.table.image_bytes, file.size);
    assert_memory_equal(controller.table.image, file.bytes, file.size);
    for (size_t k = 0; k < 2; k++) {
        sim_link_default_setup(&setups[k], &file.table, 5);
    }
    setups[1].controller_table = &controller.table.table;
    setups[1].controller = controller.parameters;
    calibration_scale_plant(&calibration, &setups[1].sim.plant);
    for (size_t k = 0; k < 2; k++) {
        sim_link_open_setup(&links[k], &setups[k], &interfaces[k]);
    }
    for (int i = 0; i < 3000; i++) {
        const struct controller_command command = {
            .kind = COMMAND_BEND, .bend_rad = 0.9f, .direction_rad = 1e-3f * (float)i};
        struct link_report reports[2];
        for (size_t k = 0; k < 2; k++) {
            if (i >= 50 && i % 50 == 0) {
                assert_true(interfaces[k].send(interfaces[k].context, &command));
            }
            assert_true(interfaces[k].receive(interfaces[k].context, &reports[k]));
        }
        assert_memory_equal(reports[0].duty, reports[1].duty, sizeof reports[0].duty);
        assert_memory_equal(reports[0].status.pressure_estimate_pa, reports[1].status.pressure_estimate_pa,
                            sizeof reports[0].status.pressure_estimate_pa);
        assert_memory_equal(&reports[0].status.direction_rad, &reports[1].status.direction_rad, sizeof(float));
    }
    calibrated_controller_free(&controller);
}

/* In the order in which the controller takes them back. */
static void poses_are_corrected_for_what_the_tip_sensor_adds(void **state) {
    (void)state;
    static struct plant plant;
    static struct calibrated_controller controller;
    static struct calibration calibration;
    const double pressure_pa[3] = {1000.0, 6000.0, 4000.0};
    struct calibration_frames frames;
    struct plant_parameters parameters;
    float position_m[3], quaternion[4];
    calibration = plain();
    add_effect(&calibration, "tip_lever_arm:x=0.004,y=-0.003,z=0.01");
    add_effect(&calibration, "tip_misalignment:x=0.1,y=-0.2,z=0.3");
    add_effect(&calibration, "tip_offset:x=0.001,y=0.002,z=-0.003");
    add_effect(&calibration, "tip_misalignment:form=1,x=-0.1,y=0.05,z=0.2");
    make_controller(&controller, &calibration);
    plant_default_parameters(&parameters);
    plant_init(&plant, &file.table, &parameters);
    plant_sample_tip(&plant, pressure_pa, 0.0, 0.01, 1.0);
    const struct tip_pose truth = plant.pose;
    for (size_t e = 0; e < calibration.effects; e++) {
        assert_true(plant_add_effect(&plant, &calibration.effect[e]));
    }
    plant_sample_tip(&plant, pressure_pa, 0.01, 0.01, 1.0);
    for (size_t i = 0; i < 4; i++) {
        quaternion[i] = (float)plant.pose.quaternion[i];
        position_m[i % 3] = (float)plant.pose.position_m[i % 3];
    }
    calibration_frames_of(&controller.parameters.calibration, &frames);
    calibration_pose(&frames, position_m, quaternion);
    for (size_t i = 0; i < 3; i++) {
        assert_close((double)position_m[i], truth.position_m[i], 1e-7);
    }
    for (size_t i = 0; i < 4; i++) {
        assert_close((double)quaternion[i], truth.quaternion[i], 1e-6);
    }
    calibrated_controller_free(&controller);
}

static void what_the_controller_cannot_use_is_said(void **state) {
    (void)state;
    static struct calibrated_controller controller;
    static struct calibration calibration;
    calibration = plain();
    add_effect(&calibration, "mullins");
    add_effect(&calibration, "creep:form=2");
    add_effect(&calibration, "tip_latency:delay=0.1");
    add_effect(&calibration, "valve_sluggish:chamber=2,onset=12");
    make_controller(&controller, &calibration);
    assert_int_equal(controller.notes, 4);
    assert_non_null(strstr(controller.note[0], "mullins: the controller cannot use it"));
    assert_non_null(strstr(controller.note[1], "creep, form 2"));
    assert_non_null(strstr(controller.note[2], "tip_latency"));
    assert_non_null(strstr(controller.note[3], "sets in at 12 s"));
    assert_int_equal(controller.parameters.calibration.tip_late_us, 45000);
    assert_close((double)controller.parameters.calibration.fill_scale[1], 0.6, 1e-6);
    calibrated_controller_free(&controller);
}

/* --- the gap closes --- */

/* A bend that swings between 10 and 60 degrees every 15 s while its direction turns, or three pressures that swing. */
static void swing(struct close_recording *recording, enum close_kind kind, double duration_s) {
    const double command_s = 0.02, rest_s = 1.0; /* of which a controller tests itself for half */
    const size_t count = (size_t)((rest_s + duration_s) / command_s);
    memset(recording, 0, sizeof *recording);
    recording->kind = kind;
    recording->duration_us = llround(1e6 * (rest_s + duration_s));
    recording->command = calloc(count, sizeof *recording->command);
    assert_non_null(recording->command);
    for (size_t i = 0; i < count; i++) {
        const double since_s = command_s * (double)i, time_s = since_s - rest_s, phase = 2.0 * M_PI * time_s;
        struct controller_command command = {.kind = kind == CLOSE_BEND ? COMMAND_BEND : COMMAND_PRESSURE};
        command.kind = since_s < rest_s ? COMMAND_VENT : command.kind;
        command.bend_rad = (float)(DEGREE * (35.0 - 25.0 * cos(phase / 15.0)));
        command.direction_rad = (float)(DEGREE * (-30.0 + 12.0 * time_s));
        for (size_t c = 0; c < 3 && kind == CLOSE_PRESSURE; c++) {
            command.pressure_pa[c] = (float)(4500.0 - 2500.0 * cos(phase / (12.0 + 3.0 * (double)c)));
        }
        recording->command[recording->count++] = (struct close_command){llround(1e6 * since_s), command};
    }
}

struct closing {
    double stiffness_scale;
    double supply_scale;
    const char *effects[3];
    enum close_kind kind;
    enum close_feedback feedback;
    enum close_quantity quantity;
    double before_least; /* the gap is one: before over that without gap */
    double ratio_most;   /* after over before */
};

static void check_closing(const struct closing *closing) {
    static struct calibrated_controller controller;
    static struct calibration calibration;
    static struct close_result result;
    struct close_recording recording;
    char error[256];
    calibration = plain();
    calibration.stiffness_scale = closing->stiffness_scale;
    calibration.supply_scale = closing->supply_scale;
    for (size_t e = 0; e < 3 && closing->effects[e] != NULL; e++) {
        add_effect(&calibration, closing->effects[e]);
    }
    swing(&recording, closing->kind, 15.0);
    make_controller(&controller, &calibration);
    assert_true(close_run(&result, &recording, &file.table, &calibration, &controller, 2, error, sizeof error));
    const struct close_figure *figure = result.figure[closing->feedback][CLOSE_WHOLE][closing->quantity];
    const double in_unit = closing->quantity == CLOSE_PRESSURE_PA ? 1e-3 : 1.0 / DEGREE;
    print_message("           x %.2f, supply x %.2f, %s%s%s: before %.3f, after %.3f, without gap %.3f %s%s\n",
                  closing->stiffness_scale, closing->supply_scale, closing->effects[0] != NULL ? closing->effects[0] : "",
                  closing->effects[1] != NULL ? " and " : "", closing->effects[1] != NULL ? closing->effects[1] : "",
                  in_unit * figure[CLOSE_BEFORE].mean, in_unit * figure[CLOSE_AFTER].mean,
                  in_unit * figure[CLOSE_WITHOUT_GAP].mean, closing->quantity == CLOSE_PRESSURE_PA ? "kPa" : "deg",
                  closing->feedback == CLOSE_NO_TIP_SENSOR ? ", no tip sensor" : "");
    for (size_t v = 0; v < CLOSE_VARIANTS; v++) {
        assert_int_equal(figure[v].seeds, 2);
        assert_int_equal(result.faults[closing->feedback][v], 0);
    }
    assert_true(figure[CLOSE_BEFORE].mean > closing->before_least * figure[CLOSE_WITHOUT_GAP].mean);
    assert_under(figure[CLOSE_AFTER].mean, closing->ratio_most * figure[CLOSE_BEFORE].mean);
    close_recording_free(&recording);
    calibrated_controller_free(&controller);
}

static void a_controller_that_knows_the_module_follows_better(void **state) {
    (void)state;
    static const struct closing cases[] = {
        {1.25, 1.0, {NULL}, CLOSE_BEND, CLOSE_TIP_SENSOR, CLOSE_BEND_RAD, 3.0, 0.3},
        {1.25, 1.0, {NULL}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 10.0, 0.1},
        {0.8, 1.0, {NULL}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 10.0, 0.1},
        {1.0, 1.0, {"pressure_offset:offset=900"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 10.0, 0.1},
        {1.0, 1.0, {"pressure_offset:offset=900"}, CLOSE_PRESSURE, CLOSE_TIP_SENSOR, CLOSE_PRESSURE_PA, 2.0, 0.7},
        {1.0, 1.0, {"pressure_offset:offset=-900"}, CLOSE_PRESSURE, CLOSE_TIP_SENSOR, CLOSE_PRESSURE_PA, 2.0, 0.7},
        {1.0, 1.0, {"pressure_gain:gain=1.1"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 5.0, 0.2},
        {1.0, 1.0, {"line_resistance:conductance_scale=0.4"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 1.5, 0.8},
        {1.0, 1.0, {"line_resistance:form=1,conductance_scale=0.4"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 1.5, 0.9},
        {1.0, 1.0, {"valve_dead_band:least_duty=0.25,loss=0.4"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 1.1, 0.9},
        {1.0, 1.0, {"chamber_asymmetry:gain=1.12,azimuth=0.1,chamber=2"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD,
         5.0, 0.2},
        {1.0, 1.0, {"end_restraint:fraction=0.88"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 5.0, 0.2},
        {1.0, 1.0, {"creep:amplitude=0.12,time_constant=2"}, CLOSE_BEND, CLOSE_NO_TIP_SENSOR, CLOSE_BEND_RAD, 3.0, 0.3},
        {1.0, 1.0, {"tip_misalignment:x=0.08,y=-0.06,z=0.05"}, CLOSE_BEND, CLOSE_TIP_SENSOR, CLOSE_BEND_RAD, 3.0, 0.3},
        {1.0, 1.0, {"tip_misalignment:form=1,x=0.05,z=0.1"}, CLOSE_BEND, CLOSE_TIP_SENSOR, CLOSE_DIRECTION_RAD, 2.0, 0.6},
        {1.2, 0.85, {"pressure_offset:offset=900", "line_resistance:conductance_scale=0.5"}, CLOSE_BEND, CLOSE_TIP_SENSOR,
         CLOSE_BEND_RAD, 3.0, 0.3},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        check_closing(&cases[i]);
    }
}

/* Hears its sensor say 2500 Pa of a vented chamber; the self-test waits for less than 2000. */
static void a_controller_that_knows_its_sensors_zero_comes_out_of_the_self_test(void **state) {
    (void)state;
    static struct calibrated_controller controller;
    static struct calibration calibration;
    static struct close_result result;
    struct close_recording recording;
    char error[256];
    calibration = plain();
    add_effect(&calibration, "pressure_offset:offset=2500");
    swing(&recording, CLOSE_PRESSURE, 4.0);
    make_controller(&controller, &calibration);
    assert_true(close_run(&result, &recording, &file.table, &calibration, &controller, 1, error, sizeof error));
    assert_true(result.never_ready[CLOSE_TIP_SENSOR][CLOSE_BEFORE]);
    assert_false(result.never_ready[CLOSE_TIP_SENSOR][CLOSE_AFTER]);
    assert_int_equal(result.figure[CLOSE_TIP_SENSOR][CLOSE_WHOLE][CLOSE_PRESSURE_PA][CLOSE_AFTER].seeds, 1);
    assert_true(isnan(close_share(result.figure[CLOSE_TIP_SENSOR][CLOSE_WHOLE][CLOSE_PRESSURE_PA])));
    close_recording_free(&recording);
    calibrated_controller_free(&controller);
}

/* An effect that sets in after 3 s: errors count from then on. */
static void errors_count_from_the_last_onset_on(void **state) {
    (void)state;
    static struct calibrated_controller controller;
    static struct calibration calibration;
    static struct close_result result;
    struct close_recording recording;
    char error[256];
    calibration = plain();
    add_effect(&calibration, "pressure_gain:gain=1.05,onset=3");
    swing(&recording, CLOSE_BEND, 6.0);
    recording.start_s = 1.0;
    make_controller(&controller, &calibration);
    assert_int_equal(controller.notes, 1);
    assert_true(close_run(&result, &recording, &file.table, &calibration, &controller, 1, error, sizeof error));
    assert_close(result.measured_from_s, 3.0, 1e-9);
    const struct close_figure *figure = result.figure[CLOSE_NO_TIP_SENSOR][CLOSE_WHOLE][CLOSE_BEND_RAD];
    assert_under(figure[CLOSE_AFTER].mean, 0.7 * figure[CLOSE_BEFORE].mean);
    assert_true(close_share(figure) > 0.8);
    close_recording_free(&recording);
    calibrated_controller_free(&controller);
}

/* --- recorded commands --- */

static void commands_are_taken_from_the_log(void **state) {
    (void)state;
    struct close_recording recording;
    char error[1024];
    write_text("# tribend-run 1\n# module: paper-semicircle\ntime_s,supply_pa,bend_cmd_rad,direction_cmd_rad,p1_cmd_pa\n"
               "5.003,40000,,,0\n5.1,40010,0.5,1,100\n5.2,40000,0.5,1,200\n5.3,40000,0.6,1,200\n5.4,40000,,,0\n");
    assert_true(close_recording_read(&recording, path, error, sizeof error));
    assert_int_equal(recording.kind, CLOSE_BEND);
    assert_string_equal(recording.module, MODULE);
    assert_true(recording.supply_measured);
    assert_close(recording.start_s, 5.0, 1e-9);
    assert_int_equal(recording.duration_us, 400000);
    assert_int_equal(recording.count, 4);
    assert_int_equal(recording.command[0].command.kind, COMMAND_VENT);
    assert_int_equal(recording.command[1].time_us, 100000);
    assert_int_equal(recording.command[1].command.kind, COMMAND_BEND);
    assert_int_equal(recording.command[2].time_us, 300000);
    assert_int_equal(recording.command[3].command.kind, COMMAND_VENT);
    close_recording_free(&recording);
    write_text("# tribend-run 1\ntime_s,supply_pa,p1_cmd_pa,p3_cmd_pa\n0,40000,1000,\n0.1,40000,,500\n0.2,40000,1000,500\n");
    assert_true(close_recording_read(&recording, path, error, sizeof error));
    assert_int_equal(recording.kind, CLOSE_PRESSURE);
    assert_false(recording.supply_measured);
    assert_int_equal(recording.count, 2);
    assert_close((double)recording.command[1].command.pressure_pa[0], 1000.0, 0.0);
    assert_close((double)recording.command[1].command.pressure_pa[1], 0.0, 0.0);
    assert_close((double)recording.command[1].command.pressure_pa[2], 500.0, 0.0);
    close_recording_free(&recording);
}

static void a_log_without_a_command_is_refused(void **state) {
    (void)state;
    struct close_recording recording;
    char error[1024];
    write_text("# tribend-run 1\ntime_s,valve1,p1_pa\n0,0,0\n1,0.5,200\n");
    assert_false(close_recording_read(&recording, path, error, sizeof error));
    assert_non_null(strstr(error, "no command was recorded"));
    write_text("# tribend-run 1\ntime_s,bend_cmd_rad\n0,0.1\n1,0.5\n");
    assert_false(close_recording_read(&recording, path, error, sizeof error));
    assert_non_null(strstr(error, "column direction_cmd_rad: it is empty at 0 s"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_a_diagnosis_writes_is_read_back),
        cmocka_unit_test(what_is_optional_may_be_left_out),
        cmocka_unit_test(bad_files_are_refused_with_line_and_key),
        cmocka_unit_test(a_file_that_is_not_there_is_said_to_be_missing),
        cmocka_unit_test(every_effect_is_used_or_has_a_reason_and_is_in_the_documentation),
        cmocka_unit_test(the_calibrated_table_bends_like_the_calibrated_module),
        cmocka_unit_test(a_calibration_lowers_limits_and_never_raises_them),
        cmocka_unit_test(a_snap_comes_at_so_many_times_the_pressure),
        cmocka_unit_test(a_calibration_that_changes_nothing_keeps_every_bit),
        cmocka_unit_test(poses_are_corrected_for_what_the_tip_sensor_adds),
        cmocka_unit_test(what_the_controller_cannot_use_is_said),
        cmocka_unit_test(a_controller_that_knows_the_module_follows_better),
        cmocka_unit_test(a_controller_that_knows_its_sensors_zero_comes_out_of_the_self_test),
        cmocka_unit_test(errors_count_from_the_last_onset_on),
        cmocka_unit_test(commands_are_taken_from_the_log),
        cmocka_unit_test(a_log_without_a_command_is_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
