/* The blind plant, against the table as the firmware reads it and against the simulator: two plants that were written apart
 * must agree where nothing is wrong, or what the blind check finds is their difference. */
#include "support/test.h"

#include "gap/blind/blind_case.h"
#include "gap/blind/blind_effect.h"
#include "program/table_file.h"
#include "sim/sim_hal.h"

#define TABLE "tables/paper-semicircle.tbt"
#define DEGREES (180.0 / M_PI)
#define STEPS 12000

static struct table_file file;

static int open_table(void **state) {
    (void)state;
    return table_file_open(&file, TABLE, NULL);
}

static int close_table(void **state) {
    (void)state;
    table_file_close(&file);
    return 0;
}

static void field_is_the_firmwares_table(void **state) {
    struct blind_field field;
    struct blind_random random;
    double worst_rad = 0.0;
    (void)state;
    assert_true(blind_field_open(&field, &file.table));
    blind_random_open(&random, 1, "places", 0);
    for (int i = 0; i < 20000; i++) {
        double at[3], bend[2], stretch;
        float at_float[3];
        struct bend_table_stencil stencil;
        for (int c = 0; c < 3; c++) {
            at_float[c] = (float)blind_uniform(&random, 0.0, 12100.0);
            at[c] = (double)at_float[c];
        }
        assert_true(blind_field_bend(&field, at, bend, &stretch));
        bend_table_locate(&file.table, at_float, &stencil);
        const double length_m = (double)file.table.module.active_length_m;
        worst_rad = fmax(worst_rad, fabs(bend[0] - length_m * (double)bend_table_value(&file.table, &stencil,
                                                                                       BEND_TABLE_CURVATURE_X)));
        worst_rad = fmax(worst_rad, fabs(bend[1] - length_m * (double)bend_table_value(&file.table, &stencil,
                                                                                       BEND_TABLE_CURVATURE_Y)));
    }
    blind_field_close(&field);
    assert_under(worst_rad * DEGREES, 0.005); /* a third of the tip sensor's noise; single precision leaves some 1e-4 */
}

static void slopes_are_those_of_the_values(void **state) {
    struct blind_field field;
    struct blind_random random;
    (void)state;
    assert_true(blind_field_open(&field, &file.table));
    blind_random_open(&random, 2, "places", 0);
    for (int i = 0; i < 2000; i++) {
        double at[3], value, gradient[1][3];
        for (int c = 0; c < 3; c++) {
            at[c] = blind_uniform(&random, 10.0, 12090.0);
        }
        assert_true(blind_field_at(&field, at, BLIND_VOLUME_1, 1, &value, gradient));
        for (int a = 0; a < 3; a++) {
            double up, down, beside[3] = {at[0], at[1], at[2]};
            beside[a] = at[a] + 0.5;
            assert_true(blind_field_at(&field, beside, BLIND_VOLUME_1, 1, &up, NULL));
            beside[a] = at[a] - 0.5;
            assert_true(blind_field_at(&field, beside, BLIND_VOLUME_1, 1, &down, NULL));
            assert_close(gradient[0][a], up - down, 1e-3 * fabs(up - down) + 2e-12);
        }
    }
    blind_field_close(&field);
}

/* Duties of the three valves in each period: holds of all sizes, the greatest near 9 kPa. */
static void duties_at(size_t step, double duty[3]) {
    const size_t second = step / 1000;
    for (size_t c = 0; c < 3; c++) {
        const double target_pa = (second + c) % 3 == 0 ? 0.0 : 3000.0 + 600.0 * (double)((7 * second + 3 * c) % 10);
        duty[c] = second == 0 ? 0.0 : blind_holding_duty(target_pa);
    }
}

static void agrees_with_the_simulator_where_nothing_is_wrong(void **state) {
    static struct sim sim;
    struct sim_parameters parameters;
    struct blind_field field;
    struct blind_plant plant;
    struct hal hal;
    struct hal_outputs outputs = {.valves_enabled = true, .supply_enabled = true};
    const struct blind_nominal nominal = {1.0, 1.0};
    double pressure_pa = 0.0, position_m = 0.0, turn = 0.0;
    size_t tips = 0;
    (void)state;
    sim_default_parameters(&parameters);
    parameters.sensor.pressure_noise_pa = parameters.sensor.pressure_step_pa = 0.0;
    parameters.sensor.tip_position_noise_m = parameters.sensor.tip_position_step_m = 0.0;
    parameters.sensor.tip_angle_noise_rad = parameters.sensor.tip_angle_step_rad = 0.0;
    sim_init(&sim, &file.table, &parameters, 1);
    sim_bind(&sim, &hal);
    assert_true(blind_field_open(&field, &file.table));
    blind_plant_init(&plant, &field, &nominal, NULL, 0);
    blind_plant_sample_tip(&plant, 10000, 10000); /* the simulator takes samples at multiples of 10 ms, the first at 10 */
    for (size_t step = 0; step < STEPS; step++) {
        struct hal_pressures pressures;
        struct hal_tip_sample theirs;
        struct blind_tip_sample ours;
        duties_at(step, plant.duty);
        for (size_t c = 0; c < 3; c++) {
            outputs.duty[c] = (float)plant.duty[c];
        }
        assert_true(hal.write_outputs(hal.context, &outputs));
        sim_advance(&sim, BLIND_STEP_US);
        blind_plant_step(&plant);
        assert_true(hal.read_pressures(hal.context, &pressures));
        for (size_t c = 0; c < 3; c++) {
            pressure_pa = fmax(pressure_pa, fabs((double)pressures.chamber_pa[c] - fmax(plant.state[c], 0.0)));
        }
        const bool arrived = hal.read_tip(hal.context, &theirs);
        assert_int_equal(arrived, blind_plant_next_tip(&plant, &ours));
        for (int d = 0; d < 3 && arrived; d++) {
            position_m = fmax(position_m, fabs((double)theirs.position_m[d] - ours.pose.position_m[d]));
            turn = fmax(turn, fabs((double)theirs.quaternion[1 + d] - ours.pose.quaternion[1 + d]));
            tips++;
        }
    }
    assert_false(plant.failed);
    assert_true(tips > 3000);
    /* a tenth of the sensors' noise: what differs does not show */
    assert_under(pressure_pa, 15.0);
    assert_under(position_m, 2e-6);
    assert_under(2.0 * turn * DEGREES, 0.0012);
    blind_field_close(&field);
}

/* The last millisecond of a run of one kind of effect, at a given strength. */
static void run_effect(struct blind_field *field, const struct blind_effect_kind *kind, double share,
                       struct blind_plant *plant, struct blind_pose *pose) {
    const struct blind_nominal nominal = {1.0, 1.0};
    const struct blind_scene scene = {.pressure_most_pa = 9100.0, .temperature_logged = true};
    struct blind_random random;
    struct blind_effect effect, *pointer = &effect;
    struct blind_tip_sample sample = {0};
    blind_random_open(&random, 3, kind->name, 0);
    blind_effect_draw(&effect, kind, &random, &scene);
    blind_effect_weaken(&effect, share);
    blind_effect_reset(&effect, 5);
    blind_plant_init(plant, field, &nominal, &pointer, 1);
    plant->temperature_k = 296.15;
    blind_plant_sample_tip(plant, 10000, 5000);
    for (size_t step = 0; step < 3005; step++) {
        duties_at(step, plant->duty);
        blind_plant_step(plant);
        while (blind_plant_next_tip(plant, &sample)) {
            *pose = sample.pose;
        }
    }
    assert_false(plant->failed);
    blind_effect_free(&effect);
}

static void every_effect_of_the_catalogue_vanishes_at_no_strength(void **state) {
    static struct blind_plant none, weak;
    struct blind_field field;
    struct blind_pose none_pose = {0}, weak_pose = {0};
    (void)state;
    assert_true(blind_field_open(&field, &file.table));
    run_effect(&field, blind_kind_find("tip_offset"), 0.0, &none, &none_pose);
    for (size_t i = 0; i < blind_catalogue_count(); i++) {
        const struct blind_effect_kind *kind = blind_catalogue_at(i);
        run_effect(&field, kind, 0.0, &weak, &weak_pose);
        for (int c = 0; c < 3; c++) {
            if (!(fabs(weak.reading_pa[c] - none.reading_pa[c]) < 20.0)) {
                fail_msg("%s: chamber %d reads %g instead of %g Pa", kind->name, c + 1, weak.reading_pa[c], none.reading_pa[c]);
            }
            if (!(fabs(weak_pose.position_m[c] - none_pose.position_m[c]) < 1e-4)) {
                fail_msg("%s moves the tip by %g m", kind->name, weak_pose.position_m[c] - none_pose.position_m[c]);
            }
        }
    }
    blind_field_close(&field);
}

static void same_seed_draws_the_same_case(void **state) {
    static struct blind_case one, two;
    struct blind_field field;
    (void)state;
    assert_true(blind_field_open(&field, &file.table));
    const struct blind_draw draw = {11, "single", 3, 6.0};
    assert_true(blind_case_open(&one, &field, &draw));
    assert_true(blind_case_open(&two, &field, &draw));
    assert_string_equal(one.id, two.id);
    assert_true(one.effects == 1 && two.effects == 1);
    assert_memory_equal(one.effect[0].parameter, two.effect[0].parameter, sizeof one.effect[0].parameter);
    assert_true(one.record[1].steps == two.record[1].steps);
    assert_memory_equal(one.record[1].step, two.record[1].step, one.record[1].steps * sizeof one.record[1].step[0]);
    blind_case_close(&one);
    blind_case_close(&two);
    blind_field_close(&field);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(field_is_the_firmwares_table),
        cmocka_unit_test(slopes_are_those_of_the_values),
        cmocka_unit_test(agrees_with_the_simulator_where_nothing_is_wrong),
        cmocka_unit_test(every_effect_of_the_catalogue_vanishes_at_no_strength),
        cmocka_unit_test(same_seed_draws_the_same_case),
    };
    return cmocka_run_group_tests(tests, open_table, close_table);
}
