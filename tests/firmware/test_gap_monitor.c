/* The gap monitor on the simulated module: silent on the nominal one, and the right stage where something is wrong.
 * Most of what is wrong is put between plant and controller, in readings, poses and duties. */
#include "support/test.h"

#include "safety/gap_monitor.h"
#include "support/rig.h"

#define DEGREES (180.0 / M_PI)

/* --- what stands between plant and controller --- */

static struct {
    struct hal plant;
    float pressure_offset_pa[3];
    float position_offset_m[3];
    double tilt_rad;         /* the sensor sits turned about the tip's own y axis */
    float duty_added[3];     /* to an energised valve: negative opens late */
    float leak_duty[3];      /* of a valve that should be shut */
} tap;

static bool tap_read_pressures(void *context, struct hal_pressures *pressures) {
    const bool read = tap.plant.read_pressures(context, pressures);
    for (size_t c = 0; c < 3; c++) {
        pressures->chamber_pa[c] += tap.pressure_offset_pa[c];
    }
    return read;
}

static bool tap_read_tip(void *context, struct hal_tip_sample *sample) {
    if (!tap.plant.read_tip(context, sample)) {
        return false;
    }
    const double w = (double)sample->quaternion[0], x = (double)sample->quaternion[1];
    const double y = (double)sample->quaternion[2], z = (double)sample->quaternion[3];
    const double c = cos(0.5 * tap.tilt_rad), s = sin(0.5 * tap.tilt_rad);
    sample->quaternion[0] = (float)(w * c - y * s);
    sample->quaternion[1] = (float)(x * c - z * s);
    sample->quaternion[2] = (float)(y * c + w * s);
    sample->quaternion[3] = (float)(z * c + x * s);
    for (size_t i = 0; i < 3; i++) {
        sample->position_m[i] += tap.position_offset_m[i];
    }
    return true;
}

static bool tap_write_outputs(void *context, const struct hal_outputs *outputs) {
    struct hal_outputs changed = *outputs;
    for (size_t c = 0; c < 3; c++) {
        const float duty = outputs->duty[c] > 0.0f ? outputs->duty[c] + tap.duty_added[c] : tap.leak_duty[c];
        changed.duty[c] = fminf(fmaxf(duty, 0.0f), 1.0f);
    }
    return tap.plant.write_outputs(context, &changed);
}

static void start(struct rig *rig, uint64_t seed) {
    rig_start(rig, &rig_file.table, seed);
    memset(&tap, 0, sizeof tap);
    tap.plant = rig->sim.tapped;
    rig->sim.tapped.read_pressures = tap_read_pressures;
    rig->sim.tapped.read_tip = tap_read_tip;
    rig->sim.tapped.write_outputs = tap_write_outputs;
}

static void add_effect(struct rig *rig, const char *text) {
    struct effect effect;
    char error[256];
    assert_true(effect_parse(text, &effect, error, sizeof error));
    assert_true(sim_add_effect(&rig->sim.sim, &effect));
}

/* --- what the monitor says --- */

static bool warns(const struct rig *rig) {
    return (rig->report.status.warnings & (1u << WARNING_MODEL_GAP)) != 0u;
}

/* Runs on; nothing but `stage` may be named, which is named at the end. */
static void run_with(struct rig *rig, enum gap_monitor_stage stage, int milliseconds) {
    for (int i = 0; i < milliseconds; i++) {
        rig_step(rig);
        const struct gap_monitor_report *gap = &rig->report.status.gap;
        assert_int_equal(warns(rig), gap->stage != GAP_MONITOR_NONE);
        if (gap->stage != GAP_MONITOR_NONE && gap->stage != stage) {
            fail_msg("%.2f s: %s, expected %s", 1e-6 * (double)rig->report.time_us, gap_monitor_stage_text(gap->stage),
                     gap_monitor_stage_text(stage));
        }
    }
    assert_int_equal(rig->report.status.gap.stage, stage);
}

/* Until `stage` is named, within `most_s`, and nothing else before; seconds that it took. */
static double time_to_name(struct rig *rig, enum gap_monitor_stage stage, double most_s) {
    const int64_t from_us = rig->report.time_us;
    const int64_t to_us = from_us + (int64_t)(1e6 * most_s);
    while (rig->report.status.gap.stage == GAP_MONITOR_NONE && rig->report.time_us < to_us) {
        rig_step(rig);
    }
    const struct gap_monitor_report *gap = &rig->report.status.gap;
    if (gap->stage != stage) {
        fail_msg("%.2f s: %s, expected %s", 1e-6 * (double)rig->report.time_us, gap_monitor_stage_text(gap->stage),
                 gap_monitor_stage_text(stage));
    }
    assert_true(warns(rig));
    return 1e-6 * (double)(rig->report.time_us - from_us);
}

/* --- missions --- */

static uint64_t random_state;

static double random_to(double most) {
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return most * (double)(random_state >> 40) / 16777216.0;
}

static struct controller_command next_command(void) {
    const double kind = random_to(1.0);
    struct controller_command command = rig_bend(random_to(105.0), random_to(360.0) - 180.0);
    if (kind > 0.9) {
        command = (struct controller_command){.kind = COMMAND_VENT};
    } else if (kind > 0.75) {
        command = rig_pressure(random_to(9000.0), random_to(9000.0), random_to(9000.0));
    } else if (kind < 0.1) {
        command.co_contraction_pa = (float)random_to(3000.0);
    }
    return command;
}

/* A minute of bends in every direction, pressures, co-contraction and vents, held for 0.2 to 10 s each. */
static void run_mission(struct rig *rig, enum gap_monitor_stage stage, uint64_t seed) {
    random_state = seed;
    int next_ms = 0;
    for (int i = 0; i < 60000; i++) {
        if (i == next_ms) {
            const struct controller_command command = next_command();
            rig_command(rig, &command);
            next_ms += (int)(200.0 + random_to(1.0) * random_to(10000.0));
        }
        rig_step(rig);
        const struct gap_monitor_report *gap = &rig->report.status.gap;
        if (gap->stage != GAP_MONITOR_NONE && gap->stage != stage) {
            fail_msg("seed %d, %.2f s: %s", (int)seed, 1e-6 * (double)rig->report.time_us,
                     gap_monitor_stage_text(gap->stage));
        }
    }
}

static void the_nominal_module_raises_nothing(void **state) {
    (void)state;
    static struct rig rig;
    for (uint64_t seed = 1; seed <= 16; seed++) {
        start(&rig, seed);
        run_mission(&rig, GAP_MONITOR_NONE, seed);
        assert_false(warns(&rig));
    }
}

static void the_nominal_module_at_rest_and_held_raises_nothing(void **state) {
    (void)state;
    static struct rig rig;
    for (int bend_deg = 0; bend_deg <= 90; bend_deg += 30) {
        const struct controller_command command = rig_bend(bend_deg, 47.0 * bend_deg);
        start(&rig, 100u + (uint64_t)bend_deg);
        rig_command(&rig, &command);
        run_with(&rig, GAP_MONITOR_NONE, 60000);
    }
}

/* --- stages --- */

static void creep_is_the_bodys(void **state) {
    (void)state;
    static struct rig rig;
    double most_s = 0.0;
    for (int d = 0; d < 8; d++) {
        const struct controller_command bend = rig_bend(60.0, -170.0 + 45.0 * d), vent = {.kind = COMMAND_VENT};
        start(&rig, 200u + (uint64_t)d);
        add_effect(&rig, "creep:amplitude=0.1,time_constant=2");
        rig_command(&rig, &bend);
        most_s = fmax(most_s, time_to_name(&rig, GAP_MONITOR_BODY, 5.0));
        run_with(&rig, GAP_MONITOR_BODY, 5000);
        rig_command(&rig, &vent); /* straight again, it cannot be seen that the body is well */
        run_with(&rig, GAP_MONITOR_BODY, 15000);
    }
    print_message("           creep of a tenth: named after at most %.1f s\n", most_s);
}

static void slow_creep_is_the_bodys_through_a_mission(void **state) {
    (void)state;
    static struct rig rig;
    for (uint64_t seed = 1; seed <= 6; seed++) {
        start(&rig, seed);
        add_effect(&rig, "creep:amplitude=0.15,time_constant=4");
        run_mission(&rig, GAP_MONITOR_BODY, seed);
        assert_int_equal(rig.report.status.gap.stage, GAP_MONITOR_BODY);
    }
}

static void a_reading_where_a_chamber_has_vented_is_the_pressure_sensors(void **state) {
    (void)state;
    static struct rig rig;
    const double offsets_pa[] = {200.0, 700.0, 1100.0, 1900.0, -300.0};
    double most_s = 0.0;
    for (size_t i = 0; i < sizeof offsets_pa / sizeof offsets_pa[0]; i++) {
        for (uint32_t c = 0; c < 3; c++) {
            start(&rig, 300u + c);
            tap.pressure_offset_pa[c] = (float)offsets_pa[i];
            most_s = fmax(most_s, time_to_name(&rig, GAP_MONITOR_PRESSURE_SENSOR, 10.0));
            assert_int_equal(rig.report.status.gap.chamber, c + 1u);
            const struct controller_command bend = rig_bend(60.0, 120.0 * c);
            rig_command(&rig, &bend); /* at work it cannot be seen; it is not forgotten */
            run_with(&rig, GAP_MONITOR_PRESSURE_SENSOR, 5000);
            assert_int_equal(rig.report.status.gap.chamber, c + 1u);
        }
    }
    print_message("           reading while vented: named after at most %.1f s\n", most_s);
}

/* What is to be seen here is a fault by now, which vents: not with this. */
static void let_the_valves_be(struct rig *rig) {
    rig->sim.app.controller.parameters.flow_watch.most_pa = 1e9f;
    controller_seal_parameters(&rig->sim.app.controller);
}

static void an_offset_at_work_is_the_bodys_until_the_module_has_vented(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command bend = rig_bend(60.0, 180.0), vent = {.kind = COMMAND_VENT};
    start(&rig, 310);
    let_the_valves_be(&rig);
    rig_command(&rig, &bend);
    run_with(&rig, GAP_MONITOR_NONE, 3000);
    tap.pressure_offset_pa[0] = 700.0f;
    rig_run(&rig, 4000);
    assert_int_equal(rig.report.status.gap.stage, GAP_MONITOR_BODY);
    rig_command(&rig, &vent);
    rig_run(&rig, 10000);
    assert_int_equal(rig.report.status.gap.stage, GAP_MONITOR_PRESSURE_SENSOR);
    assert_int_equal(rig.report.status.gap.chamber, 1);
}

static void a_displaced_position_is_the_tip_sensors(void **state) {
    (void)state;
    static struct rig rig;
    double most_s = 0.0;
    for (int d = 0; d < 8; d++) {
        const struct controller_command bend = rig_bend(15.0 * d, 50.0 * d);
        start(&rig, 400u + (uint64_t)d);
        tap.position_offset_m[0] = (float)(1e-3 * cos(0.25 * M_PI * d + 50.0 * d / DEGREES + 0.5 * M_PI));
        tap.position_offset_m[1] = (float)(1e-3 * sin(0.25 * M_PI * d + 50.0 * d / DEGREES + 0.5 * M_PI));
        rig_command(&rig, &bend);
        most_s = fmax(most_s, time_to_name(&rig, GAP_MONITOR_TIP_SENSOR, 5.0));
        run_with(&rig, GAP_MONITOR_TIP_SENSOR, 5000);
    }
    print_message("           tip displaced by 1 mm: named after at most %.1f s\n", most_s);
}

static void a_wrong_length_shows_at_rest(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command bend = rig_bend(20.0, 80.0);
    start(&rig, 420);
    tap.position_offset_m[2] = 1e-3f;
    print_message("           tip 1 mm too far out: named after %.1f s of rest\n",
                  time_to_name(&rig, GAP_MONITOR_TIP_SENSOR, 15.0));
    rig_command(&rig, &bend);
    run_with(&rig, GAP_MONITOR_TIP_SENSOR, 5000);
}

static void a_turned_tip_sensor_is_not_taken_for_a_bent_body(void **state) {
    (void)state;
    static struct rig rig;
    for (int d = 0; d < 6; d++) {
        const struct controller_command bend = rig_bend(20.0 * d, 60.0 * d);
        start(&rig, 430u + (uint64_t)d);
        tap.tilt_rad = 4.0 / DEGREES;
        rig_command(&rig, &bend);
        rig_run(&rig, 4000); /* the bend's gap may come first */
        run_with(&rig, GAP_MONITOR_TIP_SENSOR, 4000);
    }
}

static void low_conductance_is_the_valves(void **state) {
    (void)state;
    static struct rig rig;
    double most_s = 0.0;
    for (int d = 0; d < 8; d++) {
        const struct controller_command bend = rig_bend(60.0, -170.0 + 45.0 * d);
        start(&rig, 500u + (uint64_t)d);
        rig.sim.sim.plant.parameters.gas.sonic_conductance *= 0.5;
        rig_command(&rig, &bend);
        most_s = fmax(most_s, time_to_name(&rig, GAP_MONITOR_VALVE, 5.0));
        run_with(&rig, GAP_MONITOR_VALVE, 10000); /* held, a scaled flow balances: not seen, but not forgotten */
    }
    print_message("           half the conductance: named after at most %.1f s\n", most_s);
}

static void low_conductance_is_the_valves_through_a_mission(void **state) {
    (void)state;
    static struct rig rig;
    const double shares[] = {0.2, 0.35, 0.5, 0.7};
    for (uint64_t seed = 1; seed <= 12; seed++) {
        start(&rig, seed);
        rig.sim.sim.plant.parameters.gas.sonic_conductance *= shares[seed % 4];
        run_mission(&rig, GAP_MONITOR_VALVE, seed);
        assert_int_equal(rig.report.status.gap.stage, GAP_MONITOR_VALVE);
    }
}

static void a_valve_that_opens_late_is_named_by_its_chamber(void **state) {
    (void)state;
    static struct rig rig;
    double most_s = 0.0;
    for (uint32_t c = 0; c < 3; c++) {
        const struct controller_command bend = rig_bend(60.0, 180.0 + 120.0 * c + 20.0);
        start(&rig, 510u + c);
        tap.duty_added[c] = -0.06f; /* 0.6 ms of 10 ms */
        rig_command(&rig, &bend);
        most_s = fmax(most_s, time_to_name(&rig, GAP_MONITOR_VALVE, 6.0));
        assert_int_equal(rig.report.status.gap.chamber, c + 1u);
    }
    print_message("           a valve 0.6 ms late: named after at most %.1f s\n", most_s);
}

static void air_in_a_chamber_that_should_be_empty_is_the_valves(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command bend = rig_bend(50.0, 0.0); /* chamber 1 idles */
    start(&rig, 520);
    let_the_valves_be(&rig);
    tap.leak_duty[0] = 0.3f;
    rig_command(&rig, &bend);
    print_message("           air in an idle chamber: named after %.1f s\n",
                  time_to_name(&rig, GAP_MONITOR_VALVE, 10.0));
    assert_int_equal(rig.report.status.gap.chamber, 1);
    run_with(&rig, GAP_MONITOR_VALVE, 5000);
}

static void a_warning_ends_once_the_stage_is_seen_to_do_well(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command bends[2] = {rig_bend(60.0, 40.0), rig_bend(0.0, 40.0)};
    start(&rig, 530);
    const double conductance = rig.sim.sim.plant.parameters.gas.sonic_conductance;
    rig.sim.sim.plant.parameters.gas.sonic_conductance = 0.5 * conductance;
    rig_command(&rig, &bends[0]);
    (void)time_to_name(&rig, GAP_MONITOR_VALVE, 5.0);
    run_with(&rig, GAP_MONITOR_VALVE, 10000);
    rig.sim.sim.plant.parameters.gas.sonic_conductance = conductance;
    run_with(&rig, GAP_MONITOR_VALVE, 10000); /* nothing moves */
    for (int i = 1; i <= 4; i++) {
        rig_command(&rig, &bends[i % 2]);
        rig_run(&rig, 3000);
    }
    assert_int_equal(rig.report.status.gap.stage, GAP_MONITOR_NONE);
    assert_false(warns(&rig));
    tap.position_offset_m[0] = 2e-3f;
    (void)time_to_name(&rig, GAP_MONITOR_TIP_SENSOR, 5.0);
    tap.position_offset_m[0] = 0.0f;
    rig_run(&rig, 6000);
    assert_false(warns(&rig));
}

static void a_warning_changes_no_output(void **state) {
    (void)state;
    static struct rig warned, deaf;
    const struct controller_command bend = rig_bend(60.0, 20.0);
    rig_start(&warned, &rig_file.table, 600);
    rig_start(&deaf, &rig_file.table, 600);
    add_effect(&warned, "creep:amplitude=0.1,time_constant=2");
    add_effect(&deaf, "creep:amplitude=0.1,time_constant=2");
    deaf.sim.app.controller.parameters.gap_monitor.persist_s = 1e9f;
    controller_seal_parameters(&deaf.sim.app.controller);
    rig_command(&warned, &bend);
    rig_command(&deaf, &bend);
    for (int i = 0; i < 8000; i++) {
        rig_step(&warned);
        rig_step(&deaf);
        assert_memory_equal(warned.report.duty, deaf.report.duty, sizeof warned.report.duty);
    }
    assert_true(warns(&warned));
    assert_false(warns(&deaf));
}

/* --- the monitor alone --- */

static void follow_valve_for(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                             float unmodelled_pa, double seconds) {
    for (int i = 0; i < (int)(1000.0 * seconds); i++) {
        struct gap_monitor_pressure pressure[3];
        for (size_t c = 0; c < 3; c++) {
            pressure[c] = (struct gap_monitor_pressure){.reading_pa = 6000.0f,
                                                        .reading_ok = true,
                                                        .estimate_pa = 6000.0f,
                                                        .unmodelled_pa = c == 1 ? unmodelled_pa : 0.0f,
                                                        .capacity_m3 = 5e-4f,
                                                        .vented_us = 0};
        }
        gap_monitor_follow_pressures(monitor, parameters, pressure, 1e-3f);
    }
}

static void a_gap_must_persist(void **state) {
    (void)state;
    struct gap_monitor_parameters parameters;
    struct gap_monitor monitor;
    gap_monitor_default_parameters(&parameters);
    gap_monitor_init(&monitor);
    follow_valve_for(&monitor, &parameters, 0.0f, 30.0); /* the jump of the estimate to 6 kPa is forgotten */
    assert_int_equal(monitor.report.stage, GAP_MONITOR_NONE);
    assert_close((double)monitor.report.pressure_threshold_pa[1], 150.0 + 0.014 * 2.0 / 5e-4, 1.0);
    follow_valve_for(&monitor, &parameters, 1.0f, 1.9); /* toward 2 kPa */
    assert_int_equal(monitor.report.stage, GAP_MONITOR_NONE);
    assert_true(monitor.report.pressure_gap_pa[1] > 1000.0f);
    follow_valve_for(&monitor, &parameters, 1.0f, 0.5);
    assert_int_equal(monitor.report.stage, GAP_MONITOR_VALVE);
    assert_int_equal(monitor.report.chamber, 2);
}

static void follow_pose_at(struct gap_monitor *monitor, const struct gap_monitor_parameters *parameters,
                           float chamber_1_pa, const struct gap_monitor_pose *pose) {
    const float pressure_pa[3] = {chamber_1_pa, 0.0f, 0.0f};
    struct bend_table_stencil stencil;
    bend_table_locate(&rig_file.table, pressure_pa, &stencil);
    gap_monitor_follow_pose(monitor, parameters, &rig_file.table, &stencil, pose);
}

static void thresholds_follow_from_noise_and_accuracy(void **state) {
    (void)state;
    struct gap_monitor_parameters parameters;
    struct gap_monitor monitor;
    gap_monitor_default_parameters(&parameters);
    gap_monitor_init(&monitor);
    const struct bend_table_module *module = &rig_file.table.module;
    struct gap_monitor_pose pose = {
        .position_m = {0.0f, 0.0f, module->cap_proximal_m + module->chamber_length_m + module->cap_distal_m}};
    for (int i = 0; i < 1000; i++) {
        pose.measured_us += 10000;
        follow_pose_at(&monitor, &parameters, 0.0f, &pose);
    }
    /* straight: the table's 0.15 degrees and little noise */
    assert_close(DEGREES * (double)monitor.report.bend_threshold_rad, 0.155, 0.01);
    assert_close((double)monitor.report.bend_gap_rad, 0.0, 1e-9);
    assert_close((double)monitor.report.position_gap_m, 0.0, 1e-8);
    assert_close((double)monitor.report.position_threshold_m, 3e-4 + 0.95e-4 + 0.25e-4, 1e-5);
    pose.bend_rad[0] = -1.2f;
    follow_pose_at(&monitor, &parameters, 8300.0f, &pose);
    /* 25 deg/kPa x 3.35 Pa x 5, and 0.55 degrees of direction at 1.2 rad */
    assert_close(DEGREES * (double)monitor.report.bend_threshold_rad, 0.42 + 0.68, 0.03);
}

/* A beam that sags turns its tip by an angle and moves it by more than an even bend of that angle would: up to a
 * quarter of angle times length. More than that is no body. */
static void an_uneven_bend_is_the_bodys_too(void **state) {
    (void)state;
    const struct bend_table_module *module = &rig_file.table.module;
    const double bend = 0.1, length_m = (double)module->chamber_length_m, cap_m = (double)module->cap_distal_m;
    const struct {
        double share;
        enum gap_monitor_stage stage;
    } cases[] = {{0.0, GAP_MONITOR_BODY}, {0.25, GAP_MONITOR_BODY}, {0.45, GAP_MONITOR_TIP_SENSOR}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct gap_monitor_parameters parameters;
        struct gap_monitor monitor;
        gap_monitor_default_parameters(&parameters);
        gap_monitor_init(&monitor);
        const double across_m = cases[i].share * bend * length_m;
        struct gap_monitor_pose pose = {.bend_rad = {(float)bend, 0.0f}, .gap_rad = {(float)bend, 0.0f}};
        pose.position_m[0] =
            (float)(length_m * (1.0 - cos(bend)) / bend + cap_m * sin(bend) + across_m * cos(0.5 * bend));
        pose.position_m[2] = (float)((double)module->cap_proximal_m + length_m * sin(bend) / bend + cap_m * cos(bend) -
                                     across_m * sin(0.5 * bend));
        for (int k = 0; k < 600; k++) {
            pose.measured_us += 10000;
            follow_pose_at(&monitor, &parameters, 0.0f, &pose);
        }
        assert_close((double)monitor.report.bend_gap_rad, bend, 1e-3);
        assert_close((double)monitor.report.position_gap_m, across_m, 1e-5);
        struct gap_monitor_pressure pressure[3] = {{.vented_us = 0}, {.vented_us = 0}, {.vented_us = 0}};
        gap_monitor_follow_pressures(&monitor, &parameters, pressure, 1e-3f);
        assert_int_equal(monitor.report.stage, cases[i].stage);
    }
}

static void what_is_not_finite_changes_nothing(void **state) {
    (void)state;
    struct gap_monitor_parameters parameters;
    struct gap_monitor monitor, before;
    gap_monitor_default_parameters(&parameters);
    gap_monitor_init(&monitor);
    before = monitor;
    for (size_t i = 0; i < 3; i++) {
        struct gap_monitor_pose pose = {.measured_us = 10000};
        pose.position_m[i] = i == 1 ? INFINITY : NAN;
        follow_pose_at(&monitor, &parameters, 0.0f, &pose);
        assert_memory_equal(&monitor.report, &before.report, sizeof monitor.report);
    }
    const struct gap_monitor_pose outside = {.gap_rad = {1.0f, 0.0f}};
    follow_pose_at(&monitor, &parameters, 1e6f, &outside);
    assert_memory_equal(&monitor.report, &before.report, sizeof monitor.report);
    struct gap_monitor_pressure pressure[3] = {{.reading_pa = NAN, .reading_ok = true, .vented_us = INT64_MAX},
                                               {.reading_pa = INFINITY, .reading_ok = true, .vented_us = INT64_MAX},
                                               {.reading_pa = 5000.0f, .reading_ok = false, .vented_us = INT64_MAX}};
    for (int i = 0; i < 5000; i++) {
        gap_monitor_follow_pressures(&monitor, &parameters, pressure, 1e-3f);
    }
    assert_int_equal(monitor.report.stage, GAP_MONITOR_NONE);
    for (size_t c = 0; c < 3; c++) {
        assert_close((double)monitor.report.vented_pa[c], 0.0, 0.0);
    }
}

static void without_a_table_only_vented_readings_are_judged(void **state) {
    (void)state;
    static struct controller controller;
    struct controller_parameters parameters;
    struct controller_output output;
    controller_default_parameters(&parameters, NULL);
    controller_init(&controller, NULL, &parameters);
    for (int i = 0; i < 9000; i++) {
        const struct controller_input input = {.time_us = 1000 * (int64_t)i,
                                               .pressure_pa = {0.0f, 0.0f, 800.0f},
                                               .pressure_ok = {true, true, true}};
        controller_step(&controller, &input, &output);
    }
    assert_int_equal(controller.status.gap.stage, GAP_MONITOR_PRESSURE_SENSOR);
    assert_int_equal(controller.status.gap.chamber, 3);
    assert_close((double)controller.status.gap.pressure_threshold_pa[0], 0.0, 0.0); /* not judged */
}

static void every_stage_has_words(void **state) {
    (void)state;
    const char *const names[GAP_MONITOR_STAGE_COUNT] = {"none:", "valve:", "pressure sensor:", "body:", "tip sensor:"};
    for (int s = 0; s < (int)GAP_MONITOR_STAGE_COUNT; s++) {
        const char *text = gap_monitor_stage_text((enum gap_monitor_stage)s);
        assert_int_equal(strncmp(text, names[s], strlen(names[s])), 0);
    }
    assert_string_equal(gap_monitor_stage_text(GAP_MONITOR_STAGE_COUNT), "unknown");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_nominal_module_raises_nothing),
        cmocka_unit_test(the_nominal_module_at_rest_and_held_raises_nothing),
        cmocka_unit_test(creep_is_the_bodys),
        cmocka_unit_test(slow_creep_is_the_bodys_through_a_mission),
        cmocka_unit_test(a_reading_where_a_chamber_has_vented_is_the_pressure_sensors),
        cmocka_unit_test(an_offset_at_work_is_the_bodys_until_the_module_has_vented),
        cmocka_unit_test(a_displaced_position_is_the_tip_sensors),
        cmocka_unit_test(a_wrong_length_shows_at_rest),
        cmocka_unit_test(a_turned_tip_sensor_is_not_taken_for_a_bent_body),
        cmocka_unit_test(low_conductance_is_the_valves),
        cmocka_unit_test(low_conductance_is_the_valves_through_a_mission),
        cmocka_unit_test(a_valve_that_opens_late_is_named_by_its_chamber),
        cmocka_unit_test(air_in_a_chamber_that_should_be_empty_is_the_valves),
        cmocka_unit_test(a_warning_ends_once_the_stage_is_seen_to_do_well),
        cmocka_unit_test(a_warning_changes_no_output),
        cmocka_unit_test(a_gap_must_persist),
        cmocka_unit_test(thresholds_follow_from_noise_and_accuracy),
        cmocka_unit_test(an_uneven_bend_is_the_bodys_too),
        cmocka_unit_test(what_is_not_finite_changes_nothing),
        cmocka_unit_test(without_a_table_only_vented_readings_are_judged),
        cmocka_unit_test(every_stage_has_words),
    };
    return cmocka_run_group_tests(tests, rig_open, rig_close);
}
