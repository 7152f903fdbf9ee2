/* Bounds of the design page, on an emulated Cortex-M4F and short missions: a control step within 10,000 instructions, alone
 * and with CAN and telemetry on the board, a step of the inverse within 2,500 and 0.1 degree; and the same bits as on the
 * host. `make bench PART=instructions` and `PART=board` take longer missions and print the figures. */
#include "bench/board_load.h"

#include "instructions/compare.h"
#include "program/table_file.h"
#include "support/synthetic_table.h"

#define STEP_BOUND 10000u
#define INVERSION_BOUND 2500u
#define STEPS 3500u
#define INVERSIONS 500u
#define FLIGHT_MS 6000
#define DEGREES (180.0 / M_PI)

static struct table_file file;
static char elf[512];
static struct compare compare;

static int open_reference(void **state) {
    const char *build = getenv("TRIBEND_BUILD");
    (void)state;
    (void)snprintf(elf, sizeof elf, "%s/tests/bench/instructions/image.elf", build != NULL ? build : "build");
    return table_file_open(&file, "tables/paper-semicircle.tbt", "paper-semicircle");
}

static int close_reference(void **state) {
    (void)state;
    table_file_close(&file);
    return 0;
}

static void open_mission(enum frame_variant variant, uint64_t seed) {
    if (!compare_open(&compare, elf, file.bytes, file.size, variant, seed)) {
        fail_msg("%s", compare.difference);
    }
}

static void run_mission(enum frame_variant variant) {
    open_mission(variant, 11);
    if (!compare_steps(&compare, STEPS)) {
        fail_msg("%s", compare.difference);
    }
    print_message("           control step: mean %.0f, worst %llu instructions\n", cost_mean(&compare.step),
                  (unsigned long long)cost_quantile(&compare.step, 1.0));
    assert_true(cost_quantile(&compare.step, 1.0) <= STEP_BOUND);
    assert_true(compare.active > STEPS / 2u);
    compare_close(&compare);
}

static void a_control_step_holds_its_bound_and_gives_the_host_s_bits(void **state) {
    (void)state;
    run_mission(FRAME_NOMINAL);
}

static void so_does_one_with_every_calibration_in_use(void **state) {
    (void)state;
    run_mission(FRAME_CALIBRATED);
}

static void a_step_of_the_inverse_holds_its_bound_and_the_second_is_near_enough(void **state) {
    (void)state;
    open_mission(FRAME_NOMINAL, 12);
    if (!compare_inversions(&compare, INVERSIONS)) {
        fail_msg("%s", compare.difference);
    }
    print_message("           inverse: worst step %llu instructions, %.3f deg left by the second\n",
                  (unsigned long long)cost_quantile(&compare.inversion_step, 1.0), compare.preview_rad[1] * DEGREES);
    assert_true(cost_quantile(&compare.inversion_step, 1.0) <= INVERSION_BOUND);
    assert_under(compare.preview_rad[1] * DEGREES, 0.1);
    assert_true(compare.preview_rad[1] > 0.0);
    compare_close(&compare);
}

/* A fold: the cells beyond some pressures are not valid, so that the inverse must walk. */
static void walks_over_a_table_with_a_fold_hold_the_bounds(void **state) {
    (void)state;
    struct synthetic_table synthetic;
    synthetic_table_create(&synthetic, 19, 10000.0, 0.8, synthetic_module);
    const struct bend_table *table = &synthetic.table;
    uint8_t *tag = synthetic.image + (size_t)(table->tag - synthetic.image);
    for (size_t i = 0; i < 19; i++) {
        for (size_t j = 0; j < 19; j++) {
            for (size_t k = 0; k < 19; k++) {
                tag[k + 19 * (j + 19 * i)] = i + j + k > 9 ? 0 : BEND_TABLE_TAG_VALID;
            }
        }
    }
    synthetic_table_seal(&synthetic);
    if (!compare_open(&compare, elf, synthetic.image, synthetic.size, FRAME_NOMINAL, 13) ||
        !compare_steps(&compare, STEPS) || !compare_inversions(&compare, INVERSIONS)) {
        fail_msg("%s", compare.difference);
    }
    print_message("           with a fold: worst step %llu, of the inverse %llu instructions\n",
                  (unsigned long long)cost_quantile(&compare.step, 1.0),
                  (unsigned long long)cost_quantile(&compare.inversion_step, 1.0));
    assert_true(cost_quantile(&compare.step, 1.0) <= STEP_BOUND);
    assert_true(cost_quantile(&compare.inversion_step, 1.0) <= INVERSION_BOUND);
    assert_true(compare.active > STEPS / 2u);
    compare_close(&compare);
    synthetic_table_free(&synthetic);
}

static void a_step_of_the_board_holds_the_bound_under_every_load(void **state) {
    (void)state;
    assert_int_equal(hil_open_table(NULL), 0);
    for (size_t i = 0; i < BOARD_LOADS; i++) {
        const struct core_count *step = &hil.board.core.step;
        board_load_start(&board_loads[i], 1);
        board_load_fly(&board_loads[i], FLIGHT_MS, 5);
        print_message("           %s: mean %.0f, worst %llu instructions\n", board_loads[i].name,
                      (double)step->instructions / (double)step->entries, (unsigned long long)step->most);
        assert_in_range(step->entries, FLIGHT_MS - 2, FLIGHT_MS + 2);
        assert_true(step->most <= STEP_BOUND);
        hil_assert_state(SUPERVISOR_ACTIVE);
        assert_int_equal(hil.heard[MESSAGE_TELEMETRY] > 0, board_loads[i].can_fd);
        hil_off();
    }
    (void)hil_close_table(NULL);
}

static void counts_by_blocks_are_counts_by_instructions(void **state) {
    (void)state;
    open_mission(FRAME_NOMINAL, 14);
    for (int i = 0; i < 20; i++) {
        const struct frame *frame = &compare.mission.frame;
        uint64_t blocks = 0, singly = 0;
        mission_inversion(&compare.mission, &compare.mission.frame.inversion);
        assert_true(call_counter_write(compare.counter, compare.frame_address, frame, sizeof *frame));
        const uint32_t entry = call_counter_symbol(compare.counter, "image_begin");
        assert_true(call_counter_call(compare.counter, entry, 100000, &blocks));
        assert_true(call_counter_call_slowly(compare.counter, entry, 100000, &singly));
        assert_true(blocks > 100);
        assert_int_equal(blocks, singly);
    }
    compare_close(&compare);
}

static void another_table_on_the_board_is_noticed(void **state) {
    (void)state;
    const float wrong = 1e-3f;
    open_mission(FRAME_NOMINAL, 15);
    const size_t offset =
        (size_t)((const unsigned char *)(file.table.channel[BEND_TABLE_CURVATURE_X] + 200) - file.bytes);
    const uint32_t at = FRAME_TABLE_ADDRESS + (uint32_t)offset;
    for (uint32_t i = 0; i < 40; i++) {
        assert_true(call_counter_write(compare.counter, at + 400 * i, &wrong, sizeof wrong));
    }
    assert_false(compare_inversions(&compare, INVERSIONS));
    assert_true(strstr(compare.difference, "on the host") != NULL);
    compare_close(&compare);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_control_step_holds_its_bound_and_gives_the_host_s_bits),
        cmocka_unit_test(so_does_one_with_every_calibration_in_use),
        cmocka_unit_test(a_step_of_the_inverse_holds_its_bound_and_the_second_is_near_enough),
        cmocka_unit_test(walks_over_a_table_with_a_fold_hold_the_bounds),
        cmocka_unit_test(a_step_of_the_board_holds_the_bound_under_every_load),
        cmocka_unit_test(counts_by_blocks_are_counts_by_instructions),
        cmocka_unit_test(another_table_on_the_board_is_noticed),
    };
    return cmocka_run_group_tests(tests, open_reference, close_reference);
}
