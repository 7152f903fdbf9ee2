/* What earns a further effect its place: fits are made up, by what each leaves of the pressures and of the tip. */
#include "host/leaving.h"

static struct search search;

static bool earns(const struct fit *before, const struct fit *after) {
    return search_earns_place(&search, before, after);
}

static void first_effect_explains_a_share_of_the_gap(void **state) {
    const struct fit none = leaving(50.0, 800.0, NULL, NULL);
    const struct fit most = leaving(1.0, 10.0, "creep", NULL), hardly = leaving(50.0, 790.0, "creep", NULL);
    (void)state;
    search.recalibrated = none;
    assert_true(earns(&none, &most));
    assert_false(earns(&none, &hardly));
}

/* The smaller the rest, the more of it must be explained. */
static void small_rest_may_be_the_form(void **state) {
    static const double rest[] = {100.0, 25.0, 10.0, 2.0}; /* of 1000: 10, 2.5, 1 and 0.2 % */
    static const double enough[] = {0.65, 0.45, 0.15, 0.04}; /* of it, left */
    static const double too_much[] = {0.75, 0.55, 0.25, 0.12};
    (void)state;
    search.recalibrated = leaving(0.0, 1000.0, NULL, NULL);
    for (size_t i = 0; i < 4; i++) {
        const struct fit before = leaving(0.0, rest[i], "gravity", NULL);
        const struct fit enough_of_it = leaving(0.0, enough[i] * rest[i], "gravity", "tip_lever_arm");
        const struct fit too_little = leaving(0.0, too_much[i] * rest[i], "gravity", "tip_lever_arm");
        assert_true(earns(&before, &enough_of_it));
        assert_false(earns(&before, &too_little));
    }
}

/* .. the more so where the law itself is in doubt: the rest of a loop's shape is no creep. */
static void much_that_is_left_may_be_the_form_of_a_doubtful_law(void **state) {
    (void)state;
    search.recalibrated = leaving(0.0, 36.0, NULL, NULL);
    for (int lawful = 0; lawful < 2; lawful++) {
        const char *const first = lawful == 1 ? "end_restraint" : "hysteresis";
        const struct fit before = leaving(0.0, 2.0, first, NULL), with = leaving(0.0, 1.1, first, "creep");
        assert_int_equal(earns(&before, &with), lawful);
    }
}

/* What a bent field does in one form another law of the body does, too. */
static void one_form_of_a_bent_field_is_no_simple_effect(void **state) {
    const struct fit before = leaving(0.0, 5.0, "gravity", NULL);
    const struct fit bent = leaving(0.0, 0.1, "gravity", "tip_distortion:form=6");
    const struct fit offset = leaving(0.0, 0.1, "gravity", "tip_offset");
    (void)state;
    search.recalibrated = leaving(0.0, 1000.0, NULL, NULL);
    assert_false(earns(&before, &bent));
    assert_true(earns(&before, &offset));
}

/* A misalignment is a part of a bent field, and yet a field beside it is something new. */
static void what_makes_an_effect_its_part_is_not_more_of_the_same(void **state) {
    const struct fit before = leaving(0.0, 0.5, "tip_misalignment", NULL);
    struct fit bent = leaving(0.0, 0.3, "tip_misalignment", "tip_distortion:form=1");
    struct effect other_form = bent.model.effect[1];
    (void)state;
    search.recalibrated = leaving(0.0, 1000.0, NULL, NULL);
    assert_true(search_is_better(&before, &bent));
    assert_false(earns(&before, &bent));
    other_form.form = 2;
    gap_model_add(&bent.model, &other_form);
    assert_false(earns(&before, &bent));
}

/* .. but once it bends, they are more of the same. */
static void part_of_a_bent_field_is_more_of_the_same(void **state) {
    const struct fit before = leaving(0.0, 3.0, "tip_distortion:form=1", NULL);
    const struct fit with = leaving(0.0, 2.2, "tip_distortion:form=1", "tip_offset");
    (void)state;
    search.recalibrated = leaving(0.0, 1000.0, NULL, NULL);
    assert_true(earns(&before, &with));
}

/* A rest elsewhere than the gap lies is small beside the whole, however large a share of that place it is. */
static void rest_elsewhere_is_small_beside_the_whole(void **state) {
    const struct fit before = leaving(0.8, 10.0, "contact", NULL);
    const struct fit halved = leaving(0.35, 10.0, "contact", "line_volume"), gone = leaving(0.0, 10.0, "contact", "line_volume");
    (void)state;
    search.recalibrated = leaving(1.0, 9000.0, NULL, NULL);
    assert_false(earns(&before, &halved));
    assert_true(earns(&before, &gone));
}

/* After geometry, scale and timing of sensors, however little is left is another effect's; after a law of the body it is not. */
static void rest_of_exact_effects_is_not_their_form(void **state) {
    (void)state;
    search.recalibrated = leaving(0.5, 3000.0, NULL, NULL);
    for (int exact = 0; exact < 2; exact++) {
        const char *const first = exact == 1 ? "tip_lever_arm" : "end_restraint";
        const struct fit before = leaving(0.06, 0.6, first, NULL);
        const struct fit with = leaving(0.0, 0.25, first, "line_volume"), polish = leaving(0.05, 0.5, first, "line_volume");
        assert_int_equal(earns(&before, &with), exact);
        assert_false(earns(&before, &polish));
    }
    search.recalibrated = leaving(0.0, 3000.0, NULL, NULL);
    const struct fit before = leaving(0.0, 4.0, "tip_offset", NULL);
    const struct fit half = leaving(0.0, 1.8, "tip_offset", "tip_misalignment"); /* so much is no more the rest of all */
    assert_false(earns(&before, &half));
}

static void what_another_explains_better_gives_no_place(void **state) {
    const struct fit before = leaving(0.4, 17.0, "temperature_stiffness", NULL);
    const struct fit line = leaving(0.19, 15.0, "temperature_stiffness", "line_resistance");
    const struct fit creep = leaving(0.0, 7.0, "temperature_stiffness", "creep");
    const struct fit bent = leaving(0.0, 7.0, "temperature_stiffness", "tip_distortion:form=1");
    const struct fit elsewhere = leaving(0.15, 7.0, "temperature_stiffness", "creep"); /* of the tip, mostly */
    (void)state;
    search.recalibrated = leaving(1.6, 1300.0, NULL, NULL);
    assert_true(earns(&before, &line)); /* by itself */
    assert_true(search_is_forestalled(&search, &before, &line, &creep));
    assert_true(search_is_forestalled(&search, &before, &line, &bent));
    assert_false(search_is_forestalled(&search, &before, &line, &elsewhere));
    assert_false(search_is_forestalled(&search, &before, &creep, &line));
    const struct fit exact = leaving(0.06, 0.6, "tip_lever_arm", NULL);
    const struct fit volume = leaving(0.0, 0.25, "tip_lever_arm", "line_volume");
    const struct fit hair = leaving(0.0, 0.249, "tip_lever_arm", "creep"), much = leaving(0.0, 0.05, "tip_lever_arm", "creep");
    assert_false(search_is_forestalled(&search, &exact, &volume, &hair)); /* better by a hair */
    assert_true(search_is_forestalled(&search, &exact, &volume, &much));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(first_effect_explains_a_share_of_the_gap),
                                       cmocka_unit_test(small_rest_may_be_the_form),
                                       cmocka_unit_test(much_that_is_left_may_be_the_form_of_a_doubtful_law),
                                       cmocka_unit_test(one_form_of_a_bent_field_is_no_simple_effect),
                                       cmocka_unit_test(what_makes_an_effect_its_part_is_not_more_of_the_same),
                                       cmocka_unit_test(part_of_a_bent_field_is_more_of_the_same),
                                       cmocka_unit_test(rest_elsewhere_is_small_beside_the_whole),
                                       cmocka_unit_test(rest_of_exact_effects_is_not_their_form),
                                       cmocka_unit_test(what_another_explains_better_gives_no_place)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
