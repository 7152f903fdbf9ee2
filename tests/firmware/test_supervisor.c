#include "support/test.h"

#include <stdlib.h>

#include "safety/limits.h"
#include "safety/supervisor.h"
#include "control/controller.h"
#include "program/table_file.h"
#include "support/synthetic_table.h"

static void run_to_safe(struct supervisor *supervisor) {
    supervisor_init(supervisor);
    for (int64_t time_us = 0; supervisor->state != SUPERVISOR_SAFE; time_us += 1000) {
        assert_true(supervisor_step(supervisor, time_us, 0u, true, SUPERVISOR_REQUEST_NONE));
        assert_true(time_us <= SUPERVISOR_PAUSE_US);
    }
}

static void start_goes_through_self_test_to_safe(void **state) {
    (void)state;
    struct supervisor supervisor;
    supervisor_init(&supervisor);
    assert_int_equal(supervisor.state, SUPERVISOR_BOOT);
    assert_false(supervisor_valves_enabled(&supervisor));
    assert_false(supervisor_supply_enabled(&supervisor));
    (void)supervisor_step(&supervisor, 0, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
    (void)supervisor_step(&supervisor, SUPERVISOR_PAUSE_US - 1, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
    (void)supervisor_step(&supervisor, SUPERVISOR_PAUSE_US, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SAFE);
    assert_false(supervisor_valves_enabled(&supervisor));
    (void)supervisor_step(&supervisor, 1000000, 1u, true, SUPERVISOR_REQUEST_NONE); /* the next one is short */
    (void)supervisor_step(&supervisor, 2000000, 0u, true, SUPERVISOR_REQUEST_CLEAR);
    (void)supervisor_step(&supervisor, 2000000 + SUPERVISOR_SELFTEST_US - 1, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
    (void)supervisor_step(&supervisor, 2000000 + SUPERVISOR_SELFTEST_US, 0u, true, SUPERVISOR_REQUEST_NONE);
    assert_int_equal(supervisor.state, SUPERVISOR_SAFE);
}

/* A board that restarts while motion commands fly, of any period that the command timeout allows: none of them starts it,
 * before they have paused. Its clock starts wherever it likes. */
static void a_stream_that_flew_at_the_start_is_refused(void **state) {
    (void)state;
    const int64_t starts_us[] = {0, -700000, 3600000000};
    for (int64_t period_ms = 1; period_ms < SUPERVISOR_PAUSE_US / 1000; period_ms += 6) {
        for (int64_t phase_ms = 0; phase_ms < period_ms; phase_ms += 1 + period_ms / 12) {
            struct supervisor supervisor;
            const int64_t start_us = starts_us[period_ms % 3];
            supervisor_init(&supervisor);
            int64_t last_ms = 0;
            for (int64_t ms = 0; ms < 3000; ms++) {
                const bool comes = (ms + phase_ms) % period_ms == 0;
                const enum supervisor_request request = comes ? SUPERVISOR_REQUEST_MOVE : SUPERVISOR_REQUEST_NONE;
                last_ms = comes ? ms : last_ms;
                assert_true(supervisor_step(&supervisor, start_us + 1000 * ms, 0u, true, request) != comes);
                assert_false(supervisor_valves_enabled(&supervisor));
            }
            const int64_t paused_us = start_us + 1000 * last_ms + SUPERVISOR_PAUSE_US;
            assert_true(supervisor_step(&supervisor, paused_us, 0u, true, SUPERVISOR_REQUEST_MOVE));
            assert_int_equal(supervisor.state, SUPERVISOR_ACTIVE);
        }
    }
}

static void an_unhealthy_module_stays_in_self_test(void **state) {
    (void)state;
    struct supervisor supervisor;
    supervisor_init(&supervisor);
    for (int64_t time_us = 0; time_us < 5000000; time_us += 1000) {
        (void)supervisor_step(&supervisor, time_us, 0u, false, SUPERVISOR_REQUEST_MOVE);
    }
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
    assert_false(supervisor_valves_enabled(&supervisor));
}

static void moves_and_holds_and_vents(void **state) {
    (void)state;
    struct supervisor supervisor;
    run_to_safe(&supervisor);
    assert_false(supervisor_step(&supervisor, SUPERVISOR_PAUSE_US + 1, 0u, true, SUPERVISOR_REQUEST_HOLD)); /* nothing to hold */
    assert_true(supervisor_step(&supervisor, SUPERVISOR_PAUSE_US + 2, 0u, true, SUPERVISOR_REQUEST_MOVE));
    assert_int_equal(supervisor.state, SUPERVISOR_ACTIVE);
    assert_true(supervisor_valves_enabled(&supervisor));
    assert_true(supervisor_step(&supervisor, SUPERVISOR_PAUSE_US + 3, 0u, true, SUPERVISOR_REQUEST_MOVE_ON));
    assert_true(supervisor_step(&supervisor, SUPERVISOR_PAUSE_US + 3, 0u, true, SUPERVISOR_REQUEST_HOLD));
    assert_int_equal(supervisor.state, SUPERVISOR_HOLD);
    assert_false(supervisor_step(&supervisor, SUPERVISOR_PAUSE_US + 3, 0u, true, SUPERVISOR_REQUEST_MOVE_ON));
    assert_int_equal(supervisor.state, SUPERVISOR_HOLD);
    assert_true(supervisor_step(&supervisor, SUPERVISOR_PAUSE_US + 4, 0u, true, SUPERVISOR_REQUEST_MOVE));
    assert_int_equal(supervisor.state, SUPERVISOR_ACTIVE);
    assert_true(supervisor_step(&supervisor, SUPERVISOR_PAUSE_US + 5, 0u, true, SUPERVISOR_REQUEST_VENT));
    assert_int_equal(supervisor.state, SUPERVISOR_SAFE);
    assert_false(supervisor_valves_enabled(&supervisor));
}

/* --- every state that can be reached, every input ---
 *
 * Between two steps pass 50 ms; times further back than the pause are all alike. With two faults, whether the self-test is
 * healthy and every request, this is all that the supervisor can do: breadth first from its start, until nothing new
 * comes. */

#define TICK_US 50000
#define AGES (SUPERVISOR_PAUSE_US / TICK_US + 1)
#define FAULT_SETS 4u

/* What a state of the supervisor was reached by, beside itself: has a clear been taken since the last fault was latched, and
 * has a self-test passed since the start or that clear? */
struct node {
    struct supervisor supervisor; /* its times are ages, <= 0 */
    bool cleared;
    bool tested;
};

static int age_of(int64_t at_us) {
    const int64_t age = -at_us / TICK_US;
    return (int)(age < AGES - 1 ? age : AGES - 1);
}

static size_t number_of(const struct node *node) {
    const struct supervisor *s = &node->supervisor;
    size_t number = (size_t)s->state;
    number = number * FAULT_SETS + s->faults;
    number = number * 2 + (s->armed ? 1 : 0);
    number = number * 2 + (s->started ? 1 : 0);
    number = number * 2 + (node->cleared ? 1 : 0);
    number = number * 2 + (node->tested ? 1 : 0);
    number = number * AGES + (size_t)age_of(s->entered_us);
    number = number * AGES + (size_t)age_of(s->cause_us);
    number = number * AGES + (size_t)age_of(s->motion_us);
    return number * AGES + (size_t)age_of(s->clear_us);
}

static int64_t aged(int64_t at_us) {
    return -(int64_t)age_of(at_us - TICK_US) * TICK_US;
}

struct event {
    uint32_t present;
    bool healthy;
    enum supervisor_request request;
};

/* What must hold of a step from `before` to `after`. */
static void check_step(const struct node *before, const struct event *event, const struct supervisor *after, bool accepted) {
    const struct supervisor *from = &before->supervisor;
    const bool air = supervisor_valves_enabled(after);
    assert_true((after->faults != 0u) == (after->state == SUPERVISOR_FAULT)); /* never anything else with a latched fault */
    if (after->state == SUPERVISOR_FAULT) {
        assert_false(air);
        assert_false(supervisor_supply_enabled(after));
    }
    assert_true(air == (after->state == SUPERVISOR_ACTIVE || after->state == SUPERVISOR_HOLD));
    if (event->present != 0u) {
        assert_int_equal(after->state, SUPERVISOR_FAULT);
        assert_int_equal(after->faults, from->faults | event->present);
        assert_true(event->request != SUPERVISOR_REQUEST_MOVE || !accepted);
        return;
    }
    if (from->state == SUPERVISOR_FAULT && after->state != SUPERVISOR_FAULT) { /* by a single clear, the cause long gone */
        assert_int_equal(event->request, SUPERVISOR_REQUEST_CLEAR);
        assert_int_equal(after->state, SUPERVISOR_SELFTEST);
        assert_true(age_of(from->cause_us) >= SUPERVISOR_ABSENT_US / TICK_US);
        assert_true(age_of(from->clear_us) >= SUPERVISOR_PAUSE_US / TICK_US);
    }
    if (from->state == SUPERVISOR_BOOT) {
        assert_int_equal(after->state, SUPERVISOR_SELFTEST);
    }
    if (from->state == SUPERVISOR_SELFTEST && after->state != SUPERVISOR_SELFTEST) {
        assert_true(event->healthy);
        assert_true(after->state == SUPERVISOR_SAFE || event->request == SUPERVISOR_REQUEST_MOVE);
        assert_true(from->started || age_of(from->entered_us) >= SUPERVISOR_PAUSE_US / TICK_US);
    }
    if (air && !supervisor_valves_enabled(from)) { /* a motion starts by a command of its own, never by a repetition, */
        assert_int_equal(event->request, SUPERVISOR_REQUEST_MOVE);
        assert_int_equal(after->state, SUPERVISOR_ACTIVE);
        assert_true(from->state == SUPERVISOR_SAFE || from->state == SUPERVISOR_SELFTEST);
        if (!from->armed) { /* and the first one after a self-test is no part of a stream */
            assert_true(age_of(from->motion_us) >= SUPERVISOR_PAUSE_US / TICK_US);
        }
    }
    if (!accepted) {
        assert_true(!air || supervisor_valves_enabled(from)); /* what is refused starts nothing */
    }
}

static void every_reachable_state_and_every_input(void **state) {
    (void)state;
    const size_t all = (size_t)SUPERVISOR_STATE_COUNT * FAULT_SETS * 16 * AGES * AGES * AGES * AGES;
    bool *seen = calloc(all, sizeof *seen);
    struct node *queue = malloc(all * sizeof *queue);
    assert_non_null(seen);
    assert_non_null(queue);
    size_t first = 0, count = 1, steps = 0;
    bool reached[SUPERVISOR_STATE_COUNT] = {false};
    supervisor_init(&queue[0].supervisor);
    queue[0].cleared = queue[0].tested = false;
    seen[number_of(&queue[0])] = true;
    while (first < count) {
        struct node node = queue[first++];
        reached[node.supervisor.state] = true;
        struct supervisor *s = &node.supervisor;
        s->entered_us = aged(s->entered_us);
        s->cause_us = aged(s->cause_us);
        s->motion_us = aged(s->motion_us);
        s->clear_us = aged(s->clear_us);
        for (uint32_t input = 0; input < FAULT_SETS * 2 * SUPERVISOR_REQUEST_COUNT; input++) {
            const struct event event = {input % FAULT_SETS, input / FAULT_SETS % 2u == 1u,
                                        (enum supervisor_request)(input / FAULT_SETS / 2u)};
            struct node next = node;
            const bool accepted = supervisor_step(&next.supervisor, 0, event.present, event.healthy, event.request);
            check_step(&node, &event, &next.supervisor, accepted);
            if (next.supervisor.state == SUPERVISOR_FAULT) {
                next.cleared = next.tested = false;
            } else if (s->state == SUPERVISOR_FAULT) {
                next.cleared = true;
            } else if (s->state == SUPERVISOR_SELFTEST && next.supervisor.state != SUPERVISOR_SELFTEST) {
                next.tested = true;
            }
            /* no way round the self-test, whatever happened before */
            assert_true(next.tested || !supervisor_valves_enabled(&next.supervisor));
            steps++;
            const size_t number = number_of(&next);
            if (!seen[number]) {
                seen[number] = true;
                queue[count++] = next;
            }
        }
    }
    for (size_t i = 0; i < SUPERVISOR_STATE_COUNT; i++) {
        assert_true(reached[i]);
    }
    print_message("           %zu states, %zu steps\n", count, steps);
    free(seen);
    free(queue);
}

static void a_stream_of_clears_does_not_clear(void **state) {
    (void)state;
    struct supervisor supervisor;
    run_to_safe(&supervisor);
    (void)supervisor_step(&supervisor, 1000000, 1u, true, SUPERVISOR_REQUEST_NONE);
    for (int64_t time_us = 1100000; time_us < 9000000; time_us += 100000) {
        const bool first = time_us == 1100000;
        const bool accepted = supervisor_step(&supervisor, time_us, first ? 1u : 0u, true, SUPERVISOR_REQUEST_CLEAR);
        assert_false(accepted);
        assert_int_equal(supervisor.state, SUPERVISOR_FAULT);
    }
    assert_true(supervisor_step(&supervisor, 9500000, 0u, true, SUPERVISOR_REQUEST_CLEAR));
    assert_int_equal(supervisor.state, SUPERVISOR_SELFTEST);
}

static void every_row_of_the_table_has_words(void **state) {
    (void)state;
    for (int s = 0; s < (int)SUPERVISOR_STATE_COUNT; s++) {
        assert_true(strlen(supervisor_state_name((enum supervisor_state)s)) > 3);
    }
    for (int f = 0; f < (int)FAULT_COUNT; f++) {
        const struct supervisor_fault_row *row = supervisor_fault_describe((enum supervisor_fault)f);
        assert_non_null(row);
        assert_true(strlen(row->name) > 5 && strlen(row->detector) > 5 && strlen(row->remedy) > 5);
        assert_true(strlen(row->reaction) > 5 && strlen(row->clear) > 5);
        for (int other = 0; other < f; other++) {
            assert_string_not_equal(row->name, supervisor_fault_describe((enum supervisor_fault)other)->name);
        }
    }
    for (int w = 0; w < (int)WARNING_COUNT; w++) {
        assert_true(strlen(supervisor_warning_text((enum supervisor_warning)w)) > 10);
    }
    assert_null(supervisor_fault_describe(FAULT_COUNT));
    assert_true((int)FAULT_COUNT <= 32 && (int)WARNING_COUNT <= 16); /* what the status message has room for */
}

/* --- limits --- */

static void pressures_at_and_over_the_limits(void **state) {
    (void)state;
    struct limits_parameters parameters;
    limits_default_parameters(&parameters, NULL);
    const bool ok[3] = {true, true, true};
    const struct {
        float pressure_pa;
        uint32_t faults;
    } cases[] = {{0.0f, 0u},
                 {-2000.0f, 0u}, /* an offset of the sensor is no fault */
                 {parameters.working_pressure_pa, 0u},
                 {parameters.hard_pressure_pa, 0u},
                 {parameters.hard_pressure_pa + 1.0f, 1u << FAULT_OVERPRESSURE},
                 {parameters.sensor_least_pa - 1.0f, 1u << FAULT_SENSOR_RANGE},
                 {NAN, 1u << FAULT_SENSOR_RANGE},
                 {-INFINITY, 1u << FAULT_SENSOR_RANGE}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        for (size_t c = 0; c < 3; c++) {
            float pressure_pa[3] = {0.0f, 0.0f, 0.0f};
            pressure_pa[c] = cases[i].pressure_pa;
            assert_int_equal(limits_check_pressures(&parameters, pressure_pa, pressure_pa, ok), cases[i].faults);
        }
    }
    const bool channel_2_lost[3] = {true, false, true};
    const float fine[3] = {1000.0f, 1000.0f, 1000.0f};
    assert_int_equal(limits_check_pressures(&parameters, fine, fine, channel_2_lost), 1u << FAULT_SENSOR_RANGE);
    const float broken[3] = {1000.0f, 1000.0f, parameters.sensor_most_pa};
    const float high[3] = {1000.0f, parameters.hard_pressure_pa + 1.0f, 1000.0f};
    assert_int_equal(limits_check_pressures(&parameters, broken, fine, ok), 1u << FAULT_SENSOR_RANGE);
    assert_int_equal(limits_check_pressures(&parameters, high, fine, ok), 0u); /* a gain that is known to be wrong */
    assert_int_equal(limits_check_pressures(&parameters, fine, high, ok), 1u << FAULT_OVERPRESSURE);
}

/* Any flipped bit of the checked part is found within one round, and a sound table never is. */
static void find_every_damage(bool busy) {
    struct synthetic_table synthetic;
    struct limits_parameters parameters;
    struct limits limits;
    synthetic_table_create(&synthetic, 5, 10000.0, 1.0, synthetic_module);
    limits_default_parameters(&parameters, &synthetic.table);
    limits_init(&limits);
    const uint32_t bytes = busy ? parameters.table_bytes_busy : parameters.table_bytes_per_step;
    const uint32_t round = synthetic.table.image_bytes / bytes + 2u;
    for (uint32_t step = 0; step < 5u * round; step++) {
        assert_false(limits_check_table(&limits, &synthetic.table, bytes));
    }
    for (size_t byte = 16; byte < synthetic.size; byte += 101) {
        limits_init(&limits);
        for (uint32_t step = 0; step < byte % round; step++) {
            assert_false(limits_check_table(&limits, &synthetic.table, bytes));
        }
        synthetic.image[byte] ^= 4u;
        bool found = false;
        for (uint32_t step = 0; step < 2u * round && !found; step++) {
            found = limits_check_table(&limits, &synthetic.table, bytes);
        }
        synthetic.image[byte] ^= 4u;
        assert_true(found);
        assert_true(limits_check_table(&limits, &synthetic.table, bytes)); /* latched: restart to go on */
    }
    synthetic_table_free(&synthetic);
}

static void the_running_table_check_finds_every_damage(void **state) {
    (void)state;
    find_every_damage(false);
    find_every_damage(true);
}

/* What the fault table says: the reference table within 1.9 s, however much else there is to do. No step that follows a tip
 * sample, of 255 a second, or works out duties, every tenth, has a part in it. */
static void a_round_of_the_table_check_ends_within_two_seconds(void **state) {
    (void)state;
    struct limits_parameters parameters;
    struct table_file file;
    assert_int_equal(table_file_open(&file, "tables/paper-semicircle.tbt", NULL), 0);
    limits_default_parameters(&parameters, &file.table);
    const double steps = (double)file.table.image_bytes / parameters.table_bytes_busy / ((1.0 - 0.255) * (1.0 - 0.1));
    assert_under(steps * CONTROLLER_STEP_US, 2000000.0);
    table_file_close(&file);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_goes_through_self_test_to_safe),
        cmocka_unit_test(a_stream_that_flew_at_the_start_is_refused),
        cmocka_unit_test(an_unhealthy_module_stays_in_self_test),
        cmocka_unit_test(moves_and_holds_and_vents),
        cmocka_unit_test(every_reachable_state_and_every_input),
        cmocka_unit_test(a_stream_of_clears_does_not_clear),
        cmocka_unit_test(every_row_of_the_table_has_words),
        cmocka_unit_test(pressures_at_and_over_the_limits),
        cmocka_unit_test(the_running_table_check_finds_every_damage),
        cmocka_unit_test(a_round_of_the_table_check_ends_within_two_seconds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
