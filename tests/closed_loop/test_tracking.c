/* Bend commands in closed loop with sensor noise on: the plant's true bend against the command. */
#include "support/test.h"

#include "support/rig.h"

#define DEGREES (180.0 / M_PI)
#define SETTLE_MS 3000
#define WINDOW_MS 2000

struct error {
    double bend_rms_deg;
    double direction_rms_deg;
    double bend_mean_deg;
};

/* Over a window, from the plant's shape as it is before any sensor. */
static struct error steady_error(struct rig *rig, const struct controller_command *command) {
    struct error error = {0.0, 0.0, 0.0};
    for (int i = 0; i < WINDOW_MS; i++) {
        struct body_shape shape;
        rig_step(rig);
        body_shape_of(rig->sim.sim.table, &rig->sim.sim.plant.chambers, &shape);
        for (size_t e = 0; e < rig->sim.sim.plant.effect_count; e++) {
            shape = rig->sim.sim.plant.shape; /* an effect bends the body too: as it was at the last tip sample */
        }
        const double bend = DEGREES * (hypot(shape.bend_x_rad, shape.bend_y_rad) - (double)command->bend_rad);
        const double turn = DEGREES * remainder(atan2(shape.bend_y_rad, shape.bend_x_rad) -
                                                    (double)command->direction_rad,
                                                2.0 * M_PI);
        error.bend_mean_deg += bend / WINDOW_MS;
        error.bend_rms_deg += bend * bend / WINDOW_MS;
        error.direction_rms_deg += turn * turn / WINDOW_MS;
    }
    error.bend_rms_deg = sqrt(error.bend_rms_deg);
    error.direction_rms_deg = sqrt(error.direction_rms_deg);
    return error;
}

static void bends_from_10_to_90_degrees_in_every_direction(void **state) {
    (void)state;
    static struct rig rig;
    const double bends_deg[] = {10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0};
    struct error worst = {0.0, 0.0, 0.0};
    for (size_t b = 0; b < sizeof bends_deg / sizeof bends_deg[0]; b++) {
        for (int d = 0; d < 16; d++) {
            const struct controller_command command = rig_bend(bends_deg[b], -180.0 + 22.5 * d);
            rig_start(&rig, &rig_file.table, 1000u * b + (uint64_t)d);
            rig_command(&rig, &command);
            rig_run(&rig, SETTLE_MS);
            const struct error error = steady_error(&rig, &command);
            worst.bend_rms_deg = fmax(worst.bend_rms_deg, error.bend_rms_deg);
            worst.direction_rms_deg = fmax(worst.direction_rms_deg, error.direction_rms_deg);
            if (!(error.bend_rms_deg < 0.5) || !(error.direction_rms_deg < 1.0)) {
                fail_msg("%.0f deg toward %.1f deg: bend rms %.3f deg, direction rms %.3f deg", bends_deg[b],
                         -180.0 + 22.5 * d, error.bend_rms_deg, error.direction_rms_deg);
            }
            assert_int_equal(rig.report.status.faults, 0);
        }
    }
    print_message("           worst of 112: bend rms %.3f deg, direction rms %.3f deg\n", worst.bend_rms_deg,
                  worst.direction_rms_deg);
}

static void the_tip_loop_takes_out_creep_that_open_loop_leaves(void **state) {
    (void)state;
    static struct rig rig;
    char text[256];
    double error_deg[2];
    for (int open_loop = 0; open_loop < 2; open_loop++) {
        struct effect creep;
        const struct controller_command command = rig_bend(45.0, 100.0);
        rig_start(&rig, &rig_file.table, 11);
        assert_true(effect_parse("creep:amplitude=0.2,time_constant=0.5", &creep, text, sizeof text));
        assert_true(sim_add_effect(&rig.sim.sim, &creep));
        rig.sim.sim.faults.tip_stops = open_loop == 1;
        rig_command(&rig, &command);
        rig_run(&rig, SETTLE_MS);
        error_deg[open_loop] = fabs(steady_error(&rig, &command).bend_mean_deg);
        assert_int_equal(rig.report.status.bend_is_measured, open_loop == 0);
    }
    assert_under(error_deg[0], 0.3);
    assert_true(error_deg[1] > 5.0); /* a fifth of 45 degrees is 9 */
}

static void an_unreachable_bend_stops_at_the_limit_and_says_so(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command command = rig_bend(170.0, 30.0);
    rig_start(&rig, &rig_file.table, 3);
    rig_command(&rig, &command);
    for (int i = 0; i < 4000; i++) {
        rig_step(&rig);
        for (size_t c = 0; c < 3; c++) {
            assert_under(rig.sim.sim.plant.chambers.pressure_pa[c], (double)rig_file.table.module.working_pressure_pa * 1.03);
        }
    }
    assert_true((rig.report.status.warnings & (1u << WARNING_COMMAND_LIMITED)) != 0u);
    assert_close(DEGREES * (double)rig.report.status.bend_rad, DEGREES * (double)rig_file.table.module.bend_limit_rad, 2.0);
    assert_int_equal(rig.report.status.state, SUPERVISOR_ACTIVE);
}

static void commands_that_make_no_sense_are_refused_and_counted(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command bad[] = {
        {.kind = COMMAND_BEND, .bend_rad = NAN},
        {.kind = COMMAND_BEND, .bend_rad = -0.5f},
        {.kind = COMMAND_BEND, .bend_rad = 0.5f, .direction_rad = INFINITY},
        {.kind = COMMAND_BEND, .bend_rad = 0.5f, .co_contraction_pa = NAN},
        {.kind = COMMAND_PRESSURE, .pressure_pa = {0.0f, NAN, 0.0f}}};
    rig_start(&rig, &rig_file.table, 4);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_true(rig.link.send(rig.link.context, &bad[i]));
        rig_step(&rig);
        assert_int_equal(rig.report.status.commands_refused, i + 1);
        assert_int_equal(rig.report.status.state, SUPERVISOR_SAFE);
        assert_false(rig_fills(&rig));
    }
}

static void hold_keeps_the_pressures(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command move = rig_pressure(6000.0, 3000.0, 0.0), hold = {.kind = COMMAND_HOLD};
    rig_start(&rig, &rig_file.table, 5);
    rig_command(&rig, &move);
    rig_run(&rig, 1500);
    rig_command(&rig, &hold);
    rig_run(&rig, 2000);
    assert_int_equal(rig.report.status.state, SUPERVISOR_HOLD);
    assert_close(rig.sim.sim.plant.chambers.pressure_pa[0], 6000.0, 250.0);
    assert_close(rig.sim.sim.plant.chambers.pressure_pa[1], 3000.0, 250.0);
}

static void a_vent_command_empties_every_chamber(void **state) {
    (void)state;
    static struct rig rig;
    const struct controller_command move = rig_bend(80.0, 0.0), vent = {.kind = COMMAND_VENT};
    rig_start(&rig, &rig_file.table, 6);
    rig_command(&rig, &move);
    rig_run(&rig, 2000);
    rig_command(&rig, &vent);
    rig_run(&rig, 2);
    assert_false(rig_fills(&rig));
    assert_int_equal(rig.report.status.state, SUPERVISOR_SAFE);
    rig_run(&rig, 4000);
    for (size_t c = 0; c < 3; c++) {
        assert_under(rig.sim.sim.plant.chambers.pressure_pa[c], 50.0);
    }
}

/* --- the same bits --- */

static void the_same_seed_gives_the_same_bits_another_does_not(void **state) {
    (void)state;
    static struct rig first, second, other;
    const struct controller_command command = rig_bend(50.0, 75.0);
    rig_start(&first, &rig_file.table, 42);
    rig_start(&second, &rig_file.table, 42);
    rig_start(&other, &rig_file.table, 43);
    rig_command(&first, &command);
    rig_command(&second, &command);
    rig_command(&other, &command);
    bool differs = false;
    for (int i = 0; i < 3000; i++) {
        rig_step(&first);
        rig_step(&second);
        rig_step(&other);
        assert_memory_equal(first.report.duty, second.report.duty, sizeof first.report.duty);
        assert_memory_equal(first.report.pressure_pa, second.report.pressure_pa, sizeof first.report.pressure_pa);
        assert_memory_equal(first.report.tip_quaternion, second.report.tip_quaternion,
                            sizeof first.report.tip_quaternion);
        assert_memory_equal(first.sim.sim.plant.chambers.pressure_pa, second.sim.sim.plant.chambers.pressure_pa,
                            sizeof first.sim.sim.plant.chambers.pressure_pa);
        differs = differs || memcmp(first.report.pressure_pa, other.report.pressure_pa,
                                    sizeof first.report.pressure_pa) != 0;
    }
    assert_true(differs);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bends_from_10_to_90_degrees_in_every_direction),
        cmocka_unit_test(the_tip_loop_takes_out_creep_that_open_loop_leaves),
        cmocka_unit_test(an_unreachable_bend_stops_at_the_limit_and_says_so),
        cmocka_unit_test(commands_that_make_no_sense_are_refused_and_counted),
        cmocka_unit_test(hold_keeps_the_pressures),
        cmocka_unit_test(a_vent_command_empties_every_chamber),
        cmocka_unit_test(the_same_seed_gives_the_same_bits_another_does_not),
    };
    return cmocka_run_group_tests(tests, rig_open, rig_close);
}
