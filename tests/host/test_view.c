/* The arm of the live view: who may command, until when, and what is sent when nobody may any more. */
#include <math.h>
#include <string.h>

#include "support/test.h"
#include "view/view_request.h"

#define SECOND 1000000
#define BEND_RAD 0.5f

static void open_arm(struct view_arm *arm) {
    const struct view_arm_parameters parameters = {.lease_us = SECOND, .idle_us = 60 * SECOND};
    view_arm_init(arm, &parameters);
}

static const struct controller_command bend = {.kind = COMMAND_BEND, .bend_rad = BEND_RAD};

/* The kind that is sent at a time; COMMAND_NONE: nothing. */
static enum controller_command_kind sent(struct view_arm *arm, enum supervisor_state state, int64_t time_us) {
    struct controller_command command;
    return view_arm_step(arm, state, time_us, &command) ? command.kind : COMMAND_NONE;
}

static void nothing_is_sent_without_arm(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_false(view_arm_command(&arm, "a", &bend, 0));
    assert_int_equal(sent(&arm, SUPERVISOR_SAFE, 0), COMMAND_NONE);
}

static void armed_page_commands_and_repeats(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_true(view_arm_take(&arm, "a", 0));
    assert_int_equal(sent(&arm, SUPERVISOR_SAFE, 0), COMMAND_NONE); /* armed, nothing commanded */
    assert_true(view_arm_command(&arm, "a", &bend, 1000));
    assert_int_equal(sent(&arm, SUPERVISOR_SAFE, 1000), COMMAND_BEND);
    assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, 2000), COMMAND_NONE);
    assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, 1000 + VIEW_REPEAT_US), COMMAND_BEND);
}

static void one_page_at_a_time(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_true(view_arm_take(&arm, "a", 0));
    assert_false(view_arm_take(&arm, "b", 0));
    assert_false(view_arm_command(&arm, "b", &bend, 0));
    view_arm_release(&arm, "b", VIEW_ARM_GONE, 0);
    assert_true(arm.armed);
    view_arm_release(&arm, "a", VIEW_ARM_DISARMED, 0);
    assert_true(view_arm_take(&arm, "b", 0));
}

static void silent_page_vents(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_true(view_arm_take(&arm, "a", 0));
    assert_true(view_arm_command(&arm, "a", &bend, 0));
    assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, SECOND), COMMAND_BEND);
    assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, SECOND + 1), COMMAND_VENT);
    assert_int_equal(arm.end, VIEW_ARM_SILENT);
    assert_false(view_arm_command(&arm, "a", &bend, SECOND + 2)); /* it must arm again */
}

static void untouched_page_vents(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_true(view_arm_take(&arm, "a", 0));
    for (int64_t t = 0; t <= 60 * SECOND; t += SECOND / 2) {
        assert_true(view_arm_command(&arm, "a", &bend, t));
        assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, t), COMMAND_BEND);
    }
    assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, 60 * SECOND + VIEW_REPEAT_US), COMMAND_VENT);
    assert_int_equal(arm.end, VIEW_ARM_IDLE);
}

static void fault_ends_the_arm(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_true(view_arm_take(&arm, "a", 0));
    assert_true(view_arm_command(&arm, "a", &bend, 0));
    assert_int_equal(sent(&arm, SUPERVISOR_FAULT, 1), COMMAND_VENT);
    view_arm_clear(&arm);
    assert_int_equal(sent(&arm, SUPERVISOR_FAULT, 2 * SECOND), COMMAND_CLEAR);
    assert_int_equal(sent(&arm, SUPERVISOR_SAFE, 3 * SECOND),
                     COMMAND_NONE); /* a clear does not bring the motion back */
}

static void silent_board_ends_the_arm(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_true(view_arm_take(&arm, "a", 0));
    assert_true(view_arm_command(&arm, "a", &bend, 0));
    view_arm_lose(&arm, 1000);
    assert_false(view_arm_command(&arm, "a", &bend, 2000)); /* no motion when it comes back */
    assert_int_equal(sent(&arm, SUPERVISOR_SAFE, 3000), COMMAND_VENT);
    assert_int_equal(arm.end, VIEW_ARM_LOST);
}

static void vent_comes_from_anybody_at_any_time(void **state) {
    struct view_arm arm;
    (void)state;
    open_arm(&arm);
    assert_true(view_arm_take(&arm, "a", 0));
    assert_true(view_arm_command(&arm, "a", &bend, 0));
    assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, 0), COMMAND_BEND);
    view_arm_vent(&arm, 5000);
    assert_int_equal(sent(&arm, SUPERVISOR_ACTIVE, 5000),
                     COMMAND_VENT); /* no waiting for the next repetition */
    assert_false(arm.armed);
}

static void loopback_names_and_addresses(void **state) {
    (void)state;
    assert_true(view_host_is_loopback("127.0.0.1:8642"));
    assert_true(view_host_is_loopback("localhost"));
    assert_true(view_host_is_loopback("[::1]:1"));
    assert_false(view_host_is_loopback("localhost.example.org"));
    assert_false(view_host_is_loopback("127.0.0.1.example.org:80"));
    assert_false(view_host_is_loopback("localhost:80@example.org"));
    assert_false(view_host_is_loopback(NULL));
    assert_true(view_address_is_loopback("127.8.0.1"));
    assert_true(view_address_is_loopback("::1"));
    assert_false(view_address_is_loopback("0.0.0.0"));
    assert_false(view_address_is_loopback("::"));
}

static void origins(void **state) {
    (void)state;
    assert_true(view_origin_is_own(NULL, "localhost:1"));
    assert_true(view_origin_is_own("http://localhost:1", "localhost:1"));
    assert_false(view_origin_is_own("http://localhost:2", "localhost:1"));
    assert_false(view_origin_is_own("null", "localhost:1"));
    assert_false(view_origin_is_own("http://localhost:1", NULL));
}

static void tokens(void **state) {
    struct view_access access = {.loopback = false}, other;
    (void)state;
    assert_false(view_token_matches(&access, "")); /* no token is no key */
    assert_true(view_token_make(access.token) && view_token_make(other.token));
    assert_int_equal(strlen(access.token), VIEW_TOKEN_BYTES - 1u);
    assert_true(view_token_matches(&access, access.token));
    assert_false(view_token_matches(&access, other.token));
    assert_false(view_token_matches(&access, NULL));
    other = access;
    other.token[VIEW_TOKEN_BYTES - 2u] = '\0';
    assert_false(view_token_matches(&access, other.token));
}

static void command_is_taken_in_its_units(void **state) {
    const struct bend_table_module module = {.bend_limit_rad = (float)M_PI_2,
                                             .working_pressure_pa = 10000.0f};
    struct controller_command command;
    char page[VIEW_PAGE_BYTES], error[256];
    (void)state;
    assert_true(view_request_command(
        "{\"page\":\"p\",\"bend_deg\":90,\"direction_deg\":-90,\"co_contraction_kpa\":1.5}", &module, page,
        &command, error, sizeof error));
    assert_string_equal(page, "p");
    assert_int_equal(command.kind, COMMAND_BEND);
    assert_float_equal(command.bend_rad, M_PI_2, 1e-6);
    assert_float_equal(command.direction_rad, -M_PI_2, 1e-6);
    assert_float_equal(command.co_contraction_pa, 1500.0, 1e-3);
    assert_false(view_request_command(
        "{\"page\":\"p\",\"bend_deg\":1e999,\"direction_deg\":0,\"co_contraction_kpa\":0}", &module, page,
        &command, error, sizeof error));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(nothing_is_sent_without_arm),
                                       cmocka_unit_test(armed_page_commands_and_repeats),
                                       cmocka_unit_test(one_page_at_a_time),
                                       cmocka_unit_test(silent_page_vents),
                                       cmocka_unit_test(untouched_page_vents),
                                       cmocka_unit_test(fault_ends_the_arm),
                                       cmocka_unit_test(silent_board_ends_the_arm),
                                       cmocka_unit_test(vent_comes_from_anybody_at_any_time),
                                       cmocka_unit_test(loopback_names_and_addresses),
                                       cmocka_unit_test(origins),
                                       cmocka_unit_test(tokens),
                                       cmocka_unit_test(command_is_taken_in_its_units)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
