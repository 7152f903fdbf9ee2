/* Power cut within flash operations, while parameters are saved and while a table is sent over CAN: the board
 * always comes up with the old or the new ones, whole. Every operation has a child process of its own, which
 * cuts the power there, switches on again and asks the board. A sample of the operations, the first and last
 * ones among it; EVERY_CUT=1: all of them, of which those outside the sample are asked for their table and not
 * used beyond that. */
#include <sys/wait.h>
#include <unistd.h>

#include "comms/parameters.h"
#include "hil/update.h"

#define NOISE_ID 42u /* sensor_noise_pa */
#define NOISE_OLD 140.0f
#define NOISE_NEW 160.0f
#define NOISE_LAST 170.0f
#define ENDS 12u /* operations at either end that are always cut */
#define TABLE_STRIDE 700u
#define WAKE_MS 60 /* until it answers */
#define AHEAD 16u  /* more operations than a millisecond has */

enum outcome { OUTCOME_OLD, OUTCOME_NEW, OUTCOME_COUNT, OUTCOME_WRONG };

static uint32_t seen[OUTCOME_COUNT];
static bool in_child; /* a check that fails in one goes on to the next test: that ends it */

static bool every_cut(void) {
    const char *every = getenv("EVERY_CUT");
    return every != NULL && strcmp(every, "1") == 0;
}

static bool is_sampled(uint32_t operation, uint32_t of, uint32_t stride) {
    return every_cut() || operation <= ENDS || operation + ENDS > of || operation % stride == 0u;
}

/* --- parameters --- */

static void set_noise(float value) {
    struct message_parameter_set set = {.protocol = MESSAGE_PROTOCOL, .parameter = NOISE_ID};
    memcpy(&set.value, &value, sizeof value);
    hil_send(MESSAGE_PARAMETER_SET, &set, sizeof set);
    hil_run(10);
    assert_int_equal(hil.last[MESSAGE_PARAMETER_VALUE].parameter_value.status, PARAMETER_OK);
}

/* Many records to write: calibration offsets and scales of their own. */
static void set_others(float share) {
    for (uint32_t id = 100u; id <= 123u; id++) {
        struct message_parameter_set set = {.protocol = MESSAGE_PROTOCOL, .parameter = (uint16_t)id};
        const bool is_scale = id <= 102u || id >= 118u;
        const bool is_time = id >= 109u && id <= 111u;
        const float value = is_scale ? 1.0f + 0.1f * share : id <= 105u ? 100.0f * share : 0.01f * share;
        memcpy(&set.value, &value, sizeof value);
        set.value = is_time ? (uint32_t)(1000.0f * share) : set.value;
        hil_send(MESSAGE_PARAMETER_SET, &set, sizeof set);
        hil_run(10);
        assert_int_equal(hil.last[MESSAGE_PARAMETER_VALUE].parameter_value.status, PARAMETER_OK);
    }
}

static float get_noise(void) {
    const struct message_parameter_get get = {.protocol = MESSAGE_PROTOCOL, .parameter = NOISE_ID};
    const uint32_t heard = hil.heard[MESSAGE_PARAMETER_VALUE];
    float value;
    hil_send(MESSAGE_PARAMETER_GET, &get, sizeof get);
    hil_run(10);
    assert_int_equal(hil.heard[MESSAGE_PARAMETER_VALUE], heard + 1);
    memcpy(&value, &hil.last[MESSAGE_PARAMETER_VALUE].parameter_value.value, sizeof value);
    return value;
}

/* False: it did not come to its end. */
static bool save(void) {
    const struct message_parameter_action action = {.protocol = MESSAGE_PROTOCOL, .action = 1u};
    const uint32_t heard = hil.heard[MESSAGE_PARAMETER_VALUE];
    hil_send(MESSAGE_PARAMETER_ACTION, &action, sizeof action);
    for (int i = 0; i < 3000 && hil.heard[MESSAGE_PARAMETER_VALUE] == heard && !hil.board.power_lost; i++) {
        hil_run(1);
    }
    return hil.heard[MESSAGE_PARAMETER_VALUE] > heard &&
           hil.last[MESSAGE_PARAMETER_VALUE].parameter_value.status == PARAMETER_OK;
}

static void switch_on_again(void) {
    assert_true(board_power_cycle(&hil.board));
    hil_run(HIL_BOOT_MS);
    hil_assert_state(SUPERVISOR_SAFE);
}

static enum outcome parameters_after_cut(uint32_t operation) {
    set_noise(NOISE_NEW);
    board_cut_power(&hil.board, operation, operation);
    (void)save();
    assert_true(hil.board.power_lost);
    switch_on_again();
    const float noise = get_noise();
    assert_int_equal(hil.board.resets, 1);
    set_noise(NOISE_LAST); /* what the cut left behind is no hindrance */
    assert_true(save());
    switch_on_again();
    assert_float_equal(get_noise(), NOISE_LAST, 0.0f);
    return noise == NOISE_OLD ? OUTCOME_OLD : noise == NOISE_NEW ? OUTCOME_NEW : OUTCOME_WRONG;
}

/* Runs `after_cut` in a child, which ends with its outcome; whatever else it ends with fails the test. */
static void cut_in_child(enum outcome (*after_cut)(uint32_t operation), uint32_t operation) {
    (void)fflush(NULL);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        in_child = true;
        _exit((int)after_cut(operation));
    }
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    if (!WIFEXITED(status) || WEXITSTATUS(status) >= (int)OUTCOME_COUNT) {
        fail_msg("power cut within operation %u: neither the old nor the new", operation);
    }
    seen[WEXITSTATUS(status)]++;
}

static void end_if_child(void) {
    if (in_child) {
        _exit((int)OUTCOME_WRONG);
    }
}

static void cut_parameters_leave_the_old_or_the_new(void **state) {
    (void)state;
    hil_start(1);
    set_others(0.5f);
    set_noise(NOISE_OLD);
    assert_true(save());
    const uint32_t before = hil.board.flash.operations;
    set_noise(NOISE_NEW);
    assert_true(save());
    const uint32_t operations = hil.board.flash.operations - before;
    set_noise(NOISE_OLD);
    assert_true(save());
    assert_true(operations > 20u);
    memset(seen, 0, sizeof seen);
    for (uint32_t i = 1; i <= operations; i++) {
        if (is_sampled(i, operations, 4u)) {
            cut_in_child(parameters_after_cut, i);
        }
    }
    print_message("parameters: %u operations, %u cuts left the old, %u the new\n", operations,
                  seen[OUTCOME_OLD], seen[OUTCOME_NEW]);
    assert_true(seen[OUTCOME_OLD] > 0);
    hil_off();
}

/* --- a table --- */

static uint64_t hash_old, hash_new;

static bool is_of_use(void) {
    hil_run(HIL_BOOT_MS);
    hil_assert_state(SUPERVISOR_SAFE);
    hil_bend(40.0, 0.0);
    hil_run(700);
    return hil_state() == SUPERVISOR_ACTIVE;
}

static bool is_sampled_cut(uint32_t operation) {
    const uint32_t at = hil.last[MESSAGE_TRANSFER_STATE].transfer_state.state;
    return operation <= ENDS || operation % TABLE_STRIDE == 0u || at == TRANSFER_CHECKING ||
           at == TRANSFER_COMMITTING;
}

static enum outcome table_after_cut(uint32_t operation) {
    const bool sampled = is_sampled_cut(operation);
    for (int i = 0; i < 3000 && !hil.board.power_lost; i++) {
        update_send_more();
        hil_run(1);
    }
    const bool ended = !hil.board.power_lost; /* there was no such operation any more */
    hil.board.flash.cut_at_operation = 0u;
    assert_true(board_power_cycle(&hil.board));
    hil_run(WAKE_MS);
    const uint64_t hash = update_running_table();
    const bool sound = (!sampled || is_of_use()) && (!ended || hash == hash_new);
    return !sound             ? OUTCOME_WRONG
           : hash == hash_old ? OUTCOME_OLD
           : hash == hash_new ? OUTCOME_NEW
                              : OUTCOME_WRONG;
}

/* Sends the table whole, cutting the power in children on the way: the first operations, the last ones (the image is
 * there, it is checked and committed), and some between. Returns how many operations there were. */
static uint32_t transfer(void) {
    const struct message_transfer_state *at = &hil.last[MESSAGE_TRANSFER_STATE].transfer_state;
    const uint32_t before = hil.board.flash.operations;
    uint32_t cut = 0; /* the last one */
    update_begin();
    for (int i = 0; i < UPDATE_MOST_MS && at->state != TRANSFER_DONE && at->state != TRANSFER_FAILED; i++) {
        const uint32_t done = hil.board.flash.operations - before;
        assert_true(!every_cut() || done <= cut); /* else some came in between */
        for (uint32_t next = (done > cut ? done : cut) + 1u; next <= done + AHEAD; next++) {
            if (every_cut() || is_sampled_cut(next)) {
                board_cut_power(&hil.board, next - done, next);
                cut_in_child(table_after_cut, next);
                hil.board.flash.cut_at_operation = 0u;
                cut = next;
            }
        }
        update_send_more();
        hil_run(1);
    }
    if (at->state != TRANSFER_DONE) {
        fail_msg("transfer at %u of %u: %s", at->offset, update.bytes,
                 transfer_error_text((enum transfer_error)at->error));
    }
    return hil.board.flash.operations - before;
}

static void a_cut_table_leaves_the_old_or_the_new(void **state) {
    (void)state;
    end_if_child();
    hil_start(2);
    hash_old = update_running_table();
    hash_new = ~hash_old;
    update_make(hash_new);
    memset(seen, 0, sizeof seen);
    const uint32_t operations = transfer();
    print_message("table: %u operations, %u cuts left the old, %u the new\n", operations, seen[OUTCOME_OLD],
                  seen[OUTCOME_NEW]);
    assert_true(seen[OUTCOME_OLD] > 0);
    assert_true(update_running_table() == hash_old); /* until the next start */
    switch_on_again();
    assert_true(update_running_table() == hash_new);
    free(update.image);
    hil_off();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cut_parameters_leave_the_old_or_the_new),
        cmocka_unit_test(a_cut_table_leaves_the_old_or_the_new),
    };
    const int failed = cmocka_run_group_tests(tests, hil_open_table, hil_close_table);
    end_if_child();
    return failed;
}
