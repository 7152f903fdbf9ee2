/* Each fault, put into the simulation at many moments of many runs: how fast the plant's valves vent, and what the state
 * says. */
#include "support/test.h"

#include "support/rig.h"

#define VENT_WITHIN_MS 2
#define MISSIONS 60

/* A run under way: bend or pressures, at an arbitrary phase of the PWM period. */
static void start_mission(struct rig *rig, uint64_t mission, const struct bend_table *table) {
    const struct controller_command bend = rig_bend(10.0 + (double)(mission * 13 % 90), (double)(mission * 37 % 360));
    const struct controller_command pressure = rig_pressure(500.0 * (double)(mission % 20), 9000.0, 4000.0);
    rig_start(rig, table, mission);
    rig_command(rig, mission % 3 == 0 ? &pressure : &bend);
    rig_run(rig, 50 + (int)(mission * 71 % 1500));
    assert_int_equal(rig->report.status.state, SUPERVISOR_ACTIVE);
}

/* Step until the fault is latched, at most `within_ms`; then the valves must be shut within VENT_WITHIN_MS of the step that
 * saw it, for good, whatever is commanded. Returns steps until detection. */
static int expect_fault(struct rig *rig, enum supervisor_fault fault, int within_ms) {
    int steps = 0;
    do {
        assert_true(steps <= within_ms);
        rig_step(rig);
        steps++;
    } while (rig->report.status.state != SUPERVISOR_FAULT);
    assert_true((rig->report.status.faults & (1u << (unsigned)fault)) != 0u); /* a reading that jumps shows more than one */
    rig_run(rig, VENT_WITHIN_MS - 1); /* the step that saw it has let a millisecond pass */
    assert_false(rig_fills(rig));
    double before_pa = 1e9;
    for (int i = 0; i < 1000; i++) {
        rig_step(rig);
        assert_false(rig_fills(rig));
        assert_false(rig->sim.sim.outputs.supply_enabled);
        assert_int_equal(rig->report.status.state, SUPERVISOR_FAULT);
        const double *p = rig->sim.sim.plant.chambers.pressure_pa;
        const double highest_pa = fmax(fmax(p[0], p[1]), p[2]);
        assert_true(highest_pa <= before_pa + 1.0);
        before_pa = highest_pa;
    }
    return steps;
}

static void overpressure(void **state) {
    (void)state;
    static struct rig rig;
    for (uint64_t mission = 0; mission < MISSIONS; mission++) {
        start_mission(&rig, mission, &rig_file.table);
        rig.sim.sim.faults.reading_replaced[mission % 3] = true;
        rig.sim.sim.faults.reading_pa[mission % 3] = 13100.0f;
        assert_int_equal(expect_fault(&rig, FAULT_OVERPRESSURE, 1), 1);
    }
}

static void sensor_out_of_range(void **state) {
    (void)state;
    static struct rig rig;
    for (uint64_t mission = 0; mission < MISSIONS; mission++) {
        struct sim_faults *faults = &rig.sim.sim.faults;
        start_mission(&rig, mission, &rig_file.table);
        switch (mission % 5) {
        case 0:
            faults->pressure_bus_fails = true;
            break;
        case 1:
            faults->channel_fails[mission % 3] = true;
            break;
        default:
            faults->reading_replaced[mission % 3] = true;
            faults->reading_pa[mission % 3] = mission % 5 == 2 ? NAN : (mission % 5 == 3 ? -3000.0f : 50000.0f);
            break;
        }
        assert_int_equal(expect_fault(&rig, FAULT_SENSOR_RANGE, 1), 1);
    }
}

static void command_timeout(void **state) {
    (void)state;
    static struct rig rig;
    for (uint64_t mission = 0; mission < MISSIONS; mission++) {
        start_mission(&rig, mission, &rig_file.table);
        rig.silent = true;
        const int64_t last_us = rig.sim.app.controller.command_us;
        (void)expect_fault(&rig, FAULT_COMMAND_TIMEOUT, 501);
        const int64_t seen_us = rig.sim.app.controller.supervisor.entered_us;
        assert_int_equal(seen_us - last_us, 500000);
    }
}

static void hold_times_out_too(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command hold = {.kind = COMMAND_HOLD};
    start_mission(&rig, 5, &rig_file.table);
    rig_command(&rig, &hold);
    rig_run(&rig, 100);
    assert_int_equal(rig.report.status.state, SUPERVISOR_HOLD);
    rig.silent = true;
    (void)expect_fault(&rig, FAULT_COMMAND_TIMEOUT, 501);
}

/* Found within two rounds of the check; vented as fast as the others from there. */
static void table_corrupt(void **state) {
    (void)state;
    static struct rig rig;
    const int round_ms = (int)(rig_file.table.image_bytes / 160u) + 2; /* 448 bytes in an idle step, 144 or none in another */
    int slowest_ms = 0;
    for (uint64_t mission = 0; mission < MISSIONS; mission++) {
        const size_t byte = 16 + mission * 2971 % (rig_file.size - 16);
        /* the plant must not see the damage: it has its own copy */
        struct table_file plant;
        assert_int_equal(table_file_open(&plant, RIG_TABLE, NULL), 0);
        start_mission(&rig, mission, &rig_file.table);
        rig.sim.sim.table = &plant.table;
        rig_file.bytes[byte] ^= 0x01u; /* the last bit of a number, mostly: the command stays nearly what it was */
        const int steps = expect_fault(&rig, FAULT_TABLE_CORRUPT, 2 * round_ms);
        rig_file.bytes[byte] ^= 0x01u;
        slowest_ms = steps > slowest_ms ? steps : slowest_ms;
        table_file_close(&plant);
    }
    print_message("           found after at most %d ms; a round of the check takes %d ms\n", slowest_ms, round_ms - 2);
}

/* The stream stops: open loop within five steps of the sample that did not come, without venting, with a warning. */
static void tip_lost(void **state) {
    (void)state;
    static struct rig rig;
    for (uint64_t mission = 1; mission < MISSIONS; mission += mission % 3 == 2 ? 2 : 1) {
        start_mission(&rig, mission, &rig_file.table);
        rig_run(&rig, 1500);
        rig.sim.sim.faults.tip_stops = true;
        int64_t last_us = 0;
        for (int i = 0; i < 60 && rig.report.status.bend_is_measured; i++) {
            rig_step(&rig);
            last_us = rig.report.tip_new ? rig.report.time_us : last_us;
        }
        assert_false(rig.report.status.bend_is_measured);
        last_us = last_us > 0 ? last_us : rig.sim.app.controller.tip_us;
        const int64_t expected_us = last_us + rig.sim.app.controller.parameters.tip_period_us;
        assert_in_range(rig.report.time_us - expected_us, 1, 5 * CONTROLLER_STEP_US);
        assert_true((rig.report.status.warnings & (1u << WARNING_TIP_LOST)) != 0u);
        assert_int_equal(rig.report.status.state, SUPERVISOR_ACTIVE);
        assert_int_equal(rig.report.status.tip_lost_count, 1);
        /* open loop keeps the bend: the nominal plant is the table */
        rig_run(&rig, 1000);
        const double wanted_x = (double)rig.command.bend_rad * cos((double)rig.command.direction_rad);
        const double wanted_y = (double)rig.command.bend_rad * sin((double)rig.command.direction_rad);
        struct body_shape shape;
        body_shape_of(&rig_file.table, &rig.sim.sim.plant.chambers, &shape);
        assert_under(hypot(shape.bend_x_rad - wanted_x, shape.bend_y_rad - wanted_y) * 180.0 / M_PI, 1.5);
        /* and the loop closes again when samples come back */
        rig.sim.sim.faults.tip_stops = false;
        rig_run(&rig, 50);
        assert_true(rig.report.status.bend_is_measured);
        assert_int_equal(rig.report.status.warnings & (1u << WARNING_TIP_LOST), 0);
    }
}

static void a_fault_stays_until_cleared_and_only_without_its_cause(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command clear = {.kind = COMMAND_CLEAR};
    const struct controller_command bend = rig_bend(40.0, 10.0);
    start_mission(&rig, 4, &rig_file.table);
    rig.sim.sim.faults.channel_fails[1] = true;
    (void)expect_fault(&rig, FAULT_SENSOR_RANGE, 1);
    rig.command.kind = COMMAND_NONE;
    assert_true(rig.link.send(rig.link.context, &clear));
    rig_run(&rig, 2);
    assert_int_equal(rig.report.status.state, SUPERVISOR_FAULT); /* the cause is still there */
    rig.sim.sim.faults.channel_fails[1] = false;
    rig_run(&rig, 600);
    assert_int_equal(rig.report.status.state, SUPERVISOR_FAULT); /* gone, but nobody cleared */
    assert_true(rig.link.send(rig.link.context, &clear));
    rig_run(&rig, 2);
    assert_int_equal(rig.report.status.state, SUPERVISOR_SELFTEST);
    rig_run(&rig, 3000); /* until every chamber has vented */
    assert_int_equal(rig.report.status.state, SUPERVISOR_SAFE);
    assert_int_equal(rig.report.status.faults, 0);
    rig_command(&rig, &bend);
    rig_run(&rig, 2500);
    assert_int_equal(rig.report.status.state, SUPERVISOR_ACTIVE);
    assert_close((double)rig.report.status.bend_rad * 180.0 / M_PI, 40.0, 1.5);
}

/* A host that never stops sending does not get its motion back by a clear: it has to pause first. */
static void a_clear_does_not_bring_a_running_stream_back(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command clear = {.kind = COMMAND_CLEAR};
    start_mission(&rig, 4, &rig_file.table);
    const struct controller_command motion = rig.command;
    rig.sim.sim.faults.channel_fails[1] = true;
    (void)expect_fault(&rig, FAULT_SENSOR_RANGE, 1);
    rig.sim.sim.faults.channel_fails[1] = false;
    rig_run(&rig, 3000);
    assert_true(rig.link.send(rig.link.context, &clear));
    const uint32_t refused = rig.report.status.commands_refused;
    rig_run(&rig, 2000);
    assert_int_equal(rig.report.status.state, SUPERVISOR_SAFE);
    assert_true(rig.report.status.commands_refused >= refused + 19u);
    rig.command.kind = COMMAND_NONE;
    rig_run(&rig, 500);
    rig_command(&rig, &motion);
    rig_run(&rig, 100);
    assert_int_equal(rig.report.status.state, SUPERVISOR_ACTIVE);
}

static void outputs_that_cannot_be_written_are_a_fault(void **state) {
    (void)state;
    static struct rig rig;
    start_mission(&rig, 2, &rig_file.table);
    rig.sim.sim.faults.outputs_fail = true;
    rig_run(&rig, 10);
    assert_int_equal(rig.sim.app.hal_errors, 10);
    assert_int_equal(rig.report.status.faults, 1u << FAULT_OUTPUTS_REFUSED);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(overpressure),
        cmocka_unit_test(sensor_out_of_range),
        cmocka_unit_test(command_timeout),
        cmocka_unit_test(hold_times_out_too),
        cmocka_unit_test(table_corrupt),
        cmocka_unit_test(tip_lost),
        cmocka_unit_test(a_fault_stays_until_cleared_and_only_without_its_cause),
        cmocka_unit_test(a_clear_does_not_bring_a_running_stream_back),
        cmocka_unit_test(outputs_that_cannot_be_written_are_a_fault),
    };
    return cmocka_run_group_tests(tests, rig_open, rig_close);
}
