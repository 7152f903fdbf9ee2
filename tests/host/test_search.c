/* The search for effects: several at once, late ones, ones that cannot be told apart or are not to be tried; threads and a stop. */
#include "host/diagnosed.h"

#include <time.h>

#include "gap/report.h"
#include "support/scratch.h"

#define SECONDS 6.0
#define RUNS 2
#define JSON_BYTES 65536

static struct diagnosed diagnosed;
static const struct diagnosis *const diagnosis = &diagnosed.diagnosis;

static void diagnose(const char *first, const char *second, const struct search_options *options) {
    diagnosed_open(&diagnosed, &(struct recording){.effect = {first, second}, .seconds = SECONDS, .runs = RUNS, .seed = 2}, options);
}

static void two_effects_are_both_named(void **state) {
    (void)state;
    diagnose("pressure_offset:offset=1000,chamber=3", "creep:amplitude=0.12,time_constant=1", NULL);
    assert_verdict(diagnosis, GAP_EFFECTS);
    assert_int_equal(diagnosis->effects, 2);
    const struct diagnosis_effect *offset = diagnosed_effect(diagnosis, "pressure_offset");
    const struct diagnosis_effect *creep = diagnosed_effect(diagnosis, "creep");
    assert_non_null(offset);
    assert_non_null(creep);
    assert_int_equal(offset->chamber, 3);
    assert_holds(&offset->parameter[0], 1000.0);
    assert_holds(&creep->parameter[0], 0.12);
    for (size_t i = 0; i < 2; i++) { /* what has one sign is doubted by a factor */
        const struct diagnosis_interval *interval = &creep->parameter[i];
        assert_close(interval->high / interval->value, interval->value / interval->low, 1e-9);
    }
    assert_true(diagnosis->closed.value > 0.97);
    diagnosed_close(&diagnosed);
}

/* A sensor's geometry has no other form than its own: the little that it leaves is another effect's. */
static void small_effect_beside_a_sensors_geometry_is_named(void **state) {
    static const char *const beside[] = {"valve_dead_time:delay=0.003", "line_volume:volume=2e-6"};
    static const char *const name[] = {"valve_dead_time", "line_volume"};
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        diagnose("tip_lever_arm:x=-0.0008,y=0.0013,z=0.0008", beside[i], NULL);
        assert_verdict(diagnosis, GAP_EFFECTS);
        assert_int_equal(diagnosis->effects, 2);
        assert_non_null(diagnosed_effect(diagnosis, "tip_lever_arm"));
        assert_non_null(diagnosed_effect(diagnosis, name[i]));
        diagnosed_close(&diagnosed);
    }
}

/* What is not to be tried is found nowhere: neither among what is tried nor in what is said. */
static void effect_that_is_left_out_is_not_named(void **state) {
    static const char *const names[] = {"creep", "mullins"};
    const struct search_options options = {.threads = 1, .without = names, .without_count = 2};
    (void)state;
    diagnose("creep:amplitude=0.12,time_constant=1", NULL, &options);
    for (size_t n = 0; n < 2; n++) {
        assert_null(diagnosed_effect(diagnosis, names[n]));
        assert_false(diagnosed_in_group(diagnosis, names[n]));
        for (size_t i = 0; i < diagnosis->alternatives; i++) {
            assert_string_not_equal(diagnosis->alternative[i].effect->kind->name, names[n]);
        }
        for (size_t t = 0; t < diagnosed.search.trials; t++) {
            const struct gap_model *model = &diagnosed.search.trial[t].fit.model;
            for (size_t e = 0; e < model->count; e++) {
                assert_string_not_equal(model->effect[e].kind->name, names[n]);
            }
        }
    }
    assert_true(diagnosed.search.trials > 0);
    assert_verdict(diagnosis, GAP_UNKNOWN); /* nothing else goes on yielding */
    diagnosed_close(&diagnosed);
}

/* With another entry of the same stage left out, what is found may as well be that one; else it is nearly sure. */
static void name_beside_one_that_was_not_tried_is_half_sure(void **state) {
    static const char *const beside = "tip_misalignment", *const elsewhere = "creep";
    (void)state;
    for (int k = 0; k < 2; k++) {
        const struct search_options options = {.without = k == 0 ? &beside : &elsewhere, .without_count = 1};
        diagnose("tip_latency:delay=0.03", NULL, &options);
        assert_verdict(diagnosis, GAP_EFFECT);
        assert_string_equal(diagnosis->effect[0].kind->name, "tip_latency");
        assert_true(k == 0 ? diagnosis->effect[0].probability <= 0.5
                           : diagnosis->effect[0].probability > 0.9 && diagnosis->effect[0].probability < 0.98);
        diagnosed_close(&diagnosed);
    }
}

/* Repeats are seen as such; what is faint beside them is looked for like any second effect. */
static void effect_beside_repeats_is_named(void **state) {
    (void)state;
    diagnose("tip_freeze:fraction=0.35", "tip_latency:delay=0.004", NULL);
    assert_verdict(diagnosis, GAP_EFFECTS);
    assert_int_equal(diagnosis->effects, 2);
    assert_non_null(diagnosed_effect(diagnosis, "tip_freeze"));
    assert_non_null(diagnosed_effect(diagnosis, "tip_latency"));
    diagnosed_close(&diagnosed);
}

/* Repeats that begin late are counted from there. */
static void repeats_from_mid_run_have_their_onset_and_share(void **state) {
    (void)state;
    diagnose("tip_freeze:fraction=0.3,onset=4", NULL, NULL);
    assert_verdict(diagnosis, GAP_EFFECT);
    assert_string_equal(diagnosis->effect[0].kind->name, "tip_freeze");
    assert_close(diagnosis->effect[0].onset_s, 4.0, 0.3);
    assert_holds(&diagnosis->effect[0].parameter[0], 0.3);
    assert_true(diagnosis->effect[0].parameter[0].low > 0.2);
    diagnosed_close(&diagnosed);
}

static void effect_from_mid_run_has_its_onset(void **state) {
    (void)state;
    diagnosed_open(&diagnosed, &(struct recording){.effect = {"pressure_gain:gain=1.1,chamber=1,onset=6.3"}, .seconds = 12.0, .seed = 2},
                   NULL);
    assert_verdict(diagnosis, GAP_EFFECT);
    assert_string_equal(diagnosis->effect[0].kind->name, "pressure_gain");
    assert_int_equal(diagnosis->effect[0].chamber, 1);
    assert_close(diagnosis->effect[0].onset_s, 6.3, 0.5);
    assert_memory_equal(diagnosis->regime, "from ", 5);
    diagnosed_close(&diagnosed);
}

/* While an effect is taken to act from the start, one that sets in half way looks like several others. */
static void effect_that_sets_in_late_is_not_taken_for_another(void **state) {
    static const char *const late[] = {"chamber_asymmetry:gain=1.07,azimuth=-0.0228,chamber=3,onset=8",
                                       "gravity:angle=0.4,weight_scale=0.75,onset=8"};
    static const char *const name[] = {"chamber_asymmetry", "gravity"};
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        diagnosed_open(&diagnosed, &(struct recording){.effect = {late[i]}, .seconds = 16.0, .seed = 2}, NULL);
        assert_verdict(diagnosis, GAP_EFFECT);
        assert_string_equal(diagnosis->effect[0].kind->name, name[i]);
        assert_close(diagnosis->effect[0].onset_s, 8.0, 0.3);
        diagnosed_close(&diagnosed);
    }
}

/* Rubber that had crept unseen goes on from there. */
static void what_remembers_from_before_its_onset_is_seen_to(void **state) {
    (void)state;
    diagnosed_open(&diagnosed,
                   &(struct recording){.effect = {"creep:amplitude=0.08,time_constant=4,onset=8,latent=1"}, .seconds = 16.0, .seed = 2},
                   NULL);
    assert_verdict(diagnosis, GAP_EFFECT);
    assert_string_equal(diagnosis->effect[0].kind->name, "creep");
    assert_true(diagnosis->effect[0].latent);
    assert_close(diagnosis->effect[0].onset_s, 8.0, 0.3);
    diagnosed_close(&diagnosed);
    diagnosed_open(&diagnosed, &(struct recording){.effect = {"creep:amplitude=0.08,time_constant=4,onset=8"}, .seconds = 16.0, .seed = 2},
                   NULL);
    assert_verdict(diagnosis, GAP_EFFECT);
    assert_true(!diagnosis->effect[0].latent);
    assert_close(diagnosis->effect[0].onset_s, 8.0, 0.3);
    diagnosed_close(&diagnosed);
}

/* More than the largest volume: the fit ends at the bound, and what it ends at is not named. */
static void size_at_its_bound_is_not_believed(void **state) {
    (void)state;
    diagnose("line_volume:volume=8e-6", "line_volume:volume=4e-7", NULL);
    assert_verdict(diagnosis, GAP_UNKNOWN);
    diagnosed_close(&diagnosed);
}

/* All sensors too high is a supply, a stiffness and a valve that are off together: either is said to be possible, or the right
 * one is named, but no wrong one with certainty. */
static void gain_of_all_sensors_is_not_taken_for_another(void **state) {
    (void)state;
    diagnose("pressure_gain:gain=1.08", NULL, NULL);
    const bool named = diagnosis->verdict == GAP_EFFECT && diagnosed_effect(diagnosis, "pressure_gain") != NULL;
    const bool grouped = diagnosis->verdict == GAP_GROUP && diagnosed_in_group(diagnosis, "pressure_gain");
    if (!named && !grouped) {
        fail_msg("%s, first effect %s", gap_verdict_name(diagnosis->verdict),
                 diagnosis->effects > 0 ? diagnosis->effect[0].kind->name : "none");
    }
    for (size_t e = 0; e < diagnosis->effects; e++) {
        const bool right = strcmp(diagnosis->effect[e].kind->name, "pressure_gain") == 0;
        assert_true(right || diagnosis->effect[e].probability <= 0.7);
    }
    diagnosed_close(&diagnosed);
}

/* --- threads, a stop --- */

static void write_json(char *text) {
    char path[SCRATCH_BYTES], error[512];
    const int file = scratch_file(path);
    assert_true(file >= 0 && close(file) == 0);
    if (!gap_report_json(diagnosis, &diagnosed.data, path, error, sizeof error)) {
        fail_msg("%s", error);
    }
    FILE *in = fopen(path, "r");
    assert_non_null(in);
    text[fread(text, 1, JSON_BYTES - 1, in)] = '\0';
    assert_int_equal(fclose(in), 0);
    (void)remove(path);
}

static void search_again(const struct search_options *options) {
    struct plant_parameters nominal;
    plant_default_parameters(&nominal);
    search_close(&diagnosed.search);
    assert_true(search_run(&diagnosed.search, &diagnosed.data, &recording_table.table, &nominal, options));
    assert_true(diagnosis_conclude(&diagnosed.diagnosis, &diagnosed.search));
}

static void any_number_of_threads_says_the_same(void **state) {
    static char one[JSON_BYTES], two[JSON_BYTES];
    const struct search_options options = {.threads = 2};
    (void)state;
    diagnose("line_volume:volume=3e-6", NULL, NULL);
    write_json(one);
    search_again(&options);
    write_json(two);
    assert_true(strlen(one) > 500);
    assert_string_equal(one, two);
    diagnosed_close(&diagnosed);
}

struct watch {
    volatile sig_atomic_t stop;
    size_t tried;      /* candidates, before the stop */
    clock_t stopped;   /* processor time then */
    bool again;        /* a later stage was begun */
};

/* Stops in the middle of the first look at the candidates. */
static void watch_progress(void *context, const char *what, size_t done, size_t total) {
    struct watch *watch = context;
    const bool candidates = effect_kind_find(what) != NULL;
    watch->again = watch->again || (watch->stop != 0 && !candidates);
    watch->tried += candidates && watch->stop == 0;
    if (watch->stop == 0 && candidates && done > total / 2) {
        watch->stop = 1;
        watch->stopped = clock();
    }
}

static void stop_ends_the_search_soon(void **state) {
    struct watch watch = {.stop = 0};
    const struct search_options options = {.threads = 1, .stop = &watch.stop, .context = &watch, .progress = watch_progress};
    (void)state;
    clock_t begun = clock();
    diagnose("line_volume:volume=3e-6", NULL, NULL);
    const clock_t whole = clock() - begun;
    assert_false(diagnosed.search.interrupted);
    search_again(&options);
    const clock_t after = clock() - watch.stopped;
    assert_true(watch.tried > 0);
    assert_true(diagnosed.search.interrupted);
    assert_false(watch.again);
    assert_under((double)after / (double)whole, 0.5);
    /* what was known by then is there: the recalibration, and what it leaves */
    assert_true(diagnosed.search.recalibrated.sound && diagnosed.search.best.sound && diagnosed.search.everything.sound);
    assert_true(diagnosis->structure[0] > 10.0 && diagnosis->structure[1] > 10.0);
    assert_true(diagnosis->structure[2] <= diagnosis->structure[1]);
    assert_true(diagnosis->verdict != GAP_NONE && diagnosis->verdict != GAP_RECALIBRATE && diagnosis->verdict != GAP_INSUFFICIENT_DATA);
    diagnosed_close(&diagnosed);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_effects_are_both_named),
        cmocka_unit_test(small_effect_beside_a_sensors_geometry_is_named),
        cmocka_unit_test(effect_that_is_left_out_is_not_named),
        cmocka_unit_test(name_beside_one_that_was_not_tried_is_half_sure),
        cmocka_unit_test(effect_beside_repeats_is_named),
        cmocka_unit_test(repeats_from_mid_run_have_their_onset_and_share),
        cmocka_unit_test(effect_from_mid_run_has_its_onset),
        cmocka_unit_test(effect_that_sets_in_late_is_not_taken_for_another),
        cmocka_unit_test(what_remembers_from_before_its_onset_is_seen_to),
        cmocka_unit_test(size_at_its_bound_is_not_believed),
        cmocka_unit_test(gain_of_all_sensors_is_not_taken_for_another),
        cmocka_unit_test(any_number_of_threads_says_the_same), cmocka_unit_test(stop_ends_the_search_soon)};
    return cmocka_run_group_tests(tests, recording_set_up, recording_tear_down);
}
