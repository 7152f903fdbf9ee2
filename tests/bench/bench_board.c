/* The flashed ELF on the emulated board over random missions: instructions of the whole step under several loads, of the
 * table's inversion and of each interrupt, and how fast the emulation is. */
#include "bench/board_load.h"

#include <time.h>

#define MISSION_S 60
#define CALLERS_MOST 4

/* Runs of one function in thread mode, from its entry to its return. */
struct function_count {
    uint64_t started;
    bool running;
    struct core_count count;
    uint32_t caller[CALLERS_MOST];
    size_t callers;
};

static struct function_count inversion;

static void on_return(void *context, struct core *core) {
    struct function_count *function = context;
    if (function->running) {
        const uint64_t run = core->count[0].instructions - function->started;
        function->running = false;
        function->count.entries++;
        function->count.instructions += run;
        function->count.most = run > function->count.most ? run : function->count.most;
    }
}

static void on_entry(void *context, struct core *core) {
    struct function_count *function = context;
    const uint32_t caller = core_register(core, UC_ARM_REG_LR) & ~1u;
    size_t known = 0;
    while (known < function->callers && function->caller[known] != caller) {
        known++;
    }
    if (known == function->callers && known < CALLERS_MOST) {
        function->caller[function->callers++] = caller;
        (void)core_probe(core, caller, on_return, function);
    }
    function->started = core->count[0].instructions;
    function->running = true;
}

static double seconds(clockid_t clock) {
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void print_count(const char *what, const struct core_count *count) {
    if (count->entries > 0) {
        printf("%-34s %8.0f instructions mean, %llu worst, of %llu\n", what,
               (double)count->instructions / (double)count->entries, (unsigned long long)count->most,
               (unsigned long long)count->entries);
    }
}

int main(void) {
    static const struct {
        uint32_t exception;
        const char *name;
    } interrupts[] = {
        {16 + 29, "tick interrupt"}, {16 + 39, "tip byte interrupt"}, {16 + 21, "CAN interrupt"}};
    if (hil_open_table(NULL) != 0) {
        return 1;
    }
    board_load_start(&board_loads[0], 1);
    if (!board_probe(&hil.board, "bend_inverse_step", on_entry, &inversion)) {
        fprintf(stderr, "bench_board: the ELF has no bend_inverse_step\n");
        return 1;
    }
    const double wall_s = seconds(CLOCK_MONOTONIC), used_s = seconds(CLOCK_PROCESS_CPUTIME_ID);
    board_load_fly(&board_loads[0], MISSION_S * 1000, 5);
    printf("emulated board         %8.1f x real time, plant and CAN included (%.1f x by the wall clock)\n",
           MISSION_S / (seconds(CLOCK_PROCESS_CPUTIME_ID) - used_s),
           MISSION_S / (seconds(CLOCK_MONOTONIC) - wall_s));
    printf("whole step, CAN and telemetry included:\n");
    print_count(board_loads[0].name, &hil.board.core.step);
    print_count("inversion, a step", &inversion.count);
    for (size_t i = 0; i < sizeof interrupts / sizeof interrupts[0]; i++) {
        print_count(interrupts[i].name, &hil.board.core.count[interrupts[i].exception]);
    }
    bool active = hil_state() == SUPERVISOR_ACTIVE;
    hil_off();
    for (size_t i = 1; i < BOARD_LOADS && active; i++) {
        board_load_start(&board_loads[i], 1);
        board_load_fly(&board_loads[i], MISSION_S * 1000, 5);
        print_count(board_loads[i].name, &hil.board.core.step);
        active = hil_state() == SUPERVISOR_ACTIVE;
        hil_off();
    }
    if (!active) {
        fprintf(stderr, "bench_board: the mission ended in %s\n", supervisor_state_name(hil_state()));
        return 1;
    }
    return 0;
}
