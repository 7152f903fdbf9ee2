/* Diagnoses of the simulated module with nothing wrong, with its nominal parameters off, and with one effect of each stage. */
#include "host/diagnosed.h"

#define SECONDS 6.0
#define RUNS 2
#define KINDS_MOST 64

static struct diagnosed diagnosed;
static const struct diagnosis *const diagnosis = &diagnosed.diagnosis;

static void nothing_wrong_is_no_gap(void **state) {
    (void)state;
    for (uint64_t seed = 4; seed < 9; seed++) {
        diagnosed_open(&diagnosed, &(struct recording){.seconds = SECONDS, .runs = RUNS, .seed = seed}, NULL);
        assert_verdict(diagnosis, GAP_NONE);
        assert_int_equal(diagnosis->effects, 0);
        assert_string_equal(diagnosis->stage, "");
        assert_close(diagnosis->stiffness_scale.value, 1.0, 0.005);
        assert_close(diagnosis->supply_scale.value, 1.0, 0.005);
        diagnosed_close(&diagnosed);
    }
}

static void stiffness_and_supply_that_are_off_are_recalibrated(void **state) {
    (void)state;
    diagnosed_open(&diagnosed,
                   &(struct recording){.stiffness_scale = 1.3, .supply_scale = 0.95, .seconds = SECONDS, .runs = RUNS, .seed = 3}, NULL);
    assert_verdict(diagnosis, GAP_RECALIBRATE);
    assert_holds(&diagnosis->stiffness_scale, 1.3);
    assert_holds(&diagnosis->supply_scale, 0.95);
    assert_under(diagnosis->stiffness_scale.high - diagnosis->stiffness_scale.low, 0.02);
    assert_true(diagnosis->closed_recalibration.value > 0.99);
    diagnosed_close(&diagnosed);
}

/* Nominal parameters that are far off hide no gap that is small beside them. Nothing is tried here, so nothing explains it. */
static void what_recalibration_leaves_is_said(void **state) {
    const char *names[KINDS_MOST];
    struct search_options options = {.threads = 1, .without = names};
    (void)state;
    assert_true(effect_kind_count() <= KINDS_MOST);
    for (; options.without_count < effect_kind_count(); options.without_count++) {
        names[options.without_count] = effect_kind_at(options.without_count)->name;
    }
    for (int wrong = 0; wrong < 2; wrong++) {
        diagnosed_open(&diagnosed,
                       &(struct recording){.stiffness_scale = 1.3, .supply_scale = 0.95, .seconds = SECONDS, .runs = RUNS, .seed = 3,
                                           .effect = {wrong ? "end_restraint:fraction=0.9" : NULL}},
                       &options);
        assert_verdict(diagnosis, wrong ? GAP_UNKNOWN : GAP_RECALIBRATE);
        assert_true(diagnosis->structure[1] < 0.05 * diagnosis->structure[0]);
        diagnosed_close(&diagnosed);
    }
}

/* One effect, named, with its stage and chamber and every parameter within its interval. */
static void assert_named(const char *effect_text, const char *stage) {
    struct effect truth;
    char error[512];
    assert_true(effect_parse(effect_text, &truth, error, sizeof error));
    diagnosed_open(&diagnosed, &(struct recording){.effect = {effect_text}, .seconds = SECONDS, .runs = RUNS, .seed = 2}, NULL);
    assert_verdict(diagnosis, GAP_EFFECT);
    assert_int_equal(diagnosis->effects, 1);
    assert_string_equal(diagnosis->effect[0].kind->name, truth.kind->name);
    assert_string_equal(diagnosis->stage, stage);
    assert_int_equal(diagnosis->effect[0].chamber, truth.chamber);
    for (size_t c = 0; c < 3; c++) {
        assert_int_equal(diagnosis->chamber[c], truth.chamber == 0 || truth.chamber == c + 1);
    }
    assert_true(diagnosis->effect[0].probability > 0.6 && diagnosis->effect[0].onset_s == 0.0);
    for (size_t i = 0; i < truth.kind->parameter_count; i++) {
        assert_holds(&diagnosis->effect[0].parameter[i], truth.parameter[i]);
    }
    assert_true(diagnosis->closed.value > 0.97);
    diagnosed_close(&diagnosed);
}

static void effect_of_the_supply_is_named(void **state) {
    (void)state;
    assert_named("supply_droop", "supply");
}

static void effect_of_the_valves_is_named(void **state) {
    (void)state;
    assert_named("line_volume:volume=3e-6", "valve");
}

static void effect_of_a_pressure_sensor_is_named(void **state) {
    (void)state;
    assert_named("pressure_gain:gain=1.08,chamber=2", "pressure sensor");
}

static void effect_of_the_body_is_named(void **state) {
    (void)state;
    assert_named("creep:amplitude=0.1,time_constant=1", "body");
}

static void effect_of_the_tip_sensor_is_named(void **state) {
    (void)state;
    assert_named("tip_offset:x=0.003,y=-0.001,z=0.001", "tip sensor");
}

static void pressures_that_never_move_say_nothing(void **state) {
    (void)state;
    diagnosed_open(&diagnosed, &(struct recording){.effect = {"creep"}, .seconds = SECONDS, .still = true, .seed = 1}, NULL);
    assert_verdict(diagnosis, GAP_INSUFFICIENT_DATA);
    assert_int_equal(diagnosis->effects, 0);
    assert_true(diagnosis->warnings > 0);
    assert_string_equal(diagnosis->stage, ""); /* nowhere */
    diagnosed_close(&diagnosed);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(nothing_wrong_is_no_gap),
                                       cmocka_unit_test(stiffness_and_supply_that_are_off_are_recalibrated),
                                       cmocka_unit_test(what_recalibration_leaves_is_said),
                                       cmocka_unit_test(effect_of_the_supply_is_named),
                                       cmocka_unit_test(effect_of_the_valves_is_named),
                                       cmocka_unit_test(effect_of_a_pressure_sensor_is_named),
                                       cmocka_unit_test(effect_of_the_body_is_named),
                                       cmocka_unit_test(effect_of_the_tip_sensor_is_named),
                                       cmocka_unit_test(pressures_that_never_move_say_nothing)};
    return cmocka_run_group_tests(tests, recording_set_up, recording_tear_down);
}
