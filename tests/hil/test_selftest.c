/* The emulated core against its self-test program, and against QEMU running the same ELF: the same counters,
 * line by line. */
#include <stdlib.h>

#include "emulator/core.h"
#include "support/test.h"

#define CONSOLE_BYTES 8192
#define WITHIN_S 10

static char path[512], emulated[CONSOLE_BYTES], qemu[CONSOLE_BYTES];

static int find_elf(void **state) {
    const char *build = getenv("TRIBEND_BUILD");
    (void)state;
    (void)snprintf(path, sizeof path, "%s/tests/hil/selftest.elf", build != NULL ? build : "build");
    return 0;
}

static void run(struct core *core, char *console, int64_t hertz) {
    const struct core_peripherals none = {.context = NULL};
    char error[CORE_ERROR_BYTES];
    assert_true(core_open(core, &none, error, sizeof error));
    if (!core_load_elf(core, path, error, sizeof error)) {
        fail_msg("%s", error);
    }
    core->semihosting = true;
    core->console = console;
    core->console_bytes = CONSOLE_BYTES;
    core_reset(core);
    core_set_clock(core, (uint32_t)hertz);
    core_run(core, WITHIN_S * TICKS_PER_SECOND);
}

static void every_check_of_the_program_holds(void **state) {
    static struct core core;
    (void)state;
    run(&core, emulated, 170000000);
    assert_true(core.finished);
    if (core.exit_status != 0) {
        fail_msg("%s", emulated);
    }
    assert_int_equal(core.oddities.unknown_registers, 0);
    assert_int_equal(core.oddities.spurious_returns, 0);
    assert_non_null(strstr(emulated, "failures 0"));
    core_close(&core);
}

static void qemu_counts_the_same(void **state) {
    char command[1024];
    (void)state;
    (void)snprintf(command, sizeof command,
                   "timeout 60 qemu-system-arm -M netduinoplus2 -icount shift=3,sleep=off -nographic "
                   "-semihosting-config "
                   "enable=on,target=native -kernel %s </dev/null 2>&1",
                   path);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    qemu[fread(qemu, 1, sizeof qemu - 1, pipe)] = '\0';
    assert_int_equal(pclose(pipe), 0);
    assert_string_equal(emulated, qemu);
}

static void same_instructions_in_every_run(void **state) {
    static struct core first, second;
    static char console[CONSOLE_BYTES];
    (void)state;
    run(&first, console, 170000000);
    run(&second, console, 170000000);
    assert_true(first.count[0].instructions > 1000000);
    for (size_t e = 0; e < NVIC_EXCEPTIONS; e++) {
        assert_memory_equal(&first.count[e], &second.count[e], sizeof first.count[e]);
    }
    assert_int_equal(first.now_ticks, second.now_ticks);
    core_close(&first);
    core_close(&second);
}

/* Three times as many ticks for the same work: more pre-emptions, but each of them costs what it did. */
static void an_exceptions_count_leaves_out_what_nests_in_it(void **state) {
    static struct core fast, slow;
    static char console[CONSOLE_BYTES];
    (void)state;
    run(&fast, console, 170000000);
    run(&slow, console, 16000000);
    assert_true(fast.finished && slow.finished);
    assert_int_equal(fast.count[EXCEPTION_SYSTICK].entries, slow.count[EXCEPTION_SYSTICK].entries);
    assert_int_equal(fast.count[EXCEPTION_SYSTICK].instructions, slow.count[EXCEPTION_SYSTICK].instructions);
    assert_int_equal(fast.count[EXCEPTION_PENDSV].instructions, slow.count[EXCEPTION_PENDSV].instructions);
    assert_int_equal(fast.count[EXCEPTION_SYSTICK].most, slow.count[EXCEPTION_SYSTICK].most);
    assert_true(fast.count[16 + 1].most < 40); /* irq 1, in which 2 nests and 3 is raised */
    core_close(&fast);
    core_close(&slow);
}

static void a_file_that_is_no_program_is_refused(void **state) {
    static struct core core;
    const struct core_peripherals none = {.context = NULL};
    char error[CORE_ERROR_BYTES];
    (void)state;
    assert_true(core_open(&core, &none, error, sizeof error));
    assert_false(core_load_elf(&core, "tables/paper-semicircle.tbt", error, sizeof error));
    assert_non_null(strstr(error, "paper-semicircle.tbt: not an ELF file"));
    assert_false(core_load_elf(&core, "/nowhere.elf", error, sizeof error));
    assert_non_null(strstr(error, "No such file"));
    assert_false(core_load_elf(&core, "/proc/self/exe", error, sizeof error));
    core_close(&core);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_check_of_the_program_holds),
        cmocka_unit_test(qemu_counts_the_same),
        cmocka_unit_test(same_instructions_in_every_run),
        cmocka_unit_test(an_exceptions_count_leaves_out_what_nests_in_it),
        cmocka_unit_test(a_file_that_is_no_program_is_refused),
    };
    return cmocka_run_group_tests(tests, find_elf, NULL);
}
