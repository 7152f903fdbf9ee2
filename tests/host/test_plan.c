/* Plans: how they are written down, what they command, which are refused; and which experiment `tribend gap
 * plan` chooses to tell the candidates of a diagnosis apart. */
#include "support/test.h"

#include <stdlib.h>
#include <unistd.h>

#include "gap/plan_noise.h"
#include "gap/plan_search.h"
#include "plan/plan_file.h"
#include "support/rig.h"
#include "support/scratch.h"

#define DEG (M_PI / 180.0)

static char directory[SCRATCH_BYTES];
static char plan_path[SCRATCH_WITHIN_BYTES], report_path[SCRATCH_WITHIN_BYTES];

static int set_up(void **state) {
    if (!scratch_folder(directory)) {
        return -1;
    }
    (void)snprintf(plan_path, sizeof plan_path, "%s/plan.yaml", directory);
    (void)snprintf(report_path, sizeof report_path, "%s/report.json", directory);
    return rig_open(state);
}

static int tear_down(void **state) {
    (void)remove(plan_path);
    (void)remove(report_path);
    (void)rmdir(directory);
    return rig_close(state);
}

static void write_text(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static const char good[] =
    "module: paper-semicircle\n"
    "note: a bit of everything\n"
    "steps:\n"
    "  - { for: 1s, vent: true }\n"
    "  - { for: 2s, pressure: [40mbar, 1kPa, 0mbar] }\n"
    "  - { for: 4s, ramp_to: [80mbar, 0mbar, 0mbar] }\n"
    "  - { for: 1500ms, bend: 60deg, toward: 30deg, co_contraction: 5mbar }\n"
    "  - { for: 6s, sine: { chambers: [1, 2], amplitude: 20mbar, mean: 30mbar, period: 2s } }\n"
    "  - for: 6s\n"
    "    sines:\n"
    "      - { chambers: [3], amplitude: 10mbar, mean: 10mbar, period: 4s, phase: -90deg }\n"
    "      - { chambers: [3, 1], amplitude: 5mbar, mean: 20mbar, period: 1s }\n";

static void read_good(struct plan *plan) {
    char error[PLAN_ERROR_BYTES];
    write_text(plan_path, good);
    if (!plan_read(plan_path, &rig_file.table, plan, error, sizeof error)) {
        fail_msg("%s", error);
    }
}

static void assert_pressures(const struct plan *plan, double time_s, double p1_pa, double p2_pa,
                             double p3_pa) {
    struct controller_command command;
    plan_command_at(plan, time_s, &command);
    assert_int_equal(command.kind, COMMAND_PRESSURE);
    assert_close((double)command.pressure_pa[0], p1_pa, 0.01);
    assert_close((double)command.pressure_pa[1], p2_pa, 0.01);
    assert_close((double)command.pressure_pa[2], p3_pa, 0.01);
}

/* --- what a plan commands --- */

static void a_plan_is_read_as_written(void **state) {
    (void)state;
    static struct plan plan;
    read_good(&plan);
    assert_string_equal(plan.module, "paper-semicircle");
    assert_string_equal(plan.note, "a bit of everything");
    assert_int_equal(plan.steps, 6);
    assert_close(plan_length_s(&plan), 20.5, 1e-9);
    assert_close(plan_start_s(&plan, 3), 7.0, 1e-9);
    assert_int_equal(plan_step_at(&plan, 6.999), 2);
    assert_int_equal(plan_step_at(&plan, 7.0), 3);
    assert_int_equal(plan_step_at(&plan, 99.0), 5);
}

static void every_kind_of_step_commands_what_it_says(void **state) {
    (void)state;
    static struct plan plan;
    struct controller_command command;
    read_good(&plan);
    plan_command_at(&plan, 0.5, &command);
    assert_int_equal(command.kind, COMMAND_VENT);
    assert_pressures(&plan, 1.0, 4000.0, 1000.0, 0.0);
    assert_pressures(&plan, 2.9, 4000.0, 1000.0, 0.0);
    assert_pressures(&plan, 3.0, 4000.0, 1000.0, 0.0); /* a ramp starts where the step before it ended */
    assert_pressures(&plan, 4.0, 5000.0, 750.0, 0.0);
    assert_pressures(&plan, 6.0, 7000.0, 250.0, 0.0);
    plan_command_at(&plan, 7.5, &command);
    assert_int_equal(command.kind, COMMAND_BEND);
    assert_close((double)command.bend_rad, 60.0 * DEG, 1e-6);
    assert_close((double)command.direction_rad, 30.0 * DEG, 1e-6);
    assert_close((double)command.co_contraction_pa, 500.0, 1e-3);
    assert_pressures(&plan, 8.5 + 0.5, 5000.0, 5000.0, 0.0);
    assert_pressures(&plan, 8.5 + 1.5, 1000.0, 1000.0, 0.0);
    assert_pressures(&plan, 14.5, 2000.0, 0.0, 2000.0);
    /* a quarter of the short period, and nine sixteenths of the long one past its trough */
    assert_pressures(&plan, 14.5 + 2.25, 2500.0, 0.0,
                     1000.0 - 1000.0 * cos(2.25 / 4.0 * 2.0 * M_PI) + 2500.0);
}

static void a_ramp_behind_a_vent_starts_from_nothing(void **state) {
    (void)state;
    static struct plan plan;
    const double high_pa[3] = {6000.0, 0.0, 0.0};
    plan_init(&plan, "paper-semicircle", "");
    assert_true(plan_add_pressure(&plan, 1.0, high_pa));
    assert_true(plan_add_vent(&plan, 1.0));
    assert_true(plan_add_ramp(&plan, 2.0, high_pa));
    assert_pressures(&plan, 3.0, 3000.0, 0.0, 0.0);
}

static void a_plan_that_is_written_is_read_back(void **state) {
    (void)state;
    static struct plan plan, again;
    char error[PLAN_ERROR_BYTES];
    read_good(&plan);
    assert_true(plan_write(plan_path, &plan, error, sizeof error));
    if (!plan_read(plan_path, &rig_file.table, &again, error, sizeof error)) {
        fail_msg("%s", error);
    }
    assert_int_equal(again.steps, plan.steps);
    assert_string_equal(again.note, plan.note);
    for (double time_s = 0.0; time_s < plan_length_s(&plan); time_s += 0.07) {
        struct controller_command a, b;
        plan_command_at(&plan, time_s, &a);
        plan_command_at(&again, time_s, &b);
        assert_int_equal(a.kind, b.kind);
        for (size_t c = 0; c < 3; c++) {
            assert_close((double)a.pressure_pa[c], (double)b.pressure_pa[c], 0.01);
        }
        assert_close((double)a.bend_rad, (double)b.bend_rad, 1e-6);
        assert_close((double)a.direction_rad, (double)b.direction_rad, 1e-6);
    }
}

static void a_note_cannot_break_the_file(void **state) {
    (void)state;
    static struct plan plan, again;
    char error[PLAN_ERROR_BYTES];
    plan_init(&plan, "paper-semicircle", "two\nlines: \"and\" {more}\\");
    assert_true(plan_add_vent(&plan, 1.0));
    assert_true(plan_write(plan_path, &plan, error, sizeof error));
    assert_true(plan_read(plan_path, &rig_file.table, &again, error, sizeof error));
    assert_string_equal(again.note, "two lines:  and  {more} ");
}

static void a_plan_takes_no_more_than_it_has_room_for(void **state) {
    (void)state;
    static struct plan plan, half;
    const struct plan_tone tone[2] = {{{true, false, false}, 0.0, 0.0, 1.0, 0.0}};
    plan_init(&plan, "paper-semicircle", "");
    for (size_t i = 0; i < PLAN_STEPS_MAX; i++) {
        assert_true(plan_add_vent(&plan, 1.0));
    }
    assert_false(plan_add_vent(&plan, 1.0));
    assert_int_equal(plan.steps, PLAN_STEPS_MAX);
    plan_init(&half, "paper-semicircle", "");
    assert_true(plan_add_vent(&half, 1.0));
    assert_false(plan_append(&plan, &half));
    for (size_t i = 0; i < PLAN_TONES_MAX / 2; i++) {
        assert_true(plan_add_sine(&half, 1.0, tone, 2));
    }
    assert_false(plan_add_sine(&half, 1.0, tone, 1));
    assert_int_equal(half.steps, 1 + PLAN_TONES_MAX / 2);
}

static void appended_sines_keep_their_tones(void **state) {
    (void)state;
    static struct plan plan, after;
    const struct plan_tone first = {{true, false, false}, 1000.0, 1000.0, 4.0, 0.0};
    const struct plan_tone second = {{false, true, false}, 2000.0, 2000.0, 4.0, 0.0};
    plan_init(&plan, "paper-semicircle", "");
    plan_init(&after, "paper-semicircle", "");
    assert_true(plan_add_sine(&plan, 4.0, &first, 1));
    assert_true(plan_add_sine(&after, 4.0, &second, 1));
    assert_true(plan_append(&plan, &after));
    assert_pressures(&plan, 1.0, 2000.0, 0.0, 0.0);
    assert_pressures(&plan, 5.0, 0.0, 4000.0, 0.0);
}

/* --- what is refused --- */

struct bad {
    const char *find; /* in the good plan, to be replaced by .. */
    const char *with;
    const char *place; /* :LINE: KEY: */
    const char *words;
};

static const struct bad bad_plans[] = {
    {"40mbar", "120mbar", ":5: pressure: ", "over the working pressure of module paper-semicircle, 110 mbar"},
    {"40mbar", "108mbar", ":5: pressure: ", "over its bend limit of 110 deg"},
    {"40mbar", "-1mbar", ":5: pressure: ", "below ambient"},
    {"40mbar", "40", ":5: pressure: ", "'40' has no unit"},
    {"40mbar", "40deg", ":5: pressure: ", "has the unit 'deg'"},
    {"40mbar, 1kPa", "40mbar", ":5: ", "Insufficient entries"},
    {"ramp_to: [80mbar", "ramp_to: [109mbar", ":6: ramp_to: ", "over its bend limit"},
    {"60deg", "111deg", ":7: bend: ", "over the bend limit of module paper-semicircle, 110 deg"},
    {"60deg", "-5deg", ":7: bend: ", "negative"},
    {"5mbar", "200mbar", ":7: co_contraction: ", "110 mbar"},
    {"bend: 60deg, ", "", ":7: for: ", "this one has 0 of them"},
    {"bend: 60deg", "vent: true", ":7: toward: ", "only a bend has this key"},
    {"1500ms", "0s", ":7: for: ", "not between 0 and a day"},
    {"1500ms", "2days", ":7: for: ", "has the unit 'days'"},
    {"period: 2s", "period: 2ms", ":8: period: ", "no chamber can follow"},
    {"amplitude: 20mbar", "amplitude: 40mbar", ":8: sine: ", "below ambient"},
    {"mean: 30mbar", "mean: 130mbar", ":8: sine: ", "over the working pressure"},
    {"[1, 2]", "[1, 4]", ":8: chambers: ", "there is no chamber 4"},
    {"mean: 20mbar", "mean: 120mbar", ":10: sine: ", "over the working pressure"},
    {"vent: true", "vent: false", ":4: vent: ", "write true"},
    {"for: 1s", "fro: 1s", ":4: ", "Unexpected key: fro"},
    {"module: paper-semicircle", "module: stiff-flop", ":1: module: ", "--table"},
    {"note: a bit", "- note: a bit", ":", "plan.yaml"}};

static void replace(const char *find, const char *with, char *text, size_t bytes) {
    const char *at = strstr(good, find);
    assert_non_null(at);
    (void)snprintf(text, bytes, "%.*s%s%s", (int)(at - good), good, with, at + strlen(find));
}

static void a_bad_plan_is_refused_with_line_key_and_limit(void **state) {
    (void)state;
    static struct plan plan;
    char text[2048], error[PLAN_ERROR_BYTES];
    for (size_t i = 0; i < sizeof bad_plans / sizeof bad_plans[0]; i++) {
        const struct bad *bad = &bad_plans[i];
        replace(bad->find, bad->with, text, sizeof text);
        write_text(plan_path, text);
        if (plan_read(plan_path, &rig_file.table, &plan, error, sizeof error)) {
            fail_msg("'%s' for '%s' is accepted", bad->with, bad->find);
        }
        if (strstr(error, bad->place) == NULL || strstr(error, bad->words) == NULL) {
            fail_msg("'%s' for '%s': '%s' does not say '%s' and '%s'", bad->with, bad->find, error,
                     bad->place, bad->words);
        }
    }
}

static void a_ramp_behind_a_bend_is_refused(void **state) {
    (void)state;
    static struct plan plan;
    const double pressure_pa[3] = {5000.0, 0.0, 0.0};
    struct plan_fault fault;
    plan_init(&plan, "paper-semicircle", "");
    assert_true(plan_add_bend(&plan, 1.0, 0.5, 0.0, 0.0));
    assert_true(plan_add_ramp(&plan, 1.0, pressure_pa));
    assert_false(plan_check(&plan, &rig_file.table, &fault));
    assert_int_equal(fault.step, 1);
    assert_string_equal(fault.key, "ramp_to");
}

static void a_plan_without_a_file_is_refused(void **state) {
    (void)state;
    static struct plan plan;
    char error[PLAN_ERROR_BYTES];
    assert_false(plan_read("/nonexistent/plan.yaml", &rig_file.table, &plan, error, sizeof error));
    assert_non_null(strstr(error, "/nonexistent/plan.yaml"));
    assert_false(plan_write("/nonexistent/plan.yaml", &plan, error, sizeof error));
    assert_non_null(strstr(error, "/nonexistent/plan.yaml"));
}

/* --- on the bus --- */

/* The module arrives where each step of constant pressure wants it, and passes no limit on the way. */
static void a_plan_is_followed_on_the_bus(void **state) {
    (void)state;
    static struct rig rig;
    static struct plan plan;
    read_good(&plan);
    rig_start(&rig, &rig_file.table, 1);
    const int64_t start_us = rig.report.time_us, length_us = (int64_t)(1e6 * plan_length_s(&plan));
    while (rig.report.time_us < start_us + length_us) {
        const double since_s = 1e-6 * (double)(rig.report.time_us - start_us);
        struct controller_command command;
        plan_command_at(&plan, since_s, &command);
        if (rig.report.time_us % 10000 == 0) {
            rig_command(&rig, &command);
        }
        rig_step(&rig);
        assert_int_equal(rig.report.status.faults, 0u);
        for (size_t c = 0; c < 3; c++) {
            assert_under(rig.sim.sim.plant.pressure_pa[c], (double)rig_file.table.module.working_pressure_pa);
        }
        if (fabs(since_s - 2.99) < 5e-4) {
            assert_close(rig.sim.sim.plant.pressure_pa[0], 4000.0, 100.0);
            assert_close(rig.sim.sim.plant.pressure_pa[1], 1000.0, 150.0);
        } else if (fabs(since_s - 6.9) < 5e-4) {
            assert_close(rig.sim.sim.plant.pressure_pa[0], 7900.0, 150.0);
        } else if (fabs(since_s - 8.45) < 5e-4) {
            assert_close((double)rig.report.status.bend_rad, 60.0 * DEG, 3.0 * DEG);
        }
    }
    assert_int_equal(rig.report.status.commands_refused, 0u);
}

/* --- the library --- */

static void the_library_keeps_the_limits(void **state) {
    (void)state;
    struct plan_experiment *library = calloc(PLAN_LIBRARY_MAX, sizeof *library);
    struct plan_fault fault;
    assert_non_null(library);
    for (size_t lead = 1; lead <= 3; lead++) {
        for (int share = 1; share <= 4; share++) {
            const double bend_rad = 0.25 * share * (double)rig_file.table.module.bend_limit_rad;
            const size_t count = plan_library_make(&rig_file.table, lead, bend_rad, library);
            for (size_t i = 0; i < count; i++) {
                if (!plan_check(&library[i].plan, &rig_file.table, &fault)) {
                    fail_msg("%s, step %zu: %s: %s", library[i].name, fault.step, fault.key, fault.text);
                }
                assert_true(plan_length_s(&library[i].plan) >= 20.0 &&
                            plan_length_s(&library[i].plan) <= 40.0);
            }
        }
    }
    free(library);
}

/* --- noise --- */

/* Without a slow part each sample stands for itself; a constant seen through the slow part alone is worth its
 * first sample and, of each later one, what the process forgets in between. */
static void whitening_is_that_of_a_markov_process(void **state) {
    (void)state;
    enum { SAMPLES = 50 };
    const double keeps = exp(-0.02 / 2.0);
    struct plan_noise noise;
    double signal[SAMPLES];
    assert_true(plan_noise_open(&noise, SAMPLES, 2));
    for (size_t i = 0; i < SAMPLES; i++) {
        noise.size[i] = 0.0;
        noise.size[SAMPLES + i] = 3.0;
        signal[i] = 6.0;
    }
    plan_noise_prepare(&noise, 0, 2.0, 2.0, 0.02);
    plan_noise_prepare(&noise, 1, 1e-9, 2.0, 0.02);
    plan_noise_whiten(&noise, 0, 2.0, 0.02, signal, 1);
    for (size_t i = 0; i < SAMPLES; i++) {
        assert_close(signal[i], 3.0, 1e-12);
        signal[i] = 6.0;
    }
    plan_noise_whiten(&noise, 1, 2.0, 0.02, signal, 1);
    assert_close(signal[0], 2.0, 1e-6);
    for (size_t i = 1; i < SAMPLES; i++) {
        assert_close(signal[i], 2.0 * (1.0 - keeps) / sqrt(1.0 - keeps * keeps), 1e-6);
    }
    plan_noise_close(&noise);
}

/* --- candidates --- */

static void candidates_come_from_a_report(void **state) {
    (void)state;
    static struct plan_candidates candidates;
    char module[PLAN_LABEL_BYTES], error[512];
    write_text(report_path,
               "{\"verdict\": \"group\", \"module\": \"paper-semicircle\", \"locus\": {\"chambers\": [2]},"
               " \"nominal\": {\"stiffness_scale\": {\"value\": 1.2}, \"supply_scale\": {\"value\": 0.9}},"
               " \"effects\": [{\"name\": \"tip_offset\", \"probability\": 0.95, \"parameters\": {\"x\": "
               "{\"value\": 0.002}}},"
               " {\"name\": \"line_volume\", \"chamber\": 2, \"probability\": 0.5, \"parameters\": "
               "{\"volume\": {\"value\": 2e-6}}}],"
               " \"alternatives\": [{\"name\": \"line_resistance\", \"chamber\": 3, \"probability\": 0.3,"
               " \"parameters\": {\"conductance_scale\": {\"value\": 0.8}}}],"
               " \"group\": [\"line_volume\", \"line_resistance\", \"chamber_leak\"]}\n");
    plan_candidates_init(&candidates);
    assert_true(plan_candidates_read(&candidates, report_path, module, error, sizeof error));
    assert_true(plan_candidates_finish(&candidates, error, sizeof error));
    assert_string_equal(module, "paper-semicircle");
    assert_int_equal(candidates.count, 3);
    assert_string_equal(candidates.candidate[0].label, "line_volume, chamber 2");
    assert_string_equal(candidates.candidate[1].label, "line_resistance, chamber 3");
    assert_string_equal(candidates.candidate[2].label, "chamber_leak, chamber 2");
    assert_true(candidates.candidate[1].measured && !candidates.candidate[2].measured);
    assert_close(plan_candidate_effect(&candidates.candidate[0])->parameter[0], 2e-6, 1e-12);
    assert_close(candidates.candidate[0].weight, 0.5 / 0.82, 1e-9);
    for (size_t i = 0; i < 3; i++) {
        const struct gap_model *model = &candidates.candidate[i].model;
        assert_close(model->stiffness_scale, 1.2, 1e-12);
        assert_close(model->supply_scale, 0.9, 1e-12);
        assert_int_equal(model->count, 2);
        assert_string_equal(model->effect[0].kind->name,
                            "tip_offset"); /* what is sure belongs to all of them */
        assert_close(model->effect[0].parameter[0], 0.002, 1e-12);
    }
    assert_int_equal(plan_candidates_lead(&candidates), 1);
}

static void a_name_that_a_group_has_twice_is_meant_for_one_chamber_and_for_all(void **state) {
    (void)state;
    static struct plan_candidates candidates;
    char module[PLAN_LABEL_BYTES], error[512];
    write_text(
        report_path,
        "{\"verdict\": \"group\", \"module\": \"paper-semicircle\", \"locus\": {\"chambers\": [1]},"
        " \"group\": [\"valve_sluggish\", \"line_resistance\", \"line_resistance\", \"line_resistance\"]}");
    plan_candidates_init(&candidates);
    assert_true(plan_candidates_read(&candidates, report_path, module, error, sizeof error));
    assert_int_equal(candidates.count, 3);
    assert_string_equal(candidates.candidate[0].label, "valve_sluggish, chamber 1");
    assert_string_equal(candidates.candidate[1].label, "line_resistance, chamber 1");
    assert_string_equal(candidates.candidate[2].label, "line_resistance");
}

static void without_a_group_the_least_sure_effect_is_in_question(void **state) {
    (void)state;
    static struct plan_candidates candidates;
    char module[PLAN_LABEL_BYTES], error[512];
    write_text(report_path,
               "{\"verdict\": \"effects\", \"effects\": [{\"name\": \"creep\", \"probability\": 0.99},"
               " {\"name\": \"gravity\", \"probability\": 0.7}],"
               " \"alternatives\": [{\"name\": \"tip_payload\", \"probability\": 0.2}]}");
    plan_candidates_init(&candidates);
    assert_true(plan_candidates_read(&candidates, report_path, module, error, sizeof error));
    assert_int_equal(candidates.count, 2);
    assert_string_equal(candidates.candidate[0].label, "gravity");
    assert_string_equal(candidates.candidate[1].label, "tip_payload");
    assert_string_equal(candidates.candidate[1].model.effect[0].kind->name, "creep");
}

static void assert_refused_report(const char *text, const char *words) {
    static struct plan_candidates candidates;
    char module[PLAN_LABEL_BYTES], error[512] = "";
    write_text(report_path, text);
    plan_candidates_init(&candidates);
    const bool read = plan_candidates_read(&candidates, report_path, module, error, sizeof error) &&
                      plan_candidates_finish(&candidates, error, sizeof error);
    assert_false(read);
    if (strstr(error, words) == NULL) {
        fail_msg("'%s' does not say '%s'", error, words);
    }
}

static void a_report_without_a_choice_is_refused(void **state) {
    (void)state;
    assert_refused_report("{\"verdict\": ", "report.json:1: ");
    assert_refused_report("{\"group\": []}", "verdict: missing");
    assert_refused_report("{\"verdict\": \"no-gap\"}", "no candidate");
    assert_refused_report("{\"verdict\": \"effect\", \"effects\": [{\"name\": \"creep\"}]}",
                          "one candidate only");
    assert_refused_report(
        "{\"verdict\": \"effects\", \"effects\": [{\"name\": \"creep\"}, {\"name\": \"gravity\"}]}",
        "one candidate only"); /* both are there; neither stands for the other */
    assert_refused_report("{\"verdict\": \"group\", \"group\": [\"creep\", \"creep\"]}",
                          "one candidate only");
    assert_refused_report("{\"verdict\": \"group\", \"group\": [\"creep\", \"magic\"]}",
                          "there is no effect 'magic'");
}

static void a_candidate_is_named_once(void **state) {
    (void)state;
    static struct plan_candidates candidates;
    char error[512];
    plan_candidates_init(&candidates);
    assert_true(plan_candidates_add(&candidates, "creep", error, sizeof error));
    assert_true(plan_candidates_add(&candidates, "creep:amplitude=0.2", error, sizeof error));
    assert_false(plan_candidates_finish(&candidates, error, sizeof error));
    assert_non_null(strstr(error, "creep is named twice"));
    plan_candidates_init(&candidates);
    assert_true(plan_candidates_add(&candidates, "creep", error, sizeof error));
    assert_true(plan_candidates_add(&candidates, "creep:form=2", error, sizeof error));
    assert_true(plan_candidates_finish(&candidates, error, sizeof error));
    assert_false(plan_candidates_add(&candidates, "magic", error, sizeof error));
}

/* --- the choice --- */

static void name_group(struct plan_candidates *candidates, const char *const *names, size_t count) {
    char error[512];
    plan_candidates_init(candidates);
    for (size_t i = 0; i < count; i++) {
        if (!plan_candidates_add(candidates, names[i], error, sizeof error)) {
            fail_msg("%s", error);
        }
    }
    assert_true(plan_candidates_finish(candidates, error, sizeof error));
}

static struct plan_bench bench_of_rig(void) {
    struct plan_bench bench = {.table = &rig_file.table};
    plant_default_parameters(&bench.nominal);
    return bench;
}

/* Followed by a module with any of the candidates, neither bend nor pressure pass their limits. */
static void assert_safe(const struct plan *plan, const struct plan_candidates *candidates) {
    const struct plan_bench bench = bench_of_rig();
    struct plan_fault fault;
    assert_true(plan_check(plan, &rig_file.table, &fault));
    for (size_t i = 0; i < candidates->count; i++) {
        struct plan_reach reach;
        assert_true(plan_drive_follow(&bench, &candidates->candidate[i].model, plan, NULL, &reach));
        assert_false(reach.fault);
        assert_true(reach.bend_rad <= (double)rig_file.table.module.bend_limit_rad);
        assert_true(reach.pressure_pa <= (double)rig_file.table.module.working_pressure_pa);
    }
}

/* The chosen plan has at most half the expected confusion of one chamber held all the time, and is safe. */
static void assert_halves(const char *const *names, size_t count) {
    static struct plan_candidates candidates;
    static struct plan_search search;
    const struct plan_bench bench = bench_of_rig();
    const struct plan_search_options options = {.threads = 0};
    name_group(&candidates, names, count);
    assert_int_equal(plan_search_run(&search, &bench, &candidates, &options), PLAN_FOUND);
    const struct plan_trial *chosen = search.trial[0];
    print_message("  %s ..: hold %.2g %%, random %.2g %%, %s %.2g %%\n", names[0],
                  100.0 * search.before.confusion, 100.0 * search.random.confusion, chosen->verdict.name,
                  100.0 * chosen->verdict.confusion);
    assert_true(chosen->verdict.confusion <= 0.5 * search.before.confusion);
    assert_true(chosen->safe && chosen->refined);
    assert_safe(&chosen->experiment.plan, &candidates);
    plan_search_close(&search);
}

static void a_line_that_is_long_or_narrow(void **state) {
    (void)state;
    static const char *const names[2] = {"line_volume", "line_resistance"};
    assert_halves(names, 2);
}

static void a_weight_or_a_stiff_end(void **state) {
    (void)state;
    static const char *const names[3] = {"gravity", "tip_payload", "end_restraint"};
    assert_halves(names, 3);
}

static void a_rubber_that_creeps_or_remembers(void **state) {
    (void)state;
    static const char *const names[2] = {"creep", "hysteresis"};
    assert_halves(names, 2);
}

static void a_pressure_sensor_off_by_a_sum_or_a_factor(void **state) {
    (void)state;
    static const char *const names[2] = {"pressure_offset", "pressure_gain"};
    assert_halves(names, 2);
}

/* Sensors that show too little let the pressures run higher than they are told: the experiments reach less
 * far. */
static void what_would_pass_a_limit_is_tried_less_far(void **state) {
    (void)state;
    static struct plan_candidates candidates;
    static struct plan_search search;
    static const char *const names[2] = {"pressure_gain:gain=0.8", "pressure_offset:offset=-1500"};
    const struct plan_bench bench = bench_of_rig();
    const struct plan_search_options options = {.threads = 0};
    name_group(&candidates, names, 2);
    assert_int_equal(plan_search_run(&search, &bench, &candidates, &options), PLAN_FOUND);
    assert_under(search.bend_rad, 0.7 * (double)rig_file.table.module.bend_limit_rad);
    assert_safe(&search.trial[0]->experiment.plan, &candidates);
    plan_search_close(&search);
}

/* The same effect twice, of two sizes: each explains what the other shows, so one guesses. */
static void what_is_the_same_stays_confused(void **state) {
    (void)state;
    static struct plan_candidates candidates;
    static struct plan_experiment experiment;
    struct plan_verdict verdict = {.length_s = 0.0};
    const struct plan_bench bench = bench_of_rig();
    plan_candidates_init(&candidates);
    char error[512];
    assert_true(plan_candidates_add(&candidates, "end_restraint:fraction=0.9", error, sizeof error));
    assert_true(plan_candidates_add(&candidates, "end_restraint:fraction=0.8", error, sizeof error));
    candidates.candidate[0].weight = candidates.candidate[1].weight = 0.5;
    plan_library_hold(&rig_file.table, 1, 1.0, &experiment);
    assert_true(plan_search_judge(&bench, &candidates, &experiment.plan, &verdict));
    assert_close(verdict.confusion, 0.5, 0.01);
    assert_close(verdict.left, 2.0, 0.04);
}

static void a_search_that_is_interrupted_says_so(void **state) {
    (void)state;
    static struct plan_candidates candidates;
    static struct plan_search search;
    static const char *const names[2] = {"tip_offset", "tip_lever_arm"};
    const volatile sig_atomic_t stop = 1;
    const struct plan_bench bench = bench_of_rig();
    const struct plan_search_options options = {.stop = &stop};
    name_group(&candidates, names, 2);
    assert_int_equal(plan_search_run(&search, &bench, &candidates, &options), PLAN_INTERRUPTED);
    plan_search_close(&search);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plan_is_read_as_written),
        cmocka_unit_test(every_kind_of_step_commands_what_it_says),
        cmocka_unit_test(a_ramp_behind_a_vent_starts_from_nothing),
        cmocka_unit_test(a_plan_that_is_written_is_read_back),
        cmocka_unit_test(a_note_cannot_break_the_file),
        cmocka_unit_test(a_plan_takes_no_more_than_it_has_room_for),
        cmocka_unit_test(appended_sines_keep_their_tones),
        cmocka_unit_test(a_bad_plan_is_refused_with_line_key_and_limit),
        cmocka_unit_test(a_ramp_behind_a_bend_is_refused),
        cmocka_unit_test(a_plan_without_a_file_is_refused),
        cmocka_unit_test(a_plan_is_followed_on_the_bus),
        cmocka_unit_test(the_library_keeps_the_limits),
        cmocka_unit_test(whitening_is_that_of_a_markov_process),
        cmocka_unit_test(candidates_come_from_a_report),
        cmocka_unit_test(a_name_that_a_group_has_twice_is_meant_for_one_chamber_and_for_all),
        cmocka_unit_test(without_a_group_the_least_sure_effect_is_in_question),
        cmocka_unit_test(a_report_without_a_choice_is_refused),
        cmocka_unit_test(a_candidate_is_named_once),
        cmocka_unit_test(a_line_that_is_long_or_narrow),
        cmocka_unit_test(a_weight_or_a_stiff_end),
        cmocka_unit_test(a_rubber_that_creeps_or_remembers),
        cmocka_unit_test(a_pressure_sensor_off_by_a_sum_or_a_factor),
        cmocka_unit_test(what_would_pass_a_limit_is_tried_less_far),
        cmocka_unit_test(what_is_the_same_stays_confused),
        cmocka_unit_test(a_search_that_is_interrupted_says_so)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
