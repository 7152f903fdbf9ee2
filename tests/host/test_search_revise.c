/* What gives way to what could be in its place: beliefs are made up. */
#include "host/leaving.h"

static struct search search;

/* One place with two kinds, of which the best model holds the first. */
static void hold(const char *held, double belief, double held_leaves, const char *other, double other_leaves) {
    search.recalibrated = leaving(0.0, 1000.0, NULL, NULL);
    search.best = leaving(0.0, held_leaves, held, NULL);
    search.rivals_count = 1;
    struct rivals *rivals = &search.rivals[0];
    *rivals = (struct rivals){.place = 0, .count = 2, .rest = search.recalibrated};
    const struct fit fit[] = {search.best, leaving(0.0, other_leaves, other, NULL)};
    for (size_t i = 0; i < 2; i++) {
        const size_t at = (belief > 0.5) == (i == 0) ? 0 : 1;
        rivals->rival[at] = (struct rival){.kind = fit[i].model.effect[0].kind, .effect = fit[i].model.effect[0], .fit = fit[i],
                                           .belief = i == 0 ? belief : 1.0 - belief};
    }
}

static void assert_asked(struct search_past *past, const char *name) {
    const struct fit *asked = search_ask_rivals(&search, past);
    if (name == NULL) {
        assert_null(asked);
    } else {
        assert_non_null(asked);
        assert_string_equal(asked->model.effect[0].kind->name, name);
    }
}

static void believed_rival_is_put_in_place(void **state) {
    struct search_past past = {.count = 0};
    (void)state;
    hold("gravity", 0.9, 5.0, "tip_payload", 6.0);
    assert_asked(&past, NULL);
    hold("gravity", 0.4, 5.0, "tip_payload", 6.0); /* neither is sure */
    assert_asked(&past, NULL);
    assert_int_equal(past.count, 0);
    hold("gravity", 0.3, 5.0, "tip_payload", 6.0);
    assert_asked(&past, "tip_payload");
    assert_int_equal(past.count, 1);
    assert_string_equal(past.kind[0]->name, "gravity");
}

/* Weights follow what is held, so two may each speak for the other. */
static void of_two_that_speak_for_each_other_the_better_stays(void **state) {
    struct search_past past = {.count = 0};
    (void)state;
    hold("gravity", 0.05, 30.0, "tip_misalignment", 60.0);
    assert_asked(&past, "tip_misalignment");
    hold("tip_misalignment", 0.05, 100.0, "gravity", 40.0);
    assert_asked(&past, "gravity"); /* back, as it leaves less */
    hold("gravity", 0.2, 25.0, "tip_misalignment", 65.0);
    assert_asked(&past, NULL);
    past.count = 0;
    assert_asked(&past, "tip_misalignment"); /* had it not been there already */
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(believed_rival_is_put_in_place),
                                       cmocka_unit_test(of_two_that_speak_for_each_other_the_better_stays)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
