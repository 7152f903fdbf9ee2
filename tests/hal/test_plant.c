/* The plant's parts against hand calculations: valve timing, gas, body, sensors, creep. */
#include "support/test.h"

#include <stdlib.h>

#include "sim/sim_hal.h"
#include "support/synthetic_table.h"

static const struct valve_parameters valve_parameters = {.period_us = 10000, .open_delay_us = 1500, .close_delay_us = 1000};

/* --- valve --- */

static int64_t filled_us(struct valve *valve, int64_t from_us, int64_t to_us) {
    int64_t filled = 0;
    for (int64_t at_us = from_us; at_us < to_us;) {
        const int64_t next_us = valve_next_switch_us(valve, at_us);
        const int64_t end_us = next_us < to_us ? next_us : to_us;
        filled += valve_fills(valve, at_us) ? end_us - at_us : 0;
        at_us = end_us;
    }
    return filled;
}

static void a_pulse_fills_for_its_length_less_the_difference_of_delays(void **state) {
    (void)state;
    for (int on_us = 0; on_us <= 8500; on_us += 250) {
        struct valve valve;
        valve_init(&valve);
        valve_start_period(&valve, &valve_parameters, 0, 0, (double)on_us / 10000.0);
        const int64_t expected_us = on_us <= 1500 ? 0 : on_us - 500;
        assert_int_equal(filled_us(&valve, 0, 10000), expected_us);
        assert_false(valve_fills(&valve, 1499));
    }
}

static void full_duty_never_closes_between_periods(void **state) {
    (void)state;
    struct valve valve;
    valve_init(&valve);
    int64_t filled = 0;
    for (int64_t start_us = 0; start_us < 50000; start_us += 10000) {
        valve_start_period(&valve, &valve_parameters, start_us, 0, 1.0);
        filled += filled_us(&valve, start_us, start_us + 10000);
    }
    assert_int_equal(filled, 50000 - 1500);
}

static void a_cut_valve_vents_after_its_close_delay(void **state) {
    (void)state;
    struct valve valve;
    valve_init(&valve);
    valve_start_period(&valve, &valve_parameters, 0, 0, 0.8);
    valve_cut(&valve, &valve_parameters, 4000);
    assert_true(valve_fills(&valve, 4999));
    assert_false(valve_fills(&valve, 5000));
    valve_start_period(&valve, &valve_parameters, 10000, 0, 0.8);
    valve_cut(&valve, &valve_parameters, 11000); /* before it opened: it never does */
    assert_int_equal(filled_us(&valve, 11000, 20000), 0);
}

/* --- gas --- */

static void mass_flow_is_iso_6358s(void **state) {
    (void)state;
    struct sim_parameters parameters;
    sim_default_parameters(&parameters);
    const struct gas_parameters *gas = &parameters.plant.gas;
    const double c = gas->sonic_conductance, rho = gas->reference_density_kgpm3;
    /* choked below the critical ratio: C rho p1, at the reference temperature */
    assert_relative(gas_mass_flow(gas, c, 5e5, 1e5), c * rho * 5e5, 1e-12);
    assert_relative(gas_mass_flow(gas, c, 5e5, 0.0), c * rho * 5e5, 1e-12);
    const double r = 0.8, x = (r - gas->critical_ratio) / (1.0 - gas->critical_ratio);
    assert_relative(gas_mass_flow(gas, c, 1.5e5, r * 1.5e5), c * rho * 1.5e5 * sqrt(1.0 - x * x), 1e-12);
    assert_close(gas_mass_flow(gas, c, 1e5, 1e5), 0.0, 0.0);
    assert_close(gas_mass_flow(gas, c, 1e5, 2e5), 0.0, 0.0);
    struct gas_parameters hot = *gas;
    hot.temperature_k = 4.0 * 293.15;
    assert_relative(gas_mass_flow(&hot, c, 5e5, 1e5), 0.5 * c * rho * 5e5, 1e-12);
}

static double rigid(enum bend_table_channel channel, const double pressure_pa[3]) {
    (void)pressure_pa;
    return channel >= BEND_TABLE_VOLUME_1 && channel <= BEND_TABLE_VOLUME_3 ? 1e-3 : 1.0;
}

static void fill(struct chambers *chambers, const struct gas_parameters *gas, const struct bend_table *table,
                 double supply_pa, int64_t duration_us, int64_t step_us) {
    const struct valve open[3] = {{.pulse = {{0, INT64_MAX}}, .count = 1}, {.count = 0}, {.count = 0}};
    const struct chamber_influence influence = {.conductance_scale = {1.0, 1.0, 1.0}, .supply_pa = supply_pa};
    for (int64_t at_us = 0; at_us < duration_us; at_us += step_us) {
        chambers_step(chambers, gas, table, open, &influence, true, at_us, at_us + step_us);
    }
}

/* A rigid chamber behind a choked valve fills linearly: dp/dt = C rho p1 R T / V. */
static void a_rigid_chamber_fills_linearly_while_choked(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct sim_parameters parameters;
    struct chambers chambers;
    synthetic_table_create(&synthetic, 5, 10000.0, 1.0, rigid);
    sim_default_parameters(&parameters);
    const struct gas_parameters *gas = &parameters.plant.gas;
    chambers_init(&chambers, gas, &synthetic.table);
    const double supply_pa = 9e5, volume_m3 = gas->tube_volume_m3 + 0.055 * 1e-3;
    assert_relative(chambers.volume_m3[0], volume_m3, 1e-6);
    fill(&chambers, gas, &synthetic.table, supply_pa, 100000, 1000);
    const double rate = gas->sonic_conductance * gas->reference_density_kgpm3 * (supply_pa + gas->ambient_pa_abs) *
                        gas->gas_constant * gas->temperature_k / volume_m3;
    assert_relative(chambers.pressure_pa[0], 0.1 * rate, 2e-4);
    assert_close(chambers.pressure_pa[1], 0.0, 0.05); /* the table's volumes are float32 */
    synthetic_table_free(&synthetic);
}

static void a_chamber_ends_at_the_supply_and_vents_to_ambient(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct sim_parameters parameters;
    struct chambers chambers;
    synthetic_table_create(&synthetic, 9, 10000.0, 1.0, synthetic_module);
    sim_default_parameters(&parameters);
    chambers_init(&chambers, &parameters.plant.gas, &synthetic.table);
    fill(&chambers, &parameters.plant.gas, &synthetic.table, 6000.0, 5000000, 1000);
    assert_close(chambers.pressure_pa[0], 6000.0, 1.0);
    const struct valve shut[3] = {{.count = 0}, {.count = 0}, {.count = 0}};
    const struct chamber_influence influence = {.conductance_scale = {1.0, 1.0, 1.0}, .supply_pa = 6000.0};
    for (int64_t at_us = 0; at_us < 5000000; at_us += 1000) {
        chambers_step(&chambers, &parameters.plant.gas, &synthetic.table, shut, &influence, true, at_us, at_us + 1000);
        assert_true(chambers.pressure_pa[0] > -1.0);
    }
    assert_close(chambers.pressure_pa[0], 0.0, 1.0);
    synthetic_table_free(&synthetic);
}

static void halving_the_step_changes_a_fill_by_little(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct sim_parameters parameters;
    struct chambers coarse, fine;
    synthetic_table_create(&synthetic, 9, 20000.0, 1.0, synthetic_module);
    sim_default_parameters(&parameters);
    chambers_init(&coarse, &parameters.plant.gas, &synthetic.table);
    chambers_init(&fine, &parameters.plant.gas, &synthetic.table);
    for (int i = 0; i < 20; i++) {
        fill(&coarse, &parameters.plant.gas, &synthetic.table, 40000.0, 1000, 1000);
        fill(&fine, &parameters.plant.gas, &synthetic.table, 40000.0, 1000, 500);
        assert_relative(coarse.pressure_pa[0], fine.pressure_pa[0], 2e-3);
    }
    assert_true(coarse.pressure_pa[0] > 1000.0);
    synthetic_table_free(&synthetic);
}

static void a_shut_supply_gives_no_air(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct sim_parameters parameters;
    struct chambers chambers;
    synthetic_table_create(&synthetic, 9, 10000.0, 1.0, synthetic_module);
    sim_default_parameters(&parameters);
    chambers_init(&chambers, &parameters.plant.gas, &synthetic.table);
    const struct valve open[3] = {{.pulse = {{0, INT64_MAX}}, .count = 1}, {.pulse = {{0, INT64_MAX}}, .count = 1}, {.pulse = {{0, INT64_MAX}}, .count = 1}};
    const struct chamber_influence influence = {.conductance_scale = {1.0, 1.0, 1.0}, .supply_pa = 40000.0};
    for (int64_t at_us = 0; at_us < 1000000; at_us += 1000) {
        chambers_step(&chambers, &parameters.plant.gas, &synthetic.table, open, &influence, false, at_us, at_us + 1000);
    }
    for (size_t c = 0; c < 3; c++) {
        assert_close(chambers.pressure_pa[c], 0.0, 1e-6);
    }
    synthetic_table_free(&synthetic);
}

/* --- a snap --- */

/* A chamber that softens and stiffens again: p = 1250 (x^3 - 6 x^2 + 9 x) Pa, x = (V - 20 mm2) / 40 mm2. It rises to 5000 Pa
 * at x = 1, falls to nothing at x = 3 but for 2000 Pa x / 3 more, which makes both turning points move a little. */
static double balloon_pa(double volume_m2) {
    const double x = (volume_m2 - 2e-5) / 4e-5;
    return 1250.0 * x * (9.0 + x * (x - 6.0)) + 2000.0 / 3.0 * x;
}

static double balloon_m2(double pressure_pa) {
    double low = 2e-5, high = 6e-5;
    for (int i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        *(balloon_pa(middle) < pressure_pa ? &low : &high) = middle;
    }
    return low;
}

/* Only chambers' own pressures matter; chamber 1 bends to -x by its volume. */
static double low_branch(enum bend_table_channel channel, const double pressure_pa[3]) {
    if (channel >= BEND_TABLE_VOLUME_1 && channel <= BEND_TABLE_VOLUME_3) {
        return balloon_m2(pressure_pa[(int)channel - (int)BEND_TABLE_VOLUME_1]);
    }
    return channel == BEND_TABLE_CURVATURE_X ? -1e6 * (balloon_m2(pressure_pa[0]) - 2e-5) : 1.0;
}

static double ballooned_branch(enum bend_table_channel channel, const double point[3]) {
    if (channel == BEND_TABLE_PRESSURE_1) {
        return balloon_pa(point[0]);
    }
    if (channel == BEND_TABLE_VOLUME_2 || channel == BEND_TABLE_VOLUME_3) {
        return balloon_m2(point[(int)channel - (int)BEND_TABLE_VOLUME_1]);
    }
    return channel == BEND_TABLE_CURVATURE_X ? -1e6 * (point[0] - 2e-5) : channel == BEND_TABLE_CURVATURE_Y ? 0.0 : 1.0;
}

/* Chamber `c` filled and vented slowly: its pressure follows the whole curve up and down, no gas is made or lost, and the
 * tip goes where that chamber points. */
static void a_snapping_chamber_follows_its_curve_and_comes_back(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct sim_parameters parameters;
    sim_default_parameters(&parameters);
    parameters.plant.gas.sonic_conductance *= 0.02;
    synthetic_table_create(&synthetic, 25, 5000.0, 1.0, low_branch);
    synthetic_table_add_ballooned(&synthetic, 25, balloon_m2(4300.0), 2.2e-4, 5000.0, 5340.0f, 1980.0f, ballooned_branch);
    for (size_t c = 0; c < 3; c++) {
        struct chambers chambers;
        struct body_shape shape;
        struct valve valve[3] = {{.count = 0}, {.count = 0}, {.count = 0}};
        const struct chamber_influence influence = {.conductance_scale = {1.0, 1.0, 1.0}, .supply_pa = 40000.0};
        double top_pa = 0.0, least_after_pa = 1e9;
        int64_t at_us = 0;
        chambers_init(&chambers, &parameters.plant.gas, &synthetic.table);
        assert_true(chambers.snaps);
        valve[c] = (struct valve){.pulse = {{0, INT64_MAX}}, .count = 1};
        for (; chambers.volume_m3[c] < 2e-6 + 0.055 * 2.1e-4; at_us += 1000) {
            chambers_step(&chambers, &parameters.plant.gas, &synthetic.table, valve, &influence, true, at_us, at_us + 1000);
            const double volume_m2 = (chambers.volume_m3[c] - parameters.plant.gas.tube_volume_m3) / 0.055;
            assert_close(chambers.pressure_pa[c], balloon_pa(volume_m2), 25.0);
            assert_relative(chambers.gas[c], (101325.0 + chambers.pressure_pa[c]) * chambers.volume_m3[c], 1e-4);
            top_pa = volume_m2 < 1e-4 ? fmax(top_pa, chambers.pressure_pa[c]) : top_pa;
            least_after_pa = volume_m2 > 1e-4 ? fmin(least_after_pa, chambers.pressure_pa[c]) : least_after_pa;
            assert_true(at_us < 100000000);
        }
        assert_close(top_pa, 5682.0, 60.0);
        assert_close(least_after_pa, 1983.0, 60.0);
        assert_int_equal(chambers.ballooned, c);
        body_shape_of(&synthetic.table, &chambers, &shape);
        const double bend_rad = 0.055 * 1e6 * 1.9e-4, direction_rad = M_PI + (double)c * 2.0 * M_PI / 3.0;
        assert_relative(hypot(shape.bend_x_rad, shape.bend_y_rad), bend_rad, 5e-3);
        assert_close(cos(atan2(shape.bend_y_rad, shape.bend_x_rad) - direction_rad), 1.0, 1e-6);
        valve[c] = (struct valve){.count = 0};
        for (const int64_t end_us = at_us + 240000000; at_us < end_us; at_us += 1000) {
            chambers_step(&chambers, &parameters.plant.gas, &synthetic.table, valve, &influence, true, at_us, at_us + 1000);
        }
        assert_int_equal(chambers.ballooned, CHAMBERS_NONE);
        for (size_t d = 0; d < 3; d++) {
            assert_close(chambers.pressure_pa[d], 0.0, 20.0);
        }
    }
    synthetic_table_free(&synthetic);
}

/* --- body --- */

static const struct bend_table_module module = {.chamber_length_m = 0.055f, .active_length_m = 0.055f,
                                                .cap_proximal_m = 0.005f, .cap_distal_m = 0.005f};

static void a_straight_module_stands_up(void **state) {
    (void)state;
    const struct body_shape shape = {0.0, 0.0, 1.02, 1.0};
    struct tip_pose pose;
    body_tip_pose(&module, &shape, &pose);
    assert_close(pose.position_m[0], 0.0, 1e-12);
    assert_close(pose.position_m[2], 0.010 + 0.055 * 1.02, 1e-8);
    assert_close(pose.quaternion[0], 1.0, 1e-12);
}

/* Quarter turn: the arc's radius is L / (pi/2); the distal cap lies along the direction of bend. */
static void a_quarter_turn_is_where_geometry_says(void **state) {
    (void)state;
    for (int d = 0; d < 12; d++) {
        const double direction = d * M_PI / 6.0;
        const struct body_shape shape = {0.5 * M_PI * cos(direction), 0.5 * M_PI * sin(direction), 1.0, 1.0};
        struct tip_pose pose;
        body_tip_pose(&module, &shape, &pose);
        const double radius_m = 0.055 / (0.5 * M_PI);
        assert_close(pose.position_m[0], cos(direction) * (radius_m + 0.005), 1e-8);
        assert_close(pose.position_m[1], sin(direction) * (radius_m + 0.005), 1e-8);
        assert_close(pose.position_m[2], 0.005 + radius_m, 1e-8);
        /* the tip's z axis points where the tip moved */
        const double *q = pose.quaternion;
        assert_close(2.0 * (q[1] * q[3] + q[0] * q[2]), cos(direction), 1e-9);
        assert_close(2.0 * (q[2] * q[3] - q[0] * q[1]), sin(direction), 1e-9);
    }
}

static void chamber_one_alone_moves_the_tip_to_minus_x(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    struct sim_parameters parameters;
    struct chambers chambers;
    struct body_shape shape;
    synthetic_table_create(&synthetic, 9, 10000.0, 1.0, synthetic_module);
    sim_default_parameters(&parameters);
    chambers_init(&chambers, &parameters.plant.gas, &synthetic.table);
    chambers.coordinate[0] = 5000.0;
    body_shape_of(&synthetic.table, &chambers, &shape);
    assert_relative(shape.bend_x_rad, -0.055 * (1e-3 * 5000.0 + 2e-7 * 2.5e7), 1e-5);
    assert_close(shape.bend_y_rad, 0.0, 1e-7);
    synthetic_table_free(&synthetic);
}

/* --- sensors --- */

static void pressure_noise_has_the_stated_spread_and_steps(void **state) {
    (void)state;
    struct sim_parameters parameters;
    struct random_stream random;
    double sum = 0.0, square = 0.0;
    enum { SAMPLES = 200000 };
    sim_default_parameters(&parameters);
    const struct sensor_parameters *sensor = &parameters.sensor;
    random_seed(&random, 3, 3);
    for (int i = 0; i < SAMPLES; i++) {
        const double reading = sensor_pressure(sensor, 5000.0, &random);
        const double steps = reading / sensor->pressure_step_pa;
        assert_close(steps, round(steps), 1e-6);
        sum += reading - 5000.0;
        square += (reading - 5000.0) * (reading - 5000.0);
    }
    assert_close(sum / SAMPLES, 0.0, 2.0);
    assert_relative(sqrt(square / SAMPLES), sensor->pressure_noise_pa, 0.01);
    assert_close(sensor_pressure(sensor, 1e6, &random), sensor->pressure_range_pa, 0.0);
    assert_close(sensor_pressure(sensor, -1e6, &random), 0.0, 0.0);
}

/* Mean square error of a value with normal noise that is then rounded to steps. */
static double stepped_square(double value, double noise, double step) {
    double sum = 0.0;
    for (double k = round(value / step) - 50.0; k <= round(value / step) + 50.0; k += 1.0) {
        const double low = ((k - 0.5) * step - value) / (noise * sqrt(2.0));
        const double high = ((k + 0.5) * step - value) / (noise * sqrt(2.0));
        sum += 0.5 * (erf(high) - erf(low)) * (k * step - value) * (k * step - value);
    }
    return sum;
}

static void tip_noise_has_the_stated_spread(void **state) {
    (void)state;
    struct sim_parameters parameters;
    struct random_stream random;
    struct tip_pose pose;
    const struct body_shape shape = {0.8, 0.3, 1.0, 1.0};
    double position = 0.0, angle = 0.0;
    enum { SAMPLES = 50000 };
    sim_default_parameters(&parameters);
    random_seed(&random, 5, 5);
    body_tip_pose(&module, &shape, &pose);
    for (int i = 0; i < SAMPLES; i++) {
        struct hal_tip_sample sample;
        sensor_tip(&parameters.sensor, &pose, 1234, &random, &sample);
        for (int k = 0; k < 4; k++) { /* a small turn is twice the quaternions' distance */
            angle += 4.0 * pow((double)sample.quaternion[k] - pose.quaternion[k], 2.0);
        }
        position += pow((double)sample.position_m[0] - pose.position_m[0], 2.0);
        assert_int_equal(sample.measured_us, 1234);
    }
    const struct sensor_parameters *sensor = &parameters.sensor;
    assert_relative(position / SAMPLES,
                    stepped_square(pose.position_m[0], sensor->tip_position_noise_m, sensor->tip_position_step_m), 0.03);
    /* three components of a rotation; turns of a large rotation are a little less than its vector's change */
    const double expected = stepped_square(-shape.bend_y_rad, sensor->tip_angle_noise_rad, sensor->tip_angle_step_rad) +
                            stepped_square(shape.bend_x_rad, sensor->tip_angle_noise_rad, sensor->tip_angle_step_rad) +
                            stepped_square(0.0, sensor->tip_angle_noise_rad, sensor->tip_angle_step_rad);
    assert_relative(angle / SAMPLES, expected, 0.1);
}

/* --- effects --- */

static void creep_follows_its_closed_form(void **state) {
    (void)state;
    struct effect effect;
    char error[256];
    assert_true(effect_parse("creep:amplitude=0.2,time_constant=4", &effect, error, sizeof error));
    for (int i = 1; i <= 1000; i++) {
        struct body_shape shape = {1.0, -0.5, 1.1, 1.0};
        struct effect_signals signals = {.time_s = 0.01 * i, .step_s = 0.01, .shape = &shape};
        effect.kind->shape(effect.state, effect.parameter, &signals);
        const double grown = 1.0 + 0.2 * (1.0 - exp(-0.01 * i / 4.0));
        assert_close(shape.bend_x_rad, grown, 1e-12);
        assert_close(shape.bend_y_rad, -0.5 * grown, 1e-12);
        assert_close(shape.stretch, 1.0 + 0.1 * grown, 1e-12);
    }
}

static void an_effect_of_no_size_changes_nothing(void **state) {
    (void)state;
    struct effect effect;
    char error[256];
    assert_true(effect_parse("creep:amplitude=0", &effect, error, sizeof error));
    struct body_shape shape = {1.0, -0.5, 1.1, 1.0};
    struct effect_signals signals = {.time_s = 1.0, .step_s = 0.01, .shape = &shape};
    effect.kind->shape(effect.state, effect.parameter, &signals);
    assert_true(shape.bend_x_rad == 1.0 && shape.bend_y_rad == -0.5 && shape.stretch == 1.1);
}

static void misspelt_effects_are_explained(void **state) {
    (void)state;
    struct effect effect;
    char error[256];
    const char *const bad[] = {"crep", "", "creep:amplitude", "creep:size=1", "creep:amplitude=big",
                               "creep:amplitude=2", "creep:amplitude=nan", "creep:amplitude=0.1x"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        error[0] = '\0';
        assert_false(effect_parse(bad[i], &effect, error, sizeof error));
        assert_true(strlen(error) > 20);
    }
    assert_true(effect_kind_count() >= 1);
    assert_non_null(effect_kind_find("creep"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pulse_fills_for_its_length_less_the_difference_of_delays),
        cmocka_unit_test(full_duty_never_closes_between_periods),
        cmocka_unit_test(a_cut_valve_vents_after_its_close_delay),
        cmocka_unit_test(mass_flow_is_iso_6358s),
        cmocka_unit_test(a_rigid_chamber_fills_linearly_while_choked),
        cmocka_unit_test(a_chamber_ends_at_the_supply_and_vents_to_ambient),
        cmocka_unit_test(halving_the_step_changes_a_fill_by_little),
        cmocka_unit_test(a_shut_supply_gives_no_air),
        cmocka_unit_test(a_snapping_chamber_follows_its_curve_and_comes_back),
        cmocka_unit_test(a_straight_module_stands_up),
        cmocka_unit_test(a_quarter_turn_is_where_geometry_says),
        cmocka_unit_test(chamber_one_alone_moves_the_tip_to_minus_x),
        cmocka_unit_test(pressure_noise_has_the_stated_spread_and_steps),
        cmocka_unit_test(tip_noise_has_the_stated_spread),
        cmocka_unit_test(creep_follows_its_closed_form),
        cmocka_unit_test(an_effect_of_no_size_changes_nothing),
        cmocka_unit_test(misspelt_effects_are_explained),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
